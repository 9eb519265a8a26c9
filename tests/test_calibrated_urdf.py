"""The URDF of a calibrated robot: the user's own text, with other origins."""

import pickle
import re
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest
from calibration_arms import off
from identities.random_robots import random_pose

import robotmodels as rm
from robotmodels import se3
from robotmodels.calibration import calibrated_urdf
from robotmodels.errors import UrdfWarning

EXACT, SIZE = 1e-9, 0.02
SEEDS = range(3)
BODY = """  <!-- the <link> {0} > 0 -->
  <link name="{0}">
    <inertial><origin xyz="0.01 0 0.02"/><mass value="1.5"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <visual><origin xyz="0 0 0.1" rpy="0 0 1"/><geometry>
      <mesh filename="package://arm/{0}.dae"/></geometry><material name="grey"/></visual>
  </link>"""
JOINT = """  <joint name="{0}_{1}" type="{2}">
    <!-- <origin xyz="9 9 9"/> -->
    <parent link="{0}"/>{3}
    <child link="{1}"/>
    {4}
  </joint>"""


# --- robots as people write them ------------------------------------------------------------------


def joint(rng, parent, child, kind=None):
    """A joint; its origin is left out, has one part only, or is not closed at once."""
    words = [" ".join(f"{v:.6g}" for v in rng.uniform(-size, size, 3)) for size in (0.4, 3.0)]
    xyz, rpy = f'xyz="{words[0]}"', f'rpy="{words[1]}"'
    origin = rng.choice([
        "", f"<origin {xyz}/>", f"<origin {rpy} {xyz}  />", f"<origin {xyz} {rpy}></origin>",
        f"<origin\n      {rpy}\n      {xyz}/>", f"<origin {xyz.replace(chr(34), chr(39))} {rpy}/>",
    ])  # fmt: skip
    kind = kind or rng.choice(["revolute", "continuous", "prismatic"], p=[0.6, 0.2, 0.2])
    axis = rng.choice(["<axis xyz='0 0 1'/>", '<axis xyz="0 -1 0"/>', "", '<axis xyz="1 -2 0.5"/>'])
    axis += '<limit lower="-2.5" upper="2.25" effort="10" velocity="3"/>'
    if child == "finger_2":
        axis += '<mimic joint="hand_finger_1" multiplier="-1"/>'
    return JOINT.format(parent, child, kind, origin, "" if kind == "fixed" else axis)


def arm_text(rng, mount=False, stand=False, flange=True):
    """An arm with a camera, a hand with two fingers beyond its tip, and a second arm."""
    first, end = "mount" if mount else "base", "tip" if flange else "l4"
    joints = [(first, "l1"), ("l1", "l2"), ("l2", "l3"), ("l3", "l4"), ("base", "plate", "fixed"),
              ("l3", "camera", "fixed"), ("camera", "lens", "fixed"), ("base", "lamp"),
              ("l2", "cover"), (end, "hand", "fixed"), ("hand", "finger_1", "prismatic"),
              ("hand", "finger_2", "prismatic")]  # fmt: skip
    joints += [("l4", "flange", "fixed"), ("flange", "tip", "fixed")] * flange
    joints += [("base", "mount", "fixed")] * mount + [("stand", "base", "fixed")] * stand
    joints = [joints[k] for k in rng.permutation(len(joints))]
    names = list(dict.fromkeys(name for a, b, *_ in joints for name in (a, b)))
    return "\n".join([
        '<?xml version="1.0"?>', "<!-- by xacro -->", '<robot name="arm">',
        '  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>',
        *('  <link name="tip"/>' if name == "tip" else BODY.format(name) for name in names),
        *(joint(rng, *each) for each in joints),
        '  <gazebo reference="l1"><selfCollide>true</selfCollide></gazebo>',
        '  <transmission name="t"><joint name="base_l1"/><origin xyz="1 1"/></transmission>',
        "</robot>", "",
    ])  # fmt: skip


def pin_pose(text, model, q, frame, world=None):
    """Pose of a link in plain Pinocchio; joints that the model has not stand at zero."""
    twin = pin.buildModelFromXML(text)
    data, at = twin.createData(), pin.neutral(twin)
    for name, value in zip(model.table.joint_names, q, strict=True):
        j = twin.joints[twin.getJointId(name)]
        at[j.idx_q : j.idx_q + j.nq] = [np.cos(value), np.sin(value)] if j.nq == 2 else value
    pin.framesForwardKinematics(twin, data, at)

    def pose(name):
        return data.oMf[twin.getFrameId(name, pin.FrameType.BODY)].homogeneous

    return pose(frame) if world is None else se3.inverse(pose(world)) @ pose(frame)


