"""Methods and forms of identification: noise, outliers, priors, drift, essential parameters."""

import sys

import numpy as np
import pytest
from identification_fleet import clean_log, odd_robots, raw, swinging

import robotmodels as rm
from robotmodels.estimation.estimate import EstimateStatus
from robotmodels.estimation.factor import TriangularFactors, factors_of
from robotmodels.estimation.linear import first_weights, ordinary, ridge, weighted
from robotmodels.estimation.total import TotalStatus, total
from robotmodels.friction import AsymmetricFriction
from robotmodels.identification import (
    Log,
    Recursive,
    Ridge,
    Robust,
    Sequential,
    Total,
    choose_processing,
    equations,
    fit,
    reduce_equations,
)
from robotmodels.identification.equations import segments
from robotmodels.identification.forms import EquationForm
from robotmodels.identification.method_names import method_of
from robotmodels.identification.methods.base import RULES, essential
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import torque_regressor

ROBOTS = odd_robots()
BASES = {name: base_parameters(model, drive=True) for name, model in ROBOTS.items()}
CASES = ("robust", "robust:loss=tukey", "robust:loss=cauchy", "robust:loss=squares", "tls", "ridge")
CASES += ("sequential", "recursive")
FORMS = list(EquationForm)


def prepared(name, noise=0.0, seed=3, log=None, form=EquationForm.TORQUE, **options):
    """Equations of a log of a robot, their factors, and the true parameters."""
    options = {"samples": 2000, "dt": 4e-3} | options
    log = log or clean_log(ROBOTS[name], seed, noise, **options)
    system = equations(BASES[name], log, raw(log), form)
    return system, reduce_equations(system), BASES[name].values(ROBOTS[name])


def of_columns(A, y, names=("XX1", "XY1", "XZ1", "offset1")):
    """Factors of one group of equations A x = y."""
    return factors_of(names[: A.shape[1]], A[:, None], y[:, None], np.ones((len(y), 1), dtype=bool))


def grouped(*sides):
    """Factors of several groups of equations A x = y."""
    parts = [of_columns(*side) for side in sides]
    counts = np.array([len(y) for _, y in sides])
    return TriangularFactors(
        parts[0].names, tuple(part.factors[0] for part in parts), counts, 0 * counts
    )


@pytest.mark.parametrize("method", [*CASES, "prior"])
@pytest.mark.nightly
def test_covariances_hold_over_many_logs(method):
    """Squares of errors in units of the covariance add up to the number of parameters."""
    sums, errors, stated = [], [], []
    for seed in range(30):
        system, factors, true = prepared("zero lengths", 0.5, 100 + seed, samples=400, dt=0.02)
        if method == "prior":  # a true prior
            spread = 0.01 * np.ones(len(true))
            drawn = true + spread * np.random.default_rng(seed).normal(size=len(true))
            found = Ridge(drawn, spread).solve(system, factors)
            assert 1.0 < found.details.degrees < len(true) - 1
        else:
            way = Total(0.0) if method == "tls" else method_of(method)
            found = way.solve(system, factors)
        e = found.values - true
        sums.append(e @ np.linalg.solve(found.covariance, e))
        errors.append(e)
        stated.append(found.standard_errors)
    b = len(true)
    # the mean of 30 chi squares of b degrees, within four standard deviations
    assert abs(np.mean(sums) / b - 1.0) < 4.0 * np.sqrt(2.0 / (30 * b)) + 0.06
    assert 0.8 < np.median(np.std(errors, axis=0) / np.mean(stated, axis=0)) < 1.25


# --- weights ----------------------------------------------------------------------------------


@pytest.mark.parametrize("sizes", [((12, 1.0),), ((30, 1.0), (15, 0.2))])
def test_deviations_and_covariance_of_few_equations_are_those_of_the_textbook(sizes, rng):
    """Groups share the parameters by leverage."""
    sides = [(rng.normal(size=(n, 3)) * s, rng.normal(size=n)) for n, s in sizes]
    A, y = (np.concatenate(parts) for parts in zip(*sides, strict=True))
    x, inverse = np.linalg.lstsq(A, y)[0], np.linalg.inv(A.T @ A)
    sigma = [
        np.sqrt(((y - A @ x) ** 2).sum() / (len(y) - np.trace(A @ inverse @ A.T))) for A, y in sides
    ]
    expected = ((y - A @ x) ** 2).sum() / (len(y) - 3) * inverse
    found = ordinary(grouped(*sides))
    np.testing.assert_allclose(found.values, x, rtol=1e-11)
    np.testing.assert_allclose(found.sigma, sigma, rtol=1e-11)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-10, atol=1e-12)


