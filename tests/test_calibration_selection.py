"""Observability indices and the choice of configurations."""

from itertools import combinations

import numpy as np
import pytest

import robotmodels as rm
from robotmodels._arrays.tasks import Workers
from robotmodels.calibration import (
    PointContact,
    candidate_parameters,
    observability,
    select_configurations,
)
from robotmodels.calibration.measurements.kinds import as_kind, drawn_groups
from robotmodels.calibration.observability import Criterion, exchanged, greedy
from robotmodels.calibration.problem import guessed_fixtures, problem_of, stacked
from robotmodels.calibration.selection import group_rows
from robotmodels.errors import InvalidValueError
from robotmodels.obstacles import Box, Plane, Sphere, clearance

RX90 = rm.load("rx90")
RX90 = RX90.with_table(
    RX90.table.replace(
        lower=[-2.7, -1.0, -1.2, -3.0, -1.8, -3.0], upper=[2.5, 2.9, 2.6, 3.1, 2.0, 3.0]
    )
)


def value(rows, chosen, criterion):
    R = rows[np.array(chosen)].reshape(-1, rows.shape[-1])
    return observability(R, len(chosen)).value(criterion)


# --- indices -----------------------------------------------------------------------------------


def test_indices_of_a_diagonal_matrix_by_hand():
    found = observability(np.diag([8.0, 4.0, 2.0]), 4)
    assert found.o1 == pytest.approx(4.0 / 2.0)
    assert found.o2 == pytest.approx(0.25)
    assert found.o3 == pytest.approx(2.0)
    assert found.o4 == pytest.approx(0.5)
    assert found.o5 == pytest.approx(8.0 / 7.0)
    assert found.condition == pytest.approx(4.0)
    for criterion in Criterion:
        assert found.value(criterion) == getattr(found, criterion.name.lower())
    assert "O5 1.143" in str(found)


# --- exchange ----------------------------------------------------------------------------------


@pytest.mark.parametrize("criterion", Criterion)
def test_exchange_finds_what_exhaustive_search_finds(criterion):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        rows = rng.normal(size=(9, 2, 4)) * rng.uniform(0.3, 2.0, size=(9, 1, 1))
        best = max(value(rows, s, criterion) for s in combinations(range(9), 4))
        starts = [greedy(rows, 4, criterion)]
        starts += [rng.permutation(9)[:4] for _ in range(8)]
        found = max(
            value(rows, exchanged(rows, s, criterion, Workers()), criterion) for s in starts
        )
        assert found == pytest.approx(best, rel=1e-9)


# --- rows of groups ----------------------------------------------------------------------------


def test_eliminated_fixtures_leave_the_information_of_the_whole_problem():
    parameters = candidate_parameters(RX90, base=False).without(["d3"])
    drawn = drawn_groups(parameters, "point_contact", 8, 4, np.random.default_rng(0))
    full = np.bincount(drawn.label)[drawn.label] == 4
    q = drawn.q[full].reshape(-1, 4, 6)
    rows = group_rows(parameters, "point_contact", q, sigma=2e-4)
    assert rows.shape == (len(q), 9, len(parameters))
    touched = PointContact(q.reshape(-1, 6), np.repeat(np.arange(len(q)), 4), sigma=2e-4)
    problem = problem_of(parameters, [touched])
    none = np.zeros(len(parameters))
    x = np.concatenate([none, guessed_fixtures(problem, none)])
    J = stacked(problem, x, (np.ones(3),))[1]
    A, F = J[:, : problem.P], J[:, problem.P :]
    schur = A.T @ A - A.T @ F @ np.linalg.solve(F.T @ F, F.T @ A)
    R = rows.reshape(-1, problem.P)
    assert np.allclose(R.T @ R, schur, atol=1e-9 * np.abs(schur).max())


# --- the choice --------------------------------------------------------------------------------


