"""Mistakes about measurements: each gets the sentence that names it, and nothing else does."""

import pickle

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
    read_measurements,
    report,
)
from robotmodels.calibration.measurements import CameraPose, Distance, RelativePose
from robotmodels.datasets import panda_double_socket
from robotmodels.errors import InvalidValueError, ShapeError
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


@pytest.mark.sampled(2)
@pytest.mark.parametrize("prior", [None, ParameterPrior()])
@pytest.mark.parametrize("bad", [1, 2, 4])
def test_the_bad_rows_alone_are_outliers_under_squares(bad, prior):
    found = [listed(Arm(seed), bad, prior) for seed in range(6)]
    assert all(wrong <= listing for listing, wrong in found)
    # one fit in twenty lists another row by chance
    assert sum(listing == wrong for listing, wrong in found) >= 5


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["pose", "contact"])
def test_the_bad_row_alone_is_an_outlier_among_poses_and_contacts(kind):
    hits = alone = 0
    for seed in REACHED:
        if kind == "pose":
            arm = Arm(seed)
            q = arm.readings(40)
            T = rm.dgm(arm.real, q)
            T[:, :3, 3] += 1e-4 * arm.rng.normal(size=(40, 3))
            turns = [rm.se3.from_rpy(rpy) for rpy in 2e-4 * arm.rng.normal(size=(40, 3))]
            T[:, :3, :3] @= np.array(turns)[:, :3, :3]
            T[7, :3, 3] += 0.02 * np.array([0.6, 0.0, 0.8])
            measured = [Pose(q, T)]
        else:
            arm, touched = contacts(seed)
            q = touched.q.copy()
            slip = rm.jacobian(arm.real, q[7])[:3]
            q[7] += np.linalg.pinv(slip, rcond=0.1) @ [0.012, 0.0, 0.016]
            measured = [PointContact(q, touched.label), between(0.05)]
        found = fit(arm.nominal, measured, **ALONE).solution.fit.outliers.tolist()
        hits += 7 in found
        alone += found == [7]
    assert hits == len(REACHED)
    assert alone >= len(REACHED) - 1


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


@pytest.mark.parametrize("seed", REACHED[:3])
def test_the_wrong_one_of_two_distances_is_named(seed):
    arm, touched = contacts(seed, [(0.0, 0.03, 0.04), (0.2, 0.0, 0.0)])
    stated = [touched, between(0.05), between(0.21, 2)]
    result = fit(arm.nominal, stated, **ALONE)
    (note,) = notes_of_distances(result)
    assert "point:0 to point:2: stated 210 mm" in note
    assert touched.blocks + 1 in result.solution.fit.outliers
    assert touched.blocks not in result.solution.fit.outliers
    # without anything else either may be wrong
    (note,) = notes_of_distances(fit(arm.nominal, stated, prior=None, **ALONE))
    assert "is wrong" in note
    assert "point:0 to point:1" in note
    assert "point:0 to point:2" in note


@pytest.mark.parametrize("seed", REACHED[:2])
def test_the_prediction_of_a_wrong_distance_uses_the_other_distances(seed):
    # without these the scale is uncertain by more than the mistake
    arm, touched = contacts(seed, [(0.0, 0.3, 0.0), (0.2, 0.0, 0.0)])
    known = [between(0.3007), between(0.2, 2), KnownDistance("point:1", "point:2", 0.13**0.5)]
    (note,) = notes_of_distances(fit(arm.nominal, [touched, *known], **ALONE))
    mean, error = prediction(note)
    stated = int(note.split("a difference of ")[1].split()[0])
    assert stated >= 3
    assert abs(mean - 300.0) < 3.0 * error
    assert stated == pytest.approx((300.7 - mean) / np.hypot(error, 0.1), abs=0.6)


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


