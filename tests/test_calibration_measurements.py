"""Every kind of measurement, and a new one: derivatives, truth, parts, scale, files, selection."""

import pickle
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from calibration_arms import ALONE, slope
from identities.random_robots import random_model, random_pose, random_state
from scipy.spatial.transform import Rotation

import robotmodels as rm
from robotmodels.calibration import candidate_parameters, differential_model, fit
from robotmodels.calibration.combined_arms import combine_arms
from robotmodels.calibration.identifiable import identifiable_on, identifiable_parameters
from robotmodels.calibration.measurements import (
    AxisPosition,
    CameraPose,
    Contact,
    Distance,
    FileRow,
    FrameContact,
    LaserLine,
    Linearised,
    LinkedFrames,
    Orientation,
    PlaneContact,
    PointContact,
    Pose,
    Position,
    RelativePose,
    fields,
    single_observations,
    whitened,
)
from robotmodels.calibration.measurements.kinds import drawn_groups
from robotmodels.calibration.measurements.positions import pivot_of, target_points
from robotmodels.calibration.problem import guessed_fixtures, linearised, problem_of, satisfying
from robotmodels.calibration.read import read_measurements
from robotmodels.calibration.selection import select_configurations

B = 12
LABELS = ["u", "v", "w"] * 4
PIVOTS = ["u"] * 3 + ["v"] * 9
ARM = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.03, 0.1))
Q4, Z = np.zeros((4, 6)), np.eye(4)
AT = rm.se3.translation(0.1, 0.2, 0.3)
CONTACTS = (PointContact, FrameContact, PlaneContact, LaserLine)


def unit(rng):
    u = rng.normal(size=3)
    return u / np.linalg.norm(u)


def six(T):
    """Position and rotation vector of a pose."""
    return np.r_[T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_rotvec()]


def all_kinds(q, other, T, f, rng):
    """Measurements of every kind by a robot with poses T(q, end), and their fixtures.

    Targets are known and unknown, noise is stated and not. Fixtures are None where nothing is met.
    """
    at, there, away = T(q, None), T(other, None), T(q, f)
    p, inverse, axis = at[:, :3, 3], np.linalg.inv(at), unit(rng)
    S, some = np.diag([1e-6, 2e-6, 3e-6]), np.linspace(1.0, 2.0, 3 * B).reshape(B, 3)
    board, moved = random_pose(rng), random_pose(rng)
    pivots = dict(zip("uv", 2.0 * rng.normal(size=(2, 3)), strict=True))
    far = np.linalg.norm(p - [pivots[label] for label in PIVOTS], axis=1)
    apart = np.linalg.norm(p - there[:, :3, 3], axis=1)
    three = {"v": board, "u": moved, "w": board @ moved}
    seen = inverse @ [three[label] for label in LABELS]
    line = rng.normal(size=(2, 3))
    known = {"known": {"u": pivots["u"]}}
    return {
        "pose": (Pose(q, at, [1, 0, 1, 1, 0, 1]), []),
        "orientation": (Pose.of_orientations(q, at[:, :3, :3], sigma=1e-3), []),
        "position": (Position(q, away[:, :3, 3], covariance=S, frame=f), []),
        "gauge": (AxisPosition(q, p @ axis - 0.2, axis, zero=0.2), []),
        "gauge_zero": (AxisPosition(q, -p[:, 2] - 0.3, [0, 0, -2.0], sigma=1e-6), [0.3]),
        "gauge_axis": (AxisPosition(q, p @ axis, axis, axis_is_known=False), [0, 0, 0]),
        "gauge_down": (AxisPosition(q, -p[:, 2], [0, 0, -1], 0.0, axis_is_known=False), [0, 0]),
        "line": (LaserLine(q, LABELS, {"v": line}, sigma=[1e-4, 2e-4]), None),
        "line_down": (LaserLine(q, known={0: [[0.1, 0.2, 0.3], [0, 0, -1]]}), None),
        "pivot": (Distance(q, far, pivot=PIVOTS, **known), pivots["v"]),
        "pair": (Distance(q, apart, other, sigma=1e-5), []),
        "dead_path": (
            Distance(q, far + 0.1, pivot=PIVOTS, offset=True, **known), [*pivots["v"], 0.1, 0.1],
        ),
        "dead_pair": (Distance(q, apart - 0.2, other, offset=True), [-0.2]),
        "frame": (FrameContact(q, LABELS, {"w": moved}), None),
        "point": (PointContact(q, LABELS, {"w": [0.1, 0.2, 0.3]}, sigma=some), None),
        "plane": (PlaneContact(q, LABELS, {"u": [*axis, 0.4]}, sigma=1e-4, frame=f), None),
        "relative": (RelativePose(q, other, inverse @ there), []),
        "relative_position": (RelativePose(q, other, inverse @ there, [1, 1, 1, 0, 0, 0]), []),
        "linked": (LinkedFrames(q, None, f, LABELS, {"v": moved}), None),
        "linked_point": (LinkedFrames(q, None, f, orientation=False, covariance=S), None),
        "camera": (
            CameraPose(q, seen, LABELS, {"v": board}), np.r_[six(moved), six(three["w"])]
        ),
        "camera_target": (
            CameraPose(q, np.linalg.inv(away) @ board, rows=[1, 1, 0, 0, 0, 0], frame=f),
            board[:3, 3],
        ),
        "camera_turns": (
            CameraPose(q, inverse @ board, rows=[0, 0, 0, 0, 1, 1]), six(board)[3:]
        ),
        **{c.word: (c(q[:1], known={0: c.target_at(at[0], rng)}), []) for c in CONTACTS},
    }  # fmt: skip


