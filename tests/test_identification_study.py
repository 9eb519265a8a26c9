"""Intervals hold the truth as often as they say, and methods are unbiased where they claim it.

A small part of `benchmarks/accuracy_identification.py`, on an RX-90 with drives.
"""

from functools import cache

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.identification import (
    EstimateStatus,
    Log,
    choose_processing,
    correlated_covariance,
    equations,
    exciting_trajectory,
    ordinary,
    reduce_equations,
    weighted,
    with_delay,
)
from robotmodels.identification.closed_loop import (
    Controller,
    closed_loop,
    didim,
    hausman_test,
    instrumental,
    simulated_log,
    tuned_controller,
)
from robotmodels.identification.closed_loop.loop import least_width
from robotmodels.identification.methods.least_squares import solved, weights_of

DT, PERIOD = 1e-3, 10.0
FILTER = {"cutoff": 15.0, "dead_band": 0.1}


@cache
def arm():
    return rm.load("rx90").with_drive(
        rm.DriveParameters(
            Ia=[4.0, 4.0, 1.5, 0.3, 0.2, 0.1], Fv=[20.0, 20.0, 10.0, 3.0, 2.0, 1.0],
            Fc=[10.0, 10.0, 6.0, 2.0, 1.5, 1.0], offset=[0.3, -0.2, 0.1, 0.05, -0.05, 0.02],
        )
    )  # fmt: skip


@cache
def base():
    return rm.base_parameters(arm(), drive=True)


def truth():
    return base().values(arm())


@cache
def references(seconds):
    found = exciting_trajectory(
        arm(), duration=PERIOD, drive=True, starts=1, baseline=1, iterations=20, rng=0
    )
    t = (DT * np.arange(round(seconds / DT))) % PERIOD
    return found.trajectory.q(t), found.trajectory.v(t), found.trajectory.a(t)


@cache
def controller():
    """Gains, with the torques of a robot whose bodies are 10 % heavier fed forward."""
    q, _, _ = references(PERIOD)
    gains = tuned_controller(arm(), q, 8.0, period=DT, feed_forward=False)
    near = arm().with_inertia(type(arm().inertia)(1.1 * arm().inertia.values))
    return Controller(gains.kp, gains.kd, feed_forward=near), least_width(arm(), q, DT)


@cache
def controlled(seconds):
    q, v, _ = references(seconds)
    own, width = controller()
    return simulated_log(arm(), own, q, v, DT, width=width)


@cache
def followed(seconds):
    q, v, a = references(seconds)
    return Log(DT, q, rm.idm(arm(), q, v, a))


def noisy(clean, seed, position=1e-4, torque=0.05):
    rng = np.random.default_rng(seed)
    q = clean.q + position * rng.normal(size=clean.q.shape)
    tau = clean.tau + torque * rng.normal(size=clean.q.shape)
    return Log(DT, q, tau, q_ref=clean.q_ref, v_ref=clean.v_ref)


def least_squares(log, choices, way=weighted):
    """Estimate, its deviations for correlated residuals, equations and reduction."""
    system = equations(base(), log, choices)
    reduction = reduce_equations(system)
    found = way(reduction)
    w = weights_of(found.sigma, reduction) if way is weighted else np.ones(system.kinds)
    _, inverse, _ = solved(reduction, w)
    spread = correlated_covariance(system, found.values, w, inverse)
    return found, np.sqrt(np.diag(spread.covariance)), system, reduction


def loop_of(system, start):
    own, width = controller()
    return closed_loop(system, start, own, width=width)


def unbiased(z, level=1e-4):
    """Whether the mean of each column of normal errors over their deviations may be zero."""
    from scipy.stats import norm

    bound = norm.isf(level / 2.0 / z.shape[1])
    return np.abs(z.mean(axis=0)).max() * np.sqrt(len(z)) < bound


