"""Pictures: what is in a scene and in its page. No display, browser, server or network."""

import base64
import json
import re
import subprocess
import sys
import tempfile
import threading
import webbrowser

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import se3
from robotmodels.cli import main
from robotmodels.errors import (
    FrameNotFoundError,
    InvalidValueError,
    MeshNotFoundError,
    MissingExtraError,
    ShapeError,
    UrdfError,
)
from robotmodels.visual import Box, Cylinder, Mesh, Sphere, skeleton
from robotmodels.viz import page as page_module
from robotmodels.viz.camera import FIELD_OF_VIEW, framed
from robotmodels.viz.motion import keyframes
from robotmodels.viz.nodes import Label, Segments, Triangles, extent
from robotmodels.viz.stand_ins import with_stand_ins
from robotmodels.viz.surroundings import path_tube, workspace_box

H = np.pi / 2

RX90 = rm.RobotModel.from_table(
    rm.DHTable.from_rows([
        {"sigma": 0}, {"sigma": 0, "alpha": H}, {"sigma": 0, "d": 0.45},
        {"sigma": 0, "alpha": -H, "r": 0.45}, {"sigma": 0, "alpha": H}, {"sigma": 0, "alpha": -H},
    ]),
    name="rx90",
)  # fmt: skip
SCARA = rm.RobotModel.from_table(
    rm.DHTable.from_rows([
        {"sigma": 0, "r": 0.4}, {"sigma": 0, "d": 0.35},
        {"sigma": 1, "d": 0.3, "alpha": np.pi, "lower": 0.0, "upper": 0.2},
    ]),
    base=se3.translation(0.1, 0.2, 0.3),
    name="scara",
)  # fmt: skip
TREE = rm.RobotModel.from_table(
    rm.DHTable(
        antecedent=[0, 1, 2, 1, 4], sigma=[0, 0, 2, 1, 0],
        gamma=[0, 0, 0, np.pi, 0], b=[0, 0.1, 0, 0, 0], alpha=[0, H, 0.3, H, -H],
        d=[0, 0.2, 0.3, 0.2, 0.1], r=[0.5, 0, 0.1, 0.2, 0],
    ),
    tool=se3.translation(0.0, 0.0, 0.1),
    name="tree",
)  # fmt: skip