def case(kind, seed, end, **options):
    """Candidates with corrections, a measurement of that robot, its fixtures, and a generator."""
    rng = np.random.default_rng(seed)
    options = {"f": 6, "tree": True, "fixed": True, "inertia": None, **options}
    model = random_model(rng, **options)
    candidates = candidate_parameters(model, (None, end), gains=True, eccentricity=True)
    xi = 0.02 * rng.normal(size=len(candidates))
    q, other = (random_state(model, rng, B)[0] for _ in range(2))

    def T(readings, frame):
        return differential_model(candidates, readings, xi, frame).T

    return candidates, xi, *all_kinds(q, other, T, end, rng)[kind], rng


def at_readings(q, _):
    """Poses whose positions are three readings."""
    T = np.tile(np.eye(4), (len(q), 1, 1))
    T[:, :3, 3] = q
    return T


DRAWN = np.random.default_rng(0)
KINDS = all_kinds(*DRAWN.normal(size=(2, B, 3)), at_readings, 1, DRAWN)
WHOLE = [kind for kind, (m, _) in KINDS.items() if m.blocks == B]
MET = [kind for kind, (_, fixtures) in KINDS.items() if fixtures is not None]


@pytest.mark.sampled(14)
@pytest.mark.parametrize("kind", WHOLE)
@pytest.mark.parametrize("seed", [2, 3])
def test_derivatives_by_parameters_and_fixtures_are_those_of_finite_differences(kind, seed):
    candidates, _, m, _, rng = case(kind, seed, 0 if seed == 3 else 2, tip="any")
    problem = problem_of(candidates, [m])
    P = problem.P
    x = np.concatenate([0.05 * rng.normal(size=P), rng.normal(size=problem.F)])

    def residual(x):
        return linearised(problem, x[:P], x[P:])[0].residual

    part = linearised(problem, x[:P], x[P:])[0]
    assert part.residual.shape == (B, len(m.axes)) == (B, len(m.units))
    J = np.concatenate([part.by_parameters, part.by_fixtures], axis=-1)
    assert J.shape == (B, len(m.axes), P + len(m.fixtures))
    good = np.ones(B, dtype=bool)
    if "rad" in m.units:  # half a turn has two rotation vectors
        turns = part.residual[:, [u == "rad" for u in m.units]]
        good = np.linalg.norm(turns, axis=1) < 3.0
    elif isinstance(m, Distance) and not m.offset:  # short lengths bend too much for differences
        good = (part.residual[:, 0] + m.length) > 0.1
    assert good.sum() >= 3
    for k in range(len(x)):
        found = slope(residual, x, k)[good]
        np.testing.assert_allclose(J[good, :, k], found, atol=1e-7 * max(1.0, abs(found).max()))


@pytest.mark.parametrize("kind", MET)
def test_residuals_vanish_for_the_robot_that_was_measured_and_the_guess_finds_its_fixtures(kind):
    candidates, xi, m, fixtures, _ = case(kind, 4, 3, f=7)
    problem = problem_of(candidates, [m])
    guess = guessed_fixtures(problem, xi)
    np.testing.assert_allclose(guess, fixtures, atol=1e-7)
    assert np.abs(linearised(problem, xi, guess)[0].residual).max() < 1e-8
    assert np.abs(linearised(problem, xi * 0, guess)[0].residual).max() > 1e-3


