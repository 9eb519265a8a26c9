"""Drive gains from logs with and without a known load."""

import pickle

import numpy as np
import pytest

from robotmodels.drive import DriveParameters
from robotmodels.dynamics import idm, with_payload
from robotmodels.errors import InvalidValueError
from robotmodels.identification import choose_processing
from robotmodels.identification.several_logs.drive_gains import identify_drive_gains, motor_side
from robotmodels.identification.several_logs.drive_gains_result import GainMethod, GainStatus
from robotmodels.identification.several_logs.known_payload import KnownPayload, LoadedLog
from robotmodels.inertia import InertialParameters
from robotmodels.logs import Log
from robotmodels.minimal_parameters import base_parameters
from robotmodels.robots import load

DT = 0.01
MASS, COM, INERTIA = 3.0, np.array([0.02, 0.03, 0.1]), np.diag([0.01, 0.02, 0.015])


def motion(n, samples, seed):
    """Sums of sines with their derivatives."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(samples)[:, None]
    q = v = a = np.zeros((samples, n))
    for k in range(1, 6):
        w, size, phase = 0.2 * np.pi * k, rng.normal(size=n) / k, rng.uniform(0.0, 6.28, n)
        q = q + size * np.sin(w * t + phase)
        v = v + size * w * np.cos(w * t + phase)
        a = a - size * w**2 * np.sin(w * t + phase)
    return q, v, a


def robot(name):
    model = load(name)
    n, f = model.n, model.f
    rng = np.random.default_rng(0)
    bodies = InertialParameters.from_com(
        np.linspace(10.0, 1.0, f), rng.uniform(-0.1, 0.1, (f, 3)),
        np.array([np.diag([0.03, 0.04, 0.05])] * f),
    )  # fmt: skip
    drive = DriveParameters(
        Ia=np.full(n, 0.1), Fv=np.full(n, 2.0), Fc=np.full(n, 3.0), offset=np.full(n, 0.3)
    )
    if name == "planar_2r":
        model = model.with_gravity((0.0, -9.81, 0.0))
    return model.with_inertia(bodies).with_drive(drive)


def currents(model, moved, gains, noise=0.0, rng=None):
    """A log of what the amplifiers show, brought to the joints by the gear ratios."""
    side = motor_side(model)
    found = idm(model, *moved) @ side.T / gains
    if noise:
        found = found + noise * rng.normal(size=found.shape)
    return Log(DT, moved[0], np.linalg.solve(side, found.T).T, moved[1], moved[2])


def raw(log, decimation=1):
    return choose_processing(log, filtered=False, dead_band=0.0, edges=0.0, decimation=decimation)


@pytest.mark.parametrize("name", ["planar_2r", "tx40"])
@pytest.mark.parametrize("method", list(GainMethod))
@pytest.mark.parametrize("known", [(MASS,), (MASS, COM), (MASS, COM, INERTIA)])
def test_exact_logs_give_exact_gains(name, method, known):
    model = robot(name)
    gains = np.linspace(0.5, 2.0, model.n) * np.where(np.arange(model.n) == 1, -1.0, 1.0)
    carrying = with_payload(model, MASS, COM, INERTIA)
    bare = currents(model, motion(model.n, 600, 1), gains)
    loaded = currents(carrying, motion(model.n, 600, 2), gains)
    found = identify_drive_gains(
        model, bare, LoadedLog(loaded, KnownPayload(*known)), method=method, processing=raw(bare)
    )
    assert found.status is GainStatus.SOLVED
    np.testing.assert_allclose(found.gains, gains, rtol=1e-8)
    base = base_parameters(model)
    truth = dict(zip(base.names, base.values(model), strict=True))
    values = [found.value(name) for name in base.names]
    np.testing.assert_allclose(values, [truth[name] for name in base.names], atol=1e-8)
    torque = found.applied(loaded).tau
    np.testing.assert_allclose(torque, idm(carrying, loaded.q, loaded.v, loaded.a), atol=1e-7)
    if name == "tx40" and len(known) == 1:
        assert found.value("MZ load 1") == pytest.approx(MASS * COM[2], abs=1e-8)
    assert pickle.loads(pickle.dumps(found)).gains.flags.writeable is False
    assert "motor" in str(found)


def test_two_loads_without_a_log_of_the_bare_robot():
    model = robot("planar_2r")
    gains = np.array([0.5, 2.0])
    logs = []
    for k, mass in enumerate((1.0, 4.0)):
        carrying = with_payload(model, mass, COM, INERTIA)
        moved = motion(model.n, 600, k)
        logs.append(LoadedLog(currents(carrying, moved, gains), KnownPayload(mass, COM, INERTIA)))
    found = identify_drive_gains(model, (), logs, processing=raw(logs[0].log))
    np.testing.assert_allclose(found.gains, gains, rtol=1e-8)


def test_noise_leaves_no_bias_and_the_deviations_are_true():
    model = robot("planar_2r")
    gains = np.array([0.5, 2.0])
    base = base_parameters(model, drive=True)
    bare = currents(model, motion(2, 1500, 1), gains)
    full = currents(with_payload(model, MASS, COM, INERTIA), motion(2, 1500, 2), gains)
    choices, z = raw(bare, 5), []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        noisy = [
            Log(DT, log.q, log.tau + 1.0 * rng.normal(size=log.tau.shape), log.v, log.a)
            for log in (bare, full)
        ]
        found = identify_drive_gains(
            model, noisy[0], LoadedLog(noisy[1], KnownPayload(MASS)), base=base, processing=choices
        )
        z.append((found.gains - gains) / found.gain_deviations)
    scores = np.array(z)
    # a mean of 60 has a deviation of 0.13, their spread one of 0.09
    assert (np.abs(scores.mean(axis=0)) < 0.5).all()
    assert ((scores.std(axis=0) > 0.7) & (scores.std(axis=0) < 1.4)).all()


def test_a_load_that_no_torque_shows_is_said():
    model = robot("planar_2r")
    gains = np.array([0.5, 2.0])
    bare = currents(model, motion(2, 600, 1), gains)
    same = currents(model, motion(2, 600, 2), gains)  # the load was forgotten
    rng = np.random.default_rng(0)
    noisy = [
        Log(DT, log.q, log.tau + 0.3 * rng.normal(size=log.tau.shape), log.v, log.a)
        for log in (bare, same)
    ]
    found = identify_drive_gains(
        model, noisy[0], LoadedLog(noisy[1], KnownPayload(MASS, COM, INERTIA)), processing=raw(bare)
    )
    assert found.status is GainStatus.LOAD_NOT_SEEN


def test_loaded_logs_alone_do_not_tell_the_load_from_the_robot():
    model = robot("planar_2r")
    log = currents(with_payload(model, MASS, COM), motion(2, 600, 1), np.ones(2))
    found = identify_drive_gains(model, (), LoadedLog(log, KnownPayload(MASS)), processing=raw(log))
    assert found.status is GainStatus.LOAD_NOT_SEEN
    assert np.isnan(found.gains).all()


def test_mistakes_are_named():
    model = robot("planar_2r")
    log = currents(model, motion(2, 600, 1), np.ones(2))
    with pytest.raises(InvalidValueError, match="at least one LoadedLog"):
        identify_drive_gains(model, log, ())
    with pytest.raises(InvalidValueError, match="positive mass"):
        KnownPayload(0.0)
    with pytest.raises(InvalidValueError, match="com"):
        KnownPayload(1.0, inertia=INERTIA)
    other = Log(0.02, log.q, log.tau)
    with pytest.raises(InvalidValueError, match="sampling periods"):
        identify_drive_gains(model, log, LoadedLog(other, KnownPayload(1.0)))
