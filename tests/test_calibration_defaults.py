"""The defaults of calibration: another tool on a calibrated arm, and robots far from nominal."""

import dataclasses

import numpy as np
import pytest
from calibration_places import Arm, points

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Position,
    RelativePose,
    candidate_parameters,
    fit,
    report,
)
from robotmodels.calibration.alignment import best_motion
from robotmodels.calibration.other_tool import other_tool_error

ALONE = {"folds": 0, "held_out": 0}
ARMS = range(100, 112)


def flange_error(arm, model, q):
    """Rms distance of another tool from where it is, the base put where it suits best, m."""
    tool = rm.se3.translation(-0.1, 0.12, 0.05)
    real = rm.dgm(arm.real.with_tool(tool), q)[:, :3, 3]
    said = rm.dgm(model.with_tool(tool), arm.read(q))[:, :3, 3]
    Z = best_motion(said, real)
    return np.sqrt(np.mean(np.sum((said @ Z[:3, :3].T + Z[:3, 3] - real) ** 2, axis=1)))


def one_arm(seed):
    """Errors with another tool: nominal, calibrated, and that predicted."""
    arm = Arm(seed)
    measured, _ = points(arm)
    q = arm.postures(300)
    result = fit(arm.nominal, measured, **ALONE)
    models = arm.nominal, result.model
    return *(flange_error(arm, m, q) for m in models), other_tool_error(result, q, 0.16).rms


@pytest.fixture(scope="module")
def fleet():
    return np.array([one_arm(seed) for seed in ARMS])


@pytest.mark.nightly
def test_another_tool_is_better_off_after_every_calibration(fleet):
    """Geometric errors and unmodelled bending, contacts with one tool, checked with another."""
    nominal, calibrated, _ = fleet.T
    assert (calibrated < nominal).all()
    assert np.median(calibrated / nominal) < 0.4


@pytest.mark.nightly
def test_the_error_of_another_tool_is_predicted(fleet):
    _, calibrated, predicted = fleet.T
    ratio = predicted / calibrated
    assert 0.7 < np.exp(np.log(ratio).mean()) < 1.4
    assert (ratio > 1.0 / 3.0).all()  # a fleet of standard errors, and bending besides


@pytest.fixture(scope="module")
def panda():
    data = rm.datasets.panda_double_socket()
    in_0, in_1 = data.places["front"]
    touched = PointContact([*in_0, *in_1], [0] * len(in_0) + [1] * len(in_1))
    return data, [touched, KnownDistance("point:0", "point:1", data.distance)]


def test_a_real_arm_keeps_its_flange(panda):
    """README's example: with no prior, or told by name only, the flange moved by centimetres."""
    data, measured = panda
    nominal = data.model
    everywhere = []
    for k, (in_0, in_1) in enumerate(data.places.values()):
        touched = PointContact([*in_0, *in_1], [f"{k}:0"] * len(in_0) + [f"{k}:1"] * len(in_1))
        known = KnownDistance(f"point:{k}:0", f"point:{k}:1", data.distance)
        everywhere += [touched, known]
    best = fit(nominal, everywhere, **ALONE).model
    q = measured[0].q
    tool = rm.se3.translation(0.1, 0.05, 0.15)

    def apart(model):
        said, real = (rm.dgm(m.with_tool(tool), q)[:, :3, 3] for m in (model, best))
        Z = best_motion(said, real)
        return np.linalg.norm(said @ Z[:3, :3].T + Z[:3, 3] - real, axis=1).mean()

    for options in ({}, {"prior": None}):
        result = fit(nominal, measured, **options, **ALONE)
        assert apart(result.model) < 0.2 * apart(nominal)
        assert result.validation.in_sample.mean["m"] < 2.2e-4
        assert np.abs(result.corrections).max() < 0.03


def test_the_headline_says_how_far_another_tool_could_be_off(panda):
    data, measured = panda
    result = fit(data.model, measured, **ALONE)
    found = result.other_tool
    assert found == other_tool_error(result)
    assert found.rms < found.largest
    assert found.rms < 0.3 * found.nominal
    outcome = report(result).split("Notes")[0]
    words = " ".join(outcome.split())
    assert f"in the measured postures: {1e3 * found.rms:.2g} mm" in words
    assert "Prior standard deviations of the table: 1 mm, 5 mrad." in words
    assert f"another tool about {found.rms:.2g} m" in repr(result)
    # a longer tool, and postures elsewhere, are further off
    assert other_tool_error(result, length=2.0 * found.length).rms > found.rms
    low, high = np.maximum(data.model.lower, -2.5), np.minimum(data.model.upper, 2.5)
    elsewhere = np.random.default_rng(0).uniform(low, high, (200, 7))
    assert other_tool_error(result, elsewhere).rms > found.rms
    with pytest.raises(rm.errors.InvalidValueError, match="length: expected a positive length"):
        other_tool_error(result, length=0.0)


