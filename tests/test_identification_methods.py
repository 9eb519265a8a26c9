"""Robust, total, drawn, sequential and recursive least squares: exact data, noise, spikes."""

import pickle

import numpy as np
import pytest
from identification_logs import clean_log, odd_robots, swinging

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import column_basis
from robotmodels.estimation.losses import Loss
from robotmodels.identification import (
    EquationForm,
    EstimateStatus,
    Log,
    Method,
    choose_processing,
    equations,
    ordinary,
    reduce_equations,
    weighted,
)
from robotmodels.identification.methods.lengths import Lengths
from robotmodels.identification.methods.recursive import recursive
from robotmodels.identification.methods.ridge import ridge, segments, select_ridge_strength
from robotmodels.identification.methods.robust import robust
from robotmodels.identification.methods.sequential import sequential
from robotmodels.identification.methods.total import TotalStatus, total
from robotmodels.identification.scale.reduction import Reduction
from robotmodels.minimal_parameters import base_parameters

ROBOTS = odd_robots()
BASES = {name: base_parameters(model, drive=True) for name, model in ROBOTS.items()}
METHODS = {
    "huber": robust,
    "tukey": lambda s, r: robust(s, r, "tukey"),
    "cauchy": lambda s, r: robust(s, r, Loss.CAUCHY),
    "squares": lambda s, r: robust(s, r, "squares"),
    "total": lambda s, r: total(r),
    "ridge": lambda s, r: ridge(r),
    "ridge by parts": lambda s, r: ridge(r, parts=segments(s, 3)),
    "prior": lambda s, r: ridge(r, np.ones(len(r.names)), np.ones(len(r.names))),
    "sequential": sequential,
    "recursive": lambda s, r: recursive(s, r, every=250),
}


def prepared(name, noise=0.0, seed=3, log=None, form=EquationForm.TORQUE, **options):
    rng = np.random.default_rng(seed)
    options.setdefault("samples", 2000)
    options.setdefault("dt", 4e-3)
    given = clean_log(ROBOTS[name], rng, noise, **options) if log is None else log
    processing = choose_processing(given, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    system = equations(BASES[name], given, processing, form)
    return system, reduce_equations(system), BASES[name].values(ROBOTS[name])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ROBOTS)
def test_every_method_recovers_exact_parameters(name, method):
    system, reduction, true = prepared(name)
    found = METHODS[method](system, reduction)
    assert found.status is EstimateStatus.SOLVED
    assert found.names == system.names
    assert np.abs(found.values - true).max() < 1e-8 * np.abs(true).max()


@pytest.mark.parametrize("method", [*(m for m in METHODS if m != "ridge by parts")])
def test_deviations_are_those_of_many_logs(method):
    """Squares of errors in units of the covariance add up to the number of parameters."""
    sums, errors, deviations = [], [], []
    for seed in range(30):
        system, reduction, true = prepared("zero lengths", 0.5, 100 + seed, samples=400, dt=0.02)
        if method == "total":
            found = total(reduction, 0.0)
        elif method == "prior":  # a prior that is true
            spread = 0.01 * np.ones(len(true))
            drawn = true + spread * np.random.default_rng(seed).normal(size=len(true))
            found = ridge(reduction, drawn, spread)
            assert 1.0 < found.degrees < len(true) - 1
        else:
            found = METHODS[method](system, reduction)
        e = found.values - true
        sums.append(e @ np.linalg.solve(found.covariance, e))
        errors.append(e)
        deviations.append(found.deviations)
    b = len(true)
    # the mean of 30 chi squares of b degrees, within four deviations
    assert abs(np.mean(sums) / b - 1.0) < 4.0 * np.sqrt(2.0 / (30 * b)) + 0.06
    ratio = np.std(errors, axis=0) / np.mean(deviations, axis=0)
    assert 0.8 < np.median(ratio) < 1.25