# --- outliers ---------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("loss", ["huber", "cauchy", "tukey"])
def test_spikes_in_five_per_cent_of_the_torques_do_no_harm(loss):
    name = "coupled wrist"
    rng = np.random.default_rng(11)
    log = clean_log(ROBOTS[name], rng, 0.05, samples=3000)
    tau, hit = np.array(log.tau), rng.random(log.tau.shape) < 0.05
    hit[:, 0] = False
    tau[hit] += rng.uniform(10.0, 30.0, size=tau.shape)[hit]
    system, factors, true = prepared(name, log=Log(log.dt, log.q, tau, log.v, log.a))
    found = Robust(loss).solve(system, factors)
    clean = weighted(prepared(name, log=log)[1]).standard_errors
    assert found.status is EstimateStatus.SOLVED
    assert np.abs((weighted(factors).values - true) / clean).max() > 20.0
    assert np.abs((found.values - true) / clean).max() < (10.0 if loss == "huber" else 5.0)
    assert np.abs(found.sigma - 0.05).max() < (0.02 if loss == "huber" else 0.015)
    far = found.details
    assert (np.abs(far.counts - hit.sum(axis=0)) <= 3).all()
    assert len(far.t) == min(int(far.counts.sum()), 1000)
    places = zip(np.round(far.t / log.dt).astype(int), far.group, strict=True)
    assert np.mean([hit[k, j] for k, j in places]) > 0.98
    assert (np.diff(far.t) >= 0.0).all()
    assert str(int(far.counts.sum())) in found.notes[0]


# --- noise in the columns ---------------------------------------------------------------------


def test_total_least_squares_is_unbiased_where_least_squares_is_not():
    rng, x = np.random.default_rng(4), np.array([2.0, -1.0, 0.5, 3.0])
    sums, plain = [], []
    for _ in range(60):
        A = np.column_stack((rng.normal(size=(4000, 3)), np.ones(4000)))
        noisy = A + 0.3 * rng.normal(size=A.shape) * [1, 1, 1, 0]
        factors = of_columns(noisy, A @ x + 0.1 * rng.normal(size=4000))
        found = total(factors, [0.3, 0.3, 0.3, 0.0, 0.1])
        assert found.details.solution is TotalStatus.UNIQUE
        e = found.values - x
        sums.append(e @ np.linalg.solve(found.covariance, e))
        plain.append(weighted(factors).values - x)
        # the scale times the assumed noise of the right side is its noise
        noise = found.details.scale * found.details.noise[-1] * weighted(factors).sigma[0]
        assert abs(noise - 0.1) < 0.006
    assert abs(np.mean(sums) / 4 - 1.0) < 0.45
    assert np.mean(plain, axis=0)[0] < -0.1


# --- priors -----------------------------------------------------------------------------------


def test_a_prior_is_equal_to_extra_equations():
    _, factors, true = prepared("prismatic", 0.5, samples=200)
    b, rng = len(true), np.random.default_rng(0)
    prior, spread = true + 0.1 * rng.normal(size=b), rng.uniform(0.01, 1.0, size=b)
    R, y, _ = factors.stacked(first_weights(factors))
    for strength in (None, 1.0, 0.0, 40.0):
        s = np.sqrt(1.0 if strength is None else strength)
        whole, side = np.vstack((R, np.diag(s / spread))), np.append(y, s * prior / spread)
        found = ridge(factors, prior, spread, strength)
        expected = np.linalg.lstsq(whole, side, rcond=None)[0]
        inverse = np.linalg.inv(whole.T @ whole)
        np.testing.assert_allclose(found.values, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance, inverse, rtol=1e-6)
        assert abs(found.details.degrees - np.trace(R @ inverse @ R.T)) < 1e-7
    free = ridge(factors, strength=0.0).values
    np.testing.assert_allclose(free, weighted(factors).values, rtol=1e-9)
    assert ridge(factors, prior, spread, strength=1e12).details.degrees < 0.01


def test_the_strength_follows_the_quality_of_the_prior():
    # a log of little information: a true prior helps, a wrong one has little strength
    system, factors, true = prepared("prismatic", 20.0, samples=300)
    parts = segments(system, 4)
    assert sum(part.rows for part in parts) == factors.rows
    plain = np.abs(weighted(factors).values - true).sum()
    right, far = (ridge(factors, prior, folds=parts) for prior in (true, true + 3.0))
    assert right.details.strength > 10.0 * far.details.strength
    assert np.abs(right.values - true).sum() < 0.5 * plain
    assert right.details.degrees < far.details.degrees