def test_intervals_of_weighted_least_squares_hold_the_truth():
    logs = 10
    z = np.empty((logs, len(base())))
    for seed in range(logs):
        log = noisy(followed(20.0), seed)
        found, deviations, _, _ = least_squares(log, choose_processing(log))
        z[seed] = (found.values - truth()) / deviations
    inside = (np.abs(z) < 1.96).mean(axis=1)
    assert 0.92 - 3.0 * inside.std(ddof=1) / np.sqrt(logs) < inside.mean()
    assert inside.mean() < 0.97 + 3.0 * inside.std(ddof=1) / np.sqrt(logs)
    assert 0.85 < np.sqrt(np.mean(z**2)) < 1.25
    assert unbiased(z)


def test_a_held_torque_acts_half_a_period_later():
    # what is sampled at the beginning of a period is the torque of the whole period
    whole = controlled(PERIOD)
    clean = Log(DT, whole.q, whole.tau)  # without its velocities and accelerations
    choices = choose_processing(noisy(clean, 0), **FILTER)
    early, _, _, _ = least_squares(clean, choices, ordinary)
    right, _, _, _ = least_squares(with_delay(clean, -0.5 * DT), choices, ordinary)
    assert early.sigma @ early.sigma > 10.0 * right.sigma @ right.sigma
    errors = [np.abs(x.values - truth()) for x in (early, right)]
    assert np.linalg.norm(errors[1]) < 0.3 * np.linalg.norm(errors[0])


def test_instruments_and_didim_are_unbiased_and_the_test_has_nothing_to_say():
    z = {instrumental: [], didim: []}
    verdicts = []
    for seed in range(3):
        log = noisy(controlled(PERIOD), seed)
        moved = with_delay(log, -0.5 * DT)
        choices = choose_processing(moved, **FILTER)
        for method in z:
            own = moved if method is instrumental else log
            found, _, system, reduction = least_squares(own, choices)
            loop = loop_of(system, found.values)
            after = method(system, reduction, start=found.values, loop=loop)
            assert after.status is EstimateStatus.SOLVED
            z[method].append((after.values - truth()) / after.deviations)
            if method is instrumental:
                verdicts.append(hausman_test(system, after).p)
    for errors in map(np.array, z.values()):
        assert unbiased(errors)
        assert 0.6 < np.sqrt(np.mean(errors**2)) < 1.5
    assert min(verdicts) > 0.05


def test_least_squares_without_filter_are_biased_and_the_test_says_so():
    log = noisy(controlled(PERIOD), 3)
    moved = with_delay(log, -0.5 * DT)
    start = least_squares(moved, choose_processing(moved, **FILTER))[0].values
    raw = choose_processing(moved, filtered=False, decimation=1, edges=0.2, dead_band=0.3)
    found, deviations, system, reduction = least_squares(moved, raw, ordinary)
    z = (found.values - truth()) / deviations
    # by chance, one of a hundred thousand is beyond 4.5
    assert (np.abs(z) > 4.5).sum() >= 10
    assert np.abs(z).max() > 100.0
    loop = loop_of(system, start)
    after = instrumental(system, reduction, start=start, loop=loop)
    verdict = hausman_test(system, after)
    assert verdict.biased
    assert verdict.p < 1e-6
    system = equations(base(), log, raw)
    simulated = didim(system, reduce_equations(system), start=start, loop=loop_of(system, start))
    assert simulated.status is EstimateStatus.SOLVED
    for estimate in (after, simulated):
        assert np.abs((estimate.values - truth()) / estimate.deviations).max() < 4.5
    # instruments pay with variance where nothing is filtered, simulated motion does not
    errors = [np.linalg.norm(x.values - truth()) for x in (simulated, after, found)]
    assert errors[0] < 0.1 * errors[2]
    assert errors[1] < errors[2]


@pytest.mark.parametrize("way", [weighted, ordinary], ids=["wls", "ols"])
def test_a_proper_filter_leaves_no_bias(way):
    z = np.empty((6, len(base())))
    for seed in range(6):
        log = noisy(controlled(PERIOD), 20 + seed)
        moved = with_delay(log, -0.5 * DT)
        found, deviations, _, _ = least_squares(moved, choose_processing(moved, **FILTER), way)
        z[seed] = (found.values - truth()) / deviations
    assert unbiased(z)
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.5