TRIANGLE_STL = """solid one
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 2 0 0
vertex 0 1 0
endloop
endfacet
endsolid one
"""
TETRAHEDRON_OBJ = "\n".join((
    "v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4",
))  # fmt: skip
# a unit of 0.1 m and an effect with a colour
SQUARE_DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="decimetre" meter="0.1"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><phong>
<diffuse><color>1 0 0 1</color></diffuse></phong></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 10 0 0 0 10 0</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles material="s" count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p>
</triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="vs"><node id="n"><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="s" target="#m"/></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#vs"/></scene></COLLADA>
"""


def urdf(mesh: str, scale: str = "1 1 1", material: str = "") -> str:
    return f"""<robot name="one"><link name="base"/><link name="arm"><visual>
    <origin xyz="0.1 0 0"/><geometry><mesh filename="{mesh}" scale="{scale}"/></geometry>{material}
    </visual></link><joint name="turn" type="continuous"><parent link="base"/><child link="arm"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/></joint></robot>"""


def content(scene: rm.viz.Scene) -> dict:
    """What the page hands to the viewer."""
    found = re.search(
        r'<script type="application/json" id="scene">(.*?)</script>', scene.html(), re.DOTALL
    )
    assert found
    return json.loads(found.group(1))


def commands(scene: rm.viz.Scene, kind: str) -> dict[str, dict]:
    return {c["path"]: c for c in content(scene)["commands"] if c["type"] == kind}


def frame_path(scene: rm.viz.Scene, name: str) -> str:
    """The node that moves with a frame of the table."""
    paths = [p for p in scene.paths if p.split("/")[-1] == name]
    assert len(paths) == 1, (name, paths)
    return f"{paths[0]}/q" if f"{paths[0]}/q" in scene.paths else paths[0]


# ---------------------------------------------------------------- what is drawn where


@pytest.mark.parametrize("model", [RX90, SCARA, TREE], ids=lambda m: m.name)
def test_nodes_of_the_frames_are_at_link_poses(model, rng):
    q = rng.uniform(-1.0, 1.0, model.n)
    scene = rm.viz.show(model, q)
    for name, T in zip(model.table.names, rm.link_poses(model, q), strict=True):
        np.testing.assert_allclose(scene.pose(frame_path(scene, name)), T, atol=1e-14)


@pytest.mark.parametrize("model", [RX90, SCARA, TREE], ids=lambda m: m.name)
def test_the_page_holds_the_same_poses(model, rng):
    q = rng.uniform(-1.0, 1.0, model.n)
    scene = rm.viz.show(model, q, frames=True)
    sent = commands(scene, "set_transform")
    path = frame_path(scene, model.table.names[model.tip - 1])
    T, names = np.eye(4), path.split("/")
    for k in range(1, len(names)):  # "robots" itself is never moved
        matrix = sent["/".join(names[: k + 1])]["matrix"]
        T = T @ np.reshape(matrix, (4, 4)).T  # the viewer reads column by column
    np.testing.assert_allclose(T @ model.tool, rm.dgm(model, q), atol=1e-8)


def test_default_posture_is_zero():
    scene = rm.viz.show(SCARA)
    np.testing.assert_allclose(
        scene.pose(frame_path(scene, "joint_3")), rm.link_poses(SCARA, [0, 0, 0])[2], atol=1e-14
    )


def test_frames_tool_names_and_grid_are_optional():
    def count(**options):
        return sum(node.shape is not None for node in rm.viz.show(RX90, **options).nodes)

    bare = count(tool=False, grid=False)
    assert bare == len(skeleton(RX90.table, RX90.tool, RX90.tip, axes=False))
    assert count(grid=False) == bare + 3
    assert count(tool=False, grid=False, frames=True) == bare + 3 * 6
    assert count(tool=False, grid=False, names=True) == bare + 6
    assert count(tool=False) == bare + 1 + 3  # the grid and the world's axes


def test_frame_triads_and_labels_are_in_their_frames(rng):
    q = rng.uniform(-1.0, 1.0, 6)
    scene = rm.viz.show(RX90, q, frames=True, names=True)
    poses = rm.link_poses(RX90, q)
    for j, T in enumerate(poses, start=1):
        z = scene.pose(f"{frame_path(scene, f'joint_{j}')}/R{j}:z")
        np.testing.assert_allclose(z[:3, 2], T[:3, 2], atol=1e-14)
        length = np.linalg.norm(z[:3, 3] - T[:3, 3])  # to the middle of the axis
        assert 0.02 < length < 0.1
        label = scene.pose(f"{frame_path(scene, f'joint_{j}')}/label:{j}")
        np.testing.assert_allclose(np.cross(label[:3, 3] - T[:3, 3], T[:3, 2]), 0, atol=1e-14)


def test_tool_triad_is_at_the_tool():
    model = RX90.with_tool(se3.translation(0.1, 0.0, 0.2) @ se3.rotation("x", 0.3))
    q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    scene = rm.viz.show(model, q)
    T = rm.dgm(model, q)
    z = scene.pose(f"{frame_path(scene, 'joint_6')}/tool:z")
    np.testing.assert_allclose(z[:3, 2], T[:3, 2], atol=1e-14)
    half = (z[:3, 3] - T[:3, 3]) @ T[:3, 2]
    np.testing.assert_allclose(z[:3, 3], T[:3, 3] + half * T[:3, 2], atol=1e-14)


def test_several_postures_share_the_foot():
    q = np.linspace(np.zeros(6), np.full(6, 0.7), 8)
    scene = rm.viz.show(RX90, q, opacity=0.5, grid=False)
    feet = [n for n in scene.nodes if n.path.startswith("robots/rx90/shape")]
    single = rm.viz.show(RX90, grid=False)
    shapes = [n for n in scene.nodes if n.shape is not None]
    assert len(shapes) == len(feet) + 8 * (
        sum(n.shape is not None for n in single.nodes) - len(feet)
    )
    for k, posture in enumerate(q):
        paths = [p for p in scene.paths if f"posture_{k + 1}/" in p and p.endswith("joint_6/q")]
        np.testing.assert_allclose(
            scene.pose(paths[0]), rm.link_poses(RX90, posture)[5], atol=1e-14
        )
    links = {n.color for n in shapes if "/shape:" in n.path and "posture" in n.path}
    assert len(links) == 8  # a colour for each
    assert {c[3] for c in links} == {0.5}


def test_colors_of_one_and_of_each_posture():
    q = np.zeros((2, 6))
    red = rm.viz.show(RX90, q[0], color=(1, 0, 0))
    assert {n.color for n in red.nodes if "/shape:" in n.path} == {(1.0, 0.0, 0.0, 1.0)}
    two = rm.viz.show(RX90, q, color=[(1, 0, 0), (0, 1, 0, 0.5)])
    links = {n.color for n in two.nodes if "/shape:" in n.path and "posture" in n.path}
    assert links == {(1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.5)}
    same = rm.viz.show([RX90, SCARA], color=(0, 0, 1))
    assert {n.color for n in same.nodes if "/shape:" in n.path} == {(0.0, 0.0, 1.0, 1.0)}
    each = rm.viz.show([RX90, SCARA], color=[(1, 0, 0), (0, 1, 0)])
    assert {n.color[1] for n in each.nodes if "scara/" in n.path and "/shape:" in n.path} == {1.0}


def test_two_robots_side_by_side_have_nodes_of_their_own():
    other = RX90.with_base(se3.translation(0, 1, 0))
    qa, qb = np.full(6, 0.2), np.full(6, -0.3)
    scene = rm.viz.show([RX90, other], [qa, qb])
    assert scene.title == "rx90, rx90_2"
    for root, model, q in (("rx90", RX90, qa), ("rx90_2", other, qb)):
        path = next(
            p for p in scene.paths if p.startswith(f"robots/{root}/") and p.endswith("joint_6/q")
        )
        np.testing.assert_allclose(scene.pose(path), rm.link_poses(model, q)[5], atol=1e-14)
    assert len(set(scene.paths)) == len(scene.paths)


def test_postures_beside_each_other():
    """Each where it would stand alone, moved along x and against y, and none touches another."""
    arm = SCARA
    q = np.array([[0.1, 0.5, 0.1], [0.9, -0.7, 0.0], [-1.0, 0.2, 0.2], [2.0, 1.0, 0.1], [0, 0, 0]])
    scene = rm.viz.show(arm, q, columns=2)
    assert len(set(scene.paths)) == len(scene.paths)
    assert scene.title == "scara"
    spans, shifts = [], []
    for k, posture in enumerate(q):
        root = "robots/scara" + (f"_{k + 1}" if k else "")
        shift = scene.pose(root)[:3, 3] - arm.base[:3, 3]
        path = next(p for p in scene.paths if p.startswith(root + "/") and p.endswith("joint_3/q"))
        T = rm.link_poses(arm, posture)
        np.testing.assert_allclose(scene.pose(path)[:3, 3], T[2, :3, 3] + shift, atol=1e-14)
        points = np.vstack((T[:, :3, 3], arm.base[:3, 3])) + shift
        spans.append((points.min(axis=0), points.max(axis=0)))
        shifts.append(shift)
    assert shifts[0].tolist() == [0, 0, 0]
    np.testing.assert_allclose(shifts[3], shifts[1] + shifts[2], atol=1e-14)
    assert shifts[1][0] > 0 > shifts[2][1]
    assert np.abs([shifts[1][1:], shifts[2][::2]]).max() == 0
    for k, (low, high) in enumerate(spans):
        for other_low, other_high in spans[:k]:
            assert ((low > other_high) | (high < other_low))[:2].any()
    texts = [n.shape.text for n in scene.nodes if n.path.startswith("numbers/")]
    assert texts == ["1", "2", "3", "4", "5"]
    colors = {n.color for n in scene.nodes if "/shape:" in n.path}
    assert len(colors) == 5  # the feet too


def test_sixteen_postures_have_sixteen_colors():
    scene = rm.viz.show(
        RX90, np.linspace(np.zeros(6), np.ones(6), 16), legend=[str(k) for k in range(16)]
    )
    assert len({n.color for n in scene.nodes if "/shape:" in n.path and "posture" in n.path}) == 16
    assert len({color for _, color in scene.legend}) == 16


def test_legend_names_the_colors_of_the_links():
    q = np.zeros((2, 6))
    scene = rm.viz.show(RX90, q, color=[(1, 0, 0), (0, 0, 1)], legend=["<up> & away", "down"])
    assert scene.legend == (("<up> & away", (1.0, 0.0, 0.0, 1.0)), ("down", (0.0, 0.0, 1.0, 1.0)))
    text = scene.html()
    assert "background: #ff0000" in text
    assert "&lt;up&gt; &amp; away</li>" in text
    assert "<up>" not in text
    assert scene._repr_html_().count('"') == 4
    assert '<ul id="legend">' not in rm.viz.show(RX90, q).html()
    two = rm.viz.show([RX90, SCARA], color=[(1, 0, 0), (0, 1, 0)], legend=["one", "two"])
    assert [color[1] for _, color in two.legend] == [0.0, 1.0]


def test_workspace_box():
    scene = rm.viz.show(SCARA, box=(0.0, 0.5, -0.2, 0.2, 0.1, 0.4))
    faces = next(n for n in scene.nodes if n.path == "box/faces")
    np.testing.assert_allclose(faces.shape.size, (0.5, 0.4, 0.3))
    np.testing.assert_allclose(scene.pose("box/faces")[:3, 3], (0.25, 0.0, 0.25))
    edges = next(n for n in scene.nodes if n.path == "box/edges").shape.points
    assert edges.shape == (24, 3)
    np.testing.assert_allclose(np.linalg.norm(edges[0::2] - edges[1::2], axis=1).sum(), 4 * 1.2)


def test_a_slide_without_limits_reaches_the_posture_drawn():
    model = rm.RobotModel.from_table(
        rm.DHTable.from_rows([{"sigma": 0, "r": 0.5}, {"sigma": 1, "alpha": H}])
    )
    scene = rm.viz.show(model, [0.0, 2.0])
    bars = [n for n in scene.nodes if isinstance(n.shape, Box)]
    assert max(max(n.shape.size) for n in bars) == pytest.approx(2.0)


# ---------------------------------------------------------------- the camera


def in_picture(points, camera):
    """Tangents of the directions to points, across and upwards, over that of half the picture."""
    back = (camera.position - camera.target) / camera.distance
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    relative = points - camera.position
    depth = -relative @ back
    assert (depth > 0).all()
    half = np.tan(np.radians(FIELD_OF_VIEW / 2))
    return np.abs(relative @ right) / depth / half, np.abs(relative @ up) / depth / half


@pytest.mark.parametrize("size", [0.01, 1.0, 30.0])
def test_camera_sees_all_and_is_near(size, rng):
    points = size * rng.uniform(-1, 1, (50, 3)) + np.array((5.0, -2.0, 1.0))
    across, high = in_picture(points, framed(points))
    assert across.max() <= 1.15 * 1.0001
    assert high.max() <= 1.0
    assert max(across.max() / 1.15, high.max()) > 0.8  # it fills the picture


def test_camera_sees_the_arm_in_every_sample():
    q = np.linspace(np.zeros(6), (0, 1.5, 0, 0, 0, 0), 200)
    scene = rm.viz.animate(RX90, q)
    tips = rm.dgm(RX90, q)[:, :3, 3]
    across, high = in_picture(tips, scene.camera)
    assert across.max() < 1.15
    assert high.max() < 1.0


def test_view_is_taken():
    camera = rm.viz.show(RX90, view=(0.0, 0.0)).camera
    np.testing.assert_allclose((camera.position - camera.target)[1:], 0, atol=1e-12)
    sent = content(rm.viz.show(RX90, view=(0.0, 0.0)))
    # the viewer's axes have y upwards
    np.testing.assert_allclose(
        sent["target"], [camera.target[0], camera.target[2], -camera.target[1]], atol=1e-6
    )


# ---------------------------------------------------------------- animation


def replayed(scene: rm.viz.Scene, name: str, t: np.ndarray) -> np.ndarray:
    """What the viewer plays for a joint: straight lines between the keyframes of the page."""
    animations = commands(scene, "set_animation")[""]["animations"]
    track = next(a for a in animations if a["path"].endswith(f"{name}/q"))["clip"]["tracks"][0]
    return np.interp(t, track["times"], track["values"])


def test_animation_gives_back_every_sample_with_few_keyframes():
    t = np.linspace(0.0, 8.0, 4001)
    phases = np.array((0.0, 1.0, 2.0))
    q = np.sin(2.0 * t[:, None] + phases) * np.array((2.0, 1.0, 0.1)) + np.array((8.0, 0, 0.1))
    scene = rm.viz.animate(SCARA, q, dt=t[1])
    animations = commands(scene, "set_animation")[""]["animations"]
    assert [a["clip"]["tracks"][0]["name"] for a in animations] == [
        ".rotation[z]", ".rotation[z]", ".position[z]",
    ]  # fmt: skip
    kept = [len(a["clip"]["tracks"][0]["times"]) for a in animations]
    assert sum(kept) == scene.motion.keyframes
    assert scene.motion.keyframes < 0.1 * q.size
    assert scene.motion.samples == 4001
    assert scene.motion.duration == pytest.approx(8.0)
    assert {a["clip"]["fps"] for a in animations} == {1}
    assert animations[0]["clip"]["tracks"][0]["times"][-1] == pytest.approx(8.0)
    for i in range(3):
        np.testing.assert_allclose(replayed(scene, f"joint_{i + 1}", t), q[:, i], atol=6e-4)


def test_animation_times():
    q = np.zeros((31, 6))
    assert rm.viz.animate(RX90, q).motion.duration == pytest.approx(1.0)
    assert rm.viz.animate(RX90, q, fps=10).motion.duration == pytest.approx(3.0)
    assert rm.viz.animate(RX90, q, 0.5).motion.duration == pytest.approx(15.0)
    assert rm.viz.animate(RX90, q).motion.keyframes == 12  # nothing moves: two a joint


def test_motions_are_animated_at_their_own_times():
    tr, start = rm.trajectories, np.array([0.1, 0.2, -0.5, 0.4, 0.7, 0.6])
    move = tr.quintic(start, start + 0.3, duration=1.71)
    scene = rm.viz.animate(RX90, move)
    assert scene.motion.samples == 53  # 30 a second, and the end
    assert scene.motion.duration == 1.71
    assert rm.viz.animate(RX90, move, fps=10).motion.samples == 19
    assert rm.viz.animate(RX90, move, dt=0.01).motion.samples == 172
    t = np.linspace(0.0, 1.71, 9)
    for j in range(6):
        np.testing.assert_allclose(replayed(scene, f"joint_{j + 1}", t), move.q(t)[:, j], atol=2e-3)
    uneven = np.array([1.0, 1.1, 1.5, 1.7])
    scene = rm.viz.animate(RX90, move.at(uneven))
    assert scene.motion.duration == pytest.approx(0.7)
    np.testing.assert_allclose(
        replayed(scene, "joint_1", uneven - 1.0), move.q(uneven)[:, 0], atol=6e-4
    )
    assert rm.viz.animate(RX90, move.at(uneven), dt=1.0).motion.duration == pytest.approx(3.0)
    line = tr.straight_line(rm.dgm(RX90, start), rm.dgm(RX90, start + 0.1), duration=0.8)
    path = tr.joint_path(RX90, line, start, samples=50)
    scene = rm.viz.animate(RX90, path)
    assert (scene.motion.samples, scene.motion.duration) == (50, pytest.approx(0.8))
    untimed = tr.joint_path(RX90, line.resample(31).T, start)
    assert rm.viz.animate(RX90, untimed).motion.duration == pytest.approx(1.0)
    followed = tr.resolved_motion(RX90, line, start, samples=40)
    assert rm.viz.animate(RX90, followed).motion.duration == pytest.approx(0.8)
    two = rm.viz.animate([RX90, RX90], [move, path])  # each in its own time
    assert two.motion.duration == 1.71
    out = line.path.last.copy()
    out[0, 3] += 2.0
    lost = tr.joint_path(RX90, tr.straight_line(line.path.start, out, 1.0), start, samples=50)
    first = int(np.isnan(lost.q[:, 0]).argmax())
    with pytest.raises(InvalidValueError, match=rf"the first is pose {first}; .*q\[:{first}\]"):
        rm.viz.animate(RX90, lost)
    assert rm.viz.animate(RX90, lost.q[:first]).motion.samples == first


def test_what_is_no_motion_of_joints_is_not_animated():
    tr = rm.trajectories
    line = tr.straight_line(np.eye(4), np.eye(4), duration=1.0)
    limits = tr.MotionLimits(1.0, 2.0)
    for wrong, message in (
        (line, "PoseTrajectory; joint_path"),
        (line.resample(5), "PoseSamples; joint_path"),
        (limits, "got MotionLimits"),
        (None, "got NoneType"),
        (tr.quintic(np.zeros(3), np.ones(3), 1.0), "6 joints, got one of 3"),
        (tr.quintic(np.zeros((2, 6)), np.ones(6), 1.0), "batch"),
        (tr.quintic(np.zeros(6), np.zeros(6), 0.0), "takes no time"),
        (tr.quintic(np.zeros(6), np.ones(6), 1.0).at([0.0]), "at least two samples"),
        (tr.quintic(np.zeros(6), np.ones(6), 1.0).at([0.5, 0.1]), "ascending"),
    ):
        with pytest.raises((InvalidValueError, ShapeError), match=message) as refusal:
            rm.viz.animate(RX90, wrong)
        assert len(str(refusal.value)) < 160


def test_animation_loops_unless_told_otherwise():
    q = np.zeros((2, 6))
    options = commands(rm.viz.animate(RX90, q), "set_animation")[""]["options"]
    assert options["repetitions"] > 1000
    options = commands(rm.viz.animate(RX90, q, loop=False), "set_animation")[""]["options"]
    assert options["repetitions"] == 1


def test_animated_page_of_ten_thousand_samples_is_small():
    t = np.linspace(0, 10, 10_000)[:, None]
    q = np.sin(t * np.arange(1, 7))
    still = len(rm.viz.show(RX90, q[0]).html())
    assert len(rm.viz.animate(RX90, q, dt=0.001, path=True).html()) - still < 200_000


def test_tool_path_is_where_the_tool_goes():
    q = np.linspace(np.zeros(6), (1.5, 0.5, 0.5, 0, 0, 0), 500)
    scene = rm.viz.animate(RX90, q, path=True)
    tube = next(n for n in scene.nodes if n.path == "paths/rx90").shape
    centres = tube.vertices.reshape(-1, 8, 3).mean(axis=1)
    tips = rm.dgm(RX90, q)[:, :3, 3]
    np.testing.assert_allclose(centres[[0, -1]], tips[[0, -1]], atol=1e-6)
    nearest = np.linalg.norm(centres[:, None] - tips, axis=-1).min(axis=1)
    assert nearest.max() < 1e-3
    still = rm.viz.animate(RX90, np.zeros((3, 6)), path=True)
    assert not any(p.startswith("paths") for p in still.paths)


def test_two_robots_move_together():
    qa, qb = np.linspace(np.zeros(6), np.ones(6), 11), np.linspace(np.zeros(3), np.ones(3), 21)
    scene = rm.viz.animate([RX90, SCARA], [qa, qb], dt=0.1, path=True)
    assert len(scene.motion.tracks) == 9
    assert scene.motion.duration == pytest.approx(2.0)
    assert {"paths/rx90", "paths/scara"} <= set(scene.paths)


def test_keyframes_of_a_corner_and_of_noise(rng):
    t = np.arange(101.0)
    corner = np.abs(t - 50)[:, None]
    assert keyframes(t, corner, 1e-9).tolist() == [0, 50, 100]
    noise = rng.normal(size=(101, 1))
    assert len(keyframes(t, noise, 1e-9)) == 101


# ---------------------------------------------------------------- the page


def test_saved_page_is_one_offline_file(tmp_path):
    scene = rm.viz.animate(RX90, np.linspace(np.zeros(6), np.ones(6), 20), frames=True, names=True)
    path = scene.save(tmp_path / "arm.html")
    assert path == tmp_path / "arm.html"
    text = path.read_text(encoding="utf-8")
    # the browser itself is told to load nothing
    assert "default-src 'none'" in text
    outside = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"https?:", outside)
    assert not re.search(r"""<(script|link|img|iframe)[^>]*\b(src|href)=""", text)
    assert "<title>rx90</title>" in text
    assert 800_000 < len(text) < 1_000_000


def test_the_same_scene_is_the_same_page():
    q = np.linspace(np.zeros(6), np.ones(6), 20)
    assert rm.viz.animate(RX90, q).html() == rm.viz.animate(RX90, q).html()


def test_notebook_shows_the_page_in_a_frame():
    text = rm.viz.show(RX90, height=321)._repr_html_()
    assert text.startswith('<iframe srcdoc="<!DOCTYPE html>')
    assert "height: 321px" in text
    assert text.count('"') == 4  # nothing inside the page ends the attribute
    assert "127.0.0.1" not in text


def test_names_cannot_break_out_of_the_page():
    table = rm.DHTable(antecedent=[0], sigma=[0], names=("</script><b>/x",))
    scene = rm.viz.show(rm.RobotModel.from_table(table, name="<b>&"), [0.1], names=True)
    text = scene.html()
    assert text.count("</script>") == 3
    assert "<title>&lt;b&gt;&amp;</title>" in text
    assert any(path.endswith("_script><b>_x/q") for path in scene.paths)
    label = next(n for n in scene.nodes if isinstance(n.shape, Label))
    assert label.shape.text == "</script><b>/x"


def test_meshcat_grid_and_lights_give_way():
    sent = content(rm.viz.show(RX90))["commands"]
    hidden = {c["path"] for c in sent if c["type"] == "set_property" and c["value"] is False}
    assert {"Grid", "Axes"} <= hidden
    assert any(c["path"] == "Lights/PointLightPositiveX" for c in sent if c["type"] == "delete")


def test_every_shape_becomes_a_viewer_object():
    sent = commands(rm.viz.show(SCARA, names=True, box=(0, 1, 0, 1, 0, 1)), "set_object")
    kinds = {c["object"]["object"]["type"] for c in sent.values()}
    assert {"Mesh", "Sprite", "LineSegments", "PerspectiveCamera", "DirectionalLight"} <= kinds
    geometries = {g["type"] for c in sent.values() for g in c["object"].get("geometries", ())}
    assert {"BoxGeometry", "CylinderGeometry", "BufferGeometry"} <= geometries


def test_nothing_heavy_is_imported_and_no_process_is_started(tmp_path):
    code = f"""
