"""Friction models found in logs: Stribeck's curve, friction by load, and which a log supports."""

import numpy as np
import pytest

from robotmodels.drive import DriveParameters
from robotmodels.dynamics import idm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.friction import AsymmetricFriction, Friction, LoadFriction, StribeckFriction
from robotmodels.identification import choose_processing
from robotmodels.identification.friction_models.comparison import FrictionForm, compare_friction
from robotmodels.identification.friction_models.load_friction import (
    LoadFrictionStatus,
    fit_load_friction,
)
from robotmodels.identification.friction_models.stribeck import StribeckStatus, fit_stribeck
from robotmodels.inertia import InertialParameters
from robotmodels.logs import Log
from robotmodels.minimal_parameters import base_parameters
from robotmodels.robots import load

DT = 0.01


def motion(n, samples, seed=1, size=0.3):
    """Sums of sines with their derivatives."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(samples)[:, None]
    q = v = a = np.zeros((samples, n))
    for k in range(1, 6):
        w, part, phase = 0.2 * np.pi * k, size * rng.normal(size=n) / k, rng.uniform(0.0, 6.28, n)
        q = q + part * np.sin(w * t + phase)
        v = v + part * w * np.cos(w * t + phase)
        a = a - part * w**2 * np.sin(w * t + phase)
    return q, v, a


def robot(name="planar_2r", offset=0.3, Fv=2.0, Fc=3.0):
    model = load(name)
    n, f = model.n, model.f
    rng = np.random.default_rng(0)
    bodies = InertialParameters.from_com(
        np.linspace(10.0, 1.0, f), rng.uniform(-0.1, 0.1, (f, 3)),
        np.array([np.diag([0.03, 0.04, 0.05])] * f),
    )  # fmt: skip
    drive = DriveParameters(Fv=np.full(n, Fv), Fc=np.full(n, Fc), offset=np.full(n, offset))
    if name == "planar_2r":
        model = model.with_gravity((0.0, -9.81, 0.0))
    return model.with_inertia(bodies).with_drive(drive).with_transmission(None)


def logged(model, moved, more, noise=0.0, seed=0):
    tau = idm(model, *moved) + more
    tau = tau + noise * np.random.default_rng(seed).normal(size=tau.shape)
    return Log(DT, moved[0], tau, moved[1], moved[2])


def raw(log, decimation=1):
    return choose_processing(log, filtered=False, dead_band=0.005, edges=0.0, decimation=decimation)


def carried(model, moved):
    return idm(model.with_drive(DriveParameters.zeros(model.n)), *moved)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_an_exact_log_gives_the_exact_curve(exponent):
    model = robot()
    moved = motion(2, 4000)
    curve = StribeckFriction([0, 0], [0, 0], [2.0, 0.0], [0.05, 0.05], [exponent] * 2)
    log = logged(model, moved, curve.torque(moved[1]))
    found = fit_stribeck(model, log, exponents=(1.0, 2.0), processing=raw(log))
    assert found.status is StribeckStatus.SOLVED
    assert found.seen.tolist() == [True, False]
    assert found.drop[0] == pytest.approx(2.0, abs=1e-8)
    assert found.vs[0] == pytest.approx(0.05, abs=1e-8)
    assert found.exponent[0] == exponent
    assert found.drop[1] == 0.0
    assert np.isnan(found.vs[1])
    base = base_parameters(model, drive=True)
    np.testing.assert_allclose(found.values, base.values(model), atol=1e-8)
    friction = found.friction
    np.testing.assert_allclose(friction.Fs - friction.Fc, [2.0, 0.0], atol=1e-8)
    assert "yes" in str(found)


def test_a_curve_in_noise_is_seen_where_it_is():
    model = robot()
    moved = motion(2, 4000)
    curve = StribeckFriction([0, 0], [0, 0], [0.0, 1.0], [0.05, 0.05])
    z, seen = [], []
    for seed in range(12):
        log = logged(model, moved, curve.torque(moved[1]), 0.2, seed)
        found = fit_stribeck(model, log, processing=raw(log, 3))
        seen.append(found.seen.tolist())
        z.append([
            (found.drop[1] - 1.0) / found.drop_deviations[1],
            (found.vs[1] - 0.05) / found.vs_deviations[1],
        ])  # fmt: skip
    assert seen == [[False, True]] * 12
    scores = np.array(z)
    assert (np.abs(scores.mean(axis=0)) < 1.0).all()
    assert (np.abs(scores) < 4.5).all()


def test_no_curve_is_said():
    model = robot()
    moved = motion(2, 3000)
    log = logged(model, moved, 0.0, 0.2)
    found = fit_stribeck(model, log, processing=raw(log, 3))
    assert found.status is StribeckStatus.NOT_SEEN
    assert not found.drop.any()
    assert (found.p_value > 1e-3).all()


@pytest.mark.parametrize("name", ["planar_2r", "tx40"])
def test_an_exact_log_gives_the_exact_friction_by_load(name):
    model = robot(name)
    moved = motion(model.n, 2000)
    Fl = np.linspace(0.05, 0.2, model.n)
    more = LoadFriction(Fl).under_load(moved[1], carried(model, moved))
    log = logged(model, moved, more)
    found = fit_load_friction(model, log, processing=raw(log))
    assert found.status is LoadFrictionStatus.SOLVED
    np.testing.assert_allclose(found.Fl, Fl, atol=1e-8)
    np.testing.assert_allclose(
        found.values, base_parameters(model, drive=True).values(model), atol=1e-8
    )
    np.testing.assert_allclose(found.friction.Fl, Fl, atol=1e-8)


def test_friction_by_load_in_noise():
    model = robot()
    moved = motion(2, 2000, size=1.0)
    more = LoadFriction([0.1, 0.0]).under_load(moved[1], carried(model, moved))
    for seed in range(4):
        log = logged(model, moved, more, 0.2, seed)
        found = fit_load_friction(model, log, processing=raw(log, 3))
        assert found.seen.tolist() == [True, False]
        assert (np.abs(found.Fl - [0.1, 0.0]) < 4.5 * found.Fl_deviations).all()


def test_the_model_that_made_a_log_wins():
    moved = motion(2, 4000, size=0.6)
    v = moved[1]
    n = np.zeros(2)
    cases = {
        FrictionForm.VISCOUS: (robot(offset=0.0, Fc=0.0), 0.0),
        FrictionForm.COULOMB: (robot(offset=0.0, Fv=0.0), 0.0),
        FrictionForm.BOTH: (robot(offset=0.0), 0.0),
        FrictionForm.OFFSET: (robot(), 0.0),
        FrictionForm.ASYMMETRIC: (
            robot(), AsymmetricFriction(n + 1.0, n + 0.5, n - 1.0, n - 0.5).torque(v)
        ),
        FrictionForm.STRIBECK: (
            robot(), StribeckFriction(n, n, n + 2.0, n + 0.05).torque(v)
        ),
    }  # fmt: skip
    model = robot()
    cases[FrictionForm.LOAD] = (model, LoadFriction(n + 0.1).under_load(v, carried(model, moved)))
    for form, (arm, more) in cases.items():
        log = logged(arm, moved, more, 0.1)
        found = compare_friction(arm, log, processing=raw(log, 3))
        assert found.best == (form, form), str(found)
        row = found.candidates.index(form)
        assert (found.held_out[row] <= 1.02 * found.held_out.min(axis=0)).all()
    assert "criterion" in str(found)


def test_mistakes_are_named():
    model = robot()
    log = logged(model, motion(2, 600), 0.0)
    with pytest.raises(InvalidValueError, match="exponents"):
        fit_stribeck(model, log, exponents=(0.0,))
    with pytest.raises(InvalidValueError, match="Fc"):
        fit_stribeck(model, log, base=base_parameters(model, drive=("Fv",)))
    with pytest.raises(InvalidValueError, match="at least one"):
        compare_friction(model, log, ())
    with pytest.raises(ShapeError, match="Fl"):
        LoadFriction([[0.1]])


def test_friction_by_load_is_no_friction_of_velocities():
    assert not isinstance(LoadFriction([0.1]), Friction)
