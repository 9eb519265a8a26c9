"""From a log to parameters: exact without noise, right on a real log, and clear when it cannot."""

import pickle
import sys

import numpy as np
import pytest
from identification_logs import clean_log, odd_robots, swinging
from identities.random_robots import random_drive

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.identification import (
    Log,
    Processing,
    choose_processing,
    correlated_covariance,
    equations,
    fit,
    predicted_torque,
    reduce_equations,
)

ROBOTS = odd_robots()


@pytest.fixture(scope="module")
def tx40():
    return rm.datasets.load_tx40()


@pytest.fixture(scope="module")
def whole(tx40):
    return fit(tx40.model, tx40.log)


@pytest.fixture(scope="module")
def trained(tx40):
    rows = tx40.training, tx40.held_out
    training, held_out = (tx40.log.rows(part.start, part.stop) for part in rows)
    return fit(tx40.model, training, test=held_out)


# --- without noise: exact ----------------------------------------------------------------------


def as_it_is(log, decimation):
    """No filter: positions, velocities and accelerations of the log are exact."""
    return choose_processing(log, decimation=decimation, dead_band=1e-3, filtered=False)


@pytest.mark.parametrize("method", ["ols", "wls", "irls"])
@pytest.mark.parametrize("name", ROBOTS)
def test_exact_parameters_without_noise(name, method):
    model = ROBOTS[name]
    log = clean_log(model, np.random.default_rng(3))
    for decimation in (1, 25):
        found = fit(model, log, method, processing=as_it_is(log, decimation))
        truth = found.base.values(model)
        assert found.names == found.base.names
        off = np.abs(found.values - truth).max() / np.abs(truth).max()
        assert off < 1e-8, (name, decimation, off)
        assert found.fitted.filtered_rmse[~np.isnan(found.fitted.filtered_rmse)].max() < 1e-7


@pytest.mark.parametrize("name", ["erd:xarm7", "rx90"])
def test_right_angles_of_few_digits_give_no_parameter_that_no_log_shows(name):
    rng = np.random.default_rng(3)
    model = rm.load(name)
    table = model.table.replace(alpha=model.table.alpha.round(4))  # as many files are written
    model = model.with_table(table).with_drive(random_drive(rng, model.n))
    log = clean_log(model, rng, noise=0.1)
    found = fit(model, log, base=rm.base_parameters(model, drive=True))
    assert found.condition_scaled < 100
    assert not any("cannot be told apart" in note for note in found.notes)
    assert any(
        note.startswith("Treated as aligned: axis 2 and axis 1") for note in found.base.notes
    )
    z = (found.values - found.base.values(model)) / found.deviations
    assert np.sqrt((z**2).mean()) < 1.3
    every = fit(model, log, base=rm.base_parameters(model, drive=True, tolerance=1e-11))
    assert every.condition_scaled > 1e4 * found.condition_scaled
    # what is predicted is the torque of the table as given, to the angles that were taken
    q, v, a = swinging(model, rng, samples=400)
    one, other = (x.predict(q, v, a) for x in (found, every))
    torque = rm.idm(model, q, v, a)
    errors = [np.sqrt(((x - torque) ** 2).mean()) for x in (one, other)]
    assert errors[0] < 1.05 * errors[1] + 1e-5 * np.abs(torque).max()


def test_exact_from_positions_alone_to_what_differences_allow():
    # four-point differences of a motion of 1.25 Hz at 1 kHz miss (2 pi f dt)^4 / 30 of velocities
    model = rm.load("rx90").with_drive(ROBOTS["rx90"].drive)
    log = clean_log(model, np.random.default_rng(0), dt=1e-3, samples=12000)
    found = fit(model, Log(log.dt, log.q, log.tau), decimation=50, cutoff=30.0, dead_band=0.02)
    truth = found.base.values(model)
    assert np.abs(found.values - truth).max() / np.abs(truth).max() < 1e-5


