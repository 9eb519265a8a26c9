"""URDF in: every joint type, any axis, what is refused and how, and real robots there and back."""

import time
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from identities.random_robots import random_bodies, random_pose, seeds

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import (
    FrameNotFoundError,
    MeshNotFoundError,
    UrdfError,
    UrdfWarning,
)
from robotmodels.robots.erd import ERD_ARMS, erd_folder

read = rm.RobotModel.from_urdf
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'


def link(name, inside=""):
    return f'<link name="{name}">{inside}</link>'


def joint(name, parent, child, kind="revolute", axis="0 0 1", origin="", inside=None):
    inside = (LIMIT if kind in ("revolute", "prismatic") else "") if inside is None else inside
    axis = "" if axis is None else f'<axis xyz="{axis}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{origin}{axis}{inside}</joint>"
    )


def robot(*elements, name="r"):
    return f'<robot name="{name}">{"".join(elements)}</robot>'


def chain(*joints, **options):
    """Links a, b, c, ... joined by the given joints, each a dict of `joint` options."""
    letters = "abcdefghij"[: len(joints) + 1]
    return robot(
        *map(link, letters),
        *(
            joint(f"j{i}", letters[i - 1], letters[i], **options)
            for i, options in enumerate(joints, start=1)
        ),
        **options,
    )


ORIGIN = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 -0.6"/>'


def assert_like_pinocchio(text, model, frames=None, dynamics=True, tolerance=1e-12):
    """Poses of links, Jacobians and torques are those of Pinocchio's own reading of the URDF.

    Joints that Pinocchio has and the model has not are held at zero; continuous ones are a
    cosine and a sine there.
    """
    theirs = text if isinstance(text, pin.Model) else pin.buildModelFromXML(text)
    data = theirs.createData()
    rng = np.random.default_rng(0)
    joints = [theirs.joints[theirs.getJointId(name)] for name in model.table.joint_names]
    columns = [j.idx_v for j in joints]
    frames = model.frames if frames is None else frames
    ids = [theirs.getFrameId(frame.name, pin.FrameType.BODY) for frame in frames]
    assert max(ids) < theirs.nframes
    for _ in range(2):
        lower, upper = np.maximum(model.lower, -3), np.minimum(model.upper, 3)
        q = lower + (upper - lower) * rng.random(model.n)
        v, a = rng.normal(size=(2, model.n))
        full_q, full_v, full_a = pin.neutral(theirs), np.zeros(theirs.nv), np.zeros(theirs.nv)
        full_v[columns], full_a[columns] = v, a
        for j, x in zip(joints, q, strict=True):
            full_q[j.idx_q : j.idx_q + j.nq] = (np.cos(x), np.sin(x)) if j.nq == 2 else x
        pin.computeJointJacobians(theirs, data, full_q)
        pin.updateFramePlacements(theirs, data)
        # the world of the model is its base link, wherever that is in the file
        base = next(frame.name for frame in model.frames if frame.parent == 0)
        world = data.oMf[theirs.getFrameId(base, pin.FrameType.BODY)].copy()
        size = max(1.0, *(np.abs(data.oMf[i].translation).max() for i in ids))
        for frame, i in zip(frames, ids, strict=True):
            wanted = world.actInv(data.oMf[i]).homogeneous
            error = np.abs(rm.dgm(model, q, frame.name) - wanted).max()
            assert error < tolerance * size, frame.name
            J = pin.getFrameJacobian(theirs, data, i, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            # Pinocchio gives a vector for a robot of one joint
            J = np.reshape(J, (2, 3, -1))[:, :, columns]
            wanted = (world.rotation.T @ J).reshape(6, -1)
            error = np.abs(rm.jacobian(model, q, frame.name) - wanted).max()
            assert error < tolerance * size, frame.name
        if dynamics:
            theirs.gravity.linear = world.rotation @ model.gravity
            wanted = pin.rnea(theirs, data, full_q, full_v, full_a)[columns]
            error = np.abs(rm.idm(model, q, v, a, drive=False) - wanted).max()
            assert error < tolerance * size * max(1.0, np.abs(wanted).max())


# --- joints, axes, inertia ----------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize(
    "axis",
    ["0 0 1", "0 -3 0", "1 2 -3", "1e-3 0 0", "-1 1e-9 0", None],
)
def test_every_type_about_any_axis(kind, axis):
    """Axes need not be unit and may be negative: q keeps its sign and zero; default is x."""
    text = chain(
        {"origin": ORIGIN, "kind": kind, "axis": axis},
        {"origin": ORIGIN, "kind": "fixed", "axis": None},
        {"origin": ORIGIN, "kind": kind, "axis": axis},
        {"origin": ORIGIN, "axis": "0 1 0"},
    )
    model = read(text)
    assert model.table.sigma.tolist() == [int(kind == "prismatic")] * 2 + [0]
    assert_like_pinocchio(text, model, dynamics=False)


