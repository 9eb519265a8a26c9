"""Scenes: shapes at their poses, motions, sliders, and the page. No browser, server or network."""

import base64
import re
import subprocess
import sys
import webbrowser
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import umsgpack
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels import se3
from robotmodels import trajectories as tr
from robotmodels.cli import main
from robotmodels.errors import RobotModelsError, RobotModelsWarning, UrdfError
from robotmodels.kinematics.ellipsoids import OtherPart, TwistPart
from robotmodels.viz.camera import FIELD_OF_VIEW, framed
from robotmodels.viz.shapes import Triangles, apply

H = np.pi / 2
Q = np.array([0.4, 0.7, 0.8, 0.4, 0.9, 0.6])
RX90 = rm.load("rx90")
PLANAR = rm.load("planar_2r")
SCARA = rm.RobotModel.from_table(
    rm.DHTable.from_rows([
        {"sigma": 0, "r": 0.4}, {"sigma": 0, "d": 0.35},
        {"sigma": 1, "d": 0.3, "alpha": np.pi, "lower": 0.0, "upper": 0.2},
    ]),
    base=se3.translation(0.1, 0.2, 0.3), name="scara",
)  # fmt: skip
TREE = rm.RobotModel.from_table(
    rm.DHTable(
        antecedent=[0, 1, 2, 1, 4], sigma=[0, 0, 2, 1, 0], gamma=[0, 0, 0, np.pi, 0],
        b=[0, 0.1, 0, 0, 0], alpha=[0, H, 0.3, H, -H], d=[0, 0.2, 0.3, 0.2, 0.1],
        r=[0.5, 0, 0.1, 0.2, 0],
    ),
    tool=se3.translation(0.0, 0.0, 0.1), name="tree",
)  # fmt: skip
MIMIC = TREE.with_transmission(
    rm.Transmission([[1, 0, 0, 0], [0, 0, 0, 0], [0, 0.5, 0, 0], [3, 0, 0, 0]], [0, 0.1, 0.2, 0.3])
)
TRIANGLE = "solid one\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 1 0\n" \
    "endloop\nendfacet\nendsolid one\n"  # fmt: skip


def urdf(mesh, scale="1 1 1", material=""):
    return f"""<robot name="one"><link name="base"/><link name="arm"><visual>
    <origin xyz="0.1 0 0"/><geometry><mesh filename="{mesh}" scale="{scale}"/></geometry>{material}
    </visual></link><joint name="turn" type="continuous"><parent link="base"/><child link="arm"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/></joint></robot>"""


def content(scene):
    """The data of the page: commands, geometries, labels, camera and panel."""
    (text,) = re.findall(r'atob\("([^"]*)"\)', scene.html())
    return umsgpack.unpackb(base64.b64decode(text))


def commands(scene, kind):
    return {c["path"]: c for c in content(scene)["commands"] if c["type"] == kind}


def frame_path(scene, name):
    """The node that moves with a frame of the table."""
    (path,) = [p for p in scene.paths if p.split("/")[-1] == name]
    return f"{path}/q" if f"{path}/q" in scene.paths else path


def links(scene):
    return [node for node in scene.nodes if "/shape:" in node.path]


# ---------------------------------------------------------------- shapes and their poses


@pytest.mark.parametrize("model", [RX90, SCARA, TREE], ids=lambda m: m.name)
def test_scene_and_page_hold_the_poses_of_the_model(model, rng):
    q = rng.uniform(-1.0, 1.0, model.n)
    scene = rm.viz.show(model, q, frames=True, names=True)
    for name, T in zip(model.table.names, rm.link_poses(model, q), strict=True):
        path = frame_path(scene, name)
        np.testing.assert_allclose(scene.pose(path), T, atol=1e-14)
        z = scene.pose(f"{path}/R{model.table.names.index(name) + 1}:z")  # the blue axis
        np.testing.assert_allclose(z[:3, 2], T[:3, 2], atol=1e-14)
    sent = commands(scene, "set_transform")
    path = frame_path(scene, model.table.names[model.tip - 1])
    T, names = np.eye(4), path.split("/")
    for k in range(1, len(names)):
        matrix = sent["/" + "/".join(names[: k + 1])]["matrix"]
        T = T @ np.reshape(matrix, (4, 4)).T  # the viewer reads column by column
    np.testing.assert_allclose(T @ model.tool, rm.dgm(model, q), atol=1e-8)
    assert [text for _, text, _ in content(scene)["labels"]] == list(model.table.names)