import subprocess, sys
def refuse(*_, **__): raise AssertionError("a process was started")
subprocess.Popen = refuse
import robotmodels as rm
assert not {{"meshcat", "trimesh", "zmq", "matplotlib", "scipy"}} & set(sys.modules)
arm = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[0], d=[0.3]))
rm.viz.show(arm, [0.2]).save(r"{tmp_path / "a.html"}")
rm.viz.show(arm, [0.2])._repr_html_()
assert not {{"meshcat", "trimesh", "zmq", "tornado"}} & set(sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
    assert (tmp_path / "a.html").stat().st_size > 800_000


def test_works_twice_and_in_threads():
    q = np.full(6, 0.3)
    expected = rm.viz.show(RX90, q).html()
    got = []
    threads = [
        threading.Thread(target=lambda: got.append(rm.viz.show(RX90, q).html())) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert got == [expected] * 4
    assert rm.viz.show(RX90, q).html() == expected


def test_missing_meshcat_says_what_to_install(monkeypatch):
    page_module._viewer_script.cache_clear()
    monkeypatch.setattr(page_module, "find_spec", lambda name: None)
    try:
        with pytest.raises(MissingExtraError, match="pip install 'meshcat"):
            rm.viz.show(RX90).html()
    finally:
        page_module._viewer_script.cache_clear()


# ---------------------------------------------------------------- meshes


def test_missing_mesh_says_what_to_do():
    model = rm.RobotModel.from_urdf(urdf("package://nowhere/arm.stl"))
    with pytest.raises(MeshNotFoundError, match=r"nowhere/arm\.stl.*package_dirs.*meshes=False"):
        rm.viz.show(model, [0.0])
    assert rm.viz.show(model, [0.0], meshes=False).nodes


def test_mesh_file_that_has_gone(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text(TRIANGLE_STL)
    model = rm.RobotModel.from_urdf(urdf(str(path)))
    rm.viz.show(model, [0.0])
    path.unlink()
    with pytest.raises(MeshNotFoundError):
        rm.viz.show(model, [0.0])


def test_mesh_file_that_is_none(tmp_path):
    for name in ("arm.stl", "arm.dae", "arm.nonsense"):
        path = tmp_path / name
        path.write_text("this is no mesh")
        model = rm.RobotModel.from_urdf(urdf(str(path)))
        with pytest.raises(UrdfError, match=name):
            rm.viz.show(model, [0.0])


def mesh_nodes(scene):
    return [n for n in scene.nodes if isinstance(n.shape, Triangles)]


def test_stl_mesh_with_scale_and_urdf_color(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text(TRIANGLE_STL)
    blue = '<material name="blue"><color rgba="0 0 1 0.5"/></material>'
    model = rm.RobotModel.from_urdf(urdf(str(path), "0.1 -0.1 0.1", blue))
    scene = rm.viz.show(model, [H])
    (node,) = mesh_nodes(scene)
    assert node.color == (0.0, 0.0, 1.0, 0.5)
    T = scene.pose(node.path)
    corners = node.shape.vertices @ T[:3, :3].T + T[:3, 3]
    expected = np.array([[0.0, 0.1, 0.5], [0.0, 0.3, 0.5], [0.1, 0.1, 0.5]])
    np.testing.assert_allclose(sorted(corners.tolist()), sorted(expected.tolist()), atol=1e-7)


def test_obj_mesh(tmp_path):
    path = tmp_path / "arm.obj"
    path.write_text(TETRAHEDRON_OBJ)
    (node,) = mesh_nodes(rm.viz.show(rm.RobotModel.from_urdf(urdf(str(path))), [0.0]))
    assert len(node.shape.faces) == 4
    assert len(node.shape.vertices) == 12  # sharp edges are cut


def test_collada_mesh_keeps_units_and_colors(tmp_path):
    path = tmp_path / "arm.dae"
    path.write_text(SQUARE_DAE)
    green = '<material name="green"><color rgba="0 1 0 1"/></material>'
    (node,) = mesh_nodes(rm.viz.show(rm.RobotModel.from_urdf(urdf(str(path), "1 1 1", green)), [0]))
    np.testing.assert_allclose(node.shape.vertices.max(axis=0), (1.0, 1.0, 0.0), atol=1e-6)
    assert node.color == (1.0, 0.0, 0.0, 1.0)  # the file's own colour goes first


def test_a_mesh_is_in_the_page_once(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text(TRIANGLE_STL)
    model = rm.RobotModel.from_urdf(urdf(str(path)))
    arrays = content(rm.viz.show(model, np.zeros((8, 1)), grid=False))["arrays"]
    assert len(arrays) == 2  # vertices and faces
    text = dict(arrays)["Float32Array"]
    assert np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, 3).max() == 2.0


def test_ur5_with_its_meshes():
    pytest.importorskip("collada")
    model = rm.load("erd:ur5")
    scene = rm.viz.show(model, [0.3, -1.2, 1.4, -1.5, -1.57, 0.0])
    nodes = mesh_nodes(scene)
    assert len(nodes) > 7  # one for each colour of each of the seven links
    assert len({n.color for n in nodes}) > 3
    points = np.concatenate([
        extent(n.shape) @ scene.pose(n.path)[:3, :3].T + scene.pose(n.path)[:3, 3] for n in nodes
    ])  # fmt: skip
    assert points[:, 2].min() > -0.1  # it stands on the floor, upright
    assert 0.5 < points[:, 2].max() < 0.9
    assert len(scene.html()) < 3_000_000


# ---------------------------------------------------------------- wrong input


def test_wrong_joint_variables():
    with pytest.raises(ShapeError, match="q"):
        rm.viz.show(RX90, [0.0] * 5)
    with pytest.raises(ShapeError):
        rm.viz.show(RX90, np.zeros((2, 3, 6)))
    with pytest.raises(ShapeError):
        rm.viz.show(RX90, np.zeros((0, 6)))
    with pytest.raises(ShapeError, match="column"):
        rm.viz.show(RX90, np.zeros((6, 1)))
    with pytest.raises(InvalidValueError, match="nan"):
        rm.viz.show(RX90, [0, 0, 0, np.nan, 0, 0])
    with pytest.raises(ShapeError, match="each of the 2 robots"):
        rm.viz.show([RX90, SCARA], [np.zeros(6)])


def test_wrong_motion():
    with pytest.raises(ShapeError, match="at least two samples"):
        rm.viz.animate(RX90, np.zeros(6))
    with pytest.raises(ShapeError, match="at least two samples"):
        rm.viz.animate(RX90, np.zeros((1, 6)))
    with pytest.raises(ShapeError):
        rm.viz.animate(RX90, np.zeros((5, 3)))
    with pytest.raises(InvalidValueError, match="one of them"):
        rm.viz.animate(RX90, np.zeros((5, 6)), dt=0.1, fps=10)
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidValueError, match="dt"):
            rm.viz.animate(RX90, np.zeros((5, 6)), dt=bad)


def test_wrong_options():
    with pytest.raises(InvalidValueError, match="RobotModel"):
        rm.viz.show("rx90")
    with pytest.raises(InvalidValueError, match="RobotModel"):
        rm.viz.show([])
    with pytest.raises(InvalidValueError, match="RobotModel"):
        rm.viz.show([RX90, None])
    with pytest.raises(InvalidValueError, match="x from 1"):
        rm.viz.show(RX90, box=(1, 0, 0, 1, 0, 1))
    with pytest.raises(ShapeError, match="box"):
        rm.viz.show(RX90, box=(1, 0))
    with pytest.raises(InvalidValueError, match="opacity"):
        rm.viz.show(RX90, opacity=1.5)
    with pytest.raises(InvalidValueError, match="0 to 1"):
        rm.viz.show(RX90, color=(255, 0, 0))
    with pytest.raises(ShapeError, match="color"):
        rm.viz.show(RX90, color=(1, 0))
    with pytest.raises(ShapeError, match="2 postures"):
        rm.viz.show(RX90, np.zeros((2, 6)), color=[(1, 0, 0)] * 3)
    with pytest.raises(ShapeError, match="view"):
        rm.viz.show(RX90, view=(1,))
    for bad in (0, -1, 1.5, True, "two"):
        with pytest.raises(InvalidValueError, match="columns: expected how many"):
            rm.viz.show(RX90, np.zeros((2, 6)), columns=bad)
    with pytest.raises(InvalidValueError, match="several robots stand"):
        rm.viz.show([RX90, SCARA], columns=2)
    with pytest.raises(InvalidValueError, match="legend: expected a list of texts, got str"):
        rm.viz.show(RX90, np.zeros((2, 6)), legend="ab")
    with pytest.raises(ShapeError, match="each of the 2 postures drawn, got 3"):
        rm.viz.show(RX90, np.zeros((2, 6)), legend=["a", "b", "c"])
    with pytest.raises(FrameNotFoundError, match="node"):
        rm.viz.show(RX90).pose("robots/rx91")


# ---------------------------------------------------------------- small parts


@pytest.mark.parametrize(
    ("shape", "high"),
    [
        (Box((2, 4, 6)), (1, 2, 3)),
        (Cylinder(1, 4), (1, 1, 2)),
        (Sphere(2), (2, 2, 2)),
        (Segments(np.array([[0.0, 0, 0], [1, 2, 3]])), (1, 2, 3)),
    ],
)
def test_extent(shape, high):
    corners = extent(shape)
    assert corners.shape == (8, 3)
    np.testing.assert_allclose(corners.max(axis=0), high)


def test_tube_has_its_radius_and_survives_turning_back():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 1, 1]], float)
    tube = path_tube(points, 0.01)
    rings = tube.vertices.reshape(-1, 8, 3)
    assert len(rings) == 5  # the point that repeats is left out
    assert np.isfinite(rings).all()
    radii = np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=-1)
    np.testing.assert_allclose(radii, 0.01, rtol=1e-3)
    assert tube.faces.max() == len(tube.vertices) - 1
    assert path_tube(points[:1], 0.01) is None


