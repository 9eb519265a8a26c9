"""Effects of a sampled controller and of unfiltered noise on the methods, on an RX-90 with drives.

Intervals and biases of filtered logs are those of `oracles/frozen_study.json`, 51 logs.
"""

import numpy as np
from frozen_estimates import DT, FILTER, study

from robotmodels.estimation.estimate import EstimateStatus
from robotmodels.estimation.linear import ordinary, solved, weighted
from robotmodels.identification import (
    Didim,
    Instrumental,
    Log,
    choose_processing,
    correlated_covariance,
    equations,
    hausman_test,
    reduce_equations,
)
from robotmodels.logs import with_delay


def least_squares(log, choices, way=weighted):
    """Estimate, equations and factors."""
    system = equations(study().base, log, choices)
    factors = reduce_equations(system)
    return way(factors), system, factors


def test_a_held_torque_acts_half_a_period_later():
    # what is sampled at the beginning of a period is the torque of the whole period
    whole = study().controlled()
    clean = Log(DT, whole.q, whole.tau)  # without its velocities and accelerations
    choices = choose_processing(study().noisy(clean, 0), **FILTER)
    early, right = (
        least_squares(log, choices, ordinary)[0] for log in (clean, with_delay(clean, -0.5 * DT))
    )
    assert early.sigma @ early.sigma > 10.0 * right.sigma @ right.sigma
    errors = [np.linalg.norm(x.values - study().truth) for x in (early, right)]
    assert errors[1] < 0.3 * errors[0]


def test_least_squares_without_filter_are_biased_and_the_test_says_so():
    truth = study().truth
    log = study().noisy(study().controlled(), 3)
    moved = with_delay(log, -0.5 * DT)
    start = least_squares(moved, choose_processing(moved, **FILTER))[0].values
    raw = choose_processing(moved, filtered=False, decimation=1, edges=0.2, dead_band=0.3)
    found, system, factors = least_squares(moved, raw, ordinary)
    weights = np.ones(system.groups)
    inverse = solved(factors, weights)[1]
    spread = correlated_covariance(system, found.values, weights, inverse).covariance
    z = (found.values - truth) / np.sqrt(np.diag(spread))
    # by chance, one of a hundred thousand is beyond 4.5
    assert (np.abs(z) > 4.5).sum() >= 10
    assert np.abs(z).max() > 100.0
    options = {"start": start, "width": study().given["width"]}
    after = Instrumental(study().controller, **options).solve(system, factors)
    verdict = hausman_test(system, after)
    assert verdict.biased
    assert verdict.p < 1e-6
    system = equations(study().base, log, raw)
    method = Didim(study().controller, **options)
    simulated = method.solve(system, reduce_equations(system))
    assert simulated.status is EstimateStatus.SOLVED
    for estimate in (after, simulated):
        assert np.abs((estimate.values - truth) / estimate.standard_errors).max() < 4.5
    # instruments pay with variance where nothing is filtered, simulated motion does not
    errors = [np.linalg.norm(x.values - truth) for x in (simulated, after, found)]
    assert errors[0] < 0.1 * errors[2]
    assert errors[1] < errors[2]
