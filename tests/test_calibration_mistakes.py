"""Mistakes about measurements: each gets the sentence that names it, and nothing else does."""

import pickle

import numpy as np
import pytest
from calibration_arms import ALONE, Arm, distances

import robotmodels as rm
from robotmodels.calibration import (
    AxisPosition,
    CameraPose,
    Distance,
    FrameContact,
    KnownDistance,
    LaserLine,
    LinkedFrames,
    ParameterPrior,
    PlaneContact,
    PointContact,
    Pose,
    Position,
    RelativePose,
    calibrated_model,
    candidate_parameters,
    combine_arms,
    corrected_igm,
    fit,
    identifiable_parameters,
    joint_offsets,
    read_measurements,
    select_configurations,
)
from robotmodels.datasets import panda_double_socket
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError
from robotmodels.obstacles import Sphere

# --- bad input ------------------------------------------------------------------------------------

RX90 = rm.load("rx90")
Q4, Z, TWO = np.zeros((4, 6)), np.eye(4), [0, 0, 1, 1]
Q = np.random.default_rng(2).uniform(-1.5, 1.5, (30, 6))
STILL, T = np.tile(Z, (4, 1, 1)), rm.dgm(RX90, Q)
SEEN = Pose(Q, T)


def fitted(measurements=SEEN, model=RX90, **options):
    return fit(model, measurements, **{**ALONE, **options})


def selected(kind, count, **options):
    return select_configurations(RX90, kind, count, **options)


@pytest.mark.parametrize(
    ("match", "call"),
    [
        # measurements
        ("q: expected finite", lambda: FrameContact(Q4 * np.nan)),
        ("pose: expected a label for each of the 4", lambda: FrameContact(Q4, [0, 1])),
        ("has the point '2'; exp", lambda: PointContact(Q4, TWO, {2: Z[0, :3]})),
        ("expected a mapping", lambda: PointContact(Q4, known=[0.1, 0.2, 0.3])),
        (r"of length 2\. Divide", lambda: PlaneContact(Q4, known={0: [0, 0, 2, 0.4]})),
        ("axis: expected a direc", lambda: AxisPosition(Q4, 0.0, [0, 0, 0])),
        (r"positive lengths .* offset=True", lambda: Distance(Q4, -0.1)),
        ("not both", lambda: Distance(Q4, 0.1, Q4 + 1, pivot=[0] * 4)),
        (r"T: expected shape \(4, 4, 4\)", lambda: CameraPose(Q4, STILL[:2])),
        ("^T: ", lambda: RelativePose(Q4, Q4, 2 * STILL)),
        ("rows: expected 6 numbers", lambda: Pose(Q4, STILL, rows=[0] * 6)),
        ("an end other than 'a'", lambda: LinkedFrames(Q4, "a", "a")),
        ("a positive length", lambda: KnownDistance("a", "b", -1.0)),
        ("positive definite", lambda: LaserLine(Q4, covariance=np.diag([1, 0]))),
        # fits
        ("masses", lambda: fitted(model=rm.load("stanford_arm"), compliance="joints")),
        ("degrees", lambda: fitted(Position(np.rad2deg(Q), T[:, :3, 3]))),
        ("6 joints", lambda: fitted(Position(np.zeros((4, 7)), np.zeros((4, 3))))),
        ("expected one or more", lambda: fitted([])),
        ("Pose, Position", lambda: fitted([T])),
        ("^held_out", lambda: fitted(held_out=1.5)),
        ("^folds", lambda: fitted(folds=1)),
        ("ParameterPrior or None", lambda: fitted(prior="none")),
        ("^strength", lambda: fitted(
            Pose(Q4, T[:4]), parameters=["theta2"], prior=ParameterPrior(strength=None))),
        ("theta9.*near it: theta", lambda: fitted(parameters=["theta9"])),
        ("theta9.*near it: theta", lambda: fitted(prior=ParameterPrior(named={"theta9": 1.0}))),
        (r"contain no length.*known_lengths", lambda: fitted(PointContact(Q))),
        # identifiable and chosen ones
        (r"contain no length.*known_lengths=\('\w+',\).*d3", lambda: identifiable_parameters(
            rm.load("kr6_r900"), "plane_contact")),
        # an angle is no length, and a length of 0 shrinks to itself
        ("contain no length", lambda: identifiable_parameters(
            RX90, FrameContact, known_lengths=["theta2", "d5"])),
        ("the 0 parameters", lambda: selected("orientation", 6, candidates=Q, parameters=["d3"])),
        ("at least 5", lambda: selected("pose", 4, candidates=Q)),
        ("expected at most 30.*got 40", lambda: selected("pose", 40, candidates=Q)),
        ("^candidates", lambda: selected("pose", 10, candidates=Q[:, :5])),
        ("contain no length", lambda: selected("point_contact", 6, drawn=20, postures=2)),
        ("do not meet", lambda: selected("point_contact", 6, candidates=Q.reshape(10, 3, 6))),
        ("^optimise", lambda: selected("point_contact", 6, optimise=True)),
        ("at most 0", lambda: selected("pose", 6, drawn=20, obstacles=[Sphere([0, 0, 0], 5.0)])),
        ("^criterion", lambda: selected("pose", 6, criterion="O6")),
        ("^count", lambda: selected("pose", 0)),
        ("gain", lambda: selected("pose", 6, drawn=20, starts=1).enough(2.0)),
        ("^progress", lambda: selected("pose", 6, progress="bar")),
        ("kind: expected one of", lambda: selected(Q, 5)),
        # calibrated robots, and two robots
        ("none", lambda: joint_offsets(
            calibrated_model(candidate_parameters(RX90), np.zeros(34)), np.empty((0, 6)))),
        ("CalibratedRobot", lambda: corrected_igm(RX90, T)),
        ("two different texts", lambda: combine_arms(RX90, RX90, names=("a", "a"))),
        ("its gravity", lambda: combine_arms(RX90, RX90.with_gravity([0, 9.81, 0]))),
        ("base_b", lambda: combine_arms(RX90, RX90, 2 * Z)),
    ],
)  # fmt: skip
def test_mistakes_are_named(match, call):
    with pytest.raises((InvalidValueError, ShapeError, NotARotationError), match=match):
        call()