def test_box_corners():
    _, corners = workspace_box([0, 1, 2, 3, 4, 5])
    assert {tuple(c) for c in corners} == {
        (x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)
    }


def test_skeleton_of_a_gantry_stands_on_rails():
    table = rm.DHTable.from_rows([
        {"sigma": 1, "alpha": H, "theta": H, "lower": 0, "upper": 2.0},
        {"sigma": 1, "alpha": H, "theta": H, "lower": 0, "upper": 1.5},
        {"sigma": 1, "alpha": H, "lower": 0, "upper": 1.0},
    ])  # fmt: skip
    bars = {
        max(v.shape.size): v
        for v in skeleton(table, np.eye(4), 3)
        if isinstance(v.shape, Box) and max(v.shape.size) > 0.5
    }
    assert {length: bar.frame for length, bar in bars.items()} == {2.0: 0, 1.5: 1, 1.0: 3}
    # the rails lie where the joints slide, from end to end
    factors = rm.link_transforms(table, [1.0, 0.75, 0.0])
    np.testing.assert_allclose(bars[2.0].pose, factors[0], atol=1e-12)
    np.testing.assert_allclose(bars[1.5].pose, factors[1], atol=1e-12)


def test_skeleton_of_a_prismatic_joint_without_limits_is_finite():
    table = rm.DHTable(antecedent=[0], sigma=[1], d=[0.3])
    assert not np.isfinite(table.upper - table.lower).any()
    bars = [v for v in skeleton(table, np.eye(4), 1) if isinstance(v.shape, Box)]
    assert bars
    assert all(np.isfinite(v.shape.size).all() and np.isfinite(v.pose).all() for v in bars)