def random_urdf(rng, f=6):
    """A random tree of links with inertia, some of them fixed, as text."""
    kinds = ["revolute", "continuous", "prismatic", "fixed"]
    bodies = random_bodies(rng, f + 1)
    elements = []
    for j in range(f + 1):
        M = bodies.mass[j]
        com = bodies.first_moments[j] / M
        tensor = bodies.tensors[j] + M * se3.skew(com) @ se3.skew(com)
        rpy = rng.normal(size=3)
        R = se3.from_rpy(rpy)[:3, :3]
        tensor = R.T @ tensor @ R
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        numbers = zip(keys, tensor[np.triu_indices(3)], strict=True)
        elements.append(link(f"L{j}", (
            f'<inertial><origin xyz="{com[0]} {com[1]} {com[2]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/>'
            f'<mass value="{M}"/><inertia {" ".join(f"{k}={str(v)!r}" for k, v in numbers)}/>'
            "</inertial>"
        )))  # fmt: skip
    for j in range(1, f + 1):
        T = random_pose(rng, 0.3)
        xyz, rpy = T[:3, 3], se3.to_rpy(T[:3, :3])
        axis = rng.normal(size=3)
        elements.append(joint(
            f"J{f + 5 - j}", f"L{rng.integers(j)}", f"L{j}", kinds[rng.integers(4) if j > 1 else 0],
            f"{axis[0]} {axis[1]} {axis[2]}",
            f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/>',
        ))  # fmt: skip
    return robot(*elements)


@given(seeds)
def test_random_trees_are_what_pinocchio_reads(seed):
    """Poses, Jacobians and torques, merged links and reordered siblings included."""
    text = random_urdf(np.random.default_rng(seed))
    model = read(text)
    assert_like_pinocchio(text, model)
    back = read(quiet_urdf(model))
    assert_like_pinocchio(text, back, frames=model.frames)


def quiet_urdf(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UrdfWarning)
        return rm.to_urdf(model)


def test_merged_links_are_listed_and_stay_frames():
    text = chain({}, {"kind": "fixed", "axis": None, "origin": ORIGIN}, {}, {"kind": "fixed"})
    model = read(text)
    assert model.table.names == ("j1", "j3")
    assert model.merged_links == ("c", "e")
    assert model.notes[0] == "link 'c' (fixed by joint 'j2') is merged into the link of j1."
    assert set("abcde") <= set(model.frame_names)


# --- base and tip -------------------------------------------------------------------------------

BRANCHED = robot(
    *map(link, ("world", "base", "arm", "hand", "tcp", "camera", "finger", "head")),
    joint("lift", "world", "base", "prismatic", origin='<origin xyz="0 0 1"/>'),
    joint("shoulder", "base", "arm", origin=ORIGIN),
    joint("wrist", "arm", "hand", axis="1 0 0", origin=ORIGIN),
    joint("mount", "hand", "tcp", "fixed", origin='<origin xyz="0 0 0.1"/>'),
    joint("grip", "hand", "finger", "prismatic", axis="0 1 0"),
    joint("neck", "base", "head", axis="0 1 0"),
    joint("eye", "head", "camera", "fixed", origin=ORIGIN),
)


