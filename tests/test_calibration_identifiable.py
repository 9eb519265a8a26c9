"""Which geometric parameters can be told, structurally and from data, and how they regroup."""

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
    identifiable_on,
)
from robotmodels.calibration.identifiable import (
    DEPENDENT,
    identifiability_change,
    identifiable_parameters,
)
from robotmodels.calibration.measurements.kinds import Kind, as_kind, drawn_groups
from robotmodels.errors import InvalidValueError

ANGLES = [0.0, np.pi / 2, -np.pi / 2, np.pi, 0.4]


def serial(rng, R, P, special):
    """A serial arm of R revolute and P prismatic joints in any order; special: many right angles,
    parallel and intersecting axes, lengths of zero, but no axis that coincides with another.
    """
    n = R + P
    sigma = rng.permutation([0] * R + [1] * P)

    def angle():
        return rng.choice(ANGLES) if special else rng.uniform(-3, 3)

    def length():
        return rng.choice([0.0, 0.3, -0.2]) if special else rng.uniform(-0.5, 0.5)

    alpha = np.array([angle() for _ in range(n)])
    d = np.array([length() for _ in range(n)])
    d[(np.abs(np.sin(alpha)) < 0.01) & (d == 0.0)] = 0.25
    table = rm.DHTable(
        antecedent=np.arange(n),
        sigma=sigma,
        alpha=alpha,
        d=d,
        theta=[angle() for _ in range(n)],
        r=[length() for _ in range(n)],
        lower=np.where(sigma == 0, -2.5, -0.4),
        upper=np.where(sigma == 0, 2.0, 0.5),
    )
    return rm.RobotModel.from_table(table, base=random_pose(rng), tool=random_pose(rng, 0.3))


def rank_of(W):
    """Rank by singular values of unit columns, with the gap that makes it sure."""
    length = np.linalg.norm(W, axis=0)
    W = W[:, length > 1e-9 * length.max()]
    s = np.linalg.svd(W / np.linalg.norm(W, axis=0), compute_uv=False)
    s = np.append(s, 0.0) / s[0]
    rank = int((s > 1e-9).sum())
    return rank, s[rank - 1], s[rank]


def spread(model, rng, N):
    from robotmodels.kinematics.lengths import spread_configurations

    return spread_configurations(model, N, rng)


# --- counts ------------------------------------------------------------------------------------


@pytest.mark.parametrize("special", [False, True])
@pytest.mark.parametrize(("R", "P"), [(6, 0), (3, 3), (2, 1), (0, 3), (7, 0), (1, 0)])
def test_full_poses_tell_four_for_a_revolute_two_for_a_prismatic_joint_and_six(R, P, special):
    rng = np.random.default_rng(100 * R + P + 7 * special)
    for _ in range(2):
        found = identifiable_parameters(serial(rng, R, P, special), Kind.POSE)
        assert found.count == 4 * R + 2 * P + 6
        assert found.gap[1] < 1e-9 < 1e-4 < found.gap[0]


def test_the_formula_supposes_that_no_two_consecutive_revolute_axes_coincide():
    # an axis beside the one before has no direction for its common perpendicular: d and theta are
    # polar coordinates at their pole, and the table lacks one displacement
    rng = np.random.default_rng(2)
    model = serial(rng, 6, 0, False)
    for row in (2, 4):
        alpha, d = model.table.alpha.copy(), model.table.d.copy()
        alpha[row], d[row] = 0.0, 0.0
        before = identifiable_parameters(model, Kind.POSE).count
        model = model.with_table(model.table.replace(alpha=alpha, d=d))
        assert identifiable_parameters(model, Kind.POSE).count == before - 1


def test_ur10_has_thirty():
    assert identifiable_parameters(rm.load("erd:ur10"), Pose).count == 30
    assert identifiable_parameters(rm.load("ur10e"), "pose").count == 30