def test_the_prediction_is_the_spread_of_what_it_predicts():
    """Exact model and prior: over robots drawn from the prior, errors have the size predicted."""
    rng = np.random.default_rng(8)
    arm = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.2))
    p = candidate_parameters(arm, base=False)
    size = np.array([1e-3 if e.element.is_length else 5e-3 for e in p.entries])
    q = rng.uniform(-2.0, 2.0, (40, 6))
    tool = rm.se3.translation(0.15, 0.0, 0.0), rm.se3.translation(0.0, 0.0, 0.15)
    squares, predicted = [], []
    for _ in range(25):
        real = rm.calibration.calibrated_model(p, size * rng.normal(size=len(p))).model
        seen = rm.dgm(real, q)[:, :3, 3] + 1e-4 * rng.normal(size=(40, 3))
        result = fit(arm, Position(q, seen), base=False, **ALONE)
        predicted.append(other_tool_error(result, q, 0.15).rms ** 2)
        for T in tool:
            error = rm.dgm(result.model.with_tool(T), q) - rm.dgm(real.with_tool(T), q)
            squares.append(np.mean(np.sum(error[:, :3, 3] ** 2, axis=1)))
    assert np.sqrt(np.mean(squares) / np.mean(predicted)) == pytest.approx(1.0, abs=0.25)


def test_what_the_measurements_do_not_tell_is_held_by_the_prior(panda):
    # the last joint hardly moves: its axis is where it was, and the report names it
    rng = np.random.default_rng(5)
    arm = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.2))
    q = rng.uniform(-2.0, 2.0, (60, 6))
    q[:, 5] = 0.3 + 0.01 * rng.normal(size=60)
    seen = rm.dgm(arm, q)[:, :3, 3] + 2e-4 * rng.normal(size=(60, 3))
    result = fit(arm, Position(q, seen), **ALONE)
    assert result.held_by_prior
    assert "Determined mainly by the prior" in report(result)
    assert not fit(arm, Position(q, seen), prior=None, **ALONE).held_by_prior
    held = [result.names.index(name) for name in result.held_by_prior]
    assert np.abs(result.corrections[held]).max() < 5e-3


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_far_from_nominal_is_not_taken_for_noise(seed):
    """Zeros of joints that are 0.1 rad off contradict the prior, which is widened and says so."""
    rng = np.random.default_rng(seed)
    arm = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.2))
    table = arm.table
    real = arm.with_table(
        dataclasses.replace(
            table,
            theta=table.theta + 0.1 * rng.normal(size=6),
            alpha=table.alpha + 0.02 * rng.normal(size=6),
        )
    )
    q = rng.uniform(-2.0, 2.0, (30, 6))
    seen = rm.dgm(real, q)[:, :3, 3] + 1e-4 * rng.normal(size=(30, 3))
    result = fit(arm, Position(q, seen), **ALONE)
    assert result.validation.in_sample.rms["m"] < 3e-4
    assert any("increased" in n and "of angles from 0.005" in n for n in result.notes)
    fresh = rng.uniform(-2.0, 2.0, (100, 6))
    error = (rm.dgm(result.model, fresh) - rm.dgm(real, fresh))[:, :3, 3]
    assert np.linalg.norm(error, axis=1).mean() < 1e-3


def test_laws_of_the_readings_have_a_prior_of_the_same_effect():
    """Gains, eccentricity and compliance move a joint as far as a constant error may."""
    rng = np.random.default_rng(3)
    arm = rm.load("erd:ur10") if "erd:ur10" in rm.robots() else rm.load("rx90")
    q = rng.uniform(-2.0, 2.0, (60, 6))
    seen = rm.dgm(arm, q)[:, :3, 3] + 1e-4 * rng.normal(size=(60, 3))
    options = {"gains": True, "eccentricity": True, **ALONE}
    sizes = {}
    for prior in (ParameterPrior(), ParameterPrior(gain=np.inf, eccentricity=np.inf)):
        result = fit(arm, Position(q, seen), prior=prior, **options)
        deviations = result.solution.fit.prior.sigma[: len(result.names)]
        sizes[prior.gain] = dict(zip(result.names, deviations, strict=True))
    assert sizes[None]["gain2"] == pytest.approx(5e-3 / np.abs(q[:, 1]).max())
    assert sizes[None]["sine3"] == pytest.approx(5e-3, rel=1e-2)
    assert np.isinf(sizes[np.inf]["gain2"])
    assert np.isinf(sizes[np.inf]["sine3"])