@pytest.mark.parametrize("kind", WHOLE)
def test_subsets_and_copies_keep_everything(kind):
    candidates, xi, m, _, rng = case(kind, 11, 2)
    m = replace(m, origin=tuple(FileRow("a.csv", k) for k in range(B)))
    value = {f.name: rng.normal() for f in m.fixtures}

    def rows(part):
        own = problem_of(candidates, [part])
        found = linearised(own, 0.5 * xi, np.array([value[f.name] for f in own.fixtures]))[0]
        return whitened(part, found.residual, np.full(len(m.axes), 2.0))

    whole, blocks = rows(m), np.array([7, 1, 4])
    again = pickle.loads(pickle.dumps(m))
    assert (type(again), again.name) == (type(m), m.name)
    np.testing.assert_array_equal(rows(again), whole)
    assert not any(view.q.flags.writeable for view in again.views)
    part, moved = m.subset(blocks), m.with_configurations([v.q for v in m.views])
    np.testing.assert_array_equal(rows(part), whole[blocks])
    np.testing.assert_array_equal(rows(moved), whole)
    assert [row.row for row in part.origin] == [7, 1, 4]
    assert again.files == moved.files == (("a.csv", B),)
    assert m.groups.tolist() in ([0] * B, [0, 1, 2] * 4, [0] * 3 + [1] * 9)


def test_whitened_rows_have_the_length_that_a_covariance_gives_them(rng):
    A = rng.normal(size=(B, 3, 3))
    C = A @ A.swapaxes(-1, -2) + np.eye(3)
    q, r, psi = np.zeros((B, 6)), rng.normal(size=(B, 3)), rng.normal(size=(B, 3, 5))
    m = Position(q, np.zeros((B, 3)), covariance=C)
    rows, slopes = (whitened(m, x, np.ones(3)) for x in (r, psi))
    weighted = np.linalg.solve(C, r[..., None])
    np.testing.assert_allclose((rows**2).sum(axis=1), (r * weighted[..., 0]).sum(axis=1))
    expected = (psi.swapaxes(-1, -2) @ weighted)[..., 0]
    np.testing.assert_allclose(np.einsum("bip,bi->bp", slopes, rows), expected)


# --- scale and ranks ------------------------------------------------------------------------------

TWO = [0, 0, 1, 1]
STILL, MOVING = np.tile(Z, (4, 1, 1)), np.tile(AT, (4, 1, 1))


@pytest.mark.parametrize(
    ("without", "knows"),
    [
        (FrameContact(Q4, known={0: AT}), FrameContact(Q4, TWO, {0: AT, 1: Z})),
        (
            PlaneContact(Q4, TWO, {0: [0, 0, 1, 0.2], 1: [1, 0, 0, 0.5]}),
            PlaneContact(Q4, TWO, {0: [0, 0, 1, 0.2], 1: [0, 0, -1, 0.5]}),
        ),
        (LinkedFrames(Q4, 1, 2, known={0: Z}), LinkedFrames(Q4, 1, 2, known={0: AT})),
        (Distance(Q4, [0.1, 0.1, 0.2, 0.2], pivot=TWO, offset=True), Distance(Q4, 0.3, Q4 + 1)),
        (AxisPosition(Q4, 0.4, [1, 0, 0]), AxisPosition(Q4, [0.4, 0.4, 0.4, 0.5], [1, 0, 0])),
        (RelativePose(Q4, Q4, STILL), RelativePose(Q4, Q4, MOVING)),
        (CameraPose(Q4, MOVING, rows=[0, 0, 0, 1, 1, 1]), CameraPose(Q4, MOVING)),
        (Orientation(Q4, MOVING), Pose(Q4, MOVING)),
    ],
)
def test_only_what_a_shrunk_robot_would_violate_knows_a_length(without, knows):
    assert not without.knows_length
    assert knows.knows_length


@pytest.mark.parametrize(
    ("measurements", "targets"),
    [
        ([PointContact(Q4, [0, 0, 0, 1])], ["point:1"]),
        ([PointContact(Q4, [0, 0, 0, 1]), PointContact(Q4[:1], [1])], []),
        ([LaserLine(Q4, TWO)], ["line:0", "line:1"]),
        ([Distance(Q4, 0.1, offset=True)], ["pivot:0"]),
    ],
)
def test_targets_with_too_few_rows_are_named(measurements, targets):
    assert list(single_observations(measurements)) == targets


