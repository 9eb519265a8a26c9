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
from robotmodels.calibration.measurements import Distance
from robotmodels.datasets import panda_double_socket
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


# --- known distances ------------------------------------------------------------------------------


def touching(arm, places, count=20, noise=1e-4):
    """Readings at which the real tool is at each of some places, and their labels."""
    q, labels = [], []
    for label, place in enumerate(places):
        T = np.tile(np.eye(4), (4 * count, 1, 1))
        T[:, :3, 3] = place + noise * arm.rng.normal(size=(len(T), 3))
        found = rm.igm_numeric(
            arm.real, T, q0=arm.rng.uniform(-2.0, 2.0, (len(T), arm.nominal.n)),
            mask=[1, 1, 1, 0, 0, 0], rng=arm.rng,
        )  # fmt: skip
        q.append(found.q[found.valid[:, 0], 0][:count])
        labels += [label] * len(q[-1])
    return np.concatenate(q), labels


def contacts(seed, apart=((0.0, 0.03, 0.04),), count=20):
    """Contacts of a random arm with a place and others beside it."""
    arm = Arm(seed)
    place = 0.8 * rm.dgm(arm.real, arm.readings(1))[0, :3, 3]
    q, labels = touching(arm, [place, *(place + np.array(d) for d in apart)], count)
    return arm, PointContact(q, labels)


def between(length, other=1, **more):
    return KnownDistance("point:0", f"point:{other}", length, **more)


def said_of_distances(result):
    return [note for note in result.notes if note.startswith("known distance")]


REACHED = [0, 2, 3, 4, 5, 7, 8, 9]
"""Seeds of arms that reach their points."""


def test_a_known_distance_is_known_to_a_tenth_of_a_millimetre():
    assert between(0.05).sigma == pytest.approx(1e-4)


@pytest.mark.parametrize("seed", REACHED)
def test_a_wrong_distance_is_contradicted_by_the_lengths_of_the_table(seed):
    arm, touched = contacts(seed)
    right = fit(arm.nominal, [touched, between(0.05)], prior=ParameterPrior(), **ALONE)
    assert not said_of_distances(right)
    assert touched.blocks not in right.solution.fit.outliers
    wrong = fit(arm.nominal, [touched, between(0.051)], prior=ParameterPrior(), **ALONE)
    (note,) = said_of_distances(wrong)
    assert "point:0 to point:1: stated 51 mm, but the other measurements and the prior say" in note
    said, doubt = (float(x) for x in note.split(" say ")[1].split(" mm")[0].split(" +- "))
    assert abs(said - 50.0) < 4.0 * doubt < 1.0
    assert "standard errors apart" in note
    assert wrong.solution.fit.outliers.tolist()[0] == touched.blocks
    assert "stated 51 mm" in wrong.report()


@pytest.mark.parametrize("seed", REACHED)
def test_a_distance_that_alone_gives_the_scale_is_contradicted_by_nothing(seed):
    arm, touched = contacts(seed)
    for length in (0.05, 0.051):
        result = fit(arm.nominal, [touched, between(length)], **ALONE, prior=None)
        assert not said_of_distances(result)
        assert touched.blocks not in result.solution.fit.outliers


@pytest.mark.parametrize("seed", REACHED[:4])
def test_the_wrong_one_of_two_distances_is_named(seed):
    arm, touched = contacts(seed, [(0.0, 0.03, 0.04), (0.2, 0.0, 0.0)])
    stated = [touched, between(0.05), between(0.21, 2)]
    result = fit(arm.nominal, stated, prior=ParameterPrior(), **ALONE)
    (note,) = said_of_distances(result)
    assert "point:0 to point:2: stated 210 mm" in note
    assert touched.blocks + 1 in result.solution.fit.outliers
    assert touched.blocks not in result.solution.fit.outliers
    # without anything else either may be wrong
    assert len(said_of_distances(fit(arm.nominal, stated, prior=None, **ALONE))) == 2


def test_a_real_arm_contradicts_51_for_50():
    data = panda_double_socket()
    for place, (one, other) in data.places.items():
        touched = PointContact(np.concatenate([one, other]), [0] * len(one) + [1] * len(other))
        for length, expected in ((data.distance, 0), (data.distance + 1e-3, 1)):
            known = between(length)
            result = fit(data.model, [touched, known], prior=ParameterPrior(), **ALONE)
            assert len(said_of_distances(result)) == expected, place


# --- too few measurements -------------------------------------------------------------------------


def measured_by(kind, seed):
    """A function that gives the first n measurements of a kind of a random arm."""
    arm = Arm(seed)
    q = arm.readings(40)
    T = rm.dgm(arm.real, q)
    T[:, :3, 3] += 1e-4 * arm.rng.normal(size=(40, 3))
    if kind == "contact":
        _, touched = contacts(seed)
        mixed = touched.subset(np.argsort(np.arange(touched.blocks) % 20, kind="stable"))
        return arm, lambda n: [mixed.subset(np.arange(n)), between(0.05)]
    made = {
        "pose": lambda n: Pose(q[:n], T[:n]),
        "position": lambda n: Position(q[:n], T[:n, :3, 3]),
        "distance": lambda n: Distance(q[:n], np.linalg.norm(T[:n, :3, 3] - 1.0, axis=1)),
    }
    return arm, made[kind]


@pytest.mark.parametrize("prior", [None, ParameterPrior()])
@pytest.mark.parametrize("seed", [0, 3, 9])
@pytest.mark.parametrize("kind", ["pose", "position", "distance", "contact"])
def test_the_number_of_missing_measurements_is_right_at_once(kind, seed, prior):
    arm, first = measured_by(kind, seed)
    needed = set()
    for n in (2, 3, 4):
        with pytest.raises(InvalidValueError, match=r"at least \d+ more configurations") as caught:
            fit(arm.nominal, first(n), prior=prior, **ALONE)
        needed.add(n + int(str(caught.value).split("at least ")[1].split()[0]))
    (enough,) = needed
    fit(arm.nominal, first(enough), prior=prior, **ALONE)
    with pytest.raises(InvalidValueError, match="at least 1 more"):
        fit(arm.nominal, first(enough - 1), prior=prior, **ALONE)


def test_a_joint_that_stays_still_is_not_counted_as_missing():
    arm = Arm(0)
    q = arm.readings(40)
    q[:, 2] = 0.3
    p = arm.positions(q)
    with pytest.raises(InvalidValueError, match="at least") as caught:
        fit(arm.nominal, Position(q[:3], p[:3]), **ALONE)
    enough = 3 + int(str(caught.value).split("at least ")[1].split()[0])
    fit(arm.nominal, Position(q[:enough], p[:enough]), **ALONE)
    with pytest.raises(InvalidValueError, match="at least 1 more"):
        fit(arm.nominal, Position(q[: enough - 1], p[: enough - 1]), **ALONE)
