"""Robots of Staubli: the RX-90 of the seed book, and the TX40 with its identified drives."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from .. import se3
from ..drive import DriveParameters, Transmission
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..model import RobotModel
from .assembly import PublishedLink, columns, inertia_in_table_frames


def rx90() -> RobotModel:
    """Staubli RX-90, the running example of the seed book.

    Khalil-Kleinfinger table, metres and radians. The book gives the symbols ``D3`` and ``RL4``;
    both are 0.45 m (arm and forearm), as in the complete sets of postures this package is tested
    against. R_0 is at the shoulder and R_6 at the wrist centre, as in the book. No limits are
    given there.

    No inertia is published either. So that the dynamic models can be shown on this arm it has an
    assumed one, said again in `RobotModel.notes`: homogeneous solid cylinders along the links,
    30, 25, 15, 8, 2 and 0.5 kg (the maker's data sheet gives 111 kg for the whole arm with its
    foot). It is physical, but no property of the real robot; identify that, or replace it with
    `RobotModel.with_inertia`.

    Source: Seed book, Table 1.1 and examples 1.1 to 1.3.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 6,
            alpha=(0, 90, 0, -90, 90, -90),
            d=(0, 0, 0.45, 0, 0, 0),
            theta=(0,) * 6,
            r=(0, 0, 0, 0.45, 0, 0),
        ),
        degrees=True,
    )
    model = RobotModel.from_table(table, _assumed_rx90_inertia(), name="rx90")
    return replace(model, notes=(_RX90_NOTE,))


_RX90_NOTE = (
    "the inertia of this RX-90 is assumed (solid cylinders along the links), because none is "
    "published: its torques are examples, not properties of the real robot."
)


def _assumed_rx90_inertia() -> InertialParameters:
    """Solid cylinders: mass, radius, length, centre in R_j, and the axis of R_j they lie along."""
    cylinders = (
        (30.0, 0.12, 0.30, (0.0, 0.0, 0.0), 2),  # shoulder, about the first axis
        (25.0, 0.08, 0.45, (0.225, 0.0, 0.0), 0),  # arm, from axis 2 to axis 3
        (15.0, 0.08, 0.30, (0.0, 0.05, 0.0), 1),  # elbow, towards the wrist
        (8.0, 0.06, 0.25, (0.0, 0.0, -0.125), 2),  # forearm, behind the wrist centre
        (2.0, 0.05, 0.10, (0.0, 0.0, 0.0), 2),  # wrist
        (0.5, 0.04, 0.03, (0.0, 0.0, 0.07), 2),  # flange
    )
    tensors = []
    for mass, radius, length, _, axis in cylinders:
        across = mass * (3 * radius**2 + length**2) / 12
        moments = [across, across, across]
        moments[axis] = mass * radius**2 / 2
        tensors.append(np.diag(moments))
    return InertialParameters.from_com(
        [c[0] for c in cylinders], [c[3] for c in cylinders], np.array(tensors)
    )


def tx40() -> RobotModel:
    """Staubli TX40 with its identified drive parameters and its coupled wrist.

    Khalil-Kleinfinger table, metres and radians; q = 0 is the maker's: arm upright. ``q`` are
    joint angles; `RobotModel.transmission` gives them from motor angles.

    - Geometry, position, velocity and torque limits: ``tx40_mdh_modified.urdf`` of figaroh-plus
      (examples/staubli_TX40, commit c3b5172), whose joints 2 and 3 are at zero where the maker's
      are at 90 and -90 degrees. A second table agrees (class Staubli_TX40 of the package
      robotkinematicscatalogue 1.1.2) and adds the flange, 0.065 m from the wrist centre.
    - Drives (Ia, Fv, Fc, offset, joint side) and wrist coupling (Iam6, Fvm6, Fcm6), gear ratios
      32, 32, 45, -48, 45, 32 with motor 6 turned by joint 5 as well: ``TX40_config.yaml``, same
      place; they are results of identification.
    - Masses, centres of mass and inertia: same URDF, three decimals (that of link 6 is zero
      about its centre of mass). The identified values differ, so they are a start, no reference.

    Source: T. Nguyen, figaroh-plus (Apache-2.0), examples/staubli_TX40.
    """
    h = pi / 2
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 6,
            alpha=(0, -h, 0, h, -h, h),
            d=(0, 0, 0.225, 0, 0, 0),
            theta=(0, -h, h, 0, 0, pi),
            r=(0.32, 0, 0.035, 0.225, 0, 0),
            lower=(-3.14, -2.18, -2.40, -4.71, -2.09, -4.71),
            upper=(3.14, 2.18, 2.40, 4.71, 2.33, 4.71),
            velocity=(5.009, 5.009, 7.504, 7.15, 5.585, 12.217),
            effort=(131.84, 131.84, 103.49, 46.08, 43.19, 30.72),
        )
    )
    links = (
        PublishedLink((0, 0, 0.32), (0, 0, 0), 10.5, (0.0, 0.020, -0.043),
                      (0.055, 0.0, 0.0, 0.047, 0.003, 0.035)),
        PublishedLink((0, 0, 0), (-h, 0, 0), 3.6, (0.109, -0.002, 0.134),
                      (0.009, 0.0, 0.002, 0.038, 0.0, 0.040), -h),
        PublishedLink((0.225, 0, 0.035), (0, 0, 0), 4.07, (0.008, 0.006, 0.041),
                      (0.012, 0.0, 0.001, 0.012, -0.001, 0.004), -h),
        PublishedLink((0, -0.225, 0), (h, 0, 0), 3.62, (-0.004, 0.002, -0.107),
                      (0.013, 0.0, 0.0, 0.014, 0.001, 0.004), h),
        PublishedLink((0, 0, 0), (-h, 0, 0), 1.02, (-0.004, -0.003, -0.001),
                      (0.001, 0.0, 0.0, 0.001, 0.0, 0.001), -h),
        PublishedLink((0, 0, 0), (h, pi, 0), 0.2, (0.0, 0.0, 0.042),
                      (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), -h),
    )  # fmt: skip
    drive = DriveParameters(
        Ia=np.array((0.362, 0.362, 0.0988, 0.0313, 0.0468, 0.0105)),
        Fv=np.array((8.05, 5.53, 1.97, 1.11, 1.86, 0.65)),
        Fc=np.array((7.14, 8.26, 6.34, 2.48, 3.03, 0.282)),
        offset=np.array((0.392, 1.37, 0.326, -0.102, -0.0288, 0.127)),
    )
    gears = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    gears[5, 4] = 32.0
    last = np.eye(6)[5]
    transmission = Transmission(
        np.linalg.inv(gears), Iam=0.00964 * last, Fvm=0.616 * last, Fcm=1.95 * last
    )
    return RobotModel.from_table(
        table,
        inertia=inertia_in_table_frames(table, links, q_zero=(0, h, -h, 0, 0, 0)),
        drive=drive,
        tool=se3.translation(0, 0, 0.065),
        transmission=transmission,
        name="tx40",
    )