def test_base_and_tip_choose_a_chain_and_lock_the_rest():
    model = read(BRANCHED, base_link="base", tip_link="tcp")
    assert model.table.names == ("shoulder", "wrist")
    assert model.tip == 2
    assert any("'finger' (locked at zero by joint 'grip')" in note for note in model.notes)
    assert any("'head' (locked at zero by joint 'neck')" in n and "the base" in n
               for n in model.notes)  # fmt: skip
    assert "world" not in model.frame_names, "what is above the base is left out"
    assert_like_pinocchio(BRANCHED, model, dynamics=False)
    q = [0.3, -0.4]
    assert np.array_equal(rm.dgm(model, q), rm.dgm(model, q, "tcp"))
    assert np.allclose(rm.dgm(model, q, "base"), np.eye(4), atol=1e-15)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_floating_joints_are_refused_unless_left_out(kind):
    text = robot(
        *map(link, "abcd"), joint("free", "a", "b", kind), joint("turn", "b", "c"),
        joint("side", "a", "d"),
    )  # fmt: skip
    with pytest.raises(UrdfError, match=rf"'free' is of type '{kind}'.*\('b'\) as base_link"):
        read(text)
    assert read(text, base_link="b").table.names == ("turn",)
    assert read(text, tip_link="d").table.names == ("side",)
    with pytest.raises(UrdfError, match="'free' is of type"):
        read(text, tip_link="c")


# --- mimics -------------------------------------------------------------------------------------


def mimic(master, multiplier=None, offset=None):
    factor = "" if multiplier is None else f' multiplier="{multiplier}"'
    shift = "" if offset is None else f' offset="{offset}"'
    return {"inside": f'{LIMIT}<mimic joint="{master}"{factor}{shift}/>'}


def test_mimics_follow_through_chains():
    """j3 = 2 j2 + 0.1 and j2 = -3 j1 + 0.2, so j3 = -6 j1 + 0.5; the order does not matter."""
    text = chain({}, mimic("j1", -3, 0.2), mimic("j2", 2, 0.1), mimic("j1"))
    model = read(text, mimic=True)
    q = model.transmission.to_joint([0.3, 9, 9, 9])
    assert q == pytest.approx([0.3, -0.7, -1.3, 0.3])
    assert model.table.mu.tolist() == [1, 0, 0, 0]
    assert not model.transmission.is_invertible
    early = read(chain(mimic("j2", 2, 0.1), mimic("j3"), {}), mimic=True)
    assert early.transmission.to_joint([9, 9, 0.3]) == pytest.approx([0.7, 0.3, 0.3])
    alone = read(text)
    assert alone.transmission is None
    assert any("joint 'j2' mimics 'j1' and moves by itself here" in note for note in alone.notes)


# --- meshes -------------------------------------------------------------------------------------


def meshed(filename):
    visual = f'<visual><geometry><mesh filename="{filename}"/></geometry></visual>'
    return robot(link("a", visual), link("b"), joint("j", "a", "b"))


@pytest.fixture
def package(tmp_path):
    """A package ``arm_description`` with one mesh, beside a file that is none of its business."""
    folder = tmp_path / "share" / "arm_description"
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    for place in ("meshes/base link.stl", "package.xml", "../secret.stl"):
        (folder / place).write_text("<package/>\n")
    return folder


def drawn(source, **options):
    return read(source, **options).visuals[0].shape.path


@pytest.mark.parametrize("scheme", ["package", "model"])
def test_meshes_are_found_in_their_package_and_from_the_file_and_nowhere_else(package, scheme):
    share, mesh = package.parent, package / "meshes" / "base link.stl"
    secret, path = share / "secret.stl", package / "urdf" / "arm.urdf"
    (package / "urdf" / "link.stl").symlink_to(secret)
    inside = f"{scheme}://arm_description/meshes/base%20link.stl"
    for package_dirs in (str(share), (share / "other", share), package):
        assert drawn(meshed(inside), package_dirs=package_dirs) == mesh
    for name in (inside, "../meshes/base link.stl", f"file://{mesh}"):
        path.write_text(meshed(name))
        assert drawn(path).samefile(mesh)
    names = ["../../secret.stl", str(secret), f"file://{secret}", "link.stl"]
    for name in (*names, "package://arm_description/../secret.stl", "package:///../secret.stl"):
        path.write_text(meshed(name))
        assert drawn(path) is None, name
    path.write_text(meshed("../../secret.stl"))
    assert drawn(path, package_dirs=share).samefile(secret)
    (package / "package.xml").unlink()
    path.write_text(meshed("../meshes/base link.stl"))
    assert drawn(path) is None