def test_skeleton_is_deterministic_and_tells_wrist_axes_apart():
    first, second = (skeleton(RX90.table, RX90.tool, 6) for _ in range(2))
    assert len(first) == len(second)
    assert all(
        a.frame == b.frame and a.shape == b.shape and np.array_equal(a.pose, b.pose)
        for a, b in zip(first, second, strict=True)
    )
    joints = {v.frame: v.shape for v in first if v.color and v.color[0] == 0.95}
    assert joints[4].radius > joints[5].radius > joints[6].radius
    assert joints[4].length < joints[5].length < joints[6].length


# ---------------------------------------------------------------- sliders


MIMIC = TREE.with_transmission(
    rm.Transmission([[1, 0, 0, 0], [0, 0, 0, 0], [0, 0.5, 0, 0], [3, 0, 0, 0]], [0, 0.1, 0.2, 0.3])
)


def test_sliders_are_the_independent_joints():
    for model in (RX90, SCARA, TREE, rm.load("tx40")):  # coupled motors leave joints independent
        panel = rm.viz.jog(model).sliders
        assert panel.independent.tolist() == list(range(model.n))
        assert np.array_equal(panel.matrix, np.eye(model.n))
        assert not panel.offset.any()
    scene = rm.viz.jog(MIMIC)
    panel = scene.sliders
    assert panel.independent.tolist() == [0, 2]
    assert panel.matrix.tolist() == [[1, 0], [0, 0], [0, 1], [3, 0]]
    assert panel.offset.tolist() == [0, 0.1, 0, 0.3]
    assert [joint.follows for joint in panel.joints] == [(), (), (), ("joint_1",)]
    assert panel.q.tolist() == [0, 0.1, 0, 0.3]
    assert [name for name, _ in panel.postures] == ["zero (coupled joints follow)"]
    poses = rm.link_poses(MIMIC, panel.q)
    for j, name in enumerate(MIMIC.table.names):
        assert np.allclose(scene.pose(frame_path(scene, name)), poses[j], atol=1e-12)
    assert "follows joint_1; " in scene.html()
    assert "does not move; " in scene.html()
    assert repr(scene).endswith(", 2 sliders>")


