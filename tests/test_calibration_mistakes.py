"""Mistakes about measurements: each gets the sentence that names it, and nothing else does."""

import pickle
import re

import numpy as np
import pytest
from calibration_arms import ALONE, NOISE, Arm

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Pose,
    Position,
    fit,
    read_measurements,
    report,
)
from robotmodels.calibration.measurements import CameraPose, Distance, RelativePose
from robotmodels.datasets import panda_double_socket
from robotmodels.errors import InvalidValueError

# --- outliers under squares -----------------------------------------------------------------------


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


# --- known distances ------------------------------------------------------------------------------


def touching(arm, places, count=20):
    """Readings at which the real tool is at each of some places, and their labels."""
    q, labels = [], []
    for label, place in enumerate(places):
        T = np.tile(np.eye(4), (4 * count, 1, 1))
        T[:, :3, 3] = place + NOISE * arm.rng.normal(size=(len(T), 3))
        start = arm.readings(len(T))
        found = rm.igm_numeric(arm.real, T, q0=start, mask="position", rng=arm.rng)
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


def notes_of_distances(result):
    return [n for n in result.notes if "known distance" in n and "prior allows" not in n]


def prediction(note):
    """Predicted length and its standard error in a note, mm."""
    return (float(x) for x in note.split(" predict ")[1].split(" mm")[0].split(" +- "))


REACHED = [0, 2, 3, 4, 5, 7, 8, 9]
"""Seeds of arms that reach their points."""


@pytest.mark.sampled(3)
@pytest.mark.parametrize("seed", REACHED)
def test_a_wrong_distance_is_contradicted_by_the_lengths_of_the_table(seed):
    arm, touched = contacts(seed)
    assert between(0.05).sigma == pytest.approx(1e-4)
    right, wrong = (fit(arm.nominal, [touched, between(x)], **ALONE) for x in (0.05, 0.051))
    assert not notes_of_distances(right)
    assert touched.blocks not in right.solution.fit.outliers
    (note,) = notes_of_distances(wrong)
    assert (
        "point:0 to point:1: stated 51 mm, but the other measurements and the prior predict" in note
    )
    mean, error = prediction(note)
    assert abs(mean - 50.0) < 4.0 * error < 2.0
    assert wrong.solution.fit.outliers.tolist()[0] == touched.blocks
    # without a prior it alone gives the scale, and nothing contradicts it
    alone = fit(arm.nominal, [touched, between(0.051)], **ALONE, prior=None)
    assert not notes_of_distances(alone)
    assert touched.blocks not in alone.solution.fit.outliers


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", [0, 3, 7])
def test_a_wrong_length_at_every_place_and_at_one_place_are_distinguished(seed):
    arm = Arm(seed)
    q, labels = [], []
    while len(q) < 3:
        place = 0.8 * rm.dgm(arm.real, arm.readings(1))[0, :3, 3]
        there, at = touching(arm, [place, place + np.array([0.0, 0.03, 0.04])], 12)
        if len(there) == 24:
            labels += [2 * len(q) + k for k in at]
            q.append(there)
    touched = PointContact(np.concatenate(q), labels)

    def fitted(lengths):
        ends = ((f"point:{2 * k}", f"point:{2 * k + 1}") for k in range(3))
        known = [KnownDistance(*pair, x) for pair, x in zip(ends, lengths, strict=True)]
        return fit(arm.nominal, [touched, *known], **ALONE)

    assert not notes_of_distances(fitted([0.05] * 3))
    for length in (0.049, 0.055):
        (note,) = notes_of_distances(fitted([length, length + 1e-15, length]))
        assert note.startswith(f"3 known distances of {1e3 * length:g} mm: the other measurements")
        mean, error = prediction(note)
        assert abs(mean - 50.0) < 4.0 * error < 1.5
        one = fitted([0.05, length, 0.05])
        (note,) = notes_of_distances(one)
        assert f"point:2 to point:3: stated {1e3 * length:g} mm" in note
        assert touched.blocks + 1 in one.solution.fit.outliers
        assert touched.blocks not in one.solution.fit.outliers


# --- too few measurements -------------------------------------------------------------------------


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


# --- units ----------------------------------------------------------------------------------------

FACTORS = [
    (1000.0, "these look like millimetres"),
    (1 / 0.0254, "these look like inches"),
    (10.0, "as if millimetres had been converted as centimetres"),
    (1e-3, "as if metres had been converted as millimetres"),
]