def test_missing_meshes(package):
    """An error if folders were given, unresolved until somebody draws it otherwise."""
    text = meshed("package://arm_description/meshes/nope.stl")
    assert drawn(text) is None
    with pytest.raises(MeshNotFoundError, match=r"nope\.stl' was not found \(looked at .*share"):
        read(text, package_dirs=package.parent)


# --- text and files -------------------------------------------------------------------------------

GOOD = chain({}, name="good")


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + GOOD,
        '\n  <?xml version="1.0" encoding="ISO-8859-1"?>' + GOOD,
        GOOD.replace("><", ">\r\n<").replace("<link", "<!-- a <comment> & more --><link"),
        GOOD.replace("</robot>", "<gazebo><x/></gazebo><transmission/></robot>"),
        GOOD.replace("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"'),
    ],
    ids=["bom", "declaration", "comments", "others", "namespace"],
)
def test_texts_that_mean_the_same(text, tmp_path):
    assert read(text) == read(GOOD)
    path = tmp_path / "robot.urdf"
    path.write_bytes(text.encode("utf-8"))
    assert read(path) == read(GOOD)
    assert read(str(path)) == read(GOOD)


BOMB = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 30))


@pytest.mark.parametrize(
    "doctype",
    [
        f'<!DOCTYPE robot [<!ENTITY e0 "ha">{BOMB}]>',
        '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/robot.dtd">',
    ],
    ids=["bomb", "file", "network"],
)
def test_doctypes_are_refused_at_once(doctype):
    text = doctype + GOOD.replace("good", "&e29;" if "e29" in doctype else "&x;")
    start = time.process_time()
    with pytest.raises(UrdfError, match=r"has a DOCTYPE: .* Remove the"):
        read(text)
    assert time.process_time() - start < 0.1


# --- content that makes no sense ------------------------------------------------------------------


def inertial(mass="1", inertia='ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"', origin=""):
    block = f'<inertial>{origin}<mass value="{mass}"/><inertia {inertia}/></inertial>'
    return robot(link("a"), link("b", block), joint("j", "a", "b"))


def visual(inside):
    return robot(link("a", f"<visual>{inside}</visual>"), link("b"), joint("j", "a", "b"))