def test_postures_over_each_other_and_beside_each_other():
    q = np.linspace(np.zeros(6), np.ones(6), 16)
    scene = rm.viz.show(RX90, q, opacity=0.5, legend=[str(k) for k in range(16)])
    for k, posture in enumerate(q):
        (path,) = [p for p in scene.paths if f"posture_{k + 1}/" in p and p.endswith("joint_6/q")]
        T = rm.link_poses(RX90, posture)[5]
        np.testing.assert_allclose(scene.pose(path), T, atol=1e-14)
    colors = {node.color for node in links(scene) if "posture" in node.path}
    assert len(colors) == len({color for _, color in scene.legend}) == 16
    assert {color[3] for color in colors} == {0.5}
    five = np.array([[0.1, 0.5, 0.1], [0.9, -0.7, 0.0], [-1, 0.2, 0.2], [2.0, 1.0, 0.1], [0, 0, 0]])
    beside = rm.viz.show(SCARA, five, columns=2)
    shifts = []
    for k, posture in enumerate(five):
        root = "robots/scara" + (f"_{k + 1}" if k else "")
        shifts.append(beside.pose(root)[:3, 3] - SCARA.base[:3, 3])
        path = next(p for p in beside.paths if p.startswith(root + "/") and p.endswith("joint_3/q"))
        T = rm.link_poses(SCARA, posture)
        np.testing.assert_allclose(beside.pose(path)[:3, 3], T[2, :3, 3] + shifts[k], atol=1e-14)
    assert shifts[1][0] > 0.5
    assert shifts[2][1] < -0.5
    np.testing.assert_allclose(shifts[3], shifts[1] + shifts[2], atol=1e-14)


def test_colors_and_legend():
    two = rm.viz.show(RX90, np.zeros((2, 6)), color=[(1, 0, 0), (0, 0, 1, 0.5)],
                      legend=["<up> & away", "down"])  # fmt: skip
    colors = {node.color for node in links(two) if "posture" in node.path}
    assert colors == {(1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.5)}
    assert '#ff0000"></span>&lt;up&gt; &amp; away</li>' in two.html()
    twins = rm.viz.show([RX90, RX90], color=[(1, 0, 0), (0, 1, 0)])
    assert len(set(twins.paths)) == len(twins.paths)
    assert {n.color[1] for n in links(twins) if "rx90_2/" in n.path} == {1.0}


def in_picture(points, camera):
    """Tangents of the directions to points, across and upwards, over that of half the picture."""
    back = (camera.position - camera.target) / camera.distance
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    relative = points - camera.position
    depth = -relative @ back * np.tan(np.radians(FIELD_OF_VIEW / 2))
    assert (depth > 0).all()
    return np.abs(relative @ right) / depth, np.abs(relative @ np.cross(back, right)) / depth


def test_camera_sees_all_and_is_near(rng):
    for size in (0.01, 1.0, 30.0):
        points = size * rng.uniform(-1, 1, (50, 3)) + np.array((5.0, -2.0, 1.0))
        across, high = in_picture(points, framed(points))
        assert 0.8 < max(across.max() / 1.15, high.max()) <= 1.0001
    q = np.linspace(np.zeros(6), (0, 1.5, 0, 0, 0, 0), 200)
    across, high = in_picture(rm.dgm(RX90, q)[:, :3, 3], rm.viz.animate(RX90, q).camera)
    assert max(across.max() / 1.15, high.max()) < 1.0
    camera = rm.viz.show(RX90, view=(0.0, 0.0)).camera
    np.testing.assert_allclose((camera.position - camera.target)[1:], 0, atol=1e-12)
    x, y, z = camera.target
    sent = content(rm.viz.show(RX90, view=(0, 0)))["target"]
    np.testing.assert_allclose(sent, (x, z, -y), atol=1e-6)  # the y axis of the viewer is upwards


# ---------------------------------------------------------------- animation