@pytest.mark.parametrize("chunk", range(10))
def test_counts_equal_the_rank_of_the_singular_values_on_random_robots(chunk):
    rng = np.random.default_rng(chunk)
    for k in range(10):
        # every structure: f from 1 to 7, parallel axes, zero lengths, rotated bases
        options = {
            "tree": bool(k % 2), "fixed": k % 3 == 0, "prismatic": k % 4 != 1,
            "passive": k % 5 == 0, "limits": k % 2 == 0, "tip": "any" if k % 2 else None,
        }  # fmt: skip
        model = random_model(rng, f=int(rng.integers(1, 8)), inertia=None, **options)
        laws = {"gains": k % 3 == 1, "eccentricity": k % 5 == 2}
        candidates = candidate_parameters(model, **laws)
        for rows in (slice(0, 6), slice(0, 3)):
            q = spread(model, rng, 150)
            T, psi = differential_model(candidates, q)
            kind = Pose(q, T) if rows.stop == 6 else Position(q, T[:, :3, 3])
            found = identifiable_on(candidates, [kind])
            rank, last, next_ = rank_of(psi[:, rows].reshape(-1, len(candidates)))
            assert found.count == rank, (model, last, next_, found.gap)


@pytest.mark.parametrize("name", ["rx90", "puma560", "ur10e", "panda", "stanford_arm"])
def test_point_contacts_tell_the_rank_of_differences_within_each_group(name):
    model = rm.load(name)
    candidates = candidate_parameters(model)
    known = "d3" if name in ("rx90", "ur10e", "puma560") else "r3" if name == "panda" else "r2"
    found = identifiable_parameters(model, "point contact", known_lengths=[known])
    rng = np.random.default_rng(5)
    q, label = drawn_groups(candidates, Kind.POINT_CONTACT, 25, 6, rng, limits=False)
    T, psi = differential_model(candidates, q)
    same = label[1:] == label[:-1]
    assert np.abs(np.diff(T[:, :3, 3], axis=0)[same]).max() < 1e-11
    keep = [k for k, e in enumerate(candidates.entries) if e.row > 0 and e.name != known]
    W = np.diff(psi[:, :3], axis=0)[same].reshape(-1, len(candidates))[:, keep]
    assert found.count == rank_of(W)[0]
    # with the known length free the scale is one more direction that nothing shows
    keep.append(candidates.names.index(known))
    W = np.diff(psi[:, :3], axis=0)[same].reshape(-1, len(candidates))[:, keep]
    assert found.count == rank_of(W)[0]


# --- regrouping --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_regrouped_parameters_move_the_end_as_all_of_them_do(seed):
    rng = np.random.default_rng(seed)
    model = random_model(
        rng, f=6, inertia=None, tree=seed % 2 == 1, fixed=seed % 3 == 0, limits=False
    )
    found = identifiable_parameters(model, Kind.POSE, gains=seed % 4 == 0)
    q = spread(model, np.random.default_rng(seed + 50), 40)
    all_, kept = (differential_model(p, q).psi for p in (found.candidates, found.kept))
    d = rng.normal(size=len(found.candidates))
    moved = all_ @ d
    assert np.abs(moved - kept @ (found.matrix @ d)).max() < DEPENDENT * np.abs(moved).max()


def test_the_regrouping_of_contacts_holds_up_to_the_touched_point():
    model = rm.load("puma560")
    found = identifiable_parameters(model, Kind.POINT_CONTACT, known_lengths=["d3"])
    groups = drawn_groups(found.candidates, Kind.POINT_CONTACT, 9, 5, np.random.default_rng(9))
    q, label = groups
    d = np.random.default_rng(0).normal(size=len(found.candidates))
    stays = [k for k, name in enumerate(found.candidates.names)
             if found.reasons.get(name) in (Reason.GAUGE, Reason.KNOWN)]  # fmt: skip
    d[stays] = 0.0
    whole = differential_model(found.candidates, q).psi[:, :3] @ d
    part = differential_model(found.kept, q).psi[:, :3] @ (found.matrix @ d)
    left = whole - part
    for g in range(groups.count):
        assert np.abs(left[label == g] - left[label == g].mean(axis=0)).max() < 1e-10


def test_what_is_kept_left_out_and_regrouped_are_all_candidates_once():
    found = identifiable_parameters(rm.load("rx90"), Kind.POINT_CONTACT, known_lengths=["d3"])
    assert sorted([*found.names, *found.reasons]) == sorted(found.candidates.names)
    assert found.of_reason(Reason.KNOWN) == ("d3",)
    assert set(found.of_reason(Reason.GAUGE)) == {"gamma0", "b0", "alpha0", "d0", "theta0", "r0"}
    for name, terms in found.regrouped_into.items():
        assert all(found.regrouping[kept][name] == c for kept, c in terms.items())
    assert len(found.factor) == found.count
    again = pickle.loads(pickle.dumps(found))
    assert again.names == found.names
    assert not again.factor.flags.writeable


