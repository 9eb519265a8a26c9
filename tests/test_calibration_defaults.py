"""The defaults of calibration: another tool on a calibrated arm, and robots far from nominal."""

import dataclasses

import numpy as np
import pytest
from calibration_arms import ALONE

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Position,
    candidate_parameters,
    fit,
    report,
)
from robotmodels.calibration.alignment import best_motion
from robotmodels.calibration.other_tool import other_tool_error


def apart(model, real, q, read=None):
    """Rms distance of another tool on two robots, the base put where it suits best, m."""
    tool = rm.se3.translation(-0.1, 0.12, 0.05)
    said, p = (rm.dgm(m.with_tool(tool), x)[:, :3, 3]
               for m, x in ((model, q if read is None else read), (real, q)))  # fmt: skip
    Z = best_motion(said, p)
    return np.sqrt(np.mean(np.sum((said @ Z[:3, :3].T + Z[:3, 3] - p) ** 2, axis=1)))


@pytest.fixture(scope="module")
def panda():
    data = rm.datasets.panda_double_socket()
    in_0, in_1 = data.places["front"]
    touched = PointContact([*in_0, *in_1], [0] * len(in_0) + [1] * len(in_1))
    return data, [touched, KnownDistance("point:0", "point:1", data.distance)]


def test_a_real_arm_keeps_its_flange_and_says_how_far_another_tool_could_be_off(panda):
    """README's example: with no prior, or told by name only, the flange moved by centimetres."""
    data, measured = panda
    everywhere = []
    for k, (in_0, in_1) in enumerate(data.places.values()):
        touched = PointContact([*in_0, *in_1], [f"{k}:0"] * len(in_0) + [f"{k}:1"] * len(in_1))
        known = KnownDistance(f"point:{k}:0", f"point:{k}:1", data.distance)
        everywhere += [touched, known]
    best, q = fit(data.model, everywhere, **ALONE).model, measured[0].q
    for options in ({"prior": None}, {}):
        result = fit(data.model, measured, **options, **ALONE)
        assert apart(result.model, best, q) < 0.2 * apart(data.model, best, q)
        assert result.validation.in_sample.mean["m"] < 2.2e-4
        assert np.abs(result.corrections).max() < 0.03
    found = result.other_tool
    assert found == other_tool_error(result)
    assert found.rms < min(found.largest, 0.3 * found.nominal)
    words = " ".join(report(result).split())
    assert f"in the measured postures: {1e3 * found.rms:.2g} mm" in words
    assert "Prior standard deviations of the table: 1 mm, 5 mrad." in words
    # a longer tool, and postures elsewhere, are further off
    assert other_tool_error(result, length=2.0 * found.length).rms > found.rms
    low, high = np.maximum(data.model.lower, -2.5), np.minimum(data.model.upper, 2.5)
    elsewhere = np.random.default_rng(0).uniform(low, high, (200, 7))
    assert other_tool_error(result, elsewhere).rms > found.rms


def test_the_prediction_is_the_spread_of_what_it_predicts():
    """Exact model and prior: over robots drawn from the prior, errors have the size predicted."""
    rng = np.random.default_rng(8)
    arm = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.2))
    p = candidate_parameters(arm, base=False)
    size = np.array([1e-3 if e.element.is_length else 5e-3 for e in p.entries])
    q = rng.uniform(-2.0, 2.0, (40, 6))
    tool = rm.se3.translation(0.15, 0.0, 0.0), rm.se3.translation(0.0, 0.0, 0.15)
    squares, predicted = [], []
    for _ in range(12):
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


@pytest.mark.sampled(1)
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
