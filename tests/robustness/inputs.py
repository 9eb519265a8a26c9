"""What can be read: seeds that are good, ways to damage them, and the calls to be judged."""

import random as chance
from dataclasses import dataclass, fields, is_dataclass
from functools import cache

import numpy as np

import robotmodels as rm
from robotmodels.calibration import read_measurements
from robotmodels.identification import read_log

from . import mutations
from .outcomes import check_log, check_model, check_table, outcome

URDF = """<robot name="arm">
 <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
 <link name="world"/>
 <link name="base"><inertial><origin xyz="0 0 0.1" rpy="0 0.2 0"/><mass value="2"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.2"/></inertial>
  <visual><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.1" length="0.2"/></geometry>
  <material name="grey"/></visual></link>
 <link name="upper"><inertial><mass value="3"/><inertia ixx="0.1" iyy="0.2" izz="0.3"/></inertial>
  <visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>
 <link name="fore"><visual><geometry><mesh filename="package://arm/fore.stl" scale="1 1 1"/>
  </geometry></visual></link>
 <link name="slide"/><link name="finger"/><link name="tool"/>
 <joint name="stand" type="fixed"><parent link="world"/><child link="base"/>
  <origin xyz="0 0 0.5" rpy="0 0 1.57"/></joint>
 <joint name="waist" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0 0.2" rpy="0 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" effort="10" velocity="3"/><dynamics damping="0.1" friction="0.2"/>
 </joint>
 <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
  <origin xyz="0.3 0 0" rpy="1.57 0 0"/><axis xyz="0 0.6 0.8"/></joint>
 <joint name="lift" type="prismatic"><parent link="fore"/><child link="slide"/>
  <origin xyz="0.2 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="0.5" effort="9" velocity="1"/>
 </joint>
 <joint name="grip" type="prismatic"><parent link="slide"/><child link="finger"/>
  <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/>
  <mimic joint="lift" multiplier="0.5" offset="0.1"/></joint>
 <joint name="end" type="fixed"><parent link="slide"/><child link="tool"/>
  <origin xyz="0.1 0 0"/></joint>
</robot>"""

PAR = """(* Robotname = 'arm' *)
NL = 3
NJ = 3
NF = 3
Type = 0 (* Simple *)
Ant = {0, 1, 2}
Sigma = {0, 0, 1}
B = {0, 0, 0}
d = {0, 0.2, D3}
R = {0.3, 0, r3}
gamma = {0, 0, 0}
Alpha = {0, -Pi/2, Pi/2}
Mu = {1, 1, 1}
Theta = {t1, t2 + Pi/2, atan2(1, 2)}
XX = {XX1, 0.1, 0}
MZ = {0, MZ2, 1/3}
M = {1, 2, sqrt(2)}
IA = {0, 0.1, IA3}
FV = {FV1, 0.2, 0}
W0 = {0, 0, 0}
G = {0, 0, G3}
QP = {QP1, QP2, QP3}
Z = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.1, 0, 0, 0, 1}
"""
PAR_VALUES = {"D3": 0.4}

ROWS = [
    {"sigma": 0, "r": 0.3, "name": "waist", "lower": -1.0, "upper": 1.0},
    {"sigma": 0, "alpha": -np.pi / 2, "d": 0.1, "theta": 0.2, "beta": 0.01},
    {"sigma": 1, "alpha": np.pi / 2, "gamma": 0.1, "b": 0.2, "antecedent": 1, "effort": 3.0},
    {"sigma": 2, "d": 0.1, "mu": 0},
]
N = 24
_TIME = 0.01 * np.arange(N)
_Q = np.sin(np.outer(_TIME, [3.0, 5.0]) * 10.0)
_TAU = np.cos(np.outer(_TIME, [2.0, 7.0]) * 10.0)
LOG = {"t": _TIME, "q": _Q, "tau": _TAU}


def _csv(header, *columns):
    lines = [",".join(f"{x:.9g}" for x in row) for row in np.column_stack(columns)]
    return "\n".join([",".join(header), *lines])


LOG_CSV = _csv(["t", "q1", "q2", "tau1", "tau2"], _TIME, _Q, _TAU)
ROS_CSV = (
    "header.stamp.secs,header.stamp.nsecs,name,position,effort\n"
    + "\n".join(f'17,{10**7 * k},"[\'a\', \'b\']","[0.{k}, 0.2]","[1, 2]"' for k in range(9))
)  # fmt: skip
MEASURED_CSV = _csv(
    ["joint_1", "joint_2", "x", "y", "z", "roll", "pitch", "yaw", "distance", "point"],
    _Q, 0.3 * _Q, 0.1 * _TAU, _TAU, np.full((N, 1), 0.4), np.arange(N) // 12,
)  # fmt: skip
KINDS = (
    "position", "pose", "orientation", "distance", "point_contact", "frame_contact",
    "plane_contact", "relative_pose",
)  # fmt: skip