def test_friction_models_are_identified():
    model = ROBOTS["serial"].with_drive(rm.DriveParameters.zeros(ROBOTS["serial"].n))
    gears = rm.friction.AsymmetricFriction(
        Fvp=[1.0, 2.0, 3.0, 4.0], Fcp=[4.0, 3.0, 2.0, 1.0], Fvn=[2.0, 2.5, 3.0, 3.5],
        Fcn=[1.0, 2.0, 3.0, 4.0],
    )  # fmt: skip
    log = clean_log(model, np.random.default_rng(2))
    log = Log(log.dt, log.q, log.tau + gears.torque(log.v), log.v, log.a)
    choices = as_it_is(log, 20)
    found = fit(model, log, drive="Ia", friction=gears, processing=choices)
    assert found.value("Fcn4") == pytest.approx(4.0, abs=1e-8)
    assert found.value("Fvp2") == pytest.approx(2.0, abs=1e-8)


def test_weights_are_those_of_the_joints():
    model = ROBOTS["serial"]
    rng = np.random.default_rng(4)
    log = clean_log(model, rng)
    noise = np.array([3.0, 0.3, 0.1, 0.01])
    log = Log(log.dt, log.q, log.tau + noise * rng.normal(size=log.q.shape), log.v, log.a)
    choices = choose_processing(log, decimation=1, dead_band=0.0, filtered=False)
    found = {m: fit(model, log, m, processing=choices) for m in ("ols", "wls", "irls")}
    assert found["irls"].estimate.sigma == pytest.approx(noise, rel=0.05)
    truth = found["wls"].base.values(model)
    # weights make the parameters that quiet joints show much better
    error = {m: np.abs(f.values - truth) for m, f in found.items()}
    last = [k for k, name in enumerate(found["ols"].names) if name.endswith("4")]
    assert np.median(error["wls"][last]) < 0.2 * np.median(error["ols"][last])
    # what deviations say holds
    z = (found["irls"].values - truth) / found["irls"].deviations
    assert 0.7 < np.sqrt((z**2).mean()) < 1.4
    assert found["irls"].white == pytest.approx(found["irls"].deviations, rel=0.5)


# --- deviations of correlated residuals --------------------------------------------------------


@pytest.mark.filterwarnings("ignore:Poor prediction")  # such noise hides the torques
def test_covariance_of_correlated_residuals():
    # residuals that are a moving average over five samples: white deviations are too small
    model = rm.load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    rng = np.random.default_rng(1)
    clean = clean_log(model, rng, samples=3000)
    choices = choose_processing(clean, decimation=1, dead_band=0.0, filtered=False)
    z, white, segments = [], [], 0
    for _ in range(60):
        e = rng.normal(size=(3004, 2))
        e = sum(e[k : k + 3000] for k in range(5)) / 5.0
        log = Log(clean.dt, clean.q, clean.tau + e, clean.v, clean.a)
        found = fit(model, log, processing=choices, shrinkage=False)
        error = found.values - found.base.values(model)
        z.append(error / found.deviations)
        white.append(error / found.white)
        segments += any("segments of the log" in note for note in found.estimate.notes)
    assert segments <= 3  # the correlation explains them
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15
    assert np.sqrt(np.mean(np.square(white))) > 1.6


@pytest.mark.parametrize("method", ["robust", "tls", "sequential", "recursive"])
def test_correlated_residuals_enlarge_standard_errors_of_every_method_alike(method):
    rng = np.random.default_rng(1)
    clean = clean_log(ROBOTS["serial"], rng, samples=2000)
    e = rng.normal(size=(2004, clean.n))
    e = sum(e[k : k + 2000] for k in range(5)) / 5.0
    log = Log(clean.dt, clean.q, clean.tau + 0.1 * e, clean.v, clean.a)
    choices = choose_processing(clean, decimation=1, dead_band=0.0, filtered=False)
    found, plain = (
        fit(ROBOTS["serial"], log, way, processing=choices, **more)
        for way, more in ((method, {}), ("wls", {"shrinkage": False}))
    )
    ratio = plain.deviations / plain.white
    assert np.median(ratio) > 1.6
    assert np.allclose(found.deviations / found.white, ratio, rtol=0.02)


def test_covariance_does_not_depend_on_pieces(monkeypatch):
    model = ROBOTS["serial"]
    rng = np.random.default_rng(8)
    log = clean_log(model, rng, noise=0.1)
    choices = as_it_is(log, 10)
    system = equations(rm.base_parameters(model), log, choices)
    b = len(system.names)
    values, weights = rng.normal(size=b), np.array([1.0, 2.0, 3.0, 4.0])
    once = correlated_covariance(system, values, weights, np.eye(b))
    monkeypatch.setattr(sys.modules["robotmodels.identification.preparation.signals"], "PIECE", 500)
    assert len(system.pieces()) > 5
    again = correlated_covariance(system, values, weights, np.eye(b))
    assert again.lags == once.lags
    assert np.allclose(again.covariance, once.covariance, rtol=1e-9)
    assert np.allclose(again.correlation, once.correlation, rtol=1e-9)