def played(scene, name, t):
    """The motion of a joint in the page: straight lines between its keyframes."""
    found = next(c for c in content(scene)["commands"] if c["type"] == "set_animation")
    track = next(a for a in found["animations"] if a["path"].endswith(f"{name}/q"))["clip"]
    assert track["fps"] == 1  # times in seconds
    keys = track["tracks"][0]["keys"]
    return np.interp(t, [key["time"] for key in keys], [key["value"] for key in keys])


def test_animation_plays_every_motion_at_its_own_times():
    t = np.linspace(0.0, 8.0, 4001)
    q = np.sin(2.0 * t[:, None] + [0.0, 1.0, 2.0]) * (2.0, 1.0, 0.1) + (8.0, 0, 0.1)
    scene = rm.viz.animate(SCARA, q, dt=t[1])
    assert scene.motion.samples == 4001
    assert scene.motion.keyframes == 3 * 241  # 30 a second
    for j in range(3):
        np.testing.assert_allclose(played(scene, f"joint_{j + 1}", t), q[:, j], atol=2e-3)
        assert played(scene, f"joint_{j + 1}", 8.0) == pytest.approx(q[-1, j], abs=1e-6)
    move = tr.quintic(Q, Q + 0.3, duration=1.71)
    line = tr.straight_line(rm.dgm(RX90, Q), rm.dgm(RX90, Q + 0.1), duration=0.8)
    path = tr.joint_path(RX90, line, Q, samples=50)
    uneven = move.at([1.0, 1.1, 1.5, 1.7])
    for value, options, samples, duration in (
        (move, {}, 53, 1.71),
        (uneven, {}, 4, 0.7),
        (uneven, {"dt": 1.0}, 4, 3.0),
        (path, {}, 50, 0.8),
        (tr.resolved_motion(RX90, line, Q, samples=40), {}, 40, 0.8),
        (np.zeros((31, 6)), {"fps": 10}, 31, 3.0),
    ):
        motion = rm.viz.animate(RX90, value, **options).motion
        assert (motion.samples, motion.duration) == (samples, pytest.approx(duration))
    two = rm.viz.animate([RX90, SCARA], [move, q[:21]], fps=10, path=True)  # each in its own time
    assert (len(two.motion.tracks), two.motion.duration) == (9, pytest.approx(2.0))
    assert {"paths/rx90", "paths/scara"} <= set(two.paths)


def test_tool_path_is_where_the_tool_goes():
    q = np.linspace(np.zeros(6), (1.5, 0.5, 0.5, 0, 0, 0), 500)
    scene = rm.viz.animate(RX90, q, path=True)
    tube = next(n for n in scene.nodes if n.path == "paths/rx90").shape
    centres = tube.vertices.reshape(-1, 9, 3)[:, :8].mean(axis=1)
    tips = rm.dgm(RX90, q)[:, :3, 3]
    np.testing.assert_allclose(centres[[0, -1]], tips[[0, -1]], atol=1e-6)
    assert np.linalg.norm(centres[:, None] - tips, axis=-1).min(axis=1).max() < 1e-3


# ---------------------------------------------------------------- sliders


def test_sliders_are_the_independent_joints_in_their_limits():
    assert rm.viz.jog(rm.load("tx40")).sliders.independent.size == 6  # only motors are coupled
    scene = rm.viz.jog(MIMIC)
    panel = content(scene)["panel"]
    assert [joint["leads"] for joint in panel["joints"]] == [True, False, True, False]
    for name, T in zip(MIMIC.table.names, rm.link_poses(MIMIC, scene.sliders.q), strict=True):
        np.testing.assert_allclose(scene.pose(frame_path(scene, name)), T, atol=1e-12)
    table = rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 1, 0], mu=[1, 0, 1],
                       lower=[-np.inf, -np.inf, 0.5], upper=[np.inf, -2.0, np.inf])  # fmt: skip
    joints = content(rm.viz.jog(rm.RobotModel.from_table(table)))["panel"]["joints"]
    ends = [joint["ends"] for joint in joints]
    np.testing.assert_allclose(ends, [(-np.pi, np.pi), (-4.0, -2.0), (0.5, 0.5 + 2 * np.pi)])


