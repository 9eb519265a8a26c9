"""Identifiable geometric parameters, structurally and from data, and how the others regroup."""

import pickle

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose

import robotmodels as rm
from robotmodels import calibration
from robotmodels.calibration import (
    PointContact,
    Pose,
    Position,
    Reason,
    candidate_parameters,
    differential_model,
    identifiable_parameters,
)
from robotmodels.calibration.identifiable import DEPENDENT, identifiable_on
from robotmodels.calibration.measurements.kinds import drawn_groups
from robotmodels.kinematics.lengths import spread_configurations


def rank_of(W):
    """Rank by singular values of unit columns."""
    length = np.linalg.norm(W, axis=0)
    W = W[:, length > 1e-9 * length.max()]
    s = np.linalg.svd(W / np.linalg.norm(W, axis=0), compute_uv=False)
    return int((s > 1e-9 * s[0]).sum())


# --- counts ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "ur10e", "panda", "stanford_arm", "lab_rrt", "gantry"])
def test_full_poses_identify_four_for_a_revolute_two_for_a_prismatic_joint_and_six(name):
    model = rm.load(name).with_base(random_pose(np.random.default_rng(0)))
    basis = identifiable_parameters(model, "pose")
    assert (
        basis.count == 4 * np.sum(model.table.sigma == 0) + 2 * np.sum(model.table.sigma == 1) + 6
    )
    assert basis.gap[1] < 1e-9 < 1e-4 < basis.gap[0]


@pytest.mark.parametrize(
    ("kind", "count"),
    [
        (Position, 21),  # the wrist centre: theta4 to theta6 have no effect
        ("orientation", 15),  # directions of six axes, turn of the tool
        (["point_contact", "position"], 21),  # points give scale and place
    ],
)
def test_counts_of_a_known_robot(kind, count):
    basis = identifiable_parameters(rm.load("rx90"), kind)
    assert basis.count == count
    assert not basis.of_reason(Reason.GAUGE) or kind == "orientation"
    if kind is Position:
        assert {"theta4", "theta5", "theta6"} <= set(basis.of_reason(Reason.NO_EFFECT))
    if kind == "orientation":
        assert not {e.name for e in basis.kept.entries if e.element.is_length}


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
        for rows, measured in ((6, Pose(q, T)), (3, Position(q, T[:, :3, 3]))):
            basis = identifiable_on(candidates, [measured])
            assert basis.count == rank_of(psi[:, :rows].reshape(-1, len(candidates))), basis.gap


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


# --- regrouping --------------------------------------------------------------------------------


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


def test_every_candidate_is_kept_or_has_a_reason_and_the_text_says_so():
    basis = identifiable_parameters(rm.load("rx90"), "point_contact", known_lengths=["d3"])
    assert sorted([*basis.names, *basis.reasons]) == sorted(basis.candidates.names)
    assert basis.of_reason(Reason.KNOWN) == ("d3",)
    assert set(basis.of_reason(Reason.GAUGE)) == {"gamma0", "b0", "alpha0", "d0", "theta0", "r0"}
    for name, terms in basis.regrouped_into.items():
        assert all(basis.regrouping[kept][name] == c for kept, c in terms.items())
    again = pickle.loads(pickle.dumps(basis))
    assert again.names == basis.names
    assert not again.factor.flags.writeable
    for part in ("14 identifiable parameters of 34", "d3: it is known", "theta0: the base pose"):
        assert part in str(basis)


# --- scale and place of evaluation -------------------------------------------------------------


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

    def fitted(size, prior):
        rows = [
            {"sigma": 0}, {"sigma": 0, "alpha": np.pi / 2, "d": size},
            {"sigma": 0, "d": 4.0 * size}, {"sigma": 0, "d": 3.0 * size, "alpha": 0.5, "r": size},
        ]  # fmt: skip
        arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
        T = rm.dgm(arm, q)
        T[:, :3, 3] += 1e-4 * size * noise
        result = calibration.fit(arm, Pose(q, T), prior=prior, folds=0, held_out=0)
        contact = identifiable_parameters(arm, "point_contact", known_lengths=["d3"])
        left = (rm.dgm(result.model, q) - T)[:, :3, 3] / size
        return result.names, contact.names, result.status, np.linalg.norm(left)

    scaled, default = calibration.ParameterPrior, calibration.ParameterPrior()
    for small, large, prior in (
        (1.0, 1e-6, scaled), (1.0, 1e6, scaled), (1e-6, 1e-3, default), (1e2, 1e5, default),
    ):  # fmt: skip
        sizes = (
            (size, prior if prior is default else prior(1e-3 * size)) for size in (small, large)
        )
        (*one, left), (*other, other_left) = (fitted(*each) for each in sizes)
        assert len(one[0]) == 22
        assert other == one
        assert other_left == pytest.approx(left, rel=1e-9)