def seen_by(kind, arm, q, factor):
    """Measurements of a kind with their lengths in another unit."""
    T = rm.dgm(arm.real, q)
    scaled = T.copy()
    scaled[:, :3, 3] *= factor
    if kind == "position":
        return Position(q, scaled[:, :3, 3])
    if kind == "pose":
        return Pose(q, scaled)
    if kind == "pivot":
        return Distance(q, factor * np.linalg.norm(T[:, :3, 3] - [0.5, 0.2, 1.0], axis=1))
    if kind == "pair":
        apart = T[:, :3, 3] - np.roll(T[:, :3, 3], 1, axis=0)
        return Distance(q, factor * np.linalg.norm(apart, axis=1), np.roll(q, 1, axis=0))
    seen = rm.se3.inverse(T) @ rm.se3.translation(1.0, 0.5, 0.2)
    if kind == "relative":
        seen = rm.se3.inverse(T) @ np.roll(T, 1, axis=0)
    seen[:, :3, 3] *= factor
    return CameraPose(q, seen) if kind == "camera" else RelativePose(q, np.roll(q, 1, 0), seen)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("kind", ["position", "pose", "pivot", "pair", "camera", "relative"])
@pytest.mark.parametrize(("factor", "sentence"), [*FACTORS, (1.0, ""), (1.5, "")])
def test_the_unit_of_lengths_is_named(kind, factor, sentence):
    arm = Arm(0)
    measured = seen_by(kind, arm, arm.readings(25), factor)
    if not sentence:  # right lengths, or a scale that is wrong by another factor
        assert not any("look like" in x for x in fit(arm.nominal, measured, **ALONE).notes)
        return
    with pytest.raises(InvalidValueError, match=sentence) as caught:
        fit(arm.nominal, measured, **ALONE)
    assert f"multiply by {1.0 / factor:.4g}" in str(caught.value)


def test_the_unit_of_a_known_distance_is_named():
    arm, touched = contacts(0)
    for factor, sentence in FACTORS[:3]:
        with pytest.raises(InvalidValueError, match=r"point:0 to point:1") as caught:
            fit(arm.nominal, [touched, between(0.05 * factor)], **ALONE)
        assert sentence in str(caught.value)
        assert "Pass metres: 0.05" in str(caught.value)


# --- limits of joints -----------------------------------------------------------------------------


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


# --- notes ----------------------------------------------------------------------------------------


def test_implausible_residuals_are_the_first_note_and_end_the_search_for_their_cause():
    arm = Arm(0)
    q = arm.readings(40)
    p = arm.positions(q).p.copy()
    wrong, right = fit(arm.nominal, Position(q, p[::-1])), fit(arm.nominal, Position(q, p))
    assert re.match(r"position: the residuals are \d+ % of the robot's size", wrong.notes[0])
    assert not any("depend on the posture" in note for note in wrong.notes)
    assert "another tool" not in report(wrong)
    assert not any("the residuals are" in note for note in right.notes)


# --- files and the command line -------------------------------------------------------------------


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Two sockets at two places of a real arm: its URDF, files with a bad row, and poses."""
    data = panda_double_socket()
    folder = tmp_path_factory.mktemp("places")
    urdf = folder / "panda.urdf"
    urdf.write_text(rm.model.to_urdf(data.model))
    files, header = [], ",".join(f"q{j}" for j in range(1, 8))
    for place in ("front", "right"):
        (folder / place).mkdir()
        for hole, q in enumerate(data.places[place]):
            bad = q.copy()
            bad[7, 3] += 0.04 * (place == "front" and hole == 1)
            files.append(folder / place / f"hole_{hole}.csv")
            np.savetxt(files[-1], bad, delimiter=",", header=header, comments="")
            poses = rm.operational_coordinates(rm.dgm(data.model, q), "quaternion")
            named = folder / place / f"hole_{hole}_pose.csv"
            np.savetxt(named, poses, delimiter=",", header=header, comments="")
    return data, urdf, files


def test_a_folder_that_also_holds_poses_is_not_read_as_readings(places):
    data, _, files = places
    folder = files[0].parent
    with pytest.raises(InvalidValueError, match="these are not readings of the joints") as caught:
        read_measurements(folder, "point_contact", data.model)
    assert "hole_1_pose.csv (" in str(caught.value)
    assert "hole_1.csv (" not in str(caught.value)
    found = read_measurements(folder, "point_contact", data.model, pattern="hole_?.csv")
    assert found.labels == ("hole_0", "hole_1")


def test_outliers_name_their_files_and_rows(places):
    data, _, files = places
    measured = read_measurements(files[:2], "point_contact", data.model)
    k = len(data.places["front"][0]) + 7
    for found, block in ((measured, k), (measured.subset(np.r_[k, :30, 40:60]), 0)):
        known = KnownDistance("point:hole_0", "point:hole_1", data.distance)
        result = pickle.loads(pickle.dumps(fit(data.model, [found, known], **ALONE)))
        assert result.solution.fit.outliers[0] == block
        (note,) = (n for n in result.notes if "outlier" in n)
        assert f"{block + 1} in front/hole_1.csv row 8" in note
        text = report(result)
        assert "Read for point: front/hole_" in text
        assert re.search(rf"│ +{block + 1} │ +front/hole_1\.csv │ +8 │", text)


# --- markers --------------------------------------------------------------------------------------