@cache
def planar():
    """The catalogue's arm that measurements are read for."""
    return rm.load("planar_2r")


@dataclass(frozen=True, slots=True)
class Target:
    """A reader: how a good input is damaged, and what reads it and judges.

    ``damaged`` takes a ``random.Random`` and gives bytes; ``judged`` takes bytes, a folder to
    write them to, and a ``random.Random`` for the arguments.
    """

    damaged: object
    judged: object


def _urdf_judged(data, _, random):
    text = data.decode("utf-8", "replace")
    options = random.choice((
        {}, {}, {"dynamics": True}, {"mimic": True}, {"tip_link": "tool"}, {"tip_link": "fore"},
        {"base_link": "base"}, {"package_dirs": "."},
    ))  # fmt: skip
    return outcome(lambda: rm.RobotModel.from_urdf(text, **options), check_model)


def _file_judged(data, folder, _):
    path = folder / "robot.urdf"
    path.write_bytes(data)
    return outcome(lambda: rm.RobotModel.from_urdf(path), check_model)


def _par_judged(data, folder, random):
    path = folder / "robot.par"
    path.write_bytes(data)
    values = random.choice((None, PAR_VALUES, PAR_VALUES))
    return outcome(lambda: rm.read_par(path, values), check_model)


def _log_judged(suffix):
    def judged(data, folder, random):
        path = folder / f"run{suffix}"
        path.write_bytes(data)
        options = random.choice((
            {}, {}, {"dt": 0.01}, {"time": False, "dt": 0.01}, {"times": "ms"}, {"angles": "deg"},
            {"positions": "q*", "torques": "tau*"}, {"positions": [1], "torques": [2]},
            {"drive_gains": 2.0}, {"gears": [2.0, 3.0]}, {"model": planar()}, {"dt": 0.008},
            {"dt": 1e-9}, {"largest_jitter": 1e9, "largest_gap": 1e9}, {"velocities": "q"},
        ))  # fmt: skip
        return outcome(lambda: read_log(path, **options), check_log)

    return judged


def _measured_judged(data, folder, random):
    path = folder / "measured.csv"
    path.write_bytes(data)
    kind, options = random.choice(KINDS), {}
    if kind in ("pose", "orientation", "relative_pose"):
        options = {"orientation": random.choice(("rpy", "rpy_urdf", "angle_axis")),
                   "joints": ["joint_1", "joint_2"]}  # fmt: skip
    if kind == "relative_pose":
        options["other_joints"] = [2, 3]
    elif kind.endswith("contact") or kind == "distance":
        options["label"] = random.choice(("point", 9, 0))
    if random.random() < 0.3:
        options |= {"angles": "deg", "lengths": "mm"}
    return outcome(lambda: read_measurements(path, kind, planar(), **options), check_measurement)


def check_measurement(measured):
    """Readings and measured values that are finite."""
    assert is_dataclass(measured)
    for field in fields(measured):
        value = getattr(measured, field.name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            assert np.isfinite(value).all(), f"{field.name} is not finite"


def _rows_judged(data, *_):
    random = chance.Random(data)
    rows = mutations.rows(random, ROWS)
    return outcome(
        lambda: rm.DHTable.from_rows(rows, degrees=random.random() < 0.3), check_table, ()
    )


TARGETS = {
    "urdf": Target(lambda random: mutations.text_of(random, URDF), _urdf_judged),
    "urdf_file": Target(lambda random: mutations.bytes_of(random, URDF.encode(), 2), _file_judged),
    "par": Target(lambda random: mutations.text_of(random, PAR), _par_judged),
    "log_csv": Target(
        lambda random: mutations.text_of(random, random.choice((LOG_CSV, LOG_CSV, ROS_CSV))),
        _log_judged(".csv"),
    ),
    "log_npz": Target(lambda random: mutations.npz(random, LOG), _log_judged(".npz")),
    "log_mat": Target(lambda random: mutations.mat(random, LOG), _log_judged(".mat")),
    "measurements": Target(
        lambda random: mutations.text_of(random, MEASURED_CSV), _measured_judged
    ),
    "rows": Target(lambda random: str(random.random()).encode(), _rows_judged),
}  # fmt: skip