def test_coupled_joints_are_in_the_range_of_a_transmission(rng):
    # any rank, any order: what the sliders reach is what the encoders reach
    for rank in (1, 2, 3):
        K = rng.normal(size=(4, rank)) @ rng.normal(size=(rank, 4))
        model = TREE.with_transmission(rm.Transmission(K, rng.normal(size=4)))
        panel = rm.viz.jog(model).sliders
        assert panel.independent.size == rank
        q = model.transmission.to_joint(rng.normal(size=4))
        assert np.allclose(panel.matrix @ q[panel.independent] + panel.offset, q, atol=1e-9)


def test_start_configurations_and_limits_of_sliders():
    model = rm.load("puma560")
    q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    scene = rm.viz.jog(model, q)
    assert scene.sliders.start.tolist() == q
    assert {name for name, _ in scene.sliders.postures} == set(model.configurations)
    assert [joint.ends for joint in scene.sliders.joints] == [
        *zip(model.lower, model.upper, strict=True)
    ]
    limits = [(-np.inf, np.inf), (-np.inf, -2.0), (0.5, np.inf)]
    table = rm.DHTable(
        antecedent=[0, 1, 2], sigma=[0, 1, 0], mu=[1, 0, 1],
        lower=[a for a, _ in limits], upper=[b for _, b in limits],
    )  # fmt: skip
    scene = rm.viz.jog(rm.RobotModel.from_table(table))
    ends = [joint.ends for joint in scene.sliders.joints]
    assert np.allclose(ends, [(-np.pi, np.pi), (-4.0, -2.0), (0.5, 0.5 + 2 * np.pi)])
    text = scene.html()
    assert "no limits, slider -180 to 180 deg<" in text
    assert "up to -2 m, no lower limit, slider from -4 m, passive<" in text
    assert "from 28.648 deg, no upper limit, slider to 388.65 deg<" in text