@pytest.mark.parametrize("loss", ["huber", "cauchy", "tukey"])
def test_spikes_in_five_per_cent_of_the_torques_do_no_harm(loss):
    name = "coupled wrist"
    rng = np.random.default_rng(11)
    log = clean_log(ROBOTS[name], rng, 0.05, samples=3000)
    tau = np.array(log.tau)
    hit = rng.random(tau.shape) < 0.05
    hit[:, 0] = False
    tau[hit] += rng.uniform(10.0, 30.0, size=tau.shape)[hit]
    system, reduction, true = prepared(name, log=Log(log.dt, log.q, tau, log.v, log.a))
    found = robust(system, reduction, loss)
    clean = weighted(prepared(name, log=log)[1])
    worst = {
        name: np.abs((e.values - true) / clean.deviations).max()
        for name, e in (("plain", weighted(reduction)), ("robust", found))
    }
    assert found.status is EstimateStatus.SOLVED
    assert worst["plain"] > 20.0
    assert worst["robust"] < (10.0 if loss == "huber" else 5.0)
    assert np.abs(found.sigma - 0.05).max() < (0.02 if loss == "huber" else 0.015)
    counts = hit.sum(axis=0)
    assert (np.abs(found.outliers.counts - counts) <= 3).all()
    places = zip(np.round(found.outliers.t / log.dt).astype(int), found.outliers.kind, strict=True)
    assert len(found.outliers.t) == min(int(found.outliers.counts.sum()), 1000)
    assert np.mean([hit[k, j] for k, j in places]) > 0.98
    assert (np.diff(found.outliers.t) >= 0.0).all()
    assert str(int(found.outliers.counts.sum())) in found.notes[0]
    influence = found.influence(np.full((1, 4), 1e6))
    assert (influence <= 0.2).all()
    assert (influence[0] == 0.0).all() == (loss == "tukey")
    again = pickle.loads(pickle.dumps(found))
    assert not again.slopes.flags.writeable
    assert again.loss is found.loss


def test_a_robust_estimate_does_not_depend_on_what_is_kept(monkeypatch):
    system, reduction, _ = prepared("serial", 0.3, samples=600)
    kept = robust(system, reduction, "cauchy")
    monkeypatch.setattr("robotmodels.identification.methods.robust._KEPT_BYTES", 0)
    streamed = robust(system, reduction, "cauchy")
    assert (kept.values == streamed.values).all()
    assert kept.iterations == streamed.iterations


def test_lengths_give_medians_in_bounded_memory():
    rng = np.random.default_rng(0)
    x = np.abs(rng.normal(size=(20001, 2)) * [1e-9, 1e6])
    use = rng.random(x.shape) < 0.7
    whole, parts = Lengths(2), Lengths(2)
    whole.add(x, use)
    for k in range(0, 20001, 777):
        parts.add(x[k : k + 777], use[k : k + 777])
    assert (whole.counts == parts.counts).all()
    medians = [np.median(x[use[:, j], j]) / 0.674489750 for j in range(2)]
    np.testing.assert_allclose(whole.deviations(), medians, rtol=3e-3)
    assert (Lengths(2).deviations() == 0.0).all()
    nothing = Lengths(1)
    nothing.add(np.zeros((5, 1)), np.ones((5, 1), dtype=bool))
    assert nothing.deviations() == 0.0


def noisy_columns(rng, rows=4000, level=0.3, torque=0.1):
    """A regressor of three noisy columns and one of ones, in which least squares are biased."""
    A = np.column_stack((rng.normal(size=(rows, 3)), np.ones(rows)))
    x = np.array([2.0, -1.0, 0.5, 3.0])
    y = A @ x + torque * rng.normal(size=rows)
    seen = A + level * rng.normal(size=A.shape) * [1, 1, 1, 0]
    factor = np.linalg.qr(np.column_stack((seen, y)), mode="r")
    names = ("XX1", "XY1", "XZ1", "offset1")
    return Reduction(names, (factor,), np.array([rows]), np.array([0])), x


def test_total_least_squares_are_unbiased_where_others_are_not():
    rng = np.random.default_rng(4)
    sums, plain = [], []
    for _ in range(60):
        reduction, x = noisy_columns(rng)
        found = total(reduction, [0.3, 0.3, 0.3, 0.0, 0.1])
        assert found.solution is TotalStatus.GENERIC
        assert found.method is Method.TLS
        e = found.values - x
        sums.append(e @ np.linalg.solve(found.covariance, e))
        plain.append(weighted(reduction).values - x)
        # residuals' deviation times the noise of the torque gives the noise that was put in
        assert abs(found.scale * found.noise[-1] * weighted(reduction).sigma[0] - 0.1) < 0.006
    assert abs(np.mean(sums) / 4 - 1.0) < 0.45
    assert np.mean(plain, axis=0)[0] < -0.1
    again, _ = noisy_columns(rng)
    relative = total(again, 0.3 / np.sqrt(1.09))
    assert relative.noise[3] == 0.0
    assert np.abs(relative.values - x).max() < 0.1