def test_it_prints_what_is_told_and_what_is_not():
    text = str(identifiable_parameters(rm.load("rx90"), Kind.POINT_CONTACT, known_lengths=["d3"]))
    headings = ("Not identifiable", "Gauge", "Only in combination", "acts like", "stands for")
    for part in ("14 identifiable parameters of 34", *headings, "(it is known and fixed):\n  d3"):
        assert part in text


def test_the_wrist_centre_says_nothing_about_the_wrist():
    found = identifiable_parameters(rm.load("rx90"), Position)
    assert {"theta4", "theta5", "theta6"} <= set(found.of_reason(Reason.NO_EFFECT))
    assert found.count == 21


def test_orientation_alone_tells_no_length():
    found = identifiable_parameters(rm.load("rx90"), "orientation", known_lengths=["d3"])
    lengths = {e.name for e in found.candidates.entries if e.element.is_length}
    assert not lengths & set(found.names)
    assert found.count == 2 * 6 + 3  # directions of six axes, turn of the tool


# --- scale -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [Kind.POINT_CONTACT, Kind.FRAME_CONTACT, Kind.PLANE_CONTACT])
def test_contacts_without_a_known_length_are_refused_with_names(kind):
    with pytest.raises(InvalidValueError, match=r"know no length.*known_lengths=\('\w+',\).*d3"):
        identifiable_parameters(rm.load("kr6_r900"), kind)
    with pytest.raises(InvalidValueError, match="know no length"):
        # an angle is no length, and a length of 0 shrinks to itself
        identifiable_parameters(rm.load("rx90"), kind, known_lengths=["theta2", "d5"])
    with pytest.raises(InvalidValueError, match="d33"):
        identifiable_parameters(rm.load("rx90"), kind, known_lengths=["d33"])


def test_points_measured_as_well_give_the_scale_and_the_place():
    model = rm.load("rx90")
    both = identifiable_parameters(model, [Kind.POINT_CONTACT, Kind.POSITION])
    alone = identifiable_parameters(model, Kind.POSITION)
    assert both.count == alone.count
    assert not both.of_reason(Reason.GAUGE)


# --- where it is judged ------------------------------------------------------------------------


def test_what_small_deviations_show_is_said_in_a_sentence():
    model = rm.load("rx90")
    nominal = identifiable_parameters(model, Kind.POSITION)
    solved = identifiable_parameters(model, Kind.POSITION, deviation={"d7": 1e-3})
    change = identifiability_change(nominal, solved)
    assert not change.is_same
    assert "theta5" in change.gained
    assert str(change).startswith("21 parameters were identifiable, now ")
    back = identifiability_change(solved, nominal)
    assert back.lost == change.gained
    assert "it does not change what is measured" in str(back)
    same = identifiability_change(nominal, nominal)
    assert same.is_same
    assert str(same) == "The same 21 parameters are identifiable in both."
    with pytest.raises(InvalidValueError, match="same candidate"):
        identifiability_change(nominal, identifiable_parameters(model, Kind.POSE, base=False))


def test_contacts_are_judged_where_the_deviating_robot_meets_them():
    model = rm.load("ur10e")
    rng = np.random.default_rng(3)
    candidates = candidate_parameters(model)
    xi = 1e-3 * rng.normal(size=len(candidates)) * (candidates.rows > 0)
    q, label = drawn_groups(candidates, Kind.POINT_CONTACT, 14, 8, rng, deviation=xi, limits=False)
    T = differential_model(candidates, q, xi).T
    assert np.abs(np.diff(T[:, :3, 3], axis=0)[np.diff(label) == 0]).max() < 1e-11
    nominal = identifiable_parameters(model, Kind.POINT_CONTACT, known_lengths=["d3"])
    solved = identifiable_parameters(model, Kind.POINT_CONTACT, known_lengths=["d3"], deviation=xi)
    # the readings of one robot violate the contacts of the other by millimetres: where that was
    # not seen, directions that nothing shows would be counted
    on_data = identifiable_parameters(
        model, PointContact(q, label), known_lengths=["d3"], deviation=xi
    )
    at_nominal = identifiable_parameters(model, PointContact(q, label), known_lengths=["d3"])
    assert on_data.count == solved.count
    assert at_nominal.count == nominal.count


