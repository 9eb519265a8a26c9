"""Power, energy and momentum equations of a log beside those of the torques."""

import sys

import numpy as np
import pytest
from identification_logs import clean_log, odd_robots, swinging

from robotmodels.estimation.linear import weighted
from robotmodels.friction import AsymmetricFriction
from robotmodels.identification import (
    Log,
    choose_processing,
    equations,
    reduce_equations,
)
from robotmodels.identification.forms import EquationForm
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import torque_regressor

ROBOTS = odd_robots()
FORMS = list(EquationForm)


def plain(log, decimation=1, dead_band=0.0):
    return choose_processing(
        log, filtered=False, decimation=decimation, edges=0.0, dead_band=dead_band
    )


def collected(system):
    blocks = list(system.blocks())
    fields = ("t", "W", "y", "use", "v")
    return {name: np.concatenate([getattr(b, name) for b in blocks]) for name in fields}


@pytest.mark.sampled(16)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("decimation", [1, 7])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_form_recovers_exact_parameters(name, form, decimation):
    model = ROBOTS[name]
    log = clean_log(model, np.random.default_rng(3))
    base = base_parameters(model, drive=True)
    system = equations(base, log, plain(log, decimation), form)
    found = weighted(reduce_equations(system))
    true = base.values(model)
    assert system.groups == (model.n if form.by_joint else 1) == len(found.sigma)
    assert np.abs(found.values - true).max() < 1e-8 * np.abs(true).max()


@pytest.mark.parametrize("form", [EquationForm.ENERGY, EquationForm.FILTERED])
def test_what_integration_cuts_off_falls_with_the_sixth_power_of_the_period(form):
    model = ROBOTS["serial"]
    base = base_parameters(model, drive=True)
    errors = []
    for dt in (0.016, 0.008, 0.004):
        log = clean_log(model, np.random.default_rng(3), dt=dt, samples=int(8.0 / dt))
        found = weighted(reduce_equations(equations(base, log, plain(log), form)))
        errors.append(np.abs(found.values - base.values(model)).max())
    assert errors[0] > 40 * errors[1] > 1600 * errors[2]


@pytest.mark.parametrize("decimation", [1, 6])
@pytest.mark.parametrize("form", FORMS)
def test_pieces_are_the_whole(form, decimation, monkeypatch):
    model = ROBOTS["coupled wrist"]
    log = clean_log(model, np.random.default_rng(3), samples=1501)
    base = base_parameters(model)
    system = equations(base, log, plain(log, decimation), form)
    whole = collected(system)
    for size in (90, 300):
        monkeypatch.setattr(sys.modules["robotmodels.identification.signals"], "PIECE", size)
        assert len(system.pieces()) > 4
        parts = collected(system)
        for name, array in whole.items():
            np.testing.assert_allclose(parts[name], array, rtol=0, atol=2e-11)


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
        use = collected(equations(base_parameters(model), log, plain(log, 4, 1e-3), form))
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
    factors = reduce_equations(equations(base, log, plain(log), form))
    assert np.abs(weighted(factors).values - true).max() < 1e-7
    inside = {EquationForm.FILTERED: 2 * 3, EquationForm.ENERGY: 2 * 3 + 1}.get(form, 0)
    assert (factors.counts == sum(max(n - inside, 0) for n in lengths)).all()
