"""Payloads, drive gains and friction curves, identified together with the robot's parameters."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from identification_fleet import raw, swinging

from robotmodels.drive import DriveParameters
from robotmodels.dynamics import idm, with_payload
from robotmodels.friction import LoadFriction, StribeckFriction
from robotmodels.identification import (
    KnownPayload,
    LoadedLog,
    fit,
    fit_friction,
    identify_drive_gains,
    identify_payload,
)
from robotmodels.identification.drive_gains import motor_side
from robotmodels.inertia import PARAMETERS, InertialParameters
from robotmodels.logs import Log
from robotmodels.robots import load

DT = 0.01
MASS, COM, INERTIA = 3.0, np.array([0.02, 0.03, 0.1]), np.diag([0.01, 0.02, 0.015])
TRUE = InertialParameters.from_com([MASS], COM[None], INERTIA[None]).values[0]


def motion(model, samples, seed, size=0.5, locked=()):
    """Sums of sines with their derivatives."""
    moved = [np.array(x) for x in swinging(model, seed, samples, DT, 5, 10.0, size)]
    for x in moved:
        x[:, list(locked)] = 0.0
    return moved


def robot(name="planar_2r", offset=0.3, Ia=0.1):
    model = load(name)
    n, f = model.n, model.f
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (f, 3))
    tensors = np.array([np.diag([0.03, 0.04, 0.05])] * f)
    bodies = InertialParameters.from_com(np.linspace(10.0, 1.0, f), points, tensors)
    every = np.ones(n)
    drive = DriveParameters(Ia=Ia * every, Fv=2.0 * every, Fc=3.0 * every, offset=offset * every)
    if name == "planar_2r":
        model = model.with_gravity((0.0, -9.81, 0.0))
    return model.with_inertia(bodies).with_drive(drive)


def logged(model, moved, noise=0.0, seed=0, more=0.0, gains=1.0):
    """A log of torques, or of currents, which gear ratios bring to the joints."""
    side = motor_side(model)
    tau = (idm(model, *moved) + more) @ side.T / gains
    tau = tau + noise * np.random.default_rng(seed).normal(size=tau.shape)
    return Log(DT, moved[0], np.linalg.solve(side, tau.T).T, moved[1], moved[2])


def pair(name="planar_2r", noise=0.0, seed=0, samples=800, carried=(MASS, COM, INERTIA), **options):
    """A robot, its log without and with a load."""
    model = robot(name)
    moved = (motion(model, samples, k) for k in (1, 2))
    robots = zip(
        (model, with_payload(model, *carried)), moved, (2 * seed, 2 * seed + 1), strict=True
    )
    return model, *(logged(one, way, noise, k, **options) for one, way, k in robots)


def check_scores(scores):
    """Means and spreads of standard scores of many logs."""
    assert (np.abs(np.mean(scores, axis=0)) < 4.0 / np.sqrt(len(scores))).all()
    spread = np.std(scores, axis=0)
    assert ((spread > 0.67) & (spread < 1.43)).all()


# --- payloads ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "together"), [("tx40", False), ("rx90", True)])
def test_exact_logs_give_the_exact_payload(name, together):
    model, bare, full = pair(name)
    choices = raw(bare)
    reference = bare if together else fit(model, bare, processing=choices)
    found = identify_payload(model, full, reference, processing=choices)
    assert found.status.name == "COMPLETE"
    np.testing.assert_allclose(found.parameters, TRUE, atol=1e-8)
    np.testing.assert_allclose(found.inertia, INERTIA, atol=1e-8)
    tau = idm(found.carried, full.q, full.v, full.a)
    np.testing.assert_allclose(tau, full.tau, atol=1e-7)
    again = pickle.loads(pickle.dumps(found))
    assert again.value("M") == found.mass
    assert not again.values.flags.writeable


def test_friction_that_differs_between_the_logs():
    model, bare, _ = pair()
    full = logged(with_payload(robot(offset=-1.0), MASS, COM, INERTIA), motion(model, 800, 2))
    wrong = identify_payload(model, full, bare, processing=raw(bare))
    right = identify_payload(model, full, bare, changed=("offset",), processing=raw(bare))
    assert abs(wrong.mass - MASS) > 1e-3
    assert right.mass == pytest.approx(MASS, abs=1e-8)


def test_standard_errors_of_payloads_are_true():
    scores, choices = [], raw(pair()[1], 5)
    true = TRUE[[PARAMETERS.index(name) for name in ("ZZ", "MX", "MY", "M")]]
    for seed in range(30):
        model, bare, full = pair(noise=0.5, seed=seed, samples=1500)
        found = identify_payload(model, full, bare, processing=choices)
        scores.append((found.values - true) / found.standard_errors)
    check_scores(scores)
    without = logged(model, motion(model, 1500, 2), 0.5, 1)
    found = identify_payload(model, without, bare, processing=choices)
    assert found.status.name == "INSIGNIFICANT"


@pytest.mark.sampled(1)
@pytest.mark.parametrize("locked", [0, 3])
def test_parameters_that_the_reference_did_not_show_are_not_those_of_the_payload(locked):
    """A joint that stood still without the load moves with it: no error goes to the load."""
    model, _, full = pair("rx90", 0.02)
    bare = logged(model, motion(model, 800, 1, locked=[locked]), 0.02, 4)
    reference = fit(model, bare, processing=raw(bare), checked=False)
    assert reference.details.unidentifiable
    found = identify_payload(model, full, reference)
    np.testing.assert_allclose(found.sigma, 0.02, rtol=0.15)
    where = [PARAMETERS.index(name) for name in found.identifiable]
    errors = [found.standard_error(name) for name in found.identifiable]
    assert {"MX", "MY", "MZ", "M"} <= set(found.identifiable)
    assert (np.abs((found.parameters - TRUE)[where] / errors) < 4.5).all()


def test_a_consistent_body_where_least_squares_give_none():
    pytest.importorskip("clarabel")
    model, bare, full = pair("tx40", 0.3, carried=(0.3, [0.0, 0.0, 0.02], np.diag([1e-4] * 3)))
    free = identify_payload(model, full, bare, processing=raw(bare))
    assert not InertialParameters(free.parameters[None]).consistency().is_physical
    found = identify_payload(model, full, bare, consistent=True, processing=raw(bare))
    assert InertialParameters(found.parameters[None]).consistency().is_physical
    assert free.cost == 0.0 < found.cost < 0.05
    assert abs(found.mass - 0.3) < 4.0 * found.standard_error("M")


# --- drive gains ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["planar_2r", "tx40"])
@pytest.mark.parametrize("known", [(MASS,), (MASS, COM, INERTIA)])
def test_exact_logs_give_exact_gains(name, known):
    n = load(name).n
    gains = np.linspace(0.5, 2.0, n) * np.where(np.arange(n) == 1, -1.0, 1.0)
    model, bare, loaded = pair(name, gains=gains)
    found = identify_drive_gains(
        model, bare, LoadedLog(loaded, KnownPayload(*known)), processing=raw(bare)
    )
    assert found.status.name == "SOLVED"
    np.testing.assert_allclose(found.gains, gains, rtol=1e-8)
    values = [found.value(name) for name in found.base.names]
    np.testing.assert_allclose(values, found.base.values(model), atol=1e-8)
    carrying = with_payload(model, MASS, COM, INERTIA)
    torque = found.applied(loaded).tau
    np.testing.assert_allclose(torque, idm(carrying, loaded.q, loaded.v, loaded.a), atol=1e-7)
    if name == "tx40" and len(known) == 1:
        assert found.value("MZ load 1") == pytest.approx(MASS * COM[2], abs=1e-8)
    assert not pickle.loads(pickle.dumps(found)).gains.flags.writeable
    unsure = np.diag([*np.zeros(len(found.values) - 1), 1e3])
    assert replace(found, covariance=unsure).status.name == "NOT_IDENTIFIABLE"


def test_a_load_that_the_logs_do_not_show():
    model, bare, full = pair(noise=0.3, carried=(1e-9, COM), gains=np.array([0.5, 2.0]))
    for logs, known in ((bare, (MASS, COM, INERTIA)), ((), (MASS,))):
        loaded = LoadedLog(full, KnownPayload(*known))
        found = identify_drive_gains(model, logs, loaded, processing=raw(bare))
        assert found.status.name == "LOAD_INSIGNIFICANT"
    assert np.isnan(found.gains).all()
    assert str(found) == found.reason()


# --- friction curves -----------------------------------------------------------------------------


def friction_log(curve, name="planar_2r", samples=4000, noise=0.0, seed=0):
    """A robot and its log with friction of its own; of a load without rotors and couplings."""
    of_load = isinstance(curve, LoadFriction)
    model = robot(name, Ia=0.0).with_transmission(None) if of_load else robot(name)
    moved = motion(model, samples, 1, 0.15)
    links = idm(model.with_drive(DriveParameters.zeros(model.n)), *moved)
    more = curve.under_load(moved[1], links) if of_load else curve.torque(moved[1])
    return model, logged(model, moved, noise, seed, more)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_an_exact_log_gives_the_exact_stribeck_curve(exponent):
    curve = StribeckFriction([0, 0], [0, 0], [2.0, 0.0], [0.05, 0.05], [exponent] * 2)
    model, log = friction_log(curve)
    found = fit_friction(model, log, exponents=(1.0, 2.0), processing=raw(log, dead_band=0.005))
    assert found.status.name == "SOLVED"
    assert found.significant.tolist() == [True, False]
    assert found.value("drop1") == pytest.approx(2.0, abs=1e-8)
    assert found.value("vs1") == pytest.approx(0.05, abs=1e-8)
    values = [found.value(name) for name in found.base.names]
    np.testing.assert_allclose(values, found.base.values(model), atol=1e-8)
    friction = found.friction
    np.testing.assert_allclose(friction.Fs - friction.Fc, [2.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(friction.Fc, 3.0, atol=1e-8)
    assert friction.exponent[0] == exponent


def test_an_exact_log_gives_the_exact_friction_by_load():
    Fl = np.linspace(0.05, 0.2, 6)
    model, log = friction_log(LoadFriction(Fl), "tx40", 1200)
    found = fit_friction(model, log, "load", processing=raw(log, dead_band=0.005))
    assert found.status.name == "SOLVED"
    np.testing.assert_allclose(found.friction.Fl, Fl, atol=1e-8)
    true = found.base.values(model)
    np.testing.assert_allclose(found.values[: len(true)], true, atol=1e-8)
    model, log = friction_log(LoadFriction([0.2, 0.0]), samples=2000, noise=0.1)
    found = fit_friction(model, log, "load", processing=raw(log, 3, 0.005))
    assert found.significant.tolist() == [True, False]
    errors = found.standard_errors[-2:]
    assert (np.abs(found.friction.Fl - [0.2, 0.0]) < 4.5 * errors).all()