# --- the real log ------------------------------------------------------------------------------


def test_tx40_published_values(tx40, whole):
    published = {p.name: p for p in tx40.published}
    assert len(whole.names) == 61
    asked = {
        "ZZ1": 1.242, "Fv1": 8.09, "Fc1": 7.01, "ZZ2": 1.075, "Ia3": 0.097, "Ia4": 0.030,
    }  # fmt: skip
    for name, value in asked.items():
        off = abs(whole.value(name + "R") - value)
        assert off < 2.0 * published[name].wls_deviation, (name, whole.value(name))


def test_tx40_agrees_with_all_that_was_published(tx40, whole):
    # others filtered otherwise: nine of ten within two of both deviations, none beyond four
    z = [
        abs(whole.value(p.name) - p.wls) / np.hypot(whole.deviation(p.name), p.wls_deviation)
        for p in tx40.published
    ]
    assert np.mean(np.array(z) < 2.0) > 0.9
    assert max(z) < 4.0


def test_tx40_held_out(trained):
    # the best of every published fit on each joint; none is traded for another here
    best = np.array([5.97, 7.14, 4.13, 1.72, 2.65, 1.72])
    assert (trained.held_out.rmse < best).all(), trained.held_out.rmse
    assert trained.held_out.samples == 15750 - 2 * trained.system.processing.edges
    assert (np.abs(trained.held_out.bias) < trained.held_out.rmse).all()


def test_tx40_choices_come_from_the_log(whole):
    choices = whole.system.processing
    assert 5.0 < choices.motion < 10.0
    assert 2.5 * choices.motion < choices.torque_cutoff < choices.cutoff < 100.0
    assert whole.reduction.rows >= 20 * len(whole.names)
    # the dead bands published with the data are about the ramps that the log's friction shows
    published = np.array([0.0501, 0.0501, 0.0750, 0.0716, 0.0559, 0.1222])
    assert (choices.dead_band < published).all()
    assert ((0.5 * published < whole.ramp) & (whole.ramp < 1.5 * published)).all()
    assert whole.condition_scaled < 40.0 < whole.condition


def test_a_result_survives_pickling(whole):
    again = pickle.loads(pickle.dumps(whole))
    assert np.array_equal(again.values, whole.values)
    assert again.names == whole.names
    assert not again.values.flags.writeable


# --- prediction --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_prediction_is_the_inverse_model(name):
    model = ROBOTS[name]
    rng = np.random.default_rng(6)
    base = rm.base_parameters(model, drive=True)
    q, v, a = rng.normal(size=(3, 50, model.n))
    tau = predicted_torque(base, base.names, base.values(model), q, v, a)
    truth = rm.idm(model, q, v, a)
    assert np.allclose(tau, truth, atol=1e-9 * np.abs(truth).max())
    assert predicted_torque(base, base.names, base.values(model), q[0], v[0], a[0]).shape == (
        model.n,
    )
    empty = np.zeros((0, model.n))
    assert predicted_torque(base, base.names, base.values(model), *[empty] * 3).shape == empty.shape


def test_dry_friction_rises_over_the_dead_band(tx40):
    model = tx40.model
    base = rm.base_parameters(model)
    beta, zero = base.values(model), np.zeros(6)
    band = np.full(6, 0.1)

    def dry(v):
        whole = predicted_torque(base, base.names, beta, zero, v, zero, band)
        return whole - predicted_torque(base, base.names, beta, zero, zero, zero, band)

    for j in range(6):
        v = np.zeros(6)
        v[j] = 1e-9
        assert np.abs(dry(v)).max() < 1e-6  # no jump
        v[j] = 0.1
        at_the_end = dry(v)
        v[j] = 0.05
        # half of the way: half of the dry friction, half of the viscous
        assert dry(v) == pytest.approx(0.5 * at_the_end, rel=1e-3, abs=2e-3)
        v[j] = 0.1 + 1e-9
        assert dry(v) == pytest.approx(at_the_end, abs=1e-6)


