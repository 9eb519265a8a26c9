"""Identifiable parameters and how the others regroup; observability, choice of configurations."""

import pickle
from itertools import combinations

import numpy as np
import pytest
from calibration_arms import ALONE
from identities.random_robots import random_model, random_pose

import robotmodels as rm
from robotmodels._arrays.tasks import Workers
from robotmodels.calibration import (
    ParameterPrior,
    PointContact,
    Pose,
    Position,
    Reason,
    candidate_parameters,
    differential_model,
    fit,
    identifiable_parameters,
    observability,
    select_configurations,
)
from robotmodels.calibration.identifiable import DEPENDENT, identifiable_on
from robotmodels.calibration.measurements import Orientation
from robotmodels.calibration.measurements.kinds import as_kind, drawn_groups
from robotmodels.calibration.observability import Criterion, exchanged, greedy
from robotmodels.calibration.problem import guessed_fixtures, problem_of, stacked
from robotmodels.calibration.selection import group_rows
from robotmodels.kinematics.lengths import spread_configurations
from robotmodels.obstacles import Box, Plane, Sphere, clearance


def rank_of(W):
    """Rank by singular values of unit columns."""
    length = np.linalg.norm(W, axis=0)
    W = W[:, length > 1e-9 * length.max()]
    s = np.linalg.svd(W / np.linalg.norm(W, axis=0), compute_uv=False)
    return int((s > 1e-9 * s[0]).sum())


# --- counts and regrouping ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "ur10e", "panda", "stanford_arm", "lab_rrt", "gantry"])
def test_full_poses_identify_four_for_a_revolute_two_for_a_prismatic_joint_and_six(name):
    model = rm.load(name).with_base(random_pose(np.random.default_rng(0)))
    basis = identifiable_parameters(model, "pose")
    revolute, prismatic = (np.sum(model.table.sigma == sigma) for sigma in (0, 1))
    assert basis.count == 4 * revolute + 2 * prismatic + 6
    assert basis.gap[1] < 1e-9 < 1e-4 < basis.gap[0]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("chunk", range(4))
def test_counts_equal_the_rank_of_the_singular_values_on_random_robots(chunk):
    rng = np.random.default_rng(chunk)
    for k in range(10):
        # every structure: f from 1 to 7, parallel axes, zero lengths, rotated bases
        model = random_model(
            rng, f=int(rng.integers(1, 8)), inertia=None, tree=bool(k % 2), fixed=k % 3 == 0,
            prismatic=k % 4 != 1, passive=k % 5 == 0, limits=k % 2 == 0,
            tip="any" if k % 2 else None,
        )  # fmt: skip
        candidates = candidate_parameters(model, gains=k % 3 == 1, eccentricity=k % 5 == 2)
        q = spread_configurations(model, 150, rng)
        T, psi = differential_model(candidates, q)
        for rows, measured in (
            (psi, Pose(q, T)), (psi[:, :3], Position(q, T[:, :3, 3])),
            (psi[:, 3:], Orientation(q, T)),
        ):  # fmt: skip
            basis = identifiable_on(candidates, [measured])
            assert basis.count == rank_of(rows.reshape(-1, len(candidates))), basis.gap


@pytest.mark.parametrize(("name", "known"), [("rx90", "d3"), ("panda", "r3"), ("cobra_s600", "d2")])
def test_point_contacts_identify_the_rank_of_differences_within_each_group(name, known):
    model = rm.load(name)
    candidates = candidate_parameters(model)
    basis = identifiable_parameters(model, "point contact", known_lengths=[known])
    rng = np.random.default_rng(5)
    q, label = drawn_groups(candidates, "point_contact", 25, 6, rng, limits=False)
    T, psi = differential_model(candidates, q)
    same = label[1:] == label[:-1]
    assert np.abs(np.diff(T[:, :3, 3], axis=0)[same]).max() < 1e-11
    keep = [k for k, e in enumerate(candidates.entries) if e.row > 0 and e.name != known]
    W = np.diff(psi[:, :3], axis=0)[same].reshape(-1, len(candidates))
    assert basis.count == rank_of(W[:, keep])
    # with the known length free the scale is one more direction without effect
    assert basis.count == rank_of(W[:, [*keep, candidates.names.index(known)]])


@pytest.mark.parametrize("seed", range(6))
def test_regrouped_parameters_move_the_end_as_all_of_them_do(seed):
    rng = np.random.default_rng(seed)
    model = random_model(
        rng, f=6, inertia=None, tree=seed % 2 == 1, fixed=seed % 3 == 0, limits=False
    )
    basis = identifiable_parameters(model, "pose", gains=seed % 4 == 0)
    q = spread_configurations(model, 40, np.random.default_rng(seed + 50))
    all_, kept = (differential_model(p, q).psi for p in (basis.candidates, basis.kept))
    d = rng.normal(size=len(basis.candidates))
    moved = all_ @ d
    assert np.abs(moved - kept @ (basis.matrix @ d)).max() < DEPENDENT * np.abs(moved).max()


