"""Observability indices and the choice of configurations."""

import pickle
from itertools import combinations

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.calibration import PointContact, candidate_parameters, differential_model
from robotmodels.calibration.identifiable import identifiable_parameters
from robotmodels.calibration.measurements.kinds import Kind, drawn_groups, groups_of, measurement_of
from robotmodels.calibration.problem import guessed_fixtures, problem_of, stacked
from robotmodels.calibration.selection import (
    Criterion,
    added,
    exchanged,
    greedy,
    group_rows,
    index_of,
    nested,
    observability,
    select_configurations,
)
from robotmodels.errors import InvalidValueError, ShapeError
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


def test_indices_do_not_change_with_axes_and_order_of_rows():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(10, 6, 7))
    first = observability(W)
    assert first.configurations == 10
    turned = np.linalg.qr(rng.normal(size=(6, 6)))[0] @ W[rng.permutation(10)]
    mixed = turned @ np.linalg.qr(rng.normal(size=(7, 7)))[0]
    for criterion in Criterion:
        assert observability(mixed).value(criterion) == pytest.approx(first.value(criterion))
    # twice the same configurations: O1 per configuration stays, the others know more rows
    twice = observability(np.concatenate([W, W]))
    assert twice.o1 == pytest.approx(first.o1)
    assert twice.o2 == pytest.approx(first.o2)
    assert twice.o3 == pytest.approx(np.sqrt(2) * first.o3)
    assert twice.o5 == pytest.approx(np.sqrt(2) * first.o5)


def test_units_of_parameters_scale_o1_alone():
    rng = np.random.default_rng(1)
    A, B = rng.normal(size=(2, 10, 6, 5))
    units = np.array([1e3, 1.0, 1.0, 57.3, 1.0])
    ratio = observability(A).o1 / observability(B).o1
    scaled = observability(A, scales=units).o1 / observability(B, scales=units).o1
    assert scaled == pytest.approx(ratio)
    assert observability(A * units).o2 == pytest.approx(observability(A, scales=units).o2)
    other = observability(A, scales=units).o2 / observability(B, scales=units).o2
    assert abs(other / (observability(A).o2 / observability(B).o2) - 1.0) > 1e-3


def test_what_is_not_seen_makes_all_indices_zero():
    for W in (np.ones((3, 2)), np.eye(3)[:2], np.zeros((4, 2))):
        found = observability(W, 1)
        assert [found.value(c) for c in Criterion] == [0.0] * 5
        assert found.condition == np.inf


def test_indices_of_identifiable_parameters():
    found = identifiable_parameters(RX90, Kind.POINT_CONTACT, known_lengths=["d3"])
    seen = observability(found)
    assert len(seen.singular_values) == found.count
    assert seen.o3 > 0.0
    assert seen.configurations == found.configurations


def test_mistakes_about_indices_are_named():
    with pytest.raises(ShapeError, match="psi"):
        observability(np.zeros(3))
    with pytest.raises(ShapeError, match="psi"):
        observability(np.zeros((0, 3)))
    with pytest.raises(InvalidValueError, match="finite"):
        observability([[np.nan]])
    with pytest.raises(InvalidValueError, match="configurations"):
        observability(np.eye(2), 0)
    with pytest.raises(InvalidValueError, match="scales"):
        observability(np.eye(2), scales=[1.0, 0.0])


# --- exchange ----------------------------------------------------------------------------------


@pytest.mark.parametrize("criterion", Criterion)
def test_exchange_finds_what_exhaustive_search_finds(criterion):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        rows = rng.normal(size=(10, 2, 4)) * rng.uniform(0.3, 2.0, size=(10, 1, 1))
        best = max(value(rows, s, criterion) for s in combinations(range(10), 4))
        starts = [greedy(rows, 4, criterion)]
        starts += [rng.permutation(10)[:4] for _ in range(8)]
        found = max(value(rows, exchanged(rows, s, criterion), criterion) for s in starts)
        assert found == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("criterion", Criterion)
def test_exchange_is_never_worse_than_its_start_and_ends_where_no_exchange_helps(criterion):
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(40, 3, 6)) * rng.uniform(0.2, 2.0, size=(40, 1, 1))
    for start in (greedy(rows, 8, criterion), rng.permutation(40)[:8], np.arange(2)):
        found = exchanged(rows, start, criterion)
        assert len(set(found)) == len(start)
        after = value(rows, found, criterion)
        assert after >= value(rows, start, criterion) * (1 - 1e-12)
        for k in range(len(found)):
            for other in set(range(40)) - set(found):
                tried = found.copy()
                tried[k] = other
                assert value(rows, tried, criterion) <= after * (1 + 1e-8)