def test_total_least_squares_say_when_there_is_no_solution():
    rng = np.random.default_rng(5)
    A = np.column_stack((rng.normal(size=500), 1e-3 * rng.normal(size=500)))
    y = rng.normal(size=500)
    whole = np.linalg.qr(np.column_stack((A, y)))[0] * [1.0, 1e-3, 1.0]
    reduction = Reduction(
        ("XX1", "XY1"), (np.linalg.qr(whole, mode="r"),), np.array([500]), np.array([0])
    )
    found = total(reduction, [1.0, 1.0, 1.0])
    assert found.solution is TotalStatus.NOT_GENERIC
    assert found.solution.sentence in found.notes
    assert (found.values == weighted(reduction).values).all()
    alike = np.linalg.qr(np.column_stack((A, y)))[0]
    reduction = Reduction(
        ("XX1", "XY1"),
        (np.linalg.qr(alike + 1e-9 * A[:, :1], mode="r"),),
        np.array([500]),
        np.array([0]),
    )
    assert total(reduction, [1.0, 1.0, 1.0]).solution is not TotalStatus.GENERIC
    with pytest.raises(ShapeError, match="noise"):
        total(reduction, [1.0, 1.0])
    with pytest.raises(InvalidValueError, match="negative"):
        total(reduction, -0.1)
    with pytest.raises(InvalidValueError, match="torque"):
        total(reduction, [1.0, 1.0, 0.0])


def test_a_prior_is_what_extra_equations_would_be():
    _, reduction, true = prepared("prismatic", 0.5, samples=200)
    b = len(true)
    rng = np.random.default_rng(0)
    prior, spread = true + 0.1 * rng.normal(size=b), rng.uniform(0.01, 1.0, size=b)
    start = weighted(reduction)
    R, y, _ = reduction.stacked(1.0 / ordinary(reduction).sigma)
    for strength in (None, 1.0, 0.0, 40.0):
        s = np.sqrt(1.0 if strength is None else strength)
        whole, side = np.vstack((R, np.diag(s / spread))), np.append(y, s * prior / spread)
        expected = np.linalg.lstsq(whole, side, rcond=None)[0]
        found = ridge(reduction, prior, spread, strength)
        np.testing.assert_allclose(found.values, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance, np.linalg.inv(whole.T @ whole), rtol=1e-6)
        hat = R @ np.linalg.inv(whole.T @ whole) @ R.T
        assert abs(found.degrees - np.trace(hat)) < 1e-7
    np.testing.assert_allclose(ridge(reduction, strength=0.0).values, start.values, rtol=1e-9)
    assert ridge(reduction, prior, spread, strength=1e12).degrees < 0.01


def test_the_strength_follows_the_worth_of_the_prior():
    # a log that says little: a prior that is right helps, one that is wrong is put aside
    system, reduction, true = prepared("prismatic", 20.0, samples=300)
    parts = segments(system, 4)
    assert sum(part.rows for part in parts) == reduction.rows
    spread = np.full(len(true), 0.01)
    wrong = true + 3.0
    plain = np.abs(weighted(reduction).values - true).sum()
    for options in ({}, {"parts": parts}):
        right = ridge(reduction, true, spread if options else None, **options)
        far = ridge(reduction, wrong, spread if options else None, **options)
        assert right.strength > 10.0 * far.strength
        assert np.abs(right.values - true).sum() < 0.5 * plain
        assert right.degrees < far.degrees
    chosen = select_ridge_strength(parts, true, spread)
    assert chosen.errors.shape == (len(chosen.strengths), 4)
    for wrong_call in (
        lambda: ridge(reduction, strength=-1.0),
        lambda: ridge(reduction, deviations=np.zeros(len(true))),
        lambda: ridge(reduction, strength=1.0, parts=parts),
        lambda: ridge(reduction, parts=parts[:1]),
        lambda: segments(system, 1),
    ):
        with pytest.raises(InvalidValueError):
            wrong_call()