def test_names_cannot_break_out_of_the_panel():
    table = rm.DHTable(antecedent=[0], sigma=[0], names=("</script><b>x",))
    model = rm.RobotModel.from_table(
        table, name="<b>&", configurations={"</select><script>": [0.1]}
    )
    text = rm.viz.jog(model).html()
    assert text.count("</script>") == 5
    assert text.count("</select>") == 2
    assert "<b>" not in text.split('id="panel"')[1].split("<script")[0]


def test_wrong_jog():
    with pytest.raises(InvalidValueError, match="load it first"):
        rm.viz.jog("rx90")
    with pytest.raises(ShapeError, match=r"q: expected shape \(6,\), got \(5,\)"):
        rm.viz.jog(RX90, np.zeros(5))
    with pytest.raises(ShapeError, match=r"q: expected shape \(6,\), got \(2, 6\)"):
        rm.viz.jog(RX90, np.zeros((2, 6)))
    with pytest.raises(InvalidValueError, match="opacity"):
        rm.viz.jog(RX90, opacity=2.0)
    with pytest.raises(InvalidValueError, match=r"q: joint_5 moves with other joints"):
        rm.viz.jog(MIMIC, [0.5, 0.1, 0.0, 0.3])


# ---------------------------------------------------------------- the command that opens a page