@pytest.mark.parametrize("robot", ["panda_1", "panda_2"])
@pytest.mark.nightly
def test_a_real_arm_contradicts_51_for_50(robot):
    data = panda_double_socket(robot)
    touched = {
        place: PointContact(np.concatenate(pair), np.repeat([0, 1], [*map(len, pair)]), name=place)
        for place, pair in data.places.items()
    }

    def fitted(length, places):
        known = [KnownDistance(f"{p}:0", f"{p}:1", length) for p in places]
        return fit(data.model, [*(touched[p] for p in places), *known], **ALONE)

    assert not notes_of_distances(fitted(data.distance, touched))
    wrong = fitted(data.distance + 1e-3, touched)
    (note,) = notes_of_distances(wrong)
    assert note.startswith(f"{len(touched)} known distances of 51 mm")
    # the prior of lengths was widened to suit them
    (widened,) = (n for n in wrong.notes if "prior allows" in n)
    assert ("of lengths" in widened) == widened.endswith("Check the known distances.")
    assert robot != "panda_1" or "of lengths" in widened
    for place in touched if robot == "panda_1" else ():
        assert not notes_of_distances(fitted(data.distance, [place]))
        assert len(notes_of_distances(fitted(data.distance + 1e-3, [place]))) == 1


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


@pytest.mark.parametrize("kind", ["pose", "position", "distance", "contact"])
def test_the_number_of_missing_measurements_counts_down_to_one(kind):
    arm, first = measured_by(kind, 0)
    messages = []
    for n in range(4, 41):
        try:
            fit(arm.nominal, first(n), **ALONE)
            break
        except InvalidValueError as error:
            messages.append(str(error))
    assert all("more configurations" in message for message in messages)
    assert "at least 1 more" in messages[-1]


# --- units ----------------------------------------------------------------------------------------