def test_small_determinants_are_the_large_ones():
    rng = np.random.default_rng(5)
    rows, base = rng.normal(size=(30, 3, 7)), np.eye(7) + np.ones((7, 7))
    whole = index_of(base + rows.swapaxes(-1, -2) @ rows, Criterion.O1)
    assert np.allclose(added(base, rows, Criterion.O1), whole, rtol=1e-12, atol=0)
    assert np.allclose(whole, 0.5 * np.log([np.linalg.det(base + r.T @ r) for r in rows]) / 7)


def test_fixed_members_stay_and_progress_is_told():
    rng = np.random.default_rng(6)
    rows = rng.normal(size=(30, 2, 4))
    told = []
    found = exchanged(rows, np.array([3, 7, 1, 2]), Criterion.O1, lambda *a: told.append(a), 2)
    assert found[:2].tolist() == [3, 7]
    assert told[-1][0] == told[-1][1]
    assert all(a <= b for a, b in told)


def test_first_members_of_a_nested_order_are_good_sets():
    rng = np.random.default_rng(7)
    rows = rng.normal(size=(60, 3, 5)) * rng.uniform(0.1, 2.0, size=(60, 1, 1))
    chosen = rng.permutation(60)[:20]
    order = nested(rows, chosen, Criterion.O1)
    assert sorted(order) == sorted(chosen)
    for c in (4, 8, 12):
        at_random = [value(rows, rng.permutation(chosen)[:c], Criterion.O1) for _ in range(50)]
        assert value(rows, order[:c], Criterion.O1) > max(at_random)


# --- rows of groups ----------------------------------------------------------------------------


def test_eliminated_fixtures_leave_the_information_of_the_whole_problem():
    parameters = candidate_parameters(RX90, base=False).without(["d3"])
    drawn = drawn_groups(parameters, Kind.POINT_CONTACT, 8, 4, np.random.default_rng(0))
    full = np.bincount(drawn.label)[drawn.label] == 4
    q = drawn.q[full].reshape(-1, 4, 6)
    rows = group_rows(parameters, Kind.POINT_CONTACT, q, sigma=2e-4)
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


def test_deviations_by_default_count_angles_at_the_reach():
    parameters = candidate_parameters(RX90)
    q = np.zeros((1, 1, 6))
    psi = differential_model(parameters, q[:, 0]).psi[0]
    rows = group_rows(parameters, Kind.POSE, q)[0]
    assert np.allclose(rows[:3], psi[:3] / 1e-4)
    assert np.allclose(rows[3:], psi[3:] * 0.9 / 1e-4)
    sigma = [1, 2, 3, 4, 5, 6]
    assert np.allclose(group_rows(parameters, Kind.POSE, q, sigma)[0], psi / np.c_[sigma])
    with pytest.raises(ShapeError, match="sigma"):
        group_rows(parameters, Kind.POSE, q, [1.0, 2.0])


# --- the choice --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chosen():
    return select_configurations(
        RX90, Kind.POSE, 15, drawn=300, starts=2, rng=np.random.default_rng(0)
    )


def pool_of(seed, N):
    return drawn_groups(candidate_parameters(RX90), Kind.POSE, N, 1, np.random.default_rng(seed)).q


def test_what_is_chosen_is_better_than_any_of_many_random_sets():
    pool, rng = pool_of(0, 300), np.random.default_rng(1)
    for criterion in (Criterion.O1, Criterion.O3):
        found = select_configurations(
            RX90, "pose", 12, candidates=pool, criterion=criterion, starts=1, rng=rng
        )
        assert np.array_equal(pool[found.candidates], found.q)
        assert len(set(found.candidates)) == 12
        rows = group_rows(found.parameters, Kind.POSE, pool[:, None])
        scaled = rows / np.sqrt((rows**2).sum(axis=(0, 1)) / len(rows))
        own = value(scaled, found.candidates, criterion)
        assert own == pytest.approx(found.observability.value(criterion))
        others = [value(scaled, rng.permutation(300)[:12], criterion) for _ in range(200)]
        assert own > max(others)
        assert own >= value(scaled, greedy(scaled, 12, criterion), criterion) * (1 - 1e-12)