def test_coupled_joints_are_in_the_range_of_a_transmission(rng):
    # any rank, any order: the sliders reach the same configurations as the encoders
    for rank in (1, 2, 3):
        K = rng.normal(size=(4, rank)) @ rng.normal(size=(rank, 4))
        model = TREE.with_transmission(rm.Transmission(K, rng.normal(size=4)))
        panel = rm.viz.jog(model).sliders
        assert panel.independent.size == rank
        q = model.transmission.to_joint(rng.normal(size=4))
        assert np.allclose(panel.matrix @ q[panel.independent] + panel.offset, q, atol=1e-9)


# ---------------------------------------------------------------- ellipsoids


def surface(scene, path="ellipsoids/1/surface"):
    """Points of a shape in the world."""
    node = next(n for n in scene.nodes if n.path == path)
    points = node.shape.vertices if isinstance(node.shape, Triangles) else node.shape.points
    return apply(scene.pose(path), np.asarray(points, float))


def scale_of(text):
    return float(re.search(r": ([\d.e+-]+) m drawn per", text)[1])


@pytest.mark.parametrize("function", [rm.velocity_ellipsoid, rm.force_ellipsoid])
def test_the_surface_is_the_ellipsoid_at_the_tool_to_scale(function):
    model = RX90.with_base(se3.from_rpy([0.3, 0.2, 0.1], [0.5, 0.1, 0.2]))
    ellipsoid = function(model, Q, TwistPart.ANGULAR)
    scene = rm.viz.show(model, Q, ellipsoids=ellipsoid)
    ((text, _),) = scene.legend
    assert text.startswith(f"{ellipsoid.quantity.value}: ")
    for path in ("ellipsoids/1/surface", "ellipsoids/1/outline"):
        points = (surface(scene, path) - rm.dgm(model, Q)[:3, 3]) @ ellipsoid.axes
        inside = points / (scale_of(text) * ellipsoid.radii)
        np.testing.assert_allclose(np.linalg.norm(inside, axis=-1), 1.0, atol=1e-5)
        assert (np.abs([inside.min(axis=0), inside.max(axis=0)]) > 0.98).all()
    asked = rm.viz.show(model, Q, ellipsoids=ellipsoid, ellipsoid_scale=0.37)
    assert scale_of(asked.legend[0][0]) == 0.37


def test_an_ellipsoid_of_a_singular_position_is_a_bar():
    line = rm.velocity_ellipsoid(PLANAR, [0.4, 0.0])
    bar = rm.viz.show(PLANAR, [0.4, 0.0], ellipsoids=line)
    assert "ellipsoids/1/surface" not in bar.paths
    along = (surface(bar, "ellipsoids/1/axis_1") - line.centre) @ line.axes[:, 0]
    assert along.max() == pytest.approx(scale_of(bar.legend[0][0]) * line.radii[0])


@pytest.mark.parametrize("q", [[0.4, 1.2], [0.4, 0.0], [0.4, 0.02]])
def test_a_long_ellipsoid_is_cut_on_its_own_surface(q):
    ellipsoid = rm.force_ellipsoid(PLANAR, q)
    scene = rm.viz.show(PLANAR, q, ellipsoids=ellipsoid)
    text = scene.legend[0][0]
    assert "continues along its axes" in text
    points = (surface(scene) - ellipsoid.centre) @ ellipsoid.axes
    inside = points / (scale_of(text) * ellipsoid.radii)
    reach = np.abs(points).max(axis=0)
    cut = np.isclose(np.abs(points), reach.max(), rtol=1e-6).any(axis=1)
    np.testing.assert_allclose(np.linalg.norm(inside[~cut], axis=-1), 1.0, atol=1e-5)
    assert np.linalg.norm(inside, axis=-1).max() < 1.0 + 1e-5
    long = scale_of(text) * ellipsoid.radii > reach.max() * 1.001
    assert long.sum() >= np.isinf(ellipsoid.radii).sum() > 0
    for k in range(3):  # the axes go on beyond the surface
        bar = (surface(scene, f"ellipsoids/1/axis_{k + 1}") - ellipsoid.centre) @ ellipsoid.axes
        assert (np.abs(bar[:, k]).max() > 1.1 * reach[k]) == long[k]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.nightly