# --- joint by joint -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["coupled wrist", "tree", "rx90"])
def test_steps_go_from_the_last_joint_to_the_first(name):
    system, factors, _ = prepared(name, 0.1)
    found = Sequential().solve(system, factors)
    steps = found.details
    assert sorted(j for step in steps for j in step.joints) == list(range(1, ROBOTS[name].n + 1))
    firsts = [step.joints[0] for step in steps]
    assert firsts == sorted(firsts, reverse=True)
    assert ((3, 4) in [step.joints for step in steps]) == (name == "coupled wrist")
    assert sorted(name for step in steps for name in step.names) == sorted(factors.names)
    assert all(abs(step.sigma - 0.1) < 0.01 for step in steps)
    assert steps[0].equations == factors.counts[-1] * len(steps[0].joints)
    # all steps at once are never worse
    assert (found.standard_errors > 0.95 * weighted(factors).standard_errors).all()


# --- in time ------------------------------------------------------------------------------------


def test_forgetting_follows_a_parameter_that_drifts():
    name = "serial"
    log = clean_log(ROBOTS[name], np.random.default_rng(3), 0.05, samples=6000)
    k = BASES[name].names.index("Fv4")
    tau = np.array(log.tau)
    tau[:, 3] += np.where(np.arange(6000) < 3000, 0.0, 2.0) * log.v[:, 3]
    system, factors, true = prepared(name, log=Log(log.dt, log.q, tau, log.v, log.a))
    found = Recursive(0.998).solve(system, factors)
    history = found.details
    assert abs(history.memory - 500.0) < 1.0
    assert abs(found.values[k] - true[k] - 2.0) < 0.1
    assert abs(weighted(factors).values[k] - true[k] - 2.0) > 0.4
    before = np.searchsorted(history.t, 3000 * log.dt) - 1
    assert abs(history.values[before, k] - true[k]) < 0.1
    # weights by age
    blocks = list(system.blocks())
    W, y = (np.concatenate([getattr(b, x) for b in blocks]) for x in ("W", "y"))
    w = 0.998 ** (np.arange(5999, -1, -1)[:, None] / 2.0) * first_weights(factors)
    A, side = (w[..., None] * W).reshape(-1, len(true)), (w * y).reshape(-1)
    expected = np.linalg.lstsq(A, side, rcond=None)[0]
    np.testing.assert_allclose(found.values, expected, atol=1e-9)


# --- essential parameters -----------------------------------------------------------------------

NAMES = ("XX1", "XY1", "XZ1", "YZ1", "ZZ1", "MX1", "MY1", "Fv1")


@pytest.mark.parametrize("rule", RULES)
def test_parameters_without_effect_are_dropped_in_the_order_of_their_errors(rule):
    rng = np.random.default_rng(2)
    A = rng.normal(size=(2000, 8))
    y = A @ [100.0, 50.0, 20.0, 10.0, 0.0, 0.0, 0.0, 0.03] + rng.normal(size=2000)
    factors = of_columns(A, y, NAMES)
    names, dropped, _ = essential(factors, weighted(factors), rule)
    assert names[:4] == NAMES[:4]
    assert len(names) + len(dropped) == 8
    assert len(names) <= 6
    kept = list(range(8))
    for name in dropped:
        values, rest, *_ = np.linalg.lstsq(A[:, kept], y, rcond=None)
        inverse = np.linalg.inv(A[:, kept].T @ A[:, kept])
        relative = np.sqrt(rest[0] * np.diag(inverse)) / np.abs(values)
        assert NAMES[kept[int(np.argmax(relative))]] == name
        kept.pop(int(np.argmax(relative)))
    again = weighted(factors.with_names(names)).values
    np.testing.assert_allclose(again, np.linalg.lstsq(A[:, kept], y, rcond=None)[0], rtol=1e-9)


def test_residuals_grow_by_a_tenth_at_most_or_by_chance():
    _, factors, _ = prepared("rx90", 0.5)
    first, weights = weighted(factors), first_weights(factors)
    rest = factors.stacked(weights)[2]

    def grown(names):
        return np.sqrt(factors.with_names(names).stacked(weights)[2] / rest) - 1.0

    assert 0.05 < grown(essential(factors, first)[0]) <= 0.1
    _, dropped, _ = essential(factors, first, "f_test")
    assert (first.relative_errors[[factors.names.index(name) for name in dropped]] > 0.2).all()
    names, dropped, _ = essential(factors, first, "aic")
    assert grown(names) < np.exp(len(dropped) / factors.rows) - 1.0


