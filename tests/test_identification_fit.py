"""From a log to parameters: exact without noise, right on a real log, and clear when it cannot."""

import numpy as np
import pytest
from identification_logs import clean_log, odd_robots

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.identification import (
    Log,
    Wls,
    choose_processing,
    fit,
    validate,
)
from robotmodels.identification.validation import parameter_torque

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


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", ROBOTS)
def test_exact_parameters_without_noise(name):
    model = ROBOTS[name]
    log = clean_log(model, np.random.default_rng(3))
    for decimation in (1, 25):
        found = fit(model, log, processing=as_it_is(log, decimation))
        truth = found.base.values(model)
        assert found.names == found.base.names
        assert np.abs(found.values - truth).max() < 1e-8 * np.abs(truth).max()
        assert np.nanmax(found.validation.in_sample.filtered_rmse) < 1e-7
        # the given robot is the one that moved
        assert found.validation.nominal.rmse.max() < 1e-9
    bare = model.with_inertia(rm.InertialParameters(np.zeros((model.f, 10))))
    assert fit(bare, log, processing=as_it_is(log, 25)).validation.nominal is None


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
    z = (found["irls"].values - truth) / found["irls"].standard_errors
    assert 0.7 < np.sqrt((z**2).mean()) < 1.4
    assert found["irls"].details.iid_standard_errors == pytest.approx(
        found["irls"].standard_errors, rel=0.5
    )


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
        found = fit(model, log, Wls(shrinkage=False), processing=choices)
        error = found.values - found.base.values(model)
        z.append(error / found.standard_errors)
        white.append(error / found.details.iid_standard_errors)
        segments += any("segments of the log" in note for note in found.estimate.notes)
    assert segments <= 3  # the correlation explains them
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15
    assert np.sqrt(np.mean(np.square(white))) > 1.6


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["robust", "tls", "sequential", "recursive"])
def test_correlated_residuals_enlarge_standard_errors_of_every_method_alike(method):
    rng = np.random.default_rng(1)
    clean = clean_log(ROBOTS["serial"], rng, samples=2000)
    e = rng.normal(size=(2004, clean.n))
    e = sum(e[k : k + 2000] for k in range(5)) / 5.0
    log = Log(clean.dt, clean.q, clean.tau + 0.1 * e, clean.v, clean.a)
    choices = choose_processing(clean, decimation=1, dead_band=0.0, filtered=False)
    found, plain = (
        fit(ROBOTS["serial"], log, way, processing=choices)
        for way in (method, Wls(shrinkage=False))
    )
    ratio = plain.standard_errors / plain.details.iid_standard_errors
    assert np.median(ratio) > 1.6
    assert np.allclose(found.standard_errors / found.details.iid_standard_errors, ratio, rtol=0.02)


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


def test_tx40_held_out(trained):
    # the best of every published fit on each joint; none is traded for another here
    best = np.array([5.97, 7.14, 4.13, 1.72, 2.65, 1.72])
    assert (trained.validation.held_out.rmse < best).all(), trained.validation.held_out.rmse
    assert trained.validation.held_out.samples == 15750 - 2 * trained.equations.processing.edges
    assert (np.abs(trained.validation.held_out.bias) < trained.validation.held_out.rmse).all()


# --- prediction --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_prediction_is_the_inverse_model(name):
    model = ROBOTS[name]
    rng = np.random.default_rng(6)
    base = rm.base_parameters(model, drive=True)
    q, v, a = rng.normal(size=(3, 50, model.n))
    tau = parameter_torque(base, base.names, base.values(model), q, v, a)
    truth = rm.idm(model, q, v, a)
    assert np.allclose(tau, truth, atol=1e-9 * np.abs(truth).max())
    assert parameter_torque(base, base.names, base.values(model), q[0], v[0], a[0]).shape == (
        model.n,
    )
    empty = np.zeros((0, model.n))
    assert parameter_torque(base, base.names, base.values(model), *[empty] * 3).shape == empty.shape


def test_dry_friction_rises_over_the_dead_band(tx40):
    model = tx40.model
    base = rm.base_parameters(model)
    beta, zero = base.values(model), np.zeros(6)
    band = np.full(6, 0.1)

    def dry(v):
        whole = parameter_torque(base, base.names, beta, zero, v, zero, band)
        return whole - parameter_torque(base, base.names, beta, zero, zero, zero, band)

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
    tau = parameter_torque(base, base.names, beta, zero, v, zero, 0.1)
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
    assert {"Fv4", "Ia5", "Fc6"} <= set(found.details.unidentifiable)
    assert found.details.rank_gap[1] < 1e-7 < found.details.rank_gap[0]
    assert any("does not distinguish" in note and "Ia5" in note for note in found.notes)
    # what is left still gives the torques, and says what it stands for
    seen = ~np.isnan(found.validation.in_sample.filtered_rmse)
    assert found.validation.in_sample.filtered_rmse[seen].max() < 1e-7
    assert np.allclose(found.values, found.base.values(model), atol=1e-6)
    with pytest.raises(InvalidValueError, match="was not identified"):
        found.value("Ia5")


@pytest.mark.parametrize(
    ("method", "options", "words"),
    [
        ("least squares", {}, "method: expected one of ols, wls"),
        ("robust:strength=3", {}, "robust has the options essential, loss"),
        ("wls", {"processing": {"filter": 10.0}}, r"choices by name \(cutoff, decimation"),
        ("wls", {"processing": {"cutoff": 3000.0}}, "cutoff: expected a finite number above 0"),
        ("wls", {"processing": {"edges": 50.0}}, "cut at both ends"),
        ("wls", {"processing": {"decimation": 0}}, "decimation: expected a whole number"),
        (
            "wls",
            {"processing": {"decimation": 1200, "edges": 0.0, "dead_band": 0.0}},
            "too few for 8 parameters",
        ),
        ("wls", {"processing": {"dead_band": [0.1]}}, "dead_band"),
    ],
)
def test_errors_say_what_to_do(method, options, words):
    arm, log = rm.datasets.example_log()
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        fit(arm, log, method, checked=False, **options)
    with pytest.raises(InvalidValueError, match="has 2 joints, rx90 has 6"):
        fit(rm.load("rx90"), log)


def test_a_result_has_the_words_of_the_contract(tx40, trained):
    from dataclasses import fields

    assert len(fields(trained)) <= 8
    assert trained.covariance.shape == (len(trained.names),) * 2
    assert trained.reason() == trained.status.sentence
    assert trained.standard_error("ZZ1R") == trained.standard_errors[trained.names.index("ZZ1")]
    assert trained.validation.folds is None
    # before: the robot as it was given; its inertia is of a drawing, without friction
    nominal = trained.validation.nominal
    assert (nominal.rmse > trained.validation.in_sample.rmse).all()
    rows = tx40.log.rows(tx40.held_out.start, tx40.held_out.stop)
    assert (validate(trained, rows).rmse == trained.validation.held_out.rmse).all()