def test_every_candidate_is_kept_or_has_a_reason():
    basis = identifiable_parameters(rm.load("rx90"), "point_contact", known_lengths=["d3"])
    assert sorted([*basis.names, *basis.reasons]) == sorted(basis.candidates.names)
    assert basis.of_reason(Reason.KNOWN) == ("d3",)
    assert set(basis.of_reason(Reason.GAUGE)) == {"gamma0", "b0", "alpha0", "d0", "theta0", "r0"}
    for name, terms in basis.regrouped_into.items():
        assert all(basis.regrouping[kept][name] == c for kept, c in terms.items())
    again = pickle.loads(pickle.dumps(basis))
    assert again.names == basis.names
    assert not again.factor.flags.writeable
    wrist = identifiable_parameters(rm.load("rx90"), Position).of_reason(Reason.NO_EFFECT)
    assert {"theta4", "theta5", "theta6"} <= set(wrist)  # the end is the wrist centre


def test_contacts_are_judged_where_the_corrected_robot_meets_them():
    model = rm.load("ur10e")
    rng = np.random.default_rng(3)
    candidates = candidate_parameters(model)
    xi = 1e-3 * rng.normal(size=len(candidates)) * (candidates.rows > 0)
    q, label = drawn_groups(candidates, "point_contact", 14, 8, rng, corrections=xi, limits=False)
    T = differential_model(candidates, q, xi).T
    assert np.abs(np.diff(T[:, :3, 3], axis=0)[np.diff(label) == 0]).max() < 1e-11
    # readings of one robot violate the contacts of the other by millimetres: as they are, they
    # would make more parameters identifiable
    for corrections in (None, xi):
        options = {"known_lengths": ["d3"], "corrections": corrections}
        structure = identifiable_parameters(model, "point_contact", **options)
        of_data = identifiable_parameters(model, PointContact(q, label), **options)
        assert of_data.count == structure.count


def test_the_unit_of_length_does_not_change_anything():
    """Of robots a million times smaller and larger, and a thousand times with the default prior."""
    rng = np.random.default_rng(3)
    q, noise = rng.uniform(-1.0, 1.0, (30, 4)), rng.normal(size=(30, 3))

    def fitted(size, own):
        prior = ParameterPrior(1e-3 * size) if own else ParameterPrior()
        rows = [
            {"sigma": 0}, {"sigma": 0, "alpha": np.pi / 2, "d": size},
            {"sigma": 0, "d": 4.0 * size}, {"sigma": 0, "d": 3.0 * size, "alpha": 0.5, "r": size},
        ]  # fmt: skip
        arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
        T = rm.dgm(arm, q)
        T[:, :3, 3] += 1e-4 * size * noise
        result = fit(arm, Pose(q, T), prior=prior, **ALONE)
        contact = identifiable_parameters(arm, "point_contact", known_lengths=["d3"])
        left = (rm.dgm(result.model, q) - T)[:, :3, 3] / size
        return result.names, contact.names, result.status, np.linalg.norm(left)

    for small, large, own in (
        (1.0, 1e-6, True), (1.0, 1e6, True), (1e-6, 1e-3, False), (1e2, 1e5, False),
    ):  # fmt: skip
        (*one, left), (*other, other_left) = fitted(small, own), fitted(large, own)
        assert len(one[0]) == 22
        assert other == one
        assert other_left == pytest.approx(left, rel=1e-9)


# --- observability and the choice of configurations ---------------------------------------------

RX90 = rm.load("rx90")
LOWER, UPPER = np.array([[-2.7, -1.0, -1.2, -3.0, -1.8, -3.0], [2.5, 2.9, 2.6, 3.1, 2.0, 3.0]])
RX90 = RX90.with_table(RX90.table.replace(lower=LOWER, upper=UPPER))


def value(rows, chosen, criterion):
    R = rows[np.array(chosen)].reshape(-1, rows.shape[-1])
    return observability(R, len(chosen)).value(criterion)


def test_indices_of_a_diagonal_matrix_by_hand():
    found = observability(np.diag([8.0, 4.0, 2.0]), 4)
    indices = [found.value(criterion) for criterion in Criterion]
    assert indices == pytest.approx([4.0 / 2.0, 0.25, 2.0, 0.5, 8.0 / 7.0])
    assert found.condition == pytest.approx(4.0)


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
    assert chosen.enough(0.001) is None


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
        assert ((found.q >= LOWER - 1e-9) & (found.q <= UPPER + 1e-9)).all()
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
    around = p - p.mean(axis=1, keepdims=True)
    apart = {"point_contact": around, "frame_contact": np.diff(T, axis=1)}
    if kind == "plane_contact":
        apart[kind] = np.linalg.svd(around, compute_uv=False)[:, 2]
    assert np.abs(apart[kind]).max() < 1e-10
    assert ((chosen.q >= LOWER - 1e-9) & (chosen.q <= UPPER + 1e-9)).all()
    assert "d3" not in chosen.parameters.names
    assert chosen.observability.o3 > 0.0
    again = select_configurations(RX90, kind, 8, candidates=chosen.groups, **options)
    mine, other = np.sort(chosen.standard_errors[-1]), np.sort(again.standard_errors[-1])
    assert np.allclose(mine, other, rtol=1e-6)
