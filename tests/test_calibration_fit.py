"""Calibration end to end: known truths are recovered, statistics and priors hold."""

import dataclasses
import pickle

import numpy as np
import pytest
from calibration_arms import ALONE, Arm, readings
from frozen_kinds import KINDS, POINTS, Scene, erroneous, measured, noisy, touched

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    Pose,
    Position,
    Reason,
    calibrated_model,
    calibrated_pose,
    calibrated_urdf,
    candidate_parameters,
    differential_model,
    fit,
    joint_offsets,
)
from robotmodels.calibration.alignment import true_errors
from robotmodels.calibration.other_tool import other_tool_error
from robotmodels.errors import InvalidValueError
from robotmodels.estimation import FitStatus

EXACT = 1e-9
ANYWHERE = np.random.default_rng(21).uniform(-2.0, 2.0, (40, 6))
ARM = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.2))


def positions_of(model, q):
    return rm.dgm(model, q)[:, :3, 3]


def seen_of(model, q, rng, noise=1e-4):
    """Noisy positions."""
    return Position(q, positions_of(model, q) + noise * rng.normal(size=(len(q), 3)))


@pytest.fixture(scope="module")
def scene():
    return Scene(noise=0.0)


# --- exact measurements of every kind determine what they can -------------------------------------


def steps(T):
    return rm.se3.inverse(T[:-1]) @ T[1:]


def lengths(T):
    return np.linalg.norm(T[:, None, :3, 3] - T[None, :, :3, 3], axis=2)


def screws(T):
    """Of the steps: sine and cosine of the angle, and the pitch, which no base or tool changes."""
    S = steps(T)
    axis = S[:, [2, 0, 1], [1, 2, 0]] - S[:, [1, 2, 0], [2, 0, 1]]
    return np.column_stack([np.trace(S, axis1=1, axis2=2), (axis * S[:, :3, 3]).sum(axis=1)])


DETERMINED = {
    **dict.fromkeys(KINDS, (None, lengths)),
    "pose": (30, lambda T: T), "height": (None, lambda T: T[:, 2, 3]),
    "orientation": (None, lambda T: T[:, :3, :3]), "position": (27, lambda T: T[:, :3, 3]),
    "gains": (None, lambda T: T[:, :3, 3]), "line": (27, lambda T: T[:, :3, 3]),
    "frame": (None, screws), "relative": (24, steps), "camera": (24, steps), "point": (20, lengths),
    "axis": (None, lambda T: np.diff(T[:, :3, 3] @ [0.0, 0.6, 0.8])),
}  # fmt: skip
"""Number of parameters, and what is known of poses T (N, 4, 4) elsewhere: lengths are the shape."""


@pytest.mark.filterwarnings("ignore:q. joint")
@pytest.mark.parametrize("kind", KINDS)
def test_exact_measurements_determine_the_robot(scene, kind):
    nominal, seen, options = measured(kind, 0.0)
    result = fit(nominal, seen, **options, **ALONE)
    count, known = DETERMINED[kind]
    assert result.status is FitStatus.CONVERGED
    assert count is None or len(result.names) == count
    found, real, before = (known(rm.dgm(m, ANYWHERE)) for m in (result.model, scene.real, nominal))
    assert np.abs(found - real).max() < EXACT < 1e-4 < np.abs(before - real).max()
    errors = result.validation
    assert errors.folds is errors.held_out is None
    assert max(errors.in_sample.max.values()) < EXACT < max(errors.given.rms.values())
    assert result.known == tuple(options.get("known_lengths", ()))
    assert not {*result.known} & {*result.names}


def test_contacts_with_a_known_length_determine_the_shape(scene):
    _, (contact,), _ = measured("point", 0.0)
    apart = np.linalg.norm(POINTS[0] - POINTS[1])
    pair = KnownDistance("point:0", "point:1", apart, sigma=1e-9)
    result = fit(scene.nominal, [contact, pair], **ALONE)
    assert len(result.names) == 21  # 27 less the six of a base that nobody sees
    there = lengths(rm.dgm(scene.real, ANYWHERE))
    assert np.abs(lengths(rm.dgm(result.model, ANYWHERE)) - there).max() < EXACT
    wrong = KnownDistance("point:0", "point:1", 1.01 * apart)
    long = fit(scene.nominal, [contact, wrong], prior=None, **ALONE)
    assert long.model.table.r[3] == pytest.approx(1.01 * scene.real.table.r[3], rel=1e-9)