def test_measurements_of_one_kind_lend_each_other_their_noise():
    """Twenty small measurements are weighted nearly alike, two large ones by what each shows."""
    rng = np.random.default_rng(6)
    arm = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.2))

    def seen(count, noise):
        q = rng.uniform(-2.0, 2.0, (count, 6))
        return Position(q, rm.dgm(arm, q)[:, :3, 3] + noise * rng.normal(size=(count, 3)))

    small = fit(arm, [seen(4, 1e-4) for _ in range(20)], **ALONE).solution.scales
    assert max(s[0] for s in small) < 1.5 * min(s[0] for s in small)
    good, bad = fit(arm, [seen(200, 1e-4), seen(200, 1e-3)], **ALONE).solution.scales
    assert good[0] < 4e-4
    assert bad[0] > 8e-4


@pytest.mark.parametrize("seed", range(3))
def test_nearly_parallel_axes_do_not_drive_lengths_away(seed):
    """A small error of beta is not carried by centimetres of others that nothing measures."""
    rng = np.random.default_rng(seed)
    arm = rm.load("rx90")
    table = arm.table
    alpha, d = table.alpha.copy(), table.d.copy()
    alpha[5], d[5] = 0.03, 0.3
    arm = arm.with_table(
        dataclasses.replace(table, alpha=alpha, d=d, r=np.array([0, 0.1, 0.1, 0.45, 0.1, 0.1]))
    ).with_tool(rm.se3.translation(0.05, 0.02, 0.15))
    p = candidate_parameters(arm)
    size = np.array([1e-3 if e.element.is_length else 4e-3 for e in p.entries])
    real = rm.calibration.calibrated_model(p, size * rng.normal(size=len(p))).model
    q, other = rng.uniform(-2.0, 2.0, (2, 60, 6))
    relative = np.linalg.inv(rm.dgm(real, q)) @ rm.dgm(real, other)
    relative[:, :3, 3] += 1e-4 * rng.normal(size=(60, 3))
    result = fit(arm, RelativePose(q, other, relative), **ALONE)
    tool = rm.se3.translation(-0.1, 0.12, 0.05)

    def apart(model):
        said, there = (rm.dgm(m.with_tool(tool), q)[:, :3, 3] for m in (model, real))
        Z = best_motion(said, there)
        return np.linalg.norm(said @ Z[:3, :3].T + Z[:3, 3] - there, axis=1).mean()

    shared = fit(
        arm, RelativePose(q, other, relative), prior=ParameterPrior(truncated=False), **ALONE
    )
    assert apart(result.model) < 0.6 * apart(arm)
    assert apart(result.model) < 1.1 * apart(shared.model)
    assert np.abs(result.corrections[np.array(result.units) == "m"]).max() < 0.01


def test_the_prior_of_lengths_is_that_of_a_small_robot():
    """An arm of 5 cm has errors of some hundredths of a millimetre, and so has another tool."""
    rng = np.random.default_rng(2)
    arm = rm.load("rx90")
    table = dataclasses.replace(arm.table, d=0.05 * arm.table.d, r=0.05 * arm.table.r)
    arm = arm.with_table(table).with_tool(rm.se3.translation(0.0025, 0.001, 0.01))
    q = rng.uniform(-2.0, 2.0, (60, 6))
    p = rm.dgm(arm, q)[:, :3, 3] + 1e-5 * rng.normal(size=(60, 3))
    result = fit(arm, Position(q, p), **ALONE)
    sizes = result.solution.fit.prior.sigma[: len(result.names)]
    lengths = [e.element.is_length and 0 < e.row <= 6 for e in result.parameters.entries]
    assert sizes[lengths] == pytest.approx(1e-3 * result.parameters.table.size)
    assert result.other_tool.rms < 1e-4


def test_what_only_the_solution_tells_joins_the_fit():
    """Axes that meet at the nominal robot and not at the real one make more identifiable."""
    rng = np.random.default_rng(4)
    arm = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.15))
    table = arm.table
    real = arm.with_table(dataclasses.replace(table, alpha=table.alpha + 0.03 * rng.normal(size=6)))
    q = rng.uniform(-2.0, 2.0, (80, 6))
    p = rm.dgm(real, q)[:, :3, 3] + 1e-5 * rng.normal(size=(80, 3))
    result = fit(arm, Position(q, p), **ALONE)
    assert set(result.identifiable_after.names) <= set(result.names)
    assert result.validation.in_sample.rms["m"] < 3e-5