def test_linked_arms_identify_the_parameters_of_their_loop():
    pair = combine_arms(rm.load("ur10e"), rm.load("rx90"), rm.se3.translation(0.9, 0.1, 0.0))
    ends, rng = ("a_tool", "b_tool"), np.random.default_rng(6)
    q0 = np.array([0.2, -1.0, 1.4, 0.3, 1.0, 0.1, 2.8, -0.9, 1.2, 0.4, 0.9, -0.2])
    candidates = candidate_parameters(pair, ends)
    a, b = (differential_model(candidates, q0[None], None, end).T[0] for end in ends)
    known, readings = {0: np.linalg.inv(a) @ b}, q0 + rng.uniform(-0.5, 0.5, (60, 12))
    start = problem_of(candidates, [LinkedFrames(readings, *ends, known=known)])
    moved = satisfying(start, np.zeros(len(candidates)), np.zeros(0)).measurements[0]
    m = LinkedFrames(moved.q, *ends)
    found = identifiable_on(candidates, [m], known_lengths=["d3"])
    assert found.gap[1] < 1e-9 < 1e-4 < found.gap[0]
    # a loop of twelve revolute joints has 4 parameters for each, less the scale
    assert found.count + len(m.fixtures) == 47


def test_pivots_are_found_from_equal_lengths_and_below_coplanar_points():
    rng = np.random.default_rng(9)
    c, u = 2 * rng.normal(size=3), np.array([unit(rng) for _ in range(9)])
    flat, below = rng.normal(size=(9, 3)) * [1, 1, 0] + [0, 0, 0.5], np.array([0.1, 0.2, 0.1])
    for points, pivot, offset in ((c + 0.4 * u, c, 0.0), (c + 0.4 * u, c, 0.3), (flat, below, 0.0)):
        length = np.linalg.norm(points - pivot, axis=1) - offset
        np.testing.assert_allclose(pivot_of(points, length, offset > 0.0), pivot, atol=1e-8)


# --- a new kind -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class BallContact(Contact):
    """Touches of balls of a known radius, at unknown places, by the end's origin."""

    q: np.ndarray = field(metadata=fields.READINGS)
    ball: fields.Given = field(default=None, metadata=fields.LABELS)
    known: fields.Given = field(default=None, metadata=fields.targets(fields.as_point))
    sigma: fields.Given = field(default=None, metadata=fields.NOISE)
    covariance: fields.Given = field(default=None, metadata=fields.NOISE)
    frame: str | int | None = None
    name: str = "ball"

    radius = 0.05
    all_rows = (("radial", "m"),)
    unknowns = (("x", "m"), ("y", "m"), ("z", "m"))
    postures = 6
    knows_length = True

    def guess(self, evaluations):
        p, lengths = evaluations[0].T[:, :3, 3], np.full(self.blocks, self.radius)
        return self.guess_each(lambda mine: pivot_of(p[mine], lengths[mine], False))

    def linearise(self, evaluations, fixtures):
        T, psi = evaluations[0]
        centre, by_centre = target_points(self, fixtures)
        length = np.linalg.norm(T[:, :3, 3] - centre, axis=1)[:, None]
        along = ((T[:, :3, 3] - centre) / length)[:, None]
        return Linearised(length - self.radius, along @ psi[:, :3], -along @ by_centre)

    @staticmethod
    def target_at(T, rng):
        return T[:3, 3] + BallContact.radius * unit(rng)


def test_a_new_kind_is_drawn_read_selected_and_fitted(tmp_path):
    rng = np.random.default_rng(0)
    candidates = candidate_parameters(ARM)
    groups = drawn_groups(
        candidates, "ball-contact", 12, 14, rng, limits=False,
        corrections=2e-3 * rng.normal(size=len(candidates)),
    )  # fmt: skip
    rows = [[*map(str, q), f"ball {g}"] for q, g in zip(*groups, strict=True)]
    file = tmp_path / "touches.csv"
    file.write_text("\n".join(",".join(row) for row in rows))
    m = read_measurements(file, BallContact, ARM, joints=range(6), label=6, sigma=1e-5)
    assert m.labels == tuple(f"ball {g}" for g in range(groups.count))

    result = fit(ARM, m, prior=None, **ALONE)
    errors = result.validation
    assert errors.in_sample.max["m"] < 1e-6 < 1e-4 < errors.given.max["m"]
    # as many parameters as by points and a known length, and the length
    points = identifiable_parameters(ARM, PointContact, known_lengths=["d3"])
    assert identifiable_parameters(ARM, BallContact).count == points.count + 1 == len(result.names)
    chosen = select_configurations(ARM, BallContact, 8, drawn=40, starts=1, rng=rng)
    assert chosen.groups.shape == (8, 6, 6)