@pytest.mark.parametrize("name", ["stanford_arm", "cobra_s600", "iiwa14", "lab_rrt"])
def test_other_structures_are_recovered(name):
    # a prismatic joint, parallel axes, a redundant arm, a short one with a base of its own
    rng = np.random.default_rng(1)
    nominal = rm.load(name).with_base(rm.se3.from_rpy([0.4, 0.2, -1.0], [1.0, -2.0, 0.5]))
    nominal = nominal.with_tool(rm.se3.translation(0.04, 0.03, 0.1))
    real = erroneous(nominal, rng)
    q, fresh = readings(nominal, rng, 60), readings(nominal, rng, 20)
    result = fit(nominal, Pose(q, rm.dgm(real, q)), **ALONE)
    assert np.abs(rm.dgm(result.model, fresh) - rm.dgm(real, fresh)).max() < EXACT


def bent_poses(real, q, give):
    """Poses of a serial arm whose joints turn a little under the moments of gravity there.

    About x and y: compliances of all joints but the last, rad/(N m); about z: of all.
    """
    T, M = rm.link_poses(ARM, q), ARM.inertia.values.copy()
    M[5] = 0.0
    centre = M[:, 6:9] / np.maximum(M[:, 9:], 1e-12)
    centre = T[..., :3, 3] + np.einsum("...ij,...j->...i", T[..., :3, :3], centre)
    weight, poses = M[:, 9, None] * ARM.gravity, []
    arms = [centre[:, j:] - T[:, j : j + 1, :3, 3] for j in range(ARM.f)]
    moments = np.stack([np.cross(a, weight[j:]).sum(axis=-2) for j, a in enumerate(arms)], axis=-2)
    moments = np.einsum("...ji,...j->...i", T[..., :3, :3], moments)
    for row, m in zip(q, moments, strict=True):  # each configuration has a table of its own
        columns = {name: getattr(real.table, name).copy() for name in ("alpha", "beta")}
        columns["alpha"][1:] += give[:-1] * m[:-1, 0]
        columns["beta"][1:] += give[:-1] * m[:-1, 1]
        arm = real.with_table(dataclasses.replace(real.table, **columns))
        poses.append(rm.dgm(arm, row + give * m[:, 2]))
    return np.array(poses)


@pytest.mark.parametrize(
    ("mode", "name"),
    [
        ("joints", "compliance2"), ("isotropic", "compliance3"), ("uniform", "compliance_joints"),
    ],
)  # fmt: skip
def test_bending_is_recovered(mode, name):
    """Beside an independent arm, whose last joint carries nothing where bodies bend."""
    rng = np.random.default_rng(4)
    nominal, real = ARM, erroneous(ARM, rng)
    give = 2e-5 * np.array([mode == "uniform", mode != "isotropic", 1, 1, 1, mode != "isotropic"])
    if mode != "joints":  # joints 1 and 2 act like the mount
        inertia = ARM.inertia.values.copy()
        inertia[5] = 0.0
        nominal = ARM.with_inertia(rm.InertialParameters(inertia))

    def poses(q):
        if mode == "joints":
            return rm.dgm(real, q - give * rm.gravity_torque(ARM, q))
        return bent_poses(real, q, give)

    q, fresh = readings(ARM, rng, 120), readings(ARM, rng, 20)
    result = fit(nominal, Pose(q, poses(q)), compliance=mode, **ALONE)
    assert np.abs(calibrated_pose(result.robot, fresh) - poses(fresh)).max() < EXACT
    predicted = differential_model(result.parameters, fresh, result.corrections)[0]
    assert np.abs(predicted - poses(fresh)).max() < EXACT
    assert result.value(name) == pytest.approx(2e-5, abs=EXACT)


# --- statistics, priors and truncation ------------------------------------------------------------


@pytest.mark.parametrize("way", ["folds", "share"])
def test_errors_held_out_are_of_fits_without_them(way):
    arm = Arm(0)
    seen = arm.positions(arm.readings(50))
    options = {"folds": 5, "held_out": 0} if way == "folds" else {"folds": 0, "held_out": 0.2}
    validation = fit(arm.nominal, seen, rng=3, **options).validation
    errors = validation.folds if way == "folds" else validation.held_out
    assert sorted(errors.blocks) == list(range(50)) if way == "folds" else len(errors.blocks) == 10
    first = np.sort(errors.blocks[:10])
    near = np.arange(first[0] - 3, first[-1] + 4)  # what is next to a run resembles it
    assert np.array_equal(first, np.arange(first[0], first[0] + 10))
    alone = fit(arm.nominal, seen.subset(np.setdiff1d(np.arange(50), near)), **ALONE)
    gap = seen.p[first] - positions_of(alone.model, seen.q[first])
    found = errors.position[:10][np.argsort(errors.blocks[:10])]
    assert found == pytest.approx(np.linalg.norm(gap, axis=1), abs=1e-8)
    assert validation.in_sample.rms["m"] < errors.rms["m"] < errors.nominal.rms["m"]