def test_friction_models_rise_over_the_dead_band():
    model = rm.load("planar_2r")
    gears = rm.friction.AsymmetricFriction([1.0, 0], [2.0, 0], [1.0, 0], [4.0, 0])
    base = rm.base_parameters(model, drive=False, friction=gears)
    beta = np.concatenate((np.zeros(len(base) - 8), gears.parameters.ravel()))
    terms = dict(zip(base.names, beta, strict=True))
    for kind, row in zip(gears.kinds, gears.parameters, strict=True):
        terms[f"{kind}1"], terms[f"{kind}2"] = row
    beta = np.array([terms[name] for name in base.names])
    v = np.array([[-0.1, 0.0], [-0.05, 0.0], [0.0, 0.0], [0.05, 0.0], [0.1, 0.0]])
    zero = np.zeros((5, 2))
    tau = predicted_torque(base, base.names, beta, zero, v, zero, 0.1)
    assert tau[:, 0] == pytest.approx([-4.1, -2.55, -1.0, 0.55, 2.1])


# --- what a log does not tell ------------------------------------------------------------------


def test_joints_that_rest_are_named():
    model = ROBOTS["rx90"]
    rng = np.random.default_rng(5)
    log = clean_log(model, rng)
    q, v, a = np.array(log.q), np.array(log.v), np.array(log.a)
    q[:, 3:], v[:, 3:], a[:, 3:] = 0.3, 0.0, 0.0
    log = Log(log.dt, q, rm.idm(model, q, v, a), v, a)
    choices = choose_processing(log, decimation=10, dead_band=1e-3, filtered=False)
    found = fit(model, log, processing=choices)
    assert {"Fv4", "Ia5", "Fc6"} <= set(found.unseen)
    assert found.gap[1] < 1e-7 < found.gap[0]
    assert any("does not tell" in note and "Ia5" in note for note in found.notes)
    # what is left still gives the torques, and says what it stands for
    seen = ~np.isnan(found.fitted.filtered_rmse)
    assert found.fitted.filtered_rmse[seen].max() < 1e-7
    assert np.allclose(found.values, found.base.values(model), atol=1e-6)
    with pytest.raises(InvalidValueError, match="was not identified"):
        found.value("Ia5")


def test_errors_say_what_to_do(tx40):
    model, log = tx40.model, tx40.log
    with pytest.raises(InvalidValueError, match="has 6 joints, planar_2r has 2"):
        fit(rm.load("planar_2r"), log)
    with pytest.raises(InvalidValueError, match="too few; give a longer log"):
        fit(model, log.rows(10000, 12000), decimation=200, checked=False)
    with pytest.raises(InvalidValueError, match="method: expected one of 'ols', 'wls'"):
        fit(model, log, "least squares")
    with pytest.raises(InvalidValueError, match="leave out cutoff"):
        fit(model, log, processing=choose_processing(log), cutoff=10.0)
    with pytest.raises(InvalidValueError, match="half the sampling rate"):
        fit(model, log, cutoff=3000.0)
    with pytest.raises(InvalidValueError, match="cut at both ends"):
        fit(model, log, edges=5.0)
    with pytest.raises(InvalidValueError, match="decimation: expected a whole number"):
        fit(model, log, decimation=0)
    with pytest.raises(ShapeError, match="dead_band"):
        fit(model, log, dead_band=[0.1, 0.2])


def test_choices_are_values(tx40):
    choices = choose_processing(tx40.log, cutoff=40.0, decimation=50, dead_band=0.05, edges=0.1)
    assert isinstance(choices, Processing)
    assert (choices.cutoff, choices.decimation, choices.edges) == (40.0, 50, 500)
    assert choices.rate == pytest.approx(100.0)
    assert choices.torque_cutoff == pytest.approx(40.0)
    assert any("filtered at 40 Hz, as requested" in note for note in choices.notes)
    with pytest.raises(ValueError):
        choices.dead_band[0] = 1.0