def test_data_tell_no_more_than_the_structure():
    model = rm.load("puma560")
    rng = np.random.default_rng(1)
    structure = identifiable_parameters(model, Kind.POSE)
    q = spread(model, rng, 50)
    assert identifiable_parameters(model, Pose(q, rm.dgm(model, q))).names == structure.names
    q[:, 4:] = 0.3  # two joints at rest
    still = identifiable_parameters(model, Pose(q, rm.dgm(model, q)))
    assert still.count < structure.count
    assert identifiability_change(structure, still).lost
    few = q[:3]
    assert identifiable_parameters(model, Pose(few, rm.dgm(model, few))).count <= 18


def test_subsets_of_parameters_and_known_ones():
    model = rm.load("rx90")
    some = ["theta2", "theta3", "d3", "r4"]
    found = identifiable_parameters(model, Kind.POSE, parameters=some)
    assert found.names == ("theta2", "theta3", "d3", "r4")
    found = identifiable_parameters(model, Kind.POSE, known=["theta2"])
    assert found.of_reason(Reason.KNOWN) == ("theta2",)
    assert found.count == 29
    bare = identifiable_parameters(model, Kind.POSE, base=False, tool=False)
    assert all(1 <= row <= 6 for row in bare.candidates.rows)


# --- mistakes ----------------------------------------------------------------------------------


def test_mistakes_are_named():
    model = rm.load("rx90")
    with pytest.raises(InvalidValueError, match="pose"):
        identifiable_parameters(model, "laser tracker")
    with pytest.raises(InvalidValueError, match="got none"):
        identifiable_parameters(model, [])
    with pytest.raises(InvalidValueError, match="another robot"):
        identifiable_parameters(model, "pose", parameters=candidate_parameters(rm.load("puma560")))
    one = serial(np.random.default_rng(0), 1, 0, False)
    with pytest.raises(InvalidValueError, match="two postures"):
        identifiable_parameters(one, Kind.POINT_CONTACT, known_lengths=["r1"])
    wrist = rm.RobotModel.from_table(
        rm.DHTable.from_rows([{"sigma": 0}, {"sigma": 0, "alpha": 1}, {"sigma": 0, "alpha": -1}])
    )
    with pytest.raises(InvalidValueError, match="would do here: none"):
        identifiable_parameters(wrist, Kind.POINT_CONTACT)
    assert as_kind("point-contact") is as_kind(PointContact) is Kind.POINT_CONTACT


@pytest.mark.parametrize("unit", [1e-6, 1e-4, 1e-2, 1e2, 1e4, 1e6])
def test_the_unit_of_length_does_not_tell_what_is_identifiable(unit):
    rng = np.random.default_rng(3)
    q, noise = rng.uniform(-1.0, 1.0, (30, 4)), rng.normal(size=(30, 3))

    def found(size):
        rows = [
            {"sigma": 0}, {"sigma": 0, "alpha": np.pi / 2, "d": size},
            {"sigma": 0, "d": 4.0 * size}, {"sigma": 0, "d": 3.0 * size, "alpha": 0.5, "r": size},
        ]  # fmt: skip
        arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
        there = rm.dgm(arm, q)
        there[:, :3, 3] += 1e-4 * size * noise
        prior = calibration.ParameterPrior(length=1e-3 * size)
        options = {"prior": prior, "folds": 0, "held_out": 0}
        measured = calibration.fit(arm, Pose(q, there), **options)
        exact = calibration.fit(arm, Pose(q, rm.dgm(arm, q)), **options)
        contact = identifiable_parameters(arm, "point_contact", known_lengths=["d3"])
        return measured, exact.status, contact.names

    one, exact, contact = found(1.0)
    other, other_exact, other_contact = found(unit)
    assert len(one.names) == 22
    assert other.names == one.names
    assert other_contact == contact
    assert (other_exact, other.status) == (exact, one.status)
    rms = other.after.summary("m").rms / unit
    assert rms == pytest.approx(one.after.summary("m").rms, rel=1e-9)