def test_known_and_chosen_parameters(scene):
    table = scene.nominal.table
    theta = table.theta + np.array([0.0, 0.002, -0.003, 0.0, 0.0, 0.0])
    T = rm.dgm(scene.nominal.with_table(dataclasses.replace(table, theta=theta)), scene.q)
    names = ("theta2", "theta3", "d3")
    for given in (names, candidate_parameters(scene.nominal).subset(names)):
        result = fit(scene.nominal, Pose(scene.q, T), parameters=given, **ALONE)
        assert result.names == names
        assert result.corrections == pytest.approx([0.002, -0.003, 0.0], abs=EXACT)
        assert result.value("d3") == pytest.approx(0.45, abs=EXACT)
        assert result.standard_error("d3") == result.standard_errors[2]
    known = fit(scene.nominal, Pose(scene.q, T), known=["r4"], **ALONE)
    assert len(known.names) == 29
    assert known.model.table.r[3] == table.r[3]
    with pytest.raises(InvalidValueError, match=r"'theta1' was not estimated; near it: theta"):
        result.value("theta1")


@pytest.mark.nightly
def test_the_strength_of_a_prior_follows_the_data():
    # a prior that is ten times too narrow is weakened where there are many data
    s = Scene()
    narrow = ParameterPrior(length=1e-5, angle=2e-5, strength=None)
    seen = Pose(s.q, s.T)
    stuck = fit(s.nominal, seen, prior=dataclasses.replace(narrow, strength=1e4), **ALONE)
    result = fit(s.nominal, seen, prior=narrow, **ALONE)
    assert result.solution.fit.prior.strength < 0.1
    there = positions_of(s.real, ANYWHERE)
    assert np.abs(positions_of(result.model, ANYWHERE) - there).max() < 4e-4
    assert np.abs(positions_of(stuck.model, ANYWHERE) - there).max() > 1e-3


def test_parameters_that_noise_hides_stay_nominal():
    """The wrist of an arm whose target is its centre: a tool moved by noise is no information."""
    arm, rng = rm.load("rx90"), np.random.default_rng(1)
    seen = seen_of(arm, rng.uniform(-2, 2, (60, 6)), rng, 5e-5)
    hidden = {"theta4", "theta5", "alpha5", "alpha6"}
    with_prior, without = (fit(arm, seen, prior=x, **ALONE) for x in (ParameterPrior(), None))
    assert hidden <= set(without.identifiable.of_reason(Reason.NOISE))
    assert hidden <= set(with_prior.names)
    for result in (with_prior, without):
        R, given = (rm.dgm(m, seen.q)[:, :3, :3] for m in (result.model, arm))
        turned = R.swapaxes(1, 2) @ given
        assert np.trace(turned, axis1=1, axis2=2).min() > 1 + 2 * np.cos(2e-3)


def test_what_the_measurements_do_not_tell_is_held_by_the_prior_or_cut():
    # the last joint hardly moves: its axis is where it was
    rng = np.random.default_rng(5)
    q = rng.uniform(-2.0, 2.0, (60, 6))
    q[:, 5] = 0.3 + 0.01 * rng.normal(size=60)
    seen = seen_of(ARM, q, rng, 2e-4)
    result = fit(ARM, seen, **ALONE)
    assert result.held_by_prior
    assert not fit(ARM, seen, prior=None, **ALONE).held_by_prior
    held = [result.names.index(name) for name in result.held_by_prior]
    assert np.abs(result.corrections[held]).max() < 5e-3
    q, rng = ANYWHERE.copy(), np.random.default_rng(5)
    q[:, 4] = 0.3 + 1e-3 * rng.normal(size=len(q))
    cut = fit(ARM, seen_of(erroneous(ARM, rng), q, rng), truncation=1e-3, prior=None, **ALONE)
    assert cut.solution.fit.rank == len(cut.names) - 4
    assert np.abs(cut.corrections).max() < 0.01


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_robot_far_from_nominal_is_not_taken_for_noise(seed):
    """Zeros of joints that are 0.1 rad off contradict the prior, which is widened and says so."""
    rng = np.random.default_rng(seed)
    off = {"theta": 0.1 * rng.normal(size=6), "alpha": 0.02 * rng.normal(size=6)}
    columns = {name: getattr(ARM.table, name) + x for name, x in off.items()}
    real = ARM.with_table(dataclasses.replace(ARM.table, **columns))
    result = fit(ARM, seen_of(real, rng.uniform(-2.0, 2.0, (30, 6)), rng), **ALONE)
    assert result.validation.in_sample.rms["m"] < 3e-4
    assert any("increased" in n and "of angles from 0.005" in n for n in result.notes)
    error = positions_of(result.model, ANYWHERE) - positions_of(real, ANYWHERE)
    assert np.linalg.norm(error, axis=1).mean() < 1e-3