def test_any_robot_gives_a_page_and_a_figure(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=1 + seed, tree=True, fixed=True)
    q, _, _ = random_state(model, rng)
    kinds = [
        function(model, q, part, other=other)
        for function in (rm.velocity_ellipsoid, rm.force_ellipsoid)
        for part in TwistPart
        for other in OtherPart
    ]
    scene = rm.viz.show(model, q, ellipsoids=kinds)
    shapes = [node.shape for node in scene.nodes]
    points = [shape.vertices for shape in shapes if isinstance(shape, Triangles)]
    matrices = [c["matrix"] for c in content(scene)["commands"] if c["type"] == "set_transform"]
    drawn = [
        line.get_xydata() for axes in rm.viz.plot_ellipsoids(kinds).axes for line in axes.lines
    ]
    assert all(np.isfinite(each).all() for each in (*points, *matrices, *drawn))


# ---------------------------------------------------------------- the page


def test_a_page_is_one_offline_file_the_same_each_time(tmp_path):
    q = np.linspace(np.zeros(6), np.ones(6), 20)
    scene = rm.viz.animate(RX90, q, frames=True, names=True)
    text = scene.save(tmp_path / "arm.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text  # the browser itself is told to load nothing
    outside = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"https?:|<(script|link|img|iframe)[^>]*\b(src|href)=", outside)
    with ThreadPoolExecutor(3) as pool:
        draw = lambda _: rm.viz.animate(RX90, q, frames=True, names=True).html()  # noqa: E731
        assert [*pool.map(draw, range(3))] == [text] * 3
    assert rm.viz.show(RX90)._repr_html_().count('"') == 4  # nothing inside ends the attribute


def test_names_cannot_break_out_of_the_page():
    table = rm.DHTable(antecedent=[0], sigma=[0], names=("</script><b>/x",))
    model = rm.RobotModel.from_table(table, name="<b>&", configurations={"</select>": [0.1]})
    for scene in (rm.viz.show(model, [0.1], names=True), rm.viz.jog(model)):
        text = scene.html()
        assert text.count("</script>") == 2
        assert "<title>&lt;b&gt;&amp;</title>" in text
        assert any(path.endswith("_script><b>_x/q") for path in scene.paths)


def test_nothing_heavy_is_imported_and_no_process_is_started(tmp_path):
    code = f"""
import subprocess, sys
class Refuse(subprocess.Popen):
    def __init__(self, *_, **__): raise AssertionError("a process was started")
subprocess.Popen = Refuse
import robotmodels as rm
arm = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[0], d=[0.3]))
scene = rm.viz.show(arm, [0.2])
assert not {{"meshcat", "trimesh", "zmq", "matplotlib"}} & set(sys.modules)
sys.modules["meshcat"] = None
try:
    scene.html()
except rm.errors.MissingExtraError as error:
    print(error)
del sys.modules["meshcat"]
scene.save(r"{tmp_path / "a.html"}")
assert not {{"meshcat", "trimesh", "zmq", "matplotlib"}} & set(sys.modules)
"""
    run = subprocess.run([sys.executable, "-c", code], check=True, timeout=60, capture_output=True,
                         text=True)  # fmt: skip
    assert "pip install 'meshcat" in run.stdout


# ---------------------------------------------------------------- meshes


def test_a_missing_mesh_is_a_skeleton_and_a_warning():
    model = rm.RobotModel.from_urdf(urdf("package://nowhere/arm.stl"))
    with pytest.warns(RobotModelsWarning, match=r"nowhere/arm\.stl.*package_dirs.*meshes=False"):
        scene = rm.viz.show(model, [0.0])
    assert links(scene)
    assert links(rm.viz.show(model, [0.0], meshes=False))


