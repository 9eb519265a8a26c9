"""Robots with loops beside Pinocchio called from Python."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most, no_longer
from robotmodels import loops
from robotmodels.loops.dynamics import Engine, engine_of

Array = NDArray[np.float64]
POSTURES, CALLS = 10_000, 500


def planar(rows: list[dict], frames: tuple[int, int], actuated: list[int]) -> loops.LoopedRobot:
    """A planar robot of bars with unit masses."""
    table = rm.DHTable.from_rows(rows)
    bars = rm.InertialParameters.from_com(
        np.ones(table.f), np.full((table.f, 3), 0.1), [0.1 * np.eye(3)] * table.f
    )
    tree = rm.RobotModel.from_table(table, bars, gravity=(0.0, -9.81, 0.0))
    return loops.LoopedRobot(tree, [loops.Closure("pin", frames)], np.array(actuated))


def robots() -> dict[str, tuple[loops.LoopedRobot, Array]]:
    """Robots and closed postures."""
    first = [{"sigma": 0}, {"antecedent": 0, "sigma": 0, "d": 1.0}]
    four = planar(
        [*first, {"antecedent": 1, "sigma": 0, "d": 0.3},
         {"antecedent": 3, "sigma": 2, "d": 0.9}, {"antecedent": 2, "sigma": 2, "d": 0.7}],
        (4, 5), [0],
    )  # fmt: skip
    bars = [{"antecedent": k, "sigma": 0, "d": 0.6} for k in (1, 2)]
    ends = [{"antecedent": k, "sigma": 2, "d": 0.8} for k in (3, 4)]
    five = planar([*first, *bars, *ends], (5, 6), [0, 1])
    return {
        "four-bar": (four, loops.close(four, [0.7], [1.2, -0.5]).q),
        "five-bar": (five, loops.close(five, [2.0, 1.0], [-1.0, 1.0]).q),
    }


def closing(settings: Settings) -> Iterator[Work]:
    """Postures of a four-bar at positions of its crank within a radian."""
    robot, q = robots()["four-bar"]
    angles = q[0] + np.random.default_rng(0).uniform(-1.0, 1.0, (POSTURES, 1))
    ways = [Contestant(OURS, lambda: loops.close(robot, angles, q), POSTURES)]
    yield Work("closing a four-bar, batch", "us", ways, [at_most(2.0, "us")])


def two_points(engine: Engine) -> tuple:
    """A pin as users write it: two points on its axis; and its data."""
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    first = engine.models[0]
    for z in (0.0, 1.0):
        at = pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
        models.append(
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, engine.model,
                first.joint1_id, first.joint1_placement * at,
                first.joint2_id, first.joint2_placement * at, pin.LOCAL,
            )
        )  # fmt: skip
    for model in models:
        datas.append(model.createData())
    return models, datas


def direct(settings: Settings) -> Iterator[Work]:
    """The direct dynamic model, one sample a call and in a batch."""
    for name, (robot, q) in robots().items():
        v_a, tau = np.random.default_rng(0).normal(size=(2, len(robot.actuated)))
        v = loops.velocity_map(robot, q) @ v_a
        engine = engine_of(robot)
        full = np.zeros(robot.n)
        full[robot.actuated] = tau
        given = q[engine.order], v[engine.order], full[engine.order]
        points, data = two_points(engine), engine.model.createData()
        pin.initConstraintDynamics(engine.model, data, *points)

        def bare(scratch: pin.Data, closures: tuple, e: Engine = engine, g: tuple = given) -> None:
            for _ in range(CALLS):
                pin.constraintDynamics(e.model, scratch, *g, *closures, e.settings)

        def ours(r: loops.LoopedRobot = robot, x: tuple = (q, v, tau)) -> None:
            for _ in range(CALLS):
                loops.ddm(r, *x)

        own = engine.data, (engine.models, engine.datas)
        near = no_longer(1.3, "<= 1.3 x two points")
        ways = [
            Contestant(OURS, ours, CALLS),
            Contestant("Pinocchio, two points", lambda b=bare, x=(data, points): b(*x), CALLS),
            Contestant(
                "Pinocchio, one point", lambda b=bare, x=own: b(*x), CALLS, whole=False
            ),
        ]  # fmt: skip
        yield Work(f"direct dynamic model, {name}, one call", "us", ways, [near])
        many = np.tile(q, (CALLS, 1)), np.tile(v, (CALLS, 1)), tau
        batch = [Contestant(OURS, lambda r=robot, x=many: loops.ddm(r, *x), CALLS)]
        yield Work(f"direct dynamic model, {name}, batch", "us", batch)


WORKS = {"closing": closing, "direct": direct}
