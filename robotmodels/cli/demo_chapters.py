"""``robotmodels demo --chapter N``: one example from each chapter of the book, with a picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import se3
from ..errors import MissingExtraError
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..model import RobotModel
from ..robots import load
from ..trajectories import MotionLimits, quintic


def parallel_robots() -> Any:
    """A Gough-Stewart platform: its legs, and every pose that they allow."""
    from .. import parallel
    from ..viz import plot_assembly_modes

    robot = parallel.gough_symmetric(1.0, platform_radius=0.6)
    T = se3.translation(0.1, 0.05, 0.9) @ se3.rotation("y", 0.2) @ se3.rotation("z", 0.1)
    lengths = parallel.igm(robot, T).q[0]
    found = parallel.assembly_modes(robot, lengths)
    print(f"Leg lengths (m): {lengths.round(4)}")
    print(f"{found.count} poses have these lengths. {found.reason()}")
    print(parallel.classify_singularity(robot, T).reason())
    return plot_assembly_modes(robot, found)


def performance() -> Any:
    """A three-joint arm that changes its posture without passing a singular position."""
    from .. import performance as pf
    from ..viz import plot_workspace

    table = DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=[0, -np.pi / 2, np.pi / 2],
                    d=[0, 1, 2], r=[0, 1, 0])  # fmt: skip
    arm = RobotModel.from_table(table, tool=se3.translation(1.5, 0, 0), name="orthogonal 3R")
    section = pf.workspace(arm)
    print(section)
    print(f"{len(pf.cusps(arm))} cusps. {pf.cuspidality(arm).reason()}")
    return plot_workspace(section)


def fastest_motion() -> Any:
    """The quickest motion of an RX-90 along a path under limits of torque."""
    from .. import trajectories as tr
    from ..viz import plot_phase_plane

    rx90 = load("rx90")
    path = quintic([0.3, 1.0, -1.8, 0.4, 0.8, -0.2], [1.2, 0.4, -1.0, 1.0, 0.2, 0.5], duration=1.0)
    limits = MotionLimits(np.full(6, 4.0), np.full(6, 40.0))
    timed = tr.time_optimal(path, limits, model=rx90, torque=[250, 350, 150, 40, 20, 10])
    print(f"{timed.reason()} {timed.duration:.3f} s, to {timed.grid_gap:.1e} of it.")
    return plot_phase_plane(timed)


def computed_torque() -> Any:
    """Computed torque on a PUMA 560 whose masses are 20 % larger than in the controller."""
    from .. import control
    from ..viz import plot_control

    puma = load("puma560").with_drive(None)
    heavy = puma.with_inertia(InertialParameters(1.2 * puma.inertia.values))
    goal = np.array([0.3, 0.8, -0.4, 0.2, 0.3, 0.1])
    law = control.ComputedTorque(goal, omega=10.0, zeta=1.0, model=puma)
    motion = control.run(heavy, law, np.zeros(6), np.zeros(6), np.linspace(0.0, 1.5, 301))
    print(f"{motion.reason()} The last error (rad): {motion.error[-1].round(4)}")
    return plot_control(motion)


def four_points() -> Any:
    """A camera that moves to the pose of four desired image points."""
    from .. import visual_servoing as vs
    from ..viz import plot_servo

    square = vs.Points(np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]]))
    start = se3.translation(0.1, -0.05, 0.9) @ se3.rotation("x", 0.4) @ se3.rotation("z", 0.8)
    task = vs.Task(square, se3.translation(0, 0, 0.5), gain=1.0)
    motion = vs.servo(task, start, vs.Camera(), duration=8.0, step=0.04)
    print(motion.reason())
    return plot_servo(motion)


def beam_modes() -> Any:
    """A light beam on a joint: its frequencies, and its bending under a load at the tip."""
    from .. import flexible
    from ..viz import plot_modes

    link = flexible.beam(1.0, EI=(20.0, 60.0), density=0.4, modes=3)
    table = DHTable(antecedent=[0, 1], sigma=[0, 2], d=[0.0, 1.0])
    arm = flexible.FlexibleRobot(RobotModel.from_table(table, gravity=(0, 0, 0)), {1: link})
    print(f"Clamped frequencies (rad/s): {np.asarray(link.frequencies).round(2)}")
    bent = flexible.static_deflection(arm, [0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    print(f"Elastic coordinates under 1 N at the tip: {np.round(bent.e, 5)}")
    return plot_modes(link)


CHAPTERS: dict[int, tuple[str, Callable[[], Any]]] = {
    2: ("Parallel robots", parallel_robots),
    3: ("Performance analysis", performance),
    4: ("Trajectory generation", fastest_motion),
    5: ("Control", computed_torque),
    6: ("Visual servoing", four_points),
    7: ("Flexible robots", beam_modes),
}
"""Titles of the chapters and their examples; chapter 1 is the demonstration without a number."""


def show_chapter(number: int, folder: Path) -> None:
    """Print the example of a chapter and save its picture."""
    _, example = CHAPTERS[number]
    try:
        figure = example()
    except MissingExtraError as error:
        print(error)
        return
    path = folder / f"chapter_{number}.png"
    figure.savefig(path, dpi=150)
    print(f"Picture: {path.resolve()}")