def test_a_mesh_has_its_place_scale_and_colour_and_is_in_the_page_once(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text(TRIANGLE)
    blue = '<material name="blue"><color rgba="0 0 1 0.5"/></material>'
    model = rm.RobotModel.from_urdf(urdf(str(path), "0.1 -0.1 0.1", blue), package_dirs=tmp_path)
    scene = rm.viz.show(model, [H])
    (node,) = [n for n in scene.nodes if isinstance(n.shape, Triangles)]
    assert node.color == (0.0, 0.0, 1.0, 0.5)
    corners = apply(scene.pose(node.path), node.shape.vertices)
    expected = [[0.0, 0.1, 0.5], [0.0, 0.3, 0.5], [0.1, 0.1, 0.5]]
    np.testing.assert_allclose(sorted(corners.tolist()), sorted(expected), atol=1e-7)
    many = content(rm.viz.show(model, np.zeros((8, 1)), grid=False, tool=False))
    assert len(many["geometries"]) == 1
    assert sum("geometry" in command for command in many["commands"]) == 8
    texts = {"bad.stl": "this is no mesh", "bad.dae": "this is no mesh", "bomb.zip": "PK"}
    texts["nan.stl"] = TRIANGLE.replace("vertex 0", "vertex nan")
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        model = rm.RobotModel.from_urdf(urdf(name), package_dirs=tmp_path)
        with pytest.raises(UrdfError, match=name):
            rm.viz.show(model, [0.0])


# ---------------------------------------------------------------- mistakes, and the command

QUINTIC = tr.quintic(np.zeros(6), np.ones(6), 1.0)
STRAIGHT = tr.straight_line(np.eye(4), np.eye(4), duration=1.0)
BALL = rm.velocity_ellipsoid(RX90, Q)
LOST = tr.JointPath(
    np.arange(3.0), [Q, Q, Q * np.nan], np.zeros((3, 6)), np.zeros(3), np.ones(3), ["", "", ""], ()
)
MISTAKES = (
    (lambda: rm.viz.animate(RX90, LOST), r"the first is pose 2; .*q\[:2\]"),
    (lambda: rm.viz.show(RX90, np.zeros((0, 6))), "q: expected one posture"),
    (lambda: rm.viz.show([RX90, SCARA], [np.zeros(6)]), "each of the 2 robots"),
    (lambda: rm.viz.show("rx90"), "model: expected a RobotModel"),
    (lambda: rm.viz.show(RX90, "nowhere"), "q: expected one of 'zero'"),
    (lambda: rm.viz.show(RX90, box=(1, 0, 0, 1, 0, 1)), "box: .* x from 1"),
    (lambda: rm.viz.show(RX90, np.zeros((2, 6)), color=[(1, 0, 0)] * 3), "the 2 postures"),
    (lambda: rm.viz.show(RX90, ellipsoids=[BALL, 3]), "ellipsoids"),
    (lambda: rm.viz.show(RX90).pose("robots/rx91"), "node"),
    (lambda: rm.viz.animate(RX90, np.zeros(6)), "at least two samples"),
    (lambda: rm.viz.animate(RX90, STRAIGHT), "got PoseTrajectory; joint_path"),
    (lambda: rm.viz.animate(RX90, QUINTIC.at([0.5, 0.1])), "ascending"),
    (lambda: rm.viz.jog(MIMIC, [0.5, 0.1, 0.0, 0.3]), "q: joint_5 moves with other joints"),
)


@pytest.mark.parametrize(("wrong", "message"), MISTAKES)
def test_mistakes_are_named(wrong, message):
    with pytest.raises(RobotModelsError, match=message):
        wrong()


def test_the_command_opens_a_page_where_there_is_a_display(tmp_path, monkeypatch, capsys):
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("WAYLAND_DISPLAY", "BROWSER", "DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    page = tmp_path / "an arm.html"
    for display, expected in (("", []), (":0", [page.as_uri()])):
        monkeypatch.setenv("DISPLAY", display)
        assert main(["view", "rx90", "--out", str(page)]) == 0
        assert opened == expected
    assert '<div id="panel">' in page.read_text(encoding="utf-8")
    (tmp_path / "one.urdf").write_text(urdf("package://nowhere/arm.stl"))
    assert main(["view", str(tmp_path / "one.urdf"), "--no-open", "--out", str(page)]) == 0
    assert "a skeleton is drawn for them: package://nowhere/arm.stl." in capsys.readouterr().out
    assert main(["view", "rx90", "--out", str(tmp_path / "nowhere" / "arm.html")]) == 2