# --- another tool, notes and results --------------------------------------------------------------


def apart(model, real, q):
    """Rms distance of another tool on two robots, the base put where it suits best, m."""
    tool = rm.se3.translation(-0.1, 0.12, 0.05)
    return true_errors(model.with_tool(tool), real.with_tool(tool), q)[1].rms["m"]


def test_a_real_arm_keeps_its_flange_and_its_urdf_is_right_at_the_ball():
    data = rm.datasets.panda_double_socket()
    seen = touched(data, "front")
    everywhere = [m for place in data.places for m in touched(data, place)]
    best, q = fit(data.model, everywhere, **ALONE).model, seen[0].q
    for options in ({"prior": None}, {}):
        result = fit(data.model, seen, **options, **ALONE)
        assert apart(result.model, best, q) < 0.2 * apart(data.model, best, q)
        assert result.validation.in_sample.mean["m"] < 2.2e-4
        assert np.abs(result.corrections).max() < 0.03
    found = result.other_tool
    assert found == other_tool_error(result)
    assert found.rms < min(found.largest, 0.3 * found.nominal)
    # a longer tool, and postures elsewhere, are further off
    assert other_tool_error(result, length=2.0 * found.length).rms > found.rms
    elsewhere = readings(data.model, np.random.default_rng(0), 200)
    assert other_tool_error(result, elsewhere).rms > found.rms

    def spread(text):
        balls = positions_of(rm.RobotModel.from_urdf(text, tip_link="ball_link"), q)
        return np.linalg.norm(balls - balls.mean(axis=0), axis=1).mean()

    q = data.places["front"][0]
    assert spread(calibrated_urdf(result.robot)) < 3e-4 < 3e-3 < spread(data.urdf)


def test_the_prediction_is_the_spread_of_what_it_predicts():
    """Exact model and prior: over robots drawn from the prior, errors have the size predicted."""
    rng = np.random.default_rng(8)
    p = candidate_parameters(ARM, base=False)
    size = np.array([1e-3 if e.element.is_length else 5e-3 for e in p.entries])
    tool = rm.se3.translation(0.15, 0.0, 0.0), rm.se3.translation(0.0, 0.0, 0.15)
    squares, predicted = [], []
    for _ in range(12):
        real = calibrated_model(p, size * rng.normal(size=len(p))).model
        result = fit(ARM, seen_of(real, ANYWHERE, rng), base=False, **ALONE)
        predicted.append(other_tool_error(result, ANYWHERE, 0.15).rms ** 2)
        for T in tool:
            p0, p1 = (positions_of(m.with_tool(T), ANYWHERE) for m in (result.model, real))
            squares.append(np.mean(np.sum((p0 - p1) ** 2, axis=1)))
    assert np.sqrt(np.mean(squares) / np.mean(predicted)) == pytest.approx(1.0, abs=0.25)


def test_notes_name_what_is_strange(scene):
    still, twice = scene.q.copy(), np.r_[np.arange(60), [3, 3, 7]]
    still[:, 2] = 0.7
    rough = noisy(scene.T, np.random.default_rng(14), 1e-3)[:, :3, 3]
    mixed = scene.q[np.random.default_rng(0).permutation(60)]
    for words, seen in {
        "Joint 3": Pose(still, rm.dgm(scene.real, still)),
        "3 of 63 rows repeat": Pose(scene.q[twice], scene.T[twice]),
        "times the stated standard deviations": Position(scene.q, rough, sigma=1e-6),
        "belong": Pose(mixed, scene.T),
    }.items():
        assert any(words in note for note in fit(scene.nominal, seen, **ALONE).notes)
    assert not fit(scene.nominal, Pose(scene.q, scene.T), **ALONE).notes


def test_a_result_pickles_and_counts_its_fits(scene):
    done = []
    result = fit(scene.nominal, Position(scene.q, scene.p), folds=3, progress=done.append)
    assert done == [0.2, 0.4, 0.6, 0.8, 1.0]
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.covariance, result.covariance)
    assert again.validation.folds.rms == result.validation.folds.rms
    assert not again.solution.fit.x.flags.writeable
    offsets = joint_offsets(result, scene.q).offset  # of the measured coordinates
    masked = joint_offsets(result.robot, scene.q, mask=[1, 1, 1, 0, 0, 0])
    assert np.array_equal(offsets, masked.offset)