MISTAKES = {
    "bytes": (b"<robot/>", "expected a path or the text of a URDF, got bytes"),
    "nothing": ("", "got an empty text"),
    "no file": ("nowhere/arm.urdf", "cannot read 'nowhere/arm.urdf': No such file"),
    "a folder": (Path("/"), "cannot read '/'"),
    "open tag": ("<robot name='r'><link name='a'>", "not well-formed XML.*no element found"),
    "no links": ("<robot name='r'/>", "has no <link>"),
    "nothing moves": (robot(link("a")), "no joint moves"),
    "two joints alike": (
        robot(*map(link, "abc"), joint("j", "a", "b"), joint("j", "b", "c")),
        "two joints are called 'j'",
    ),
    "unknown parent": (
        robot(link("base_link"), link("b"), joint("j", "base_lnk", "b")),
        "'j': its parent link 'base_lnk' is not defined. Did you mean 'base_link'?",
    ),
    "two parents": (
        robot(*map(link, "abc"), joint("j", "a", "c"), joint("k", "b", "c")),
        "link 'c' hangs from two joints, 'j' and 'k'.*tree",
    ),
    "loop": (robot(*map(link, "ab"), joint("j", "a", "b"), joint("k", "b", "a")), "form a loop"),
    "loop aside": (
        robot(*map(link, "abc"), joint("j", "a", "b"), joint("k", "b", "a")),
        "a, b form a loop apart from the root",
    ),
    "two roots": (robot(*map(link, "abc"), joint("j", "a", "b")), r"2 root links \(a, c\)"),
    "no direction": (chain({"axis": "1e-9 0 0"}), "an axis needs a direction"),
    "NaN origin": (chain({"origin": '<origin xyz="0 nan 0"/>'}), "origin xyz: expected 3 finite"),
    "no limits": (chain({"inside": ""}), "a revolute joint without limits is of type continuous"),
    "no stroke": (chain({"kind": "prismatic", "inside": ""}), "a prismatic joint needs <limit"),
    "limits crossed": (
        chain({"inside": '<limit lower="1" upper="-1"/>'}), "lower limit 1.0 is above the upper",
    ),
    "negative speed": (
        chain({"inside": '<limit velocity="-1"/>'}), "'j1': limit velocity is a magnitude, got -1",
    ),
    "negative mass": (inertial("-1"), "link 'b': a mass cannot be negative, got -1.0 kg"),
    "no mass": (GOOD.replace("</link>", "<inertial/></link>", 1), "<mass"),
    "odd shape": (visual("<geometry><torus/></geometry>"), "unknown shape <torus>"),
    "mesh": (visual("<geometry><mesh/></geometry>"), "a mesh has no filename"),
    "tip": (BRANCHED, r"No link 'fingr'\. Did you mean 'finger'", {"tip_link": "fingr"}),
    "tip above": (
        BRANCHED, "below the base link 'head'", {"base_link": "head", "tip_link": "tcp"},
    ),
    "no chain": (
        BRANCHED, "no joint moves between", {"base_link": "hand", "tip_link": "tcp"},
    ),
    "mimic circle": (
        chain(mimic("j2"), mimic("j1")), "j1, j2 mimic each other in a circle", {"mimic": True},
    ),
    "mimic fixed": (
        chain({}, {"kind": "fixed"}, mimic("j2")), "'j2', which is not a moving", {"mimic": True},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_refused_with_the_element_at_fault(name):
    source, words, *options = MISTAKES[name]
    with pytest.raises((UrdfError, FrameNotFoundError), match=words):
        read(source, **(options[0] if options else {}))


def test_shapes_and_colours_are_kept():
    shapes = (
        '<visual><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry>'
        '<material name="blue"/></visual>'
        '<visual><geometry><!-- c --><cylinder radius="0.1" length="0.2"/></geometry>'
        '<material name="own"><color rgba="1 0 0 0.5"/></material></visual>'
        '<visual><geometry><sphere radius="0.3"/></geometry></visual>'
    )
    text = robot(
        '<material name="blue"><color rgba="0 0 1 1"/></material>',
        link("a", shapes), link("b"), joint("j", "a", "b"),
    )  # fmt: skip
    box, cylinder, ball = read(text).visuals
    assert box.shape.size == (1, 2, 3)
    assert box.color == (0, 0, 1, 1)
    assert (cylinder.shape.radius, cylinder.shape.length) == (0.1, 0.2)
    assert cylinder.color == (1, 0, 0, 0.5)
    assert (ball.shape.radius, ball.color) == (0.3, None)
    back = read(rm.to_urdf(read(text))).visuals
    assert [v.shape for v in back] == [box.shape, cylinder.shape, ball.shape]
    assert [v.color for v in back] == [box.color, cylinder.color, ball.color]


# --- real robots, there and back ------------------------------------------------------------------


@cache
def original(urdf):
    return pin.buildModelFromUrdf(str(erd_folder() / urdf))


@pytest.mark.parametrize("name", ERD_ARMS)
@pytest.mark.nightly
def test_real_arms_there_and_back(name):
    """URDF -> table -> URDF: poses of every link, Jacobians and torques as in the original.

    The original is the whole robot as Pinocchio reads it; where an arm is cut out of it by base
    and tip, its other joints rest at zero and its base link is the arm's world.
    """
    arm = ERD_ARMS[name]
    model = rm.load(f"erd:{name}").with_gravity([1.0, -2.0, -9.0])
    assert_like_pinocchio(original(arm.urdf), model)
    back = read(quiet_urdf(model)).with_gravity(model.gravity)
    assert_like_pinocchio(original(arm.urdf), back, frames=model.frames)
    for limit in ("lower", "upper", "velocity", "effort"):
        assert np.array_equal(getattr(back.table, limit), getattr(model.table, limit)), limit
    lengths = np.abs([model.table.b, model.table.d, model.table.r])
    assert lengths.max() < 3.0, "no length beyond the robot's size, let alone kilometres"