def assert_same_poses(text, robot, rng, frame, link, options=None, all_joints=True):
    """In plain Pinocchio, and read again; the link is where the model has the frame."""
    options = options or {}
    model, world = robot.model, options.get("base_link")
    again = rm.RobotModel.from_urdf(text, **options)
    assert again.table.joint_names == model.table.joint_names or not all_joints
    columns = [model.table.joint_names.index(name) for name in again.table.joint_names]
    for q in rng.uniform(-2.0, 2.0, (4, model.n)):
        there = rm.dgm(model, q, frame)
        np.testing.assert_allclose(pin_pose(text, model, q, link, world), there, 0, EXACT)
        np.testing.assert_allclose(rm.dgm(again, q[columns], frame and link), there, 0, EXACT)


def without_origins(text, joints='[^"]*'):
    """The text with the origins of joints taken out, and the spaces before them."""
    text = re.sub(r"<!--.*?-->", lambda m: m[0].replace("<origin", "<comment"), text, flags=re.S)
    return re.sub(
        rf'(  <joint name="({joints})" type=.*?</joint>)',
        lambda m: re.sub(r"\s*<origin[^>]*?(/>|></origin>)", "", m[0], flags=re.S),
        text, flags=re.S,
    )  # fmt: skip


# --- the tip that was named, everything else stays ------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_the_named_tip_is_the_calibrated_one_and_only_origins_change(seed):
    rng = np.random.default_rng(seed)
    text = arm_text(rng, mount=seed % 2 == 0)
    options = {"tip_link": "tip"}
    model = rm.RobotModel.from_urdf(text, **options)
    robot = off(model, rng, SIZE, base=seed % 2 == 0)
    written = calibrated_urdf(robot)
    assert_same_poses(written, robot, rng, None, "tip", options)
    assert_same_poses(written, robot, rng, "tip", "tip", options)
    own = rf"l\d_l\d|flange_tip|{'base_mount|mount_l1' if seed % 2 == 0 else 'base_l1'}"
    assert without_origins(written, own) == without_origins(text, own)  # comments, meshes, order
    # links beside the chain keep their place in their bodies
    bodies = {"camera": "l3", "lens": "l3", "flange": "l4", "cover": "l2", "plate": "base",
              "lamp": "base", "hand": "tip", "finger_1": "tip", "finger_2": "tip"}  # fmt: skip
    for q in rng.uniform(-2.0, 2.0, (2, model.n)):
        for name, on in bodies.items():
            before, after = (pin_pose(t, model, q, name, on) for t in (text, written))
            np.testing.assert_allclose(after, before, 0, EXACT)
        for name in ("camera", "lens", "flange", "l3"):
            there = rm.dgm(robot.model, q, name)
            np.testing.assert_allclose(pin_pose(written, model, q, name), there, 0, EXACT)


@pytest.mark.parametrize("seed", SEEDS)
def test_other_measured_links_are_calibrated_too(seed):
    rng = np.random.default_rng(seed)
    options = {"tip_link": None if seed % 2 else "tip"}
    text = arm_text(rng, mount=True)
    model = rm.RobotModel.from_urdf(text, **options)
    frames = (None, "camera", "plate", "finger_1")  # on the chain, on the base, beyond the tip
    robot = off(model, rng, SIZE, frames)
    written = calibrated_urdf(robot)
    tip = model.source.tool_link
    for frame, name in ((None, tip), ("camera",) * 2, ("plate",) * 2, ("finger_1",) * 2):
        assert_same_poses(written, robot, rng, frame, name, options)
    added = len(ET.fromstring(written)) - len(ET.fromstring(text))
    moving = {tip, "finger_1"} - set(model.merged_links)  # measured off their own axes
    assert added == 2 * len(moving)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_tip_that_a_joint_moves_is_carried_by_one_more_link(seed):
    rng = np.random.default_rng(seed)
    text = arm_text(rng, flange=False)
    options = {"tip_link": "l4"}
    model = rm.RobotModel.from_urdf(text, **options)
    same = calibrated_urdf(off(model, rng, SIZE, base=False, tool=False))
    assert without_origins(same) == without_origins(text)
    robot = off(model, rng, SIZE, base=False)
    written = calibrated_urdf(robot)
    assert_same_poses(written, robot, rng, None, "l4", options)
    twin, before = pin.buildModelFromXML(written), pin.buildModelFromXML(text)
    assert twin.nq == before.nq
    names = {f.name for f in twin.frames} - {f.name for f in before.frames}
    assert names == {"l3_l4_axis", "l4_fixed"}