def test_the_curve_gives_the_count_that_is_enough():
    chosen = select_configurations(RX90, "pose", 15, drawn=150, starts=2, rng=0)
    assert chosen.count == len(chosen.q) == chosen.counts[-1] == 15
    assert chosen.counts[0] == 5  # 30 parameters, 6 rows each
    assert np.all(np.diff(chosen.standard_errors, axis=0) <= 1e-15)
    for c, expected in zip(chosen.counts[::4], chosen.standard_errors[::4], strict=True):
        rows = group_rows(chosen.parameters, "pose", chosen.groups[:c])
        R = rows.reshape(-1, rows.shape[-1])
        scale = np.linalg.norm(R, axis=0)
        inverse = np.linalg.inv((R / scale).T @ (R / scale))
        assert np.allclose(np.sqrt(np.diag(inverse)) / scale, expected, rtol=1e-6)
    assert chosen.values[-1] == pytest.approx(chosen.observability.o1)
    enough = chosen.enough(0.2)
    k = chosen.counts.tolist().index(enough)
    assert (chosen.gains[k:] < 0.2).all()
    assert k == 0 or chosen.gains[k - 1] >= 0.2
    assert chosen.enough_sentence(0.2).startswith(f"From {enough} on")
    assert chosen.enough(0.001) is None
    assert "not yet enough" in chosen.enough_sentence(0.001)
    with pytest.raises(InvalidValueError, match="gain"):
        chosen.enough(2.0)


def test_limits_and_obstacles_are_respected_also_when_configurations_are_moved():
    bodies = [Plane([0, 0, 0], [0, 0, 1]), Sphere([0.6, 0.3, 0.4], 0.15),
              Box([-1, -1, -1], [-0.3, 1, 1])]  # fmt: skip
    calls = []
    free, first, moved = (
        select_configurations(
            RX90, "position", 9, drawn=60, starts=1, rng=np.random.default_rng(0),
            progress=calls.append, **options,
        )
        for options in (
            {}, {"obstacles": bodies, "radius": 0.06},
            {"obstacles": bodies, "radius": 0.06, "optimise": True},
        )
    )  # fmt: skip
    for found in (first, moved):
        assert ((found.q >= RX90.lower - 1e-9) & (found.q <= RX90.upper + 1e-9)).all()
        assert clearance(RX90, found.q, bodies, 0.06).min() > 0.0
        assert any("obstacle" in note for note in found.left_out)
    assert all(0 < done <= 1 for done in calls)
    assert calls[-1] == 1.0
    assert moved.observability.o1 > 1.02 * first.observability.o1
    assert (moved.candidates == -1).any()
    # without the obstacles some configurations touch
    assert clearance(RX90, free.q, bodies, 0.06).min() < 0.0


@pytest.mark.parametrize("kind", ["point_contact", "frame_contact", "plane_contact"])
def test_contacts_are_chosen_as_groups_that_meet_within_the_limits(kind):
    options = {"known_lengths": ["d3"], "starts": 1, "rng": np.random.default_rng(0)}
    chosen = select_configurations(RX90, kind, 8, drawn=40, **options)
    assert chosen.groups.shape == (8, as_kind(kind).postures, 6)
    assert chosen.labels.tolist() == sorted([*range(8)] * as_kind(kind).postures)
    T = rm.dgm(RX90, chosen.groups)
    p = T[..., :3, 3]
    if kind == "point_contact":
        assert np.ptp(p, axis=1).max() < 1e-10
    elif kind == "frame_contact":
        assert np.abs(np.diff(T, axis=1)).max() < 1e-10
    else:
        around = p - p.mean(axis=1, keepdims=True)
        assert np.linalg.svd(around, compute_uv=False)[:, 2].max() < 1e-10
    assert ((chosen.q >= RX90.lower - 1e-9) & (chosen.q <= RX90.upper + 1e-9)).all()
    assert "d3" not in chosen.parameters.names
    assert chosen.observability.o3 > 0.0
    again = select_configurations(RX90, kind, 8, candidates=chosen.groups, **options)
    mine, other = np.sort(chosen.standard_errors[-1]), np.sort(again.standard_errors[-1])
    assert np.allclose(mine, other, rtol=1e-6)