def test_options_by_parameter_follow_the_essential_parameters():
    arm, log = rm.datasets.example_log()
    free = fit(arm, log)
    prior = free.values * (1.0 + 1e-3 * np.arange(len(free.names)))
    found = fit(arm, log, Ridge(prior, 1e-11 + 1e-11 * np.abs(prior), essential=3.0))
    assert found.details.dropped
    kept = [free.names.index(name) for name in found.names]
    np.testing.assert_allclose(found.values, prior[kept], rtol=1e-6)
    assert Total([0.1, 0.2, 0.3, 4.0]).without([1]).noise.tolist() == [0.1, 0.3, 4.0]
    assert (Total(0.1).without([1]).noise, Ridge(arm).without([1]).prior) == (0.1, arm)


# --- forms --------------------------------------------------------------------------------------


def collected(system):
    blocks = list(system.blocks())
    fields = ("t", "W", "y", "use", "v")
    return {name: np.concatenate([getattr(b, name) for b in blocks]) for name in fields}


@pytest.mark.parametrize(("decimation", "cutoff"), [(1, None), (6, None), (4, 20.0)])
@pytest.mark.parametrize("form", FORMS)
def test_pieces_are_the_whole(form, decimation, cutoff, monkeypatch):
    """Filter, differences, integrals and decimation; no piece has an end of its own."""
    model = ROBOTS["coupled wrist"]
    log = clean_log(model, 3, samples=1501)
    processing = raw(log, decimation)
    if cutoff is not None:
        log = Log(log.dt, log.q, log.tau)
        processing = choose_processing(log, decimation=decimation, cutoff=cutoff)
    system = equations(base_parameters(model), log, processing, form)
    whole = collected(system)
    for size in (90, 300):
        monkeypatch.setattr(sys.modules["robotmodels.identification.signals"], "PIECE", size)
        assert len(system.pieces()) > 4
        for name, array in collected(system).items():
            atol = 2e-11 if cutoff is None else 1e-9 * np.abs(whole[name]).max()
            np.testing.assert_allclose(array, whole[name], rtol=0, atol=atol)


@pytest.mark.parametrize("form", FORMS)
def test_stretches_at_rest_are_left_out(form):
    model = ROBOTS["serial"]
    rng = np.random.default_rng(5)
    q, v, a = swinging(model, rng, samples=1200)
    rest = slice(400, 800)
    still = [np.array(x) for x in (q, v, a)]
    still[0][rest], still[1][rest], still[2][rest] = q[400], 0.0, 0.0
    one = np.array(v)
    one[rest, 0] = 0.0
    for speeds, alone in ((still[1], False), (one, True)):
        log = Log(2e-3, still[0], np.zeros_like(q), speeds, still[2])
        use = collected(equations(base_parameters(model), log, raw(log, 4, 1e-3), form))
        middle = (use["t"] > 0.9) & (use["t"] < 1.5)
        if form.by_joint:
            assert not use["use"][middle, 0].any()
            assert use["use"][middle, 1:].any() == alone
        else:
            assert use["use"][middle].all() if alone else not use["use"][middle].any()


@pytest.mark.parametrize("form", FORMS)
def test_several_recordings_some_too_short_with_a_friction_model(form):
    model, rng = ROBOTS["serial"], np.random.default_rng(8)
    lengths = (900, 5, 2, 800)
    parts = [swinging(model, np.random.default_rng(k), samples=n) for k, n in enumerate(lengths)]
    q, v, a = (np.concatenate(x) for x in zip(*parts, strict=True))
    friction = AsymmetricFriction(*np.ones((4, model.n)))
    base = base_parameters(model, drive=("Ia",), friction=friction)
    true = rng.normal(size=len(base))
    options = {"columns": base.names, "friction": base.friction}
    tau = torque_regressor(model, q, v, a, base.drive, **options) @ true
    log = Log(2e-3, q, tau, v, a, starts=(0, 900, 905, 907))
    factors = reduce_equations(equations(base, log, raw(log), form))
    assert np.abs(weighted(factors).values - true).max() < 1e-7
    inside = {EquationForm.FILTERED: 2 * 3, EquationForm.ENERGY: 2 * 3 + 1}.get(form, 0)
    assert (factors.counts == sum(max(n - inside, 0) for n in lengths)).all()