@pytest.mark.parametrize("seed", range(4))
def test_fingers_in_the_table_follow_a_tip_before_them(seed):
    rng = np.random.default_rng(seed)
    text = arm_text(rng)
    model = rm.RobotModel.from_urdf(text)
    hand = next(frame for frame in model.frames if frame.name == "hand")
    robot = off(model.with_tool(hand.pose, hand.parent), rng, SIZE, base=False)
    written = calibrated_urdf(robot)
    assert_same_poses(written, robot, rng, None, "hand", {"tip_link": "hand"}, all_joints=False)
    own = r"base_l1|l\d_l\d|tip_hand"
    assert without_origins(written, own) == without_origins(text, own)


# --- base, tools and sources ----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("base_link", [None, "base"])
@pytest.mark.parametrize("mount", [False, True])
@pytest.mark.parametrize("stand", [False, True])
def test_the_base_is_placed_in_the_link_that_is_the_world(seed, base_link, mount, stand):
    rng = np.random.default_rng(seed)
    text = arm_text(rng, mount, stand)
    options = {"base_link": base_link, "tip_link": "tip"}
    model = rm.RobotModel.from_urdf(text, **options)
    robot = off(model.with_base(random_pose(rng) @ model.base), rng, SIZE)
    written = calibrated_urdf(robot)
    assert_same_poses(written, robot, rng, None, "tip", options)
    added = len(ET.fromstring(written)) - len(ET.fromstring(text))
    at_root = base_link is None and not mount and not stand
    assert added == (2 if at_root else 0)
    q = np.zeros(model.n)
    for name in ("base", "plate", "lamp") * at_root:  # all of the robot goes along
        before, after = pin_pose(text, model, q, name), pin_pose(written, model, q, name, "base")
        np.testing.assert_allclose(after, before, 0, EXACT)
        moved = pin_pose(written, model, q, name, "world")
        np.testing.assert_allclose(moved, rm.dgm(robot.model, q, name), 0, EXACT)


@pytest.mark.parametrize("tip_link", ["tip", "l4", None])
def test_a_tool_that_is_no_link_becomes_one_and_the_tip_link_stays(tip_link, rng):
    text = arm_text(rng).replace('name="lamp"', 'name="tool"').replace('link="lamp"', 'link="tool"')
    bare = rm.RobotModel.from_urdf(text, tip_link=tip_link or "tip")
    model = bare.with_tool(bare.tool @ se3.translation(0.0, 0.05, 0.1))
    named = bare.source.tool_link
    robot = off(model, rng, SIZE, base=False)
    written = calibrated_urdf(robot)
    assert_same_poses(written, robot, rng, None, "tool_new", {"tip_link": "tool_new"})
    for q in rng.uniform(-2.0, 2.0, (3, model.n)):
        there = rm.dgm(robot.model, q, named)
        np.testing.assert_allclose(pin_pose(written, model, q, named), there, 0, EXACT)
        before, after = (pin_pose(t, model, q, named, "l4") for t in (text, written))
        np.testing.assert_allclose(after, before, 0, EXACT)


def test_nothing_off_writes_the_text_as_it_was(rng):
    text = arm_text(rng, mount=True)
    for options in ({}, {"tip_link": "tip"}, {"base_link": "base"}, {"mimic": True}):
        model = rm.RobotModel.from_urdf(text, **options)
        robot = pickle.loads(pickle.dumps(off(model, rng, 0.0)))
        assert calibrated_urdf(robot) == text


def test_what_the_text_cannot_hold_is_warned_of(rng):
    text = arm_text(rng)
    model = rm.RobotModel.from_urdf(text, tip_link="tip")
    robot = off(model, rng, SIZE, gains=True, eccentricity=True, compliance="joints")
    with pytest.warns(UrdfWarning, match=r"Gains.*Eccentricity.*Compliance"):
        calibrated_urdf(robot)
    with pytest.warns(UrdfWarning, match=r"tilt .* gravity, \[0\.098"):
        calibrated_urdf(off(model.with_gravity([0.0981, 0.0, -9.81]), rng, SIZE))
    geared = model.with_transmission(rm.Transmission(np.diag(np.full(model.n, 0.01))))
    with pytest.warns(UrdfWarning, match="transmission"):
        calibrated_urdf(off(geared, rng, SIZE))
