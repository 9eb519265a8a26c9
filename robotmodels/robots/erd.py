"""Arms of the package example-robot-data by their name there, and arms cut out of mobile robots.

The package's own loaders take 0.7 s to import and build a Pinocchio model; this is the short way:
a table of file names, checked against the loaders by a test, and the installed data folder.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .._arrays import Array
from ..errors import MissingExtraError, RobotNotFoundError
from ..model import RobotModel

_FOLDER = Path("share", "example-robot-data", "robots")


@dataclass(frozen=True, slots=True)
class ErdArm:
    """Where a robot of example-robot-data is, and which part of it is meant."""

    urdf: str
    base_link: str | None = None
    tip_link: str | None = None
    srdf: str | None = None
    tool: str | None = None


_UR = "ur_description/urdf/"
_UR_SRDF = "ur_description/srdf/"
_BRAVO = "bravo7_description/"
_PENDULUM = "double_pendulum_description/urdf/double_pendulum"
_HAND = "allegro_hand_description/urdf/allegro_"
_ALEX = "alex_description/"
_TIAGO = "tiago_description/robots/tiago"
_TIAGO_PRO = "tiago_pro_description/robots/tiago_pro.urdf"
_TALOS = "talos_data/robots/talos_full_v2.urdf"
_PR2 = "pr2_description/urdf/pr2.urdf"
_BAXTER = "baxter_description/urdf/baxter.urdf"
_ROMEO = "romeo_description/urdf/romeo.urdf"
_ICUB = "icub_description/robots/icub.urdf"
_G1 = "g1_description/urdf/g1_29dof_rev_1_0.urdf"
_CENTAURO = "centauro_description/urdf/centauro.urdf"
_HUMAN = "human_description/robots/human.urdf"

ERD_ARMS: dict[str, ErdArm] = {
    # fixed to the ground, by the name and with the file of the package's loader;
    # "ur3" there loads the UR5 by mistake, here the UR3
    "ur3": ErdArm(_UR + "ur3_robot.urdf"),
    "ur3_gripper": ErdArm(_UR + "ur3_gripper.urdf", srdf=_UR_SRDF + "ur3_gripper.srdf"),
    "ur3_limited": ErdArm(_UR + "ur3_joint_limited_robot.urdf"),
    "ur5": ErdArm(_UR + "ur5_robot.urdf", srdf=_UR_SRDF + "ur5.srdf"),
    "ur5_gripper": ErdArm(_UR + "ur5_gripper.urdf", srdf=_UR_SRDF + "ur5_gripper.srdf"),
    "ur5_limited": ErdArm(_UR + "ur5_joint_limited_robot.urdf", srdf=_UR_SRDF + "ur5.srdf"),
    "ur10": ErdArm(_UR + "ur10_robot.urdf"),
    "ur10_limited": ErdArm(_UR + "ur10_joint_limited_robot.urdf"),
    "panda": ErdArm(
        "panda_description/urdf/panda.urdf",
        srdf="panda_description/srdf/panda.srdf",
        tool="panda_hand_tcp",
    ),
    "panda_collision": ErdArm("panda_description/urdf/panda_collision.urdf", tool="panda_hand_tcp"),
    "kinova": ErdArm(
        "kinova_description/robots/kinova.urdf", srdf="kinova_description/srdf/kinova.srdf"
    ),
    "xarm7": ErdArm("xarm_description/urdf/xarm7.urdf", srdf="xarm_description/srdf/xarm7.srdf"),
    "z1": ErdArm("z1_description/urdf/z1.urdf", srdf="z1_description/srdf/z1.srdf"),
    "bravo7_no_ee": ErdArm(
        _BRAVO + "urdf/bravo7_no_ee.urdf", srdf=_BRAVO + "srdf/bravo7_no_ee.srdf"
    ),
    "bravo7_gripper": ErdArm(
        _BRAVO + "urdf/bravo7_gripper.urdf", srdf=_BRAVO + "srdf/bravo7_gripper.srdf"
    ),
    "talos_arm": ErdArm("talos_data/robots/talos_left_arm.urdf", srdf="talos_data/srdf/talos.srdf"),
    "asr_twodof": ErdArm("asr_twodof_description/urdf/TwoDofs.urdf"),
    "double_pendulum": ErdArm(_PENDULUM + ".urdf"),
    "double_pendulum_continuous": ErdArm(_PENDULUM + "_continuous.urdf"),
    "double_pendulum_simple": ErdArm(_PENDULUM + "_simple.urdf"),
    "finger_edu": ErdArm(
        "finger_edu_description/robots/finger_edu.urdf",
        srdf="finger_edu_description/srdf/finger_edu.srdf",
    ),
    "allegro_right_hand": ErdArm(_HAND + "right_hand.urdf"),
    "allegro_left_hand": ErdArm(_HAND + "left_hand.urdf"),
    "baxter": ErdArm(_BAXTER, srdf="baxter_description/srdf/baxter_manipulation.srdf"),
    "alex_nub_hands": ErdArm(_ALEX + "urdf/alex_nub_hands.urdf"),
    "alex_psyonic_hands": ErdArm(
        _ALEX + "urdf/alex_psyonic_hands.urdf", srdf=_ALEX + "srdf/alex_psyonic_hands.srdf"
    ),
    "alex_sake_hands": ErdArm(
        _ALEX + "urdf/alex_sake_hands.urdf", srdf=_ALEX + "srdf/alex_sake_hands.srdf"
    ),
    "tiago": ErdArm(_TIAGO + ".urdf"),
    "tiago_dual": ErdArm(_TIAGO + "_dual.urdf"),
    "tiago_no_hand": ErdArm(_TIAGO + "_no_hand.urdf"),
    "tiago_pro": ErdArm(_TIAGO_PRO),
    # the package's loader lets the base of these two float, but they are table-top arms
    "so100": ErdArm("so_arm_description/urdf/so100.urdf"),
    "so101": ErdArm("so_arm_description/urdf/so101.urdf"),
    # arms of robots that walk, drive, fly or dive: cut out by base and tip
    "baxter_left_arm": ErdArm(_BAXTER, "left_arm_mount", "left_wrist"),
    "baxter_right_arm": ErdArm(_BAXTER, "right_arm_mount", "right_wrist"),
    "tiago_arm": ErdArm(_TIAGO + ".urdf", "torso_lift_link", "arm_7_link"),
    "tiago_dual_left_arm": ErdArm(_TIAGO + "_dual.urdf", "torso_lift_link", "arm_left_7_link"),
    "tiago_dual_right_arm": ErdArm(_TIAGO + "_dual.urdf", "torso_lift_link", "arm_right_7_link"),
    "tiago_pro_left_arm": ErdArm(_TIAGO_PRO, "torso_lift_link", "arm_left_7_link"),
    "tiago_pro_right_arm": ErdArm(_TIAGO_PRO, "torso_lift_link", "arm_right_7_link"),
    "talos_left_arm": ErdArm(_TALOS, "torso_2_link", "arm_left_7_link"),
    "talos_right_arm": ErdArm(_TALOS, "torso_2_link", "arm_right_7_link"),
    "pr2_left_arm": ErdArm(_PR2, "torso_lift_link", "l_wrist_roll_link"),
    "pr2_right_arm": ErdArm(_PR2, "torso_lift_link", "r_wrist_roll_link"),
    "romeo_left_arm": ErdArm(_ROMEO, "torso", "l_wrist"),
    "romeo_right_arm": ErdArm(_ROMEO, "torso", "r_wrist"),
    "icub_left_arm": ErdArm(_ICUB, "chest", "l_hand"),
    "icub_right_arm": ErdArm(_ICUB, "chest", "r_hand"),
    "g1_left_arm": ErdArm(_G1, "torso_link", "left_wrist_yaw_link"),
    "g1_right_arm": ErdArm(_G1, "torso_link", "right_wrist_yaw_link"),
    "centauro_left_arm": ErdArm(_CENTAURO, "torso_2", "arm1_6"),
    "centauro_right_arm": ErdArm(_CENTAURO, "torso_2", "arm2_6"),
    "human_left_arm": ErdArm(_HUMAN, "left_clavicle", "left_hand"),
    "human_right_arm": ErdArm(_HUMAN, "right_clavicle", "right_hand"),
    "b1_z1_arm": ErdArm("b1_description/urdf/b1-z1.urdf", "link00", "link06"),
    "anymal_kinova_arm": ErdArm(
        "anymal_b_simple_description/robots/anymal-kinova.urdf",
        "j2s6s200_link_base",
        "j2s6s200_end_effector",
    ),
    "hextilt_arm": ErdArm(
        "hextilt_description/urdf/hextilt_flying_arm_5.urdf",
        "flying_arm_5__base_link",
        "flying_arm_5__gripper",
    ),
    "borinot_arm": ErdArm(
        "borinot_description/urdf/borinot_flying_arm_2.urdf",
        "borinot__base_link",
        "flying_arm_2__ee",
    ),
    "falcon_bravo7_arm": ErdArm(
        "falcon_description/urdf/falcon_bravo7_no_ee.urdf", "falcon", "contact_point"
    ),
    "bluevolta_bravo7_arm": ErdArm(
        "bluevolta_description/urdf/bluevolta_bravo7_no_ee.urdf", "box_base_bravo", "contact_point"
    ),
}
"""What ``erd:<name>`` loads."""


def load_erd(name: str) -> RobotModel:
    """Load an arm of example-robot-data from its URDF."""
    arm = ERD_ARMS.get(name)
    if arm is None:
        raise RobotNotFoundError(
            "robot in example-robot-data", name, ERD_ARMS,
            "For another file of the package use RobotModel.from_urdf(path, base_link, tip_link).",
        )  # fmt: skip
    folder = erd_folder()
    path = folder / arm.urdf
    if not path.is_file():
        raise RobotNotFoundError(
            "robot in the installed example-robot-data", name,
            [other for other, a in ERD_ARMS.items() if (folder / a.urdf).is_file()],
            f"Its file would be {arm.urdf}; update with: pip install -U example-robot-data",
        )  # fmt: skip
    model = RobotModel.from_urdf(path, base_link=arm.base_link, tip_link=arm.tip_link)
    if arm.tool is not None:
        point = model.twin.frame(arm.tool)
        tool = np.eye(4)
        tool[:3, :3], tool[:3, 3] = point.rotation, point.position
        model = replace(model.with_tool(tool, tip=point.parent), notes=_without_branches(model))
    postures = _postures(folder / arm.srdf, model) if arm.srdf else {}
    return model.with_configurations(postures) if postures else model


def _without_branches(model: RobotModel) -> tuple[str, ...]:
    """Notes of a model whose tool has been chosen: the one about the choice is void."""
    return tuple(note for note in model.notes if "the tool is link" not in note)


def erd_folder() -> Path:
    """Folder of the robots of the installed example-robot-data."""
    for prefix in _prefixes():
        folder = prefix / _FOLDER
        if folder.is_dir():
            return folder
    raise MissingExtraError(
        "Robots named erd:... are read from the package example-robot-data, which is not "
        "installed. Run: pip install example-robot-data"
    )


def _prefixes() -> Iterator[Path]:
    # wheels built with cmeel keep their files in a prefix inside site-packages
    yield from (Path(entry, "cmeel.prefix") for entry in sys.path if entry)
    yield from (Path(entry) for entry in dict.fromkeys((sys.prefix, sys.base_prefix)))


def _postures(srdf: Path, model: RobotModel) -> dict[str, Array]:
    if not srdf.is_file():
        return {}
    column = {name: i for i, name in enumerate(model.table.joint_names)}
    postures: dict[str, Array] = {}
    for state in ET.parse(srdf).getroot().iter("group_state"):
        given = {joint.get("name"): joint.get("value", "").split() for joint in state.iter("joint")}
        q = np.zeros(model.n)
        known = [name for name in given if name in column and len(given[name]) == 1]
        for name in known:
            q[column[name]] = float(given[name][0])
        if known:
            postures[state.get("name", "state")] = q
    return postures