# --- wrong measurements, and too few of them ------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("prior", [None, ParameterPrior()])
@pytest.mark.parametrize("bad", [1, 2, 4])
def test_the_bad_rows_alone_are_outliers_under_squares(bad, prior):
    found = []
    for arm in map(Arm, range(6)):
        q = arm.readings(int(arm.rng.integers(30, 61)))
        p = arm.positions(q).p.copy()
        wrong = arm.rng.choice(len(q), bad, replace=False)
        way = arm.rng.normal(size=(bad, 3))
        p[wrong] += 0.02 * way / np.linalg.norm(way, axis=1, keepdims=True)
        result = fit(arm.nominal, Position(q, p), prior=prior, **ALONE)
        found.append((set(result.solution.fit.outliers.tolist()), set(wrong.tolist())))
    assert all(wrong <= listing for listing, wrong in found)
    # one fit in twenty lists another row by chance
    assert sum(listing == wrong for listing, wrong in found) >= 5


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("places", "lengths"), [(1, [0.051]), (3, [0.049, 0.055])])
def test_a_wrong_distance_is_contradicted_by_the_lengths_of_the_table(places, lengths, seed):
    arm = Arm(seed)
    touched, _ = arm.touches(places, 24 if places > 1 else 40, 0.05)
    first = sum(m.blocks for m in touched)

    def judged(lengths, **options):
        """The notes of known distances, and those that are outliers."""
        found = fit(arm.nominal, [*touched, *distances(lengths)], **ALONE, **options)
        notes = [n for n in found.notes if "known distance" in n and "prior allows" not in n]
        return notes, {*found.solution.fit.outliers} & {*range(first, first + places)}

    assert judged([0.05] * places) == ([], set())
    here = f"point:{places // 2}:0 to point:{places // 2}:1"
    all_of_them = here if places == 1 else f"{places} known distances"
    for length in lengths:
        every, one = [length] * places, [0.05] * places
        one[places // 2] = length
        # without a prior they alone give the scale, and nothing contradicts them
        assert judged(every, prior=None) == ([], set())
        assert judged(one)[1] == {first + places // 2}
        for wrong, subject in ((every, all_of_them), (one, here)):
            ((note,), _) = judged(wrong)
            assert f"{subject}: stated {1e3 * length:g} mm, but the other measurements" in note
            predicted = note.split(" predict ")[1].split(" mm")[0].split(" +- ")
            mean, error = map(float, predicted)
            assert abs(mean - 50.0) < 4.0 * error < (2.0 if places == 1 else 1.5)


# --- units, limits of joints, and files -----------------------------------------------------------


@pytest.mark.parametrize("kind", [Pose, Position])
def test_the_number_of_missing_measurements_counts_down_to_one(kind):
    arm = Arm(0)
    q, messages = arm.readings(40), []
    T = rm.dgm(arm.real, q)
    for n in range(2, 41):
        try:
            fit(arm.nominal, kind(q[:n], (T if kind is Pose else T[:, :3, 3])[:n]), **ALONE)
            break
        except InvalidValueError as error:
            messages.append(str(error))
    assert all("more configurations" in message for message in messages)
    assert "at least 1 more" in messages[-1]


FACTORS = [
    (1000.0, "these look like millimetres"),
    (1 / 0.0254, "these look like inches"),
    (10.0, "as if millimetres had been converted as centimetres"),
    (1e-3, "as if metres had been converted as millimetres"),
]


def seen_by(arm, q, factor):
    """Measurements of each kind with their lengths in another unit."""
    T = rm.dgm(arm.real, q)
    q_other, other, p = np.roll(q, 1, axis=0), np.roll(T, 1, axis=0), T[:, :3, 3]

    def scaled(T):
        return np.block([[T[:, :3, :3], factor * T[:, :3, 3:]], [T[:, 3:]]])

    return {
        "position": Position(q, factor * p),
        "pose": Pose(q, scaled(T)),
        "pivot": Distance(q, factor * np.linalg.norm(p - [0.5, 0.2, 1.0], axis=1)),
        "pair": Distance(q, factor * np.linalg.norm(p - other[:, :3, 3], axis=1), q_other),
        "camera": CameraPose(q, scaled(rm.se3.inverse(T) @ rm.se3.translation(1.0, 0.5, 0.2))),
        "relative": RelativePose(q, q_other, scaled(rm.se3.inverse(T) @ other)),
    }


@pytest.mark.sampled(4)
@pytest.mark.parametrize("kind", ["position", "pose", "pivot", "pair", "camera", "relative"])
@pytest.mark.parametrize(("factor", "sentence"), [*FACTORS, (1.0, ""), (1.5, "")])
def test_the_unit_of_lengths_is_named(kind, factor, sentence):
    arm = Arm(0)
    measured = seen_by(arm, arm.readings(25), factor)[kind]
    if not sentence:  # right lengths, or a scale that is wrong by another factor
        assert not any("look like" in x for x in fit(arm.nominal, measured, **ALONE).notes)
        return
    with pytest.raises(InvalidValueError, match=sentence) as caught:
        fit(arm.nominal, measured, **ALONE)
    assert f"multiply by {1.0 / factor:.4g}" in str(caught.value)


def test_the_unit_of_a_known_distance_is_named():
    arm = Arm(0)
    touched, _ = arm.touches(1, 40, 0.05)
    for factor, sentence in FACTORS[:3]:
        with pytest.raises(InvalidValueError, match=r"point:0:0 to point:0:1") as caught:
            fit(arm.nominal, [*touched, *distances([0.05 * factor])], **ALONE)
        assert sentence in str(caught.value)
        assert "Pass metres: 0.05" in str(caught.value)


LOWER, UPPER = np.array([-2, -2, -3, -3, -2, -0.1]), np.array([2, 2, 3, -0.1, 2, 3])
"""Limits of two joints that are on one side of zero, as those of many arms."""


@pytest.mark.parametrize("mistake", ["order", "sign", "degrees"])
def test_columns_beyond_the_limits_are_refused_before_any_fit(mistake):
    arm = Arm(0)
    q = arm.rng.uniform(LOWER, UPPER, (40, 6))
    p = arm.positions(q).p.copy()
    model = arm.nominal.with_table(arm.nominal.table.replace(lower=LOWER, upper=UPPER))
    order, signs = [0, 1, 2, 5, 4, 3], [1, 1, 1, -1, 1, 1]
    wrong = {"order": q[:, order], "sign": q * signs, "degrees": np.rad2deg(0.1 * q)}[mistake]
    with pytest.raises(InvalidValueError, match="beyond the limits of the joints") as caught:
        fit(model, Position(wrong, p), progress=lambda *_: pytest.fail("a fit"), **ALONE)
    assert "joint 4" in str(caught.value)
    q[3, 1] = UPPER[1] + 0.3
    (note,) = (n for n in fit(model, Position(q, p), **ALONE).notes if "beyond the limits" in n)
    assert "1 of 40 readings, by up to 0.3 rad" in note


def test_implausible_residuals_are_the_first_note_and_end_the_search_for_their_cause():
    arm = Arm(0)
    q = arm.readings(40)
    p = arm.positions(q).p.copy()
    wrong, right = fit(arm.nominal, Position(q, p[::-1])), fit(arm.nominal, Position(q, p))
    assert "% of the robot's size" in wrong.notes[0]
    assert not any("depend on the posture" in note for note in wrong.notes)
    assert not any("the residuals are" in note for note in right.notes)


def test_outliers_name_their_files_and_folders_with_poses_are_refused(tmp_path):
    data = panda_double_socket()
    header, files = ",".join(f"q{j}" for j in range(1, 8)), []
    (tmp_path / "front").mkdir()
    for hole, q in enumerate(data.places["front"]):
        bad = q.copy()
        bad[7, 3] += 0.04 * hole
        poses = rm.operational_coordinates(rm.dgm(data.model, q), "quaternion")
        for rows, name in ((bad, f"hole_{hole}"), (poses, f"hole_{hole}_pose")):
            files.append(tmp_path / "front" / f"{name}.csv")
            np.savetxt(files[-1], rows, delimiter=",", header=header, comments="")
    with pytest.raises(InvalidValueError, match="these are not readings of the joints") as caught:
        read_measurements(tmp_path / "front", "point_contact", data.model)
    assert "hole_1_pose.csv (" in str(caught.value)
    assert "hole_1.csv (" not in str(caught.value)
    measured = read_measurements(files[::2], "point_contact", data.model)
    assert measured.labels == ("hole_0", "hole_1")
    k = len(data.places["front"][0]) + 7
    for found, block in ((measured, k), (measured.subset(np.r_[k, :30, 40:60]), 0)):
        known = KnownDistance("point:hole_0", "point:hole_1", data.distance)
        result = pickle.loads(pickle.dumps(fit(data.model, [found, known], **ALONE)))
        assert result.solution.fit.outliers[0] == block
        (note,) = (n for n in result.notes if "outlier" in n)
        assert f"{block + 1} in front/hole_1.csv row 8" in note
