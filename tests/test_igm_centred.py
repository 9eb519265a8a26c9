"""Arms on slides that are run out far: the same postures as beside the origin."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robotmodels as rm

RIGHT = np.pi / 2
RAIL_AND_WRIST = (
    {"sigma": 1, "d": 0.2}, {"alpha": RIGHT, "d": 0.2}, {"alpha": -RIGHT},
    {"alpha": RIGHT, "theta": RIGHT, "r": 0.25}, {"d": 0.2}, {"d": 0.2, "alpha": 0.7},
)  # fmt: skip
GENERAL = (
    {"sigma": 1}, {"alpha": 0.7, "d": 0.2}, {"alpha": RIGHT, "d": 0.3, "r": 0.25},
    {"alpha": -RIGHT, "d": 0.2}, {"alpha": 0.9, "d": 0.1, "r": 0.2}, {"alpha": -0.8, "r": 0.25},
)  # fmt: skip
TWO_RAILS = (
    {"sigma": 1}, {"sigma": 1, "alpha": 0.7, "d": 0.1}, {"alpha": RIGHT, "d": 0.2},
    {"alpha": -0.6, "d": 0.3}, {"alpha": RIGHT, "r": 0.25}, {"alpha": -RIGHT, "d": 0.1},
)  # fmt: skip
TOOL_SLIDE = (
    {}, {"alpha": 0.7, "d": 0.2}, {"alpha": RIGHT, "d": 0.3, "r": 0.25},
    {"alpha": -RIGHT, "d": 0.2}, {"alpha": 0.9, "d": 0.1, "r": 0.2}, {"sigma": 1, "alpha": -0.8},
)  # fmt: skip
ROWS = {"rail and wrist": RAIL_AND_WRIST, "general": GENERAL, "two rails": TWO_RAILS,
        "tool": TOOL_SLIDE}  # fmt: skip


@cache
def arm_of(number):
    rows = ROWS[number]
    base = rm.se3.translation(1.0, -2.0, 0.5)
    base[:3, :3] = [[0, -0.6, 0.8], [1, 0, 0], [0, 0.8, 0.6]]
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows), base=base)


def drawn(arm, N, rng):
    turns = arm.table.sigma == 0
    return np.where(turns, rng.uniform(-2.0, 2.0, (N, arm.n)), rng.uniform(-0.3, 0.3, (N, arm.n)))


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("far", [30.0, 1e3, -1e4])
def test_how_far_the_rail_is_out_changes_nothing_else(name, far, rng):
    arm = arm_of(name)
    q = drawn(arm, 12, rng)
    slides = np.array([row.get("sigma", 0) for row in ROWS[name]])
    out = far * slides * [1.0, 0.4, 0.0, 0.0, 0.0, 1.0]
    near, away = rm.igm(arm, rm.dgm(arm, q)), rm.igm(arm, rm.dgm(arm, q + out))
    assert np.array_equal(near.count, away.count)
    assert near.count.min() >= 2
    assert away.method == near.method
    # joints are good to the rounding of what stands in the pose
    for n in range(len(q)):
        d = (away.q[n, away.valid[n]] - out)[:, None] - near.q[n, near.valid[n]]
        d = np.where(arm.table.sigma == 0, np.remainder(d + np.pi, 2 * np.pi) - np.pi, d)
        assert np.abs(d).max(axis=-1).min(axis=0).max() < 1e-7
    there = away.valid
    T = rm.dgm(arm, away.q[there])
    wanted = np.broadcast_to(rm.dgm(arm, q + out)[:, None], (*there.shape, 4, 4))[there]
    assert np.abs(T - wanted).max() < 1e-10
    assert away.residual[there].max() < 1e-10


def test_references_limits_and_masks_count_from_the_true_zero(rng):
    arm = arm_of("rail and wrist")
    q = drawn(arm, 4, rng)
    q[:, 0] += 2000.0
    T = rm.dgm(arm, q)
    found = rm.igm(arm, T, q_ref=q)
    assert np.abs(found.q[:, 0] - q).max() < 1e-8
    table = arm.table
    for low, high, some in ((1999.0, 2001.5, True), (-3.0, 3.0, False)):
        lower, upper = table.lower.copy(), table.upper.copy()
        lower[0], upper[0] = low, high
        limited = replace(table, lower=lower, upper=upper)
        boxed = rm.RobotModel.from_table(limited, base=arm.base)
        inside = rm.igm(boxed, T, limits=True)
        assert (inside.status == rm.IGMStatus.OUTSIDE_LIMITS).all() != some
        assert np.all(inside.count > 0) == some
    # with a turn of the tool left open the rail takes its reference as it is given
    mask = [1, 1, 1, 0, 1, 1]
    pointed = rm.igm(arm, T[0], q_ref=q[0] + 0.01, mask=mask, mask_axes="tool")
    free = pointed.free_joints[pointed.valid]
    assert free[:, 0].all()
    assert np.all(pointed.q[pointed.valid][:, 0] == q[0, 0] + 0.01)
    P = rm.dgm(arm, pointed.q[pointed.valid])
    assert np.abs(P[:, :3, 3] - T[0, :3, 3]).max() < 1e-9
    assert np.abs(P[:, :3, 0] - T[0, :3, 0]).max() < 1e-9


ONE_TOO_MANY = (
    {"sigma": 1}, {"alpha": RIGHT, "d": 0.2}, {"d": 0.4}, {"alpha": RIGHT, "r": 0.3},
    {"alpha": -RIGHT}, {"alpha": RIGHT},
)  # fmt: skip


@pytest.mark.parametrize("far", [100.5, 1e4, -3e3])
def test_a_reference_out_of_reach_of_a_family_still_names_its_free_joint(far):
    """The rail slides across three parallel axes: 0 is too far, the nearest value is taken."""
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(ONE_TOO_MANY))
    T = rm.dgm(arm, [far, -0.9, -1.8, -1.9, 1.25, 1.65])
    found = rm.igm(arm, T)
    assert found.status == rm.IGMStatus.REACHED_FAMILY
    assert found.count == 2  # stretched out, the wrist either way
    assert np.all(found.free_joints == [True, False, False, False, False, False])
    assert np.all(found.family_joints == [False, True, True, True, True, True])
    rail = found.q[:, 0]
    assert np.ptp(rail) < 1e-9
    # the arm reaches there along the rail and no further
    behind = rail[0] - np.sign(far) * 1e-3
    assert rm.igm(arm, T, lock={0: behind}).count == 0
    assert rm.igm(arm, T, lock={0: rail[0] + np.sign(far) * 1e-3}).count > 0


def test_what_is_met_is_never_said_to_be_too_far(rng):
    """Starts far from a rail run out by kilometres: some end at the position by the last steps."""
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(ONE_TOO_MANY))
    q = rng.uniform(-2.0, 2.0, (1000, 6))
    met = 0
    for i, row in enumerate(q):
        row[0] = (1e4, 1e3, 3e3, 2e4)[i % 4]
        found = rm.igm_numeric(
            arm, rm.dgm(arm, row), q0=np.zeros(6), position_tolerance=1e-9,
            orientation_tolerance=1e-9, restarts=1 + i % 5, iterations=60,
        )  # fmt: skip
        there = np.linalg.norm(found.error[0, :3]) <= 1e-9
        met += there
        sides = (rm.IGMStatus.TOO_FAR, rm.IGMStatus.TOO_NEAR)
        assert not (there and found.status in sides), found.reason()
    assert met > 100
