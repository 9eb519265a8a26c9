"""Noise of the positions: least squares are biased and the test says so; the others are not."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.drive import DriveParameters
from robotmodels.estimation.linear import ordinary
from robotmodels.identification import Log, choose_processing, equations, reduce_equations
from robotmodels.identification.closed_loop import (
    Didim,
    Instrumental,
    hausman_test,
    simulated_log,
    tuned_controller,
)
from robotmodels.identification.signals import central_differences
from robotmodels.inertia import InertialParameters

DT = 2e-3
WIDTH = 0.01


def arm():
    bodies = InertialParameters.from_com(
        [3.0, 2.0], [[0.3, 0.02, 0.0], [0.2, 0.01, 0.0]],
        [np.diag([0.02, 0.1, 0.1]), np.diag([0.01, 0.05, 0.05])],
    )  # fmt: skip
    drive = DriveParameters(Ia=[0.1, 0.05], Fv=[1.0, 0.5], Fc=[0.8, 0.4], offset=[0.1, -0.1])
    return rm.load("planar_2r").with_inertia(bodies).with_drive(drive)


def recorded():
    """Log without noise, and the controller."""
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 3.0, DT)[:, None]
    q, v = np.zeros((len(t), 2)), np.zeros((len(t), 2))
    for k in range(1, 6):
        w = np.pi * k
        c, p = rng.normal(size=2) * 0.7 / k, rng.uniform(0.0, 6.0, 2)
        q += c * np.sin(w * t + p)
        v += c * w * np.cos(w * t + p)
    control = tuned_controller(arm(), q, 8.0, period=DT, feed_forward=False)
    return control, simulated_log(arm(), control, q, v, DT, width=WIDTH)


def studied(count, position, torque, decimation, methods):
    """Of so many noisy logs: errors in deviations by method, verdicts of the test, and errors of
    the least squares that it tests.
    """
    control, exact = recorded()
    base = rm.base_parameters(arm(), drive=True)
    truth = base.values(arm())
    rng = np.random.default_rng(1)
    errors, verdicts, off = [], [], []
    for _ in range(count):
        e = position * rng.normal(size=exact.q.shape)
        de = central_differences(e, DT)
        log = Log(
            DT, exact.q + e, exact.tau + torque * rng.normal(size=e.shape), exact.v + de,
            exact.a + central_differences(de, DT), exact.q_ref, exact.v_ref,
        )  # fmt: skip
        choices = choose_processing(
            log, decimation=decimation, dead_band=0.05, edges=0.0, filtered=False
        )
        system = equations(base, log, choices)
        factors = reduce_equations(system)
        options = {"start": 1.1 * truth, "lags": 0, "width": WIDTH}
        both = [m(control, **options).solve(system, factors) for m in methods]
        found = (ordinary(factors), *both)
        errors.append([(one.values - truth) / one.standard_errors for one in found])
        verdict = hausman_test(system, both[0], lags=0)
        off.append((both[0].values + verdict.effect - truth) / verdict.least_squares_errors)
        verdicts.append(verdict)
    return np.array(errors), verdicts, np.array(off)


@pytest.mark.nightly
def test_differentiated_noise_biases_least_squares_alone_and_the_test_says_so():
    count = 8
    errors, verdicts, _ = studied(count, 1e-4, 0.5, 1, (Instrumental, Didim))
    z = errors.mean(axis=0) * np.sqrt(count)  # of order one where nothing is biased
    assert np.abs(z[0]).max() > 6.0
    assert np.abs(z[1:]).max() < 4.0
    for verdict in verdicts:
        assert verdict.p < 1e-3
        named = [x for x, bad in zip(verdict.names, verdict.biased_parameters, strict=True) if bad]
        assert named
        assert all(f"{name} (" in verdict.sentence for name in named)


def test_the_test_names_parameters_whose_bias_matters_and_no_others():
    _, verdicts, off = studied(6, 3e-5, 0.5, 1, (Instrumental,))
    bias = np.abs(off.mean(axis=0))
    named = np.mean([verdict.biased_parameters for verdict in verdicts], axis=0)
    assert (bias > 2.0).sum() >= 3
    assert (named[bias > 2.0] == 1.0).all()
    assert (bias < 0.5).sum() >= 3
    assert (named[bias < 0.5] == 0.0).all()


@pytest.mark.nightly
@pytest.mark.parametrize(("position", "decimation"), [(0.0, 10), (3e-6, 1), (3e-5, 10)])
def test_noise_whose_bias_does_not_matter_is_not_rejected(position, decimation):
    _, verdicts, off = studied(10, position, 0.5, decimation, (Instrumental,))
    assert np.abs(off.mean(axis=0)).max() < 0.7  # half a standard error, and what ten logs tell
    assert np.mean([verdict.biased for verdict in verdicts]) <= 0.1