FACTORS = [
    (1000.0, "these look like millimetres"), (100.0, "these look like centimetres"),
    (1 / 0.0254, "these look like inches"),
    (25.4, "as if millimetres had been converted as inches"),
    (10.0, "as if millimetres had been converted as centimetres"),
    (0.1, "as if centimetres had been converted as millimetres"),
    (1 / 25.4, "as if inches had been converted as millimetres"),
    (1e-3, "as if metres had been converted as millimetres"),
]  # fmt: skip
TENFOLD = [
    (10.0, "0.5 m is ten times too long: a misplaced decimal point, or mm for cm"),
    (0.1, "0.005 m is ten times too short: a misplaced decimal point, or cm for mm"),
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


KINDS = ["position", "pose", "pivot", "pair", "camera", "relative"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("factor", "sentence"), [*FACTORS, (1.0, ""), (1.5, "")])
@pytest.mark.nightly
def test_the_unit_of_lengths_is_named(kind, factor, sentence):
    for seed in range(2):
        arm = Arm(seed)
        measured = seen_by(kind, arm, arm.readings(25), factor)
        if not sentence:  # right lengths, or a scale that is wrong by another factor
            assert not any("look like" in x for x in fit(arm.nominal, measured, **ALONE).notes)
            continue
        with pytest.raises(InvalidValueError, match=sentence) as caught:
            fit(arm.nominal, measured, **ALONE)
        assert f"multiply by {1.0 / factor:.4g}" in str(caught.value)


@pytest.mark.parametrize("prior", [None, ParameterPrior()])
@pytest.mark.parametrize(("factor", "sentence"), FACTORS[:3] + TENFOLD)
def test_the_unit_of_a_known_distance_is_named(factor, sentence, prior):
    for seed in (0, 3, 9):
        arm, touched = contacts(seed)
        with pytest.raises(InvalidValueError, match=r"point:0 to point:1") as caught:
            fit(arm.nominal, [touched, between(0.05 * factor)], prior=prior, **ALONE)
        assert sentence in str(caught.value)
        assert "Pass metres: 0.05" in str(caught.value)


@pytest.mark.parametrize(
    ("factor", "lengths", "advice"),
    [
        (1e3, "m", "like millimetres. Use lengths='mm'"),
        (1.0, "mm", "like metres. Use lengths='m'"),
        (1e2, "mm", "like centimetres. Multiply them by 10"),
        (1e3, "mm", None),
    ],
)  # fmt: skip
def test_the_unit_of_a_file_is_named(tmp_path, factor, lengths, advice):
    arm = Arm(1)
    q = arm.readings(20)
    rows = np.hstack([q, factor * arm.positions(q)])
    file = tmp_path / "tracker.csv"
    np.savetxt(file, rows, delimiter=",", header="q1,q2,q3,q4,q5,q6,x,y,z", comments="")
    if advice is None:
        assert read_measurements(file, "position", arm.nominal, lengths=lengths).blocks == 20
        return
    with pytest.raises(InvalidValueError, match=advice):
        read_measurements(file, "position", arm.nominal, lengths=lengths)


# --- limits of joints -----------------------------------------------------------------------------


def limited(arm, lower, upper):
    table = arm.nominal.table
    return arm.nominal.with_table(table.replace(lower=lower, upper=upper))


LOWER, UPPER = np.array([-2, -2, -3, -3, -2, -0.1]), np.array([2, 2, 3, -0.1, 2, 3])
"""Limits of two joints that are on one side of zero, as those of many arms."""


def within_limits(arm, count=40):
    return arm.rng.uniform(LOWER, UPPER, (count, 6))


@pytest.mark.parametrize("mistake", ["order", "sign", "degrees"])
def test_columns_beyond_the_limits_are_refused_before_any_fit(mistake):
    arm = Arm(0)
    q = within_limits(arm)
    p = arm.positions(q)
    model = limited(arm, LOWER, UPPER)
    fit(model, Position(q, p), **ALONE)
    wrong = {
        "order": q[:, [0, 1, 2, 5, 4, 3]], "sign": q * [1, 1, 1, -1, 1, 1],
        "degrees": np.rad2deg(0.1 * q),
    }[mistake]  # fmt: skip
    with pytest.raises(InvalidValueError, match="beyond the limits of the joints") as caught:
        fit(model, Position(wrong, p), progress=lambda *_: pytest.fail("a fit"), **ALONE)
    assert "joint 4" in str(caught.value)
    assert "order of the joints, with the signs and zeros" in str(caught.value)


@pytest.mark.nightly
def test_a_few_readings_beyond_the_limits_are_a_note():
    arm = Arm(0)
    q = within_limits(arm)
    q[3, 1] = UPPER[1] + 0.3
    model = limited(arm, LOWER, UPPER)
    result = fit(model, Position(q, arm.positions(q)), **ALONE)
    (note,) = (note for note in result.notes if "beyond the limits" in note)
    assert "joint 2" in note
    assert "1 of 40 readings, by up to 0.3 rad" in note
    assert note in report(result).replace("\n", " ") or "beyond the limits" in report(result)
    # a zero that is off by a degree is no news, and without limits there is nothing to say
    q[3, 1] = UPPER[1] + 0.017
    p = arm.positions(q)
    assert not any("beyond" in n for n in fit(model, Position(q, p), **ALONE).notes)
    q[:, 1] += 10.0
    assert not any("beyond" in n for n in fit(arm.nominal, Position(q, p), **ALONE).notes)


# --- files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def socket(tmp_path_factory):
    """A folder with readings of two sockets beside poses that a controller believed in."""
    data = panda_double_socket()
    folder = tmp_path_factory.mktemp("data") / "front"
    folder.mkdir()
    for hole, q in enumerate(data.places["front"]):
        np.savetxt(folder / f"hole_{hole}.csv", q, delimiter=",")
        T = rm.dgm(data.model, q)
        kind = rm.kinematics.OrientationKind.QUATERNION
        poses = rm.operational_coordinates(T, kind)
        np.savetxt(folder / f"hole_{hole}_pose.csv", poses, delimiter=",")
    return data, folder


@pytest.mark.parametrize("limits", [True, False])
def test_a_folder_that_also_holds_poses_is_not_read_as_readings(socket, limits):
    data, folder = socket
    model = data.model
    if not limits:
        far = np.full(model.n, np.inf)
        model = model.with_table(model.table.replace(lower=-far, upper=far))
    with pytest.raises(InvalidValueError, match="these are not readings of the joints") as caught:
        read_measurements(folder, "point_contact", model)
    for said in ("hole_0.csv, hole_0_pose.csv", "hole_1_pose.csv (", "pattern='*.csv'"):
        assert said in str(caught.value)
    assert "hole_1.csv (" not in str(caught.value)
    found = read_measurements(folder, "point_contact", model, pattern="hole_?.csv")
    assert found.labels == ("hole_0", "hole_1")


def test_the_files_read_are_listed(socket):
    data, folder = socket
    found = read_measurements(folder, "point_contact", data.model, pattern="hole_?.csv")
    listed = "front/hole_0.csv (30 rows), front/hole_1.csv (32 rows)"
    assert ", ".join(str(file) for file in found.files) == listed
    known = KnownDistance("front:hole_0", "front:hole_1", data.distance)
    result = fit(data.model, [found, known], prior=ParameterPrior(), **ALONE)
    assert f"Read for front: {listed}." in report(result)
    assert f"Read for front: {listed}." in report(pickle.loads(pickle.dumps(result)))
    touched = PointContact(found.q, found.label, name="front")
    by_hand = fit(data.model, [touched, known], prior=ParameterPrior(), **ALONE)
    assert "Read for" not in report(by_hand)
    assert np.array_equal(by_hand.values, result.values)


def test_joints_beside_the_chain_are_named_where_their_columns_are_missing(tmp_path):
    arm = Arm(0)
    q = arm.readings(5)
    finger = {"sigma": 1, "alpha": 0.0, "d": 0.0, "theta": 0.0, "r": 0.1}
    table = arm.nominal.table
    rows = [
        {name: getattr(table, name)[j] for name in ("sigma", "alpha", "d", "theta", "r")}
        for j in range(6)
    ]
    hand = rm.RobotModel.from_table(DHTable.from_rows([*rows, finger]), tip=6)
    file = tmp_path / "hole.csv"
    np.savetxt(file, q, delimiter=",")
    sentence = "all 7 joints of the model are needed: .*tip_link"
    with pytest.raises(InvalidValueError, match=sentence) as caught:
        read_measurements(file, "point_contact", hand)
    assert f"{hand.table.joint_names[-1]} do not move the tool" in str(caught.value)
    with pytest.raises(InvalidValueError, match=sentence):
        read_measurements(file, "point_contact", hand, joints=range(6))
    with pytest.raises(ShapeError, match=sentence):
        fit(hand, PointContact(q), **ALONE)


# --- markers --------------------------------------------------------------------------------------

MARKERS = {
    "marker_1": np.array([0.05, 0.0, 0.02]),
    "marker_2": np.array([0.0, 0.06, -0.03]),
    "marker_3": np.array([-0.04, -0.02, 0.05]),
}


@pytest.mark.parametrize("seed", range(2))
def test_markers_are_added_in_one_call_and_calibrated(seed):
    arm = Arm(seed)
    off = {name: p + 2e-3 * arm.rng.normal(size=3) for name, p in MARKERS.items()}
    nominal, real = arm.nominal.with_frames(MARKERS), arm.real.with_frames(off)
    q = arm.readings(40)
    for name, place in MARKERS.items():
        at = rm.dgm(arm.nominal, q) @ rm.se3.translation(*place)
        assert rm.dgm(nominal, q, name) == pytest.approx(at, abs=1e-13)
    measured = [
        Position(q, rm.dgm(real, q, name)[:, :3, 3] + 5e-5 * arm.rng.normal(size=(40, 3)),
                 frame=name, name=name)
        for name in MARKERS
    ]  # fmt: skip
    for prior in (None, ParameterPrior()):
        result = fit(nominal, measured, prior=prior, **ALONE)
        fresh = arm.readings(30)
        for name in MARKERS:
            gap = (rm.dgm(result.model, fresh, name) - rm.dgm(real, fresh, name))[:, :3, 3]
            assert np.linalg.norm(gap, axis=1).max() < 2e-4
        # and they lie to each other as they do: a rigid hand
        one, other = (rm.dgm(result.model, fresh[0], name)[:3, 3] for name in list(MARKERS)[:2])
        apart = np.linalg.norm(off["marker_1"] - off["marker_2"])
        assert np.linalg.norm(one - other) == pytest.approx(apart, abs=1e-4)


def test_frames_are_given_in_any_frame_as_points_or_poses():
    arm = Arm(1).nominal
    turned = rm.se3.translation(0.1, 0.2, 0.3) @ rm.se3.rotation("x", 0.4)
    model = arm.with_frames({"a": [0.1, 0.0, 0.0], "b": turned}, frame=3)
    again = model.with_frames({"c": [0.0, 0.0, 0.1]}, frame="b")
    q = np.linspace(-1.0, 1.0, 6)
    for name, at in (("a", rm.se3.translation(0.1, 0, 0)), ("b", turned)):
        assert rm.dgm(model, q, name) == pytest.approx(rm.dgm(arm, q, 3) @ at, abs=1e-14)
    at = rm.dgm(model, q, "b") @ rm.se3.translation(0.0, 0.0, 0.1)
    assert rm.dgm(again, q, "c") == pytest.approx(at, abs=1e-14)
    assert "b" not in arm.frame_names
    assert rm.dgm(pickle.loads(pickle.dumps(again)), q, "c") == pytest.approx(at, abs=1e-14)