@pytest.mark.parametrize("name", ROBOTS)
def test_steps_go_from_the_last_joint_to_the_first(name):
    system, reduction, _ = prepared(name, 0.1)
    found = sequential(system, reduction)
    joints = [j for step in found.steps for j in step.joints]
    assert sorted(joints) == list(range(1, ROBOTS[name].n + 1))
    firsts = [step.joints[0] for step in found.steps]
    assert firsts == sorted(firsts, reverse=True)
    assert ((3, 4) in [step.joints for step in found.steps]) == (name == "coupled wrist")
    told = [name for step in found.steps for name in step.names]
    assert sorted(told) == sorted(reduction.names)
    assert all(abs(step.sigma - 0.1) < 0.01 for step in found.steps)
    assert found.steps[0].equations == reduction.counts[-1] * len(found.steps[0].joints)
    # all steps at once are never worse
    assert (found.deviations > 0.95 * weighted(reduction).deviations).all()


def resting_first_joint(rng, noise):
    """A planar arm whose first joint rests: the second tells ZZ2 + Ia2 alone, the first ZZ2."""
    model = rm.load("planar_2r").with_drive(
        rm.DriveParameters(Ia=[0.4, 0.3], Fv=[1.0, 2.0], Fc=[0.5, 0.7], offset=[0.1, -0.2])
    )
    q, v, a = swinging(model, rng, samples=600, dt=1e-2)
    q[:, 0], v[:, 0], a[:, 0] = 0.4, 0.0, 0.0
    tau = rm.idm(model, q, v, a)
    log = Log(1e-2, q, tau + noise * rng.normal(size=tau.shape), v, a)
    base = base_parameters(model, drive=True)
    processing = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    every = equations(base, log, processing)
    R, _, _ = reduce_equations(every).stacked()
    kept = column_basis(R, nothing=1e-7).kept.tolist()
    return every.with_names(tuple(base.names[k] for k in kept))


def test_what_a_joint_does_not_tell_waits_for_the_joint_before():
    exact = resting_first_joint(np.random.default_rng(0), 0.0)
    reduction = reduce_equations(exact)
    found = sequential(exact, reduction)
    assert found.steps[0].waiting == ("ZZ2", "Ia2")
    assert {"ZZ2", "Ia2"} <= set(found.steps[1].names)
    np.testing.assert_allclose(found.values, weighted(reduction).values, atol=1e-10)
    sums = []
    for seed in range(60):
        system = resting_first_joint(np.random.default_rng(seed), 0.2)
        noisy = sequential(system, reduce_equations(system))
        clean = resting_first_joint(np.random.default_rng(seed), 0.0)
        e = noisy.values - weighted(reduce_equations(clean)).values
        sums.append(e @ np.linalg.solve(noisy.covariance, e))
    b = len(found.names)
    assert abs(np.mean(sums) / b - 1.0) < 4.0 * np.sqrt(2.0 / (60 * b)) + 0.03


def test_the_last_joint_does_not_learn_from_the_others():
    name = "rx90"
    log = clean_log(ROBOTS[name], np.random.default_rng(3), 0.1, samples=1500)
    tau = np.array(log.tau)
    tau[:, :4] += 30.0 * np.sin(log.t)[:, None]  # a wrong model of the other joints
    results = []
    for torques in (log.tau, tau):
        given = Log(log.dt, log.q, torques, log.v, log.a)
        system, reduction, _ = prepared(name, log=given)
        results.append(sequential(system, reduction))
    own = [results[0].names.index(n) for step in results[0].steps[:2] for n in step.names]
    np.testing.assert_allclose(results[0].values[own], results[1].values[own], rtol=1e-9, atol=1e-9)
    momentum, reduced, true = prepared(name, form=EquationForm.FILTERED)
    assert np.abs(sequential(momentum, reduced).values - true).max() < 1e-5
    power, reduced, _ = prepared(name, form=EquationForm.POWER)
    with pytest.raises(InvalidValueError, match="form"):
        sequential(power, reduced)