def test_real_errors_of_parameters_are_smaller_than_with_random_sets(chosen):
    rng = np.random.default_rng(2)
    p = len(chosen.parameters)
    sigma = np.array([1e-4] * 3 + [1e-4 / 0.9] * 3)
    pool = pool_of(3, 300)
    effect = np.sqrt(
        (group_rows(chosen.parameters, Kind.POSE, pool[:, None]) ** 2).sum(axis=1).mean(axis=0)
    )

    def errors(q, repeats=300):
        psi = differential_model(chosen.parameters, q).psi
        noise = sigma * rng.normal(size=(repeats, len(q), 6))
        W = (psi / sigma[:, None]).reshape(-1, p)
        found = np.linalg.lstsq(W, (noise / sigma).reshape(repeats, -1).T, rcond=None)[0]
        return np.sqrt((found**2).mean(axis=1))

    mine = errors(chosen.q)
    # what was promised is what comes
    assert np.allclose(mine, chosen.deviations[-1], rtol=0.2)
    random_ones = np.array([errors(pool[rng.permutation(300)[:15]], 100) for _ in range(10)])
    weighted = np.sqrt(((random_ones * effect) ** 2).mean(axis=1))
    assert np.sqrt(((mine * effect) ** 2).mean()) < weighted.min()


def test_the_curve_says_how_many_are_enough(chosen):
    assert chosen.count == 15
    assert chosen.q.shape == (15, 6)
    assert chosen.counts[-1] == 15
    assert chosen.counts[0] == 5  # 30 parameters, 6 rows each
    assert np.all(np.diff(chosen.deviations, axis=0) <= 1e-15)
    for c, expected in zip(chosen.counts, chosen.deviations, strict=True):
        rows = group_rows(chosen.parameters, Kind.POSE, chosen.groups[:c])
        R = rows.reshape(-1, rows.shape[-1])
        scale = np.linalg.norm(R, axis=0)
        inverse = np.linalg.inv((R / scale).T @ (R / scale))
        assert np.allclose(np.sqrt(np.diag(inverse)) / scale, expected, rtol=1e-6)
    assert chosen.values[-1] == pytest.approx(chosen.observability.o1)
    for gain in (0.05, 0.1, 0.2, 0.5):
        found = chosen.enough(gain)
        if found is not None:
            k = int(np.flatnonzero(chosen.counts == found)[0])
            assert (chosen.gains[k:] < gain).all()
            assert k == 0 or chosen.gains[k - 1] >= gain
            assert chosen.enough_sentence(gain).startswith(f"From {found} on")
    assert chosen.enough(0.5) is not None
    assert chosen.enough(0.001) is None
    assert "not yet enough" in chosen.enough_sentence(0.001)
    with pytest.raises(InvalidValueError, match="gain"):
        chosen.enough(2.0)


def test_a_choice_prints_and_pickles(chosen):
    assert "15 chosen of 300 candidates" in str(chosen)
    again = pickle.loads(pickle.dumps(chosen))
    assert np.array_equal(again.q, chosen.q)
    assert not again.groups.flags.writeable


def test_limits_and_obstacles_are_respected_also_when_configurations_are_moved():
    bodies = [
        Plane([0, 0, 0], [0, 0, 1]),
        Sphere([0.6, 0.3, 0.4], 0.15),
        Box([-1, -1, -1], [-0.3, 1, 1]),
    ]
    rng = np.random.default_rng(0)
    told = []
    first, moved = (
        select_configurations(
            RX90, Kind.POSITION, 9, drawn=100, obstacles=bodies, radius=0.06, optimise=optimise,
            starts=1, rng=np.random.default_rng(0), progress=lambda *a: told.append(a),
        )
        for optimise in (False, True)
    )  # fmt: skip
    for found in (first, moved):
        assert (found.q >= RX90.lower - 1e-9).all()
        assert (found.q <= RX90.upper + 1e-9).all()
        assert clearance(RX90, found.q, bodies, 0.06).min() > 0.0
        assert any("obstacle" in note for note in found.left_out)
    assert told
    assert all(0 < done <= total for done, total in told)
    assert moved.observability.o1 > 1.02 * first.observability.o1
    assert (moved.candidates == -1).any()
    # the obstacles matter: without them some configurations would touch
    free = select_configurations(RX90, Kind.POSITION, 9, drawn=100, starts=1, rng=rng)
    assert clearance(RX90, free.q, bodies, 0.06).min() < 0.0


def test_given_candidates_beyond_limits_or_touching_are_left_out():
    pool = pool_of(1, 80)
    pool[:20, 0] = RX90.upper[0] + 0.1
    found = select_configurations(
        RX90, Kind.POSE, 8, candidates=pool, obstacles=[Plane([0, 0, -0.2], [0, 0, 1])],
        rng=np.random.default_rng(0),
    )  # fmt: skip
    assert (found.candidates >= 20).all()
    assert found.left_out[0].startswith("20 candidates are beyond the limits")
    assert clearance(RX90, found.q, [Plane([0, 0, -0.2], [0, 0, 1])], 0.05).min() > 0.0
    assert np.array_equal(pool[found.candidates], found.q)


