"""Mistakes about measurements: each gets the sentence that names it, and nothing else does."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Pose,
    Position,
    fit,
)
from robotmodels.errors import InvalidValueError
from robotmodels.geometry import DHTable

ALONE = {"folds": 0, "held_out": 0}
"""A fit without its fits on part of the data."""


class Arm:
    """A random arm of six joints, the same with small errors of its table, and readings."""

    def __init__(self, seed, joints=6):
        self.rng = rng = np.random.default_rng(seed)
        there = rng.random((2, joints)) < 0.6
        rows = [
            {
                "sigma": 0,
                "alpha": rng.choice([0.0, np.pi / 2, -np.pi / 2]) if j else 0.0,
                "d": rng.uniform(0.1, 0.5) * there[0, j] if j else 0.0,
                "theta": rng.uniform(-1.0, 1.0),
                "r": rng.uniform(0.1, 0.5) * there[1, j],
            }
            for j in range(joints)
        ]
        tool = rm.se3.translation(*rng.uniform(0.05, 0.2, 3))
        table = DHTable.from_rows(rows)
        self.nominal = rm.RobotModel.from_table(table, tool=tool)
        errors = {
            name: getattr(table, name) + size * rng.normal(size=joints)
            for name, size in (("alpha", 2e-3), ("d", 1e-3), ("theta", 2e-3), ("r", 1e-3))
        }
        self.real = self.nominal.with_table(table.replace(**errors))

    def readings(self, count):
        return self.rng.uniform(-2.0, 2.0, (count, self.nominal.n))

    def positions(self, q, noise=1e-4):
        return rm.dgm(self.real, q)[:, :3, 3] + noise * self.rng.normal(size=(len(q), 3))


# --- outliers under squares -----------------------------------------------------------------------


def listed(arm, bad, prior=None):
    """Numbers of the outliers where some of 30 to 60 positions are off by 20 mm."""
    q = arm.readings(int(arm.rng.integers(30, 61)))
    p = arm.positions(q)
    wrong = arm.rng.choice(len(q), bad, replace=False)
    way = arm.rng.normal(size=(bad, 3))
    p[wrong] += 0.02 * way / np.linalg.norm(way, axis=1, keepdims=True)
    result = fit(arm.nominal, Position(q, p), prior=prior, **ALONE)
    return set(result.solution.fit.outliers.tolist()), set(wrong.tolist())


@pytest.mark.parametrize("prior", [None, ParameterPrior()])
@pytest.mark.parametrize("bad", [1, 2, 4])
def test_the_bad_rows_alone_are_outliers_under_squares(bad, prior):
    found = [listed(Arm(seed), bad, prior) for seed in range(20)]
    assert all(wrong <= listing for listing, wrong in found)
    # one fit in twenty lists another row by chance
    assert sum(listing == wrong for listing, wrong in found) >= 17


def test_without_a_bad_row_one_fit_in_twenty_lists_an_outlier():
    listings = [listed(Arm(seed), 0)[0] for seed in range(100, 220)]
    assert 1 <= sum(bool(listing) for listing in listings) <= 12