@pytest.fixture
def view(capsys, monkeypatch):
    """Exit status, output and pages opened of `robotmodels view`."""
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)

    def view(*words):
        code = main(["view", *map(str, words)])
        return code, capsys.readouterr(), opened

    return view


def test_view_opens_the_page_where_there_is_a_display(view, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DISPLAY", ":0")
    page = tmp_path / "an arm.html"
    code, said, opened = view("rx90", "--out", page)
    assert (code, opened) == (0, [page.as_uri()])
    assert said.out == f"Scene of rx90 at q = [0. 0. 0. 0. 0. 0.] written to {page}\n"
    assert 'type="range"' in page.read_text(encoding="utf-8")
    code, said, opened = view("rx90", "--out", page, "--no-open")
    assert len(opened) == 1
    assert "no display" not in said.out
    monkeypatch.delenv("DISPLAY")
    code, said, opened = view("rx90", "--out", page)
    assert (code, len(opened)) == (0, 1)
    assert "There is no display or no browser here" in said.out


def test_view_writes_to_the_folder_for_temporary_files(view, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    code, said, _ = view("planar_2r", "--no-open", "--json", "--q", 90, 0, "--degrees")
    data = json.loads(said.out)
    (page,) = tmp_path.iterdir()
    assert code == 0
    assert data["page"] == str(page)
    assert page.name.startswith("robotmodels_planar_2r_")
    assert data["q"] == [H, 0.0]
    assert (data["opened"], data["missing_meshes"]) == (False, [])


def test_view_draws_a_skeleton_for_missing_meshes(view, tmp_path):
    file = tmp_path / "one.urdf"
    file.write_text(urdf("package://nowhere/arm.stl"))
    page = tmp_path / "one.html"
    code, said, _ = view(file, "--no-open", "--out", page)
    assert code == 0
    assert (
        "Mesh files not found, a skeleton is drawn for them: package://nowhere/arm.stl." in said.out
    )
    assert "CylinderGeometry" in page.read_text(encoding="utf-8")
    code, said, _ = view(file, "--no-open", "--skeleton", "--out", page)
    assert "not found" not in said.out


def test_stand_ins_take_the_place_of_missing_meshes_only(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text(TRIANGLE_STL)
    model = rm.RobotModel.from_urdf(urdf(str(path)))
    assert with_stand_ins(model) == (model, ())
    path.unlink()
    drawn, missing = with_stand_ins(model)
    assert missing == (str(path),)
    assert drawn.visuals
    assert {visual.frame for visual in drawn.visuals} == {1}
    assert not any(isinstance(visual.shape, Mesh) for visual in drawn.visuals)
    assert rm.viz.jog(drawn).nodes


def test_view_says_what_is_wrong(view, tmp_path):
    code, said, opened = view("rx90", "--out", tmp_path / "nowhere" / "arm.html")
    assert code == 2
    assert "No such file or directory" in said.err
    code, said, opened = view("rx90", "--q", 1, 2)
    assert code == 2
    assert "--q: expected 6 numbers" in said.err
    assert not opened