@pytest.mark.parametrize("name", ["serial", "tree", "rx90"])
def test_recursion_ends_where_weighted_least_squares_are(name):
    system, reduction, _ = prepared(name, 0.3)
    found = recursive(system, reduction, every=37)
    expected = weighted(reduction)
    size = np.abs(expected.values).max()
    assert np.abs(found.values - expected.values).max() < 1e-10 * size
    np.testing.assert_allclose(found.deviations, expected.deviations, rtol=1e-8)
    assert len(found.history) == -(-2000 // 37)
    assert found.memory == 2000.0
    for k in (20, 40):  # the history is what the log up to there tells
        t = found.history.t[k]
        part = system.log.rows(0, round(t / system.log.dt) + 1)
        cut = reduce_equations(equations(system.base, part, system.processing))
        R, y, rest = cut.stacked(found.weights)
        values = np.linalg.solve(R, y)
        np.testing.assert_allclose(found.history.values[k], values, atol=1e-9 * size)
        inverse = np.linalg.inv(R)
        scale = rest / (cut.rows - len(values))
        deviations = np.sqrt(scale) * np.linalg.norm(inverse, axis=1)
        np.testing.assert_allclose(found.history.deviations[k], deviations, rtol=1e-7)
    early = recursive(system, reduction, every=1).history
    assert np.isnan(early.values[0]).all()
    assert not np.isnan(early.values[-1]).any()


def test_as_many_rows_as_columns_are_reduced_before_they_are_judged():
    """b + 1 equations without a change of sign: Fc is the offset, though no diagonal shows it."""
    model = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[0]))
    base = base_parameters(model, drive=True)
    b, t = len(base), 0.02 * np.arange(370)[:, None]
    q, v, a = np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)
    true = np.linspace(1.0, 2.0, b)
    tau = base.reduce(rm.torque_regressor(model, q, v, a, drive=base.drive)) @ true
    log = Log(0.02, q, tau, v, a)
    given = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    system = equations(base, log, given)
    history = recursive(system, reduce_equations(system), every=b + 1).history
    turned = int((v > 0.0).argmin()) // (b + 1)
    assert np.isnan(history.values[:turned]).all()
    assert np.isnan(history.deviations[:turned]).all()
    values = history.values[turned:]
    np.testing.assert_allclose(values, np.tile(true, (len(values), 1)), rtol=1e-8)
    # the same number of rows, told from the start: without what only a change of sign tells
    base = base_parameters(model, drive=("Fv",))
    system = equations(base, Log(0.02, q, v * true[1] + a * true[0], v, a), given)
    assert base.names == ("ZZ1", "Fv1")
    history = recursive(system, reduce_equations(system), every=3).history
    np.testing.assert_allclose(history.values, np.tile(true[:2], (len(history), 1)), rtol=1e-8)


def test_forgetting_follows_a_parameter_that_drifts():
    name = "serial"
    log = clean_log(ROBOTS[name], np.random.default_rng(3), 0.05, samples=6000)
    k = BASES[name].names.index("Fv4")
    drift = np.where(np.arange(6000) < 3000, 0.0, 2.0)
    tau = np.array(log.tau)
    tau[:, 3] += drift * log.v[:, 3]
    system, reduction, true = prepared(name, log=Log(log.dt, log.q, tau, log.v, log.a))
    found = recursive(system, reduction, forgetting=0.998)
    assert abs(found.memory - 500.0) < 1.0
    assert abs(found.values[k] - true[k] - 2.0) < 0.1
    assert abs(weighted(reduction).values[k] - true[k] - 2.0) > 0.4
    before = np.searchsorted(found.history.t, 3000 * log.dt) - 1
    assert abs(found.history.values[before, k] - true[k]) < 0.1
    # weights of age by hand
    blocks = list(system.blocks())
    whole_W, whole_y = (np.concatenate([getattr(b, x) for b in blocks]) for x in ("W", "y"))
    w = 0.998 ** (np.arange(5999, -1, -1)[:, None] / 2.0) * found.weights
    A, y = (w[..., None] * whole_W).reshape(-1, len(true)), (w * whole_y).reshape(-1)
    expected = np.linalg.lstsq(A, y, rcond=None)[0]
    np.testing.assert_allclose(found.values, expected, atol=1e-9)
    for wrong in (0.0, 1.1, -0.5):
        with pytest.raises(InvalidValueError, match="forgetting"):
            recursive(system, reduction, forgetting=wrong)
    with pytest.raises(InvalidValueError, match="do not tell"):
        recursive(system, reduction, forgetting=0.3)
    with pytest.raises(InvalidValueError, match="every"):
        recursive(system, reduction, every=0)