def test_contacts_are_chosen_as_groups_that_meet():
    found = select_configurations(
        RX90, Kind.POINT_CONTACT, 6, drawn=40, postures=3, known_lengths=["d3"], starts=1,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    assert found.groups.shape == (6, 3, 6)
    assert found.labels.tolist() == sorted([*range(6)] * 3)
    p = rm.dgm(RX90, found.groups)[..., :3, 3]
    assert np.ptp(p, axis=1).max() < 1e-10
    assert (found.q >= RX90.lower - 1e-9).all()
    assert (found.q <= RX90.upper + 1e-9).all()
    assert "d3" not in found.parameters.names
    assert found.observability.o3 > 0.0
    again = select_configurations(
        RX90, Kind.POINT_CONTACT, 6, candidates=found.groups, known_lengths=["d3"],
        rng=np.random.default_rng(0),
    )  # fmt: skip
    assert np.allclose(np.sort(again.deviations[-1]), np.sort(found.deviations[-1]), rtol=1e-6)


def test_the_same_chance_gives_the_same_choice():
    a, b = (
        select_configurations(RX90, "position", 10, drawn=60, rng=np.random.default_rng(5))
        for _ in range(2)
    )
    assert np.array_equal(a.q, b.q)


def test_mistakes_about_the_choice_are_named():
    pool = pool_of(2, 30)
    with pytest.raises(InvalidValueError, match="at least 5"):
        select_configurations(RX90, Kind.POSE, 4, candidates=pool)
    with pytest.raises(InvalidValueError, match="40 were asked for, but only 30"):
        select_configurations(RX90, Kind.POSE, 40, candidates=pool)
    with pytest.raises(ShapeError, match="candidates"):
        select_configurations(RX90, Kind.POSE, 10, candidates=pool[:, :5])
    with pytest.raises(InvalidValueError, match="know no length"):
        select_configurations(RX90, Kind.POINT_CONTACT, 6, drawn=20, postures=2)
    groups = pool.reshape(10, 3, 6)
    with pytest.raises(InvalidValueError, match="do not meet"):
        select_configurations(RX90, Kind.POINT_CONTACT, 6, candidates=groups, known_lengths=["d3"])
    with pytest.raises(InvalidValueError, match="optimise"):
        select_configurations(RX90, Kind.POINT_CONTACT, 6, optimise=True, known_lengths=["d3"])
    with pytest.raises(InvalidValueError, match="only 0 candidates"):
        select_configurations(
            RX90, Kind.POSE, 6, drawn=20, obstacles=[Sphere([0, 0, 0], 5.0)], radius=0.0
        )
    with pytest.raises(InvalidValueError, match="criterion"):
        select_configurations(RX90, Kind.POSE, 6, criterion="O6")
    with pytest.raises(InvalidValueError, match="count"):
        select_configurations(RX90, Kind.POSE, 0)
    with pytest.raises(InvalidValueError, match="progress"):
        select_configurations(RX90, Kind.POSE, 6, progress="bar")


def test_drawn_measurements_have_no_residual():
    parameters = candidate_parameters(RX90)
    q = pool_of(4, 5)[:, None]
    for kind in (Kind.POSE, Kind.POSITION, Kind.ORIENTATION):
        problem = problem_of(parameters, [measurement_of(parameters, kind, groups_of(q))])
        r = stacked(
            problem, np.zeros(len(parameters)), (np.ones(len(problem.measurements[0].axes)),)
        )
        assert np.abs(r[0]).max() < 1e-14


@pytest.mark.parametrize("kind", [Kind.FRAME_CONTACT, Kind.PLANE_CONTACT])
def test_frames_and_planes_are_met_exactly_within_the_limits(kind):
    found = select_configurations(
        RX90, kind, 8, drawn=40, known_lengths=["d3"], starts=1, rng=np.random.default_rng(0)
    )
    assert found.groups.shape == (8, kind.postures, 6)
    T = rm.dgm(RX90, found.groups)
    if kind is Kind.FRAME_CONTACT:
        assert np.abs(np.diff(T, axis=1)).max() < 1e-10
    else:
        p = T[..., :3, 3] - T[..., :3, 3].mean(axis=1, keepdims=True)
        assert np.linalg.svd(p, compute_uv=False)[:, 2].max() < 1e-10
    assert (found.q >= RX90.lower - 1e-9).all()
    assert (found.q <= RX90.upper + 1e-9).all()