def test_several_recordings_are_one_log(tx40):
    # a recording that is cut in two has the equations of its halves
    log = tx40.log.rows(0, 24750)
    q, tau = np.array(log.q), np.array(log.tau)
    cut = Log(log.dt, q, tau, starts=[0, 12000])
    choices = choose_processing(log)
    base = rm.base_parameters(tx40.model)
    both = reduce_equations(equations(base, cut, choices))
    parts = [
        reduce_equations(equations(base, log.rows(*rows), choices))
        for rows in ((0, 12000), (12000, 24750))
    ]
    for j in range(6):
        G = sum(part.factors[j].T @ part.factors[j] for part in parts)
        assert np.allclose(both.factors[j].T @ both.factors[j], G, rtol=1e-9, atol=1e-9 * G.max())
    assert (both.counts == parts[0].counts + parts[1].counts).all()


# --- every method through one door -------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("robust", {"loss": "tukey"}),
        ("tls", {"noise": 1e-4}),
        ("ridge", {"strength": 0.0}),
        ("sequential", {}),
        ("recursive", {"forgetting": 1.0}),
    ],
)
def test_other_methods_are_exact_as_well(method, options):
    model = ROBOTS["serial"]
    log = clean_log(model, np.random.default_rng(3))
    found = fit(model, log, method, processing=as_it_is(log, 10), **options)
    truth = found.base.values(model)
    assert np.abs(found.values - truth).max() / np.abs(truth).max() < 1e-8
    assert found.estimate.method.name.lower() == method
    for name, value in options.items():
        assert getattr(found.options, name) == value


def test_no_option_is_ignored(tx40):
    model, log = tx40.model, tx40.log
    cases = {
        "loss": "huber", "prior": model, "strength": 1.0, "noise": 0.1, "forgetting": 0.9,
        "start": np.zeros(61), "output": "torque",
    }  # fmt: skip
    for name, value in cases.items():
        with pytest.raises(InvalidValueError, match=f"{name}: the method 'wls' does not take it"):
            fit(model, log, "wls", **{name: value})


def test_a_prior_is_a_robot_or_numbers(tx40):
    model, log = tx40.model, tx40.log.rows(0, 24750)
    by_robot = fit(model, log, "ridge", prior=model, strength=10.0)
    numbers = by_robot.base.values(model)
    by_numbers = fit(model, log, "ridge", prior=numbers, strength=10.0)
    assert np.array_equal(by_robot.values, by_numbers.values)
    # it draws: nearer to the prior than least squares, where the log says little
    free = fit(model, log)
    far = np.abs(free.values - numbers) / free.deviations
    near = np.abs(by_robot.values - numbers) / free.deviations
    assert np.median(near) < np.median(far)


def test_essential_parameters_are_those_that_are_seen(tx40, whole):
    found = fit(tx40.model, tx40.log, essential=30)
    assert 20 <= len(found.names) <= 32
    published = {p.name for p in tx40.essential}
    assert published <= set(found.names)
    assert set(found.names) | set(found.not_essential) == set(whole.names)
    assert (found.relative_deviations < 0.5).all()
    assert found.essential_rule == "ratio 30"
    # they predict as well
    assert (found.fitted.filtered_rmse < 1.15 * whole.fitted.filtered_rmse).all()
    assert len(found.whole()) == 61
    assert (found.whole() == 0.0).sum() == len(found.not_essential)


def test_tx40_with_instruments_says_the_same(tx40, whole):
    from robotmodels.identification import hausman_test

    found = fit(tx40.model, tx40.log, "iv")
    off = np.abs(found.values - whole.values) / whole.deviations
    assert off.max() < 0.5
    verdict = hausman_test(found.system, found.estimate)
    assert verdict.p > 0.05
    assert verdict.sentence.startswith("No bias of least squares above half a standard error")


def test_tx40_of_real_bodies_costs_little(tx40, trained):
    from robotmodels.identification import consistent_robot, urdf_parity

    robot = consistent_robot(trained)
    assert 0.0 <= robot.price < 3.0  # per cent of the residual
    real = trained.validate(tx40.log.rows(tx40.held_out.start, tx40.held_out.stop))
    from robotmodels.identification import validate

    held_out = validate(
        trained.base, trained.base.names, robot.base_values,
        tx40.log.rows(tx40.held_out.start, tx40.held_out.stop), trained.system.processing,
    )  # fmt: skip
    assert (held_out.rmse < 1.03 * real.rmse).all(), held_out.rmse / real.rmse
    parity = urdf_parity(robot.of(tx40.model))
    assert max(parity.links, parity.drives) < 1e-9
