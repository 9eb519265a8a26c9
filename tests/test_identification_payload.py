"""A payload from torques with and without it."""

import pickle

import numpy as np
import pytest

from robotmodels.drive import DriveParameters
from robotmodels.dynamics import idm, with_payload
from robotmodels.errors import InvalidValueError
from robotmodels.identification import choose_processing, fit
from robotmodels.identification.several_logs.payload import PayloadStatus, identify_payload
from robotmodels.inertia import PARAMETERS, InertialParameters
from robotmodels.logs import Log
from robotmodels.robots import load

DT = 0.01
MASS, COM, INERTIA = 3.0, np.array([0.02, 0.03, 0.1]), np.diag([0.01, 0.02, 0.015])
TRUE = InertialParameters.from_com([MASS], COM[None], INERTIA[None]).values[0]


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


def robot(name, offset=0.3):
    model = load(name)
    n, f = model.n, model.f
    rng = np.random.default_rng(0)
    bodies = InertialParameters.from_com(
        np.linspace(10.0, 1.0, f), rng.uniform(-0.1, 0.1, (f, 3)),
        np.array([np.diag([0.03, 0.04, 0.05])] * f),
    )  # fmt: skip
    drive = DriveParameters(
        Ia=np.full(n, 0.1), Fv=np.full(n, 2.0), Fc=np.full(n, 3.0), offset=np.full(n, offset)
    )
    if name == "planar_2r":
        model = model.with_gravity((0.0, -9.81, 0.0))
    return model.with_inertia(bodies).with_drive(drive)


def logged(model, seed, samples=800, noise=0.0, rng=None):
    q, v, a = motion(model.n, samples, seed)
    tau = idm(model, q, v, a)
    if noise:
        tau = tau + noise * rng.normal(size=tau.shape)
    return Log(DT, q, tau, v, a)


def raw(log, decimation=1):
    return choose_processing(log, filtered=False, dead_band=0.0, edges=0.0, decimation=decimation)


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("name", ["tx40", "rx90"])
def test_exact_logs_give_the_exact_load(name, together):
    model = robot(name)
    bare, full = logged(model, 1), logged(with_payload(model, MASS, COM, INERTIA), 2)
    choices = raw(bare)
    if together:
        found = identify_payload(model, full, bare, processing=choices)
    else:
        found = identify_payload(model, full, fit(model, bare, processing=choices))
    assert found.status is PayloadStatus.COMPLETE
    np.testing.assert_allclose(found.parameters, TRUE, atol=1e-8)
    np.testing.assert_allclose(found.com, COM, atol=1e-8)
    np.testing.assert_allclose(found.inertia, INERTIA, atol=1e-8)
    tau = idm(found.carried, full.q, full.v, full.a)
    np.testing.assert_allclose(tau, full.tau, atol=1e-7)
    assert pickle.loads(pickle.dumps(found.values)) is not None


def test_a_load_in_a_turned_frame_on_an_inner_link():
    model = robot("rx90")
    frame = 3
    bare, full = logged(model, 1), logged(with_payload(model, MASS, COM, INERTIA, frame), 2)
    found = identify_payload(model, full, bare, frame, processing=raw(bare))
    known = [PARAMETERS.index(name) for name in found.identifiable]
    assert {"MX", "MY"} <= set(found.identifiable)
    np.testing.assert_allclose(found.parameters[known], TRUE[known], atol=1e-8)


def test_a_planar_robot_shows_four_parameters():
    model = robot("planar_2r")
    bare, full = logged(model, 1), logged(with_payload(model, MASS, COM, INERTIA), 2)
    found = identify_payload(model, full, bare, processing=raw(bare))
    assert found.status is PayloadStatus.PARTIAL
    assert found.identifiable == ("ZZ", "MX", "MY", "M")
    assert found.no_effect == ("XX", "XY", "XZ", "YY", "YZ", "MZ")
    assert found.mass == pytest.approx(MASS, abs=1e-8)
    assert np.isnan(found.com[2])
    with pytest.raises(InvalidValueError, match="MZ"):
        _ = found.carried


def test_friction_that_differs_with_the_load_is_found_again():
    model, other = robot("planar_2r"), robot("planar_2r", offset=-1.0)
    bare, full = logged(model, 1), logged(with_payload(other, MASS, COM, INERTIA), 2)
    wrong = identify_payload(model, full, bare, processing=raw(bare))
    assert abs(wrong.mass - MASS) > 1e-3
    right = identify_payload(model, full, bare, own=("offset",), processing=raw(bare))
    assert right.mass == pytest.approx(MASS, abs=1e-8)
    with pytest.raises(InvalidValueError, match="Ia"):
        identify_payload(model, full, bare, own=("mass",), processing=raw(bare))


@pytest.mark.parametrize("together", [True, False])
def test_deviations_are_true(together):
    model = robot("planar_2r")
    carrying = with_payload(model, MASS, COM, INERTIA)
    choices, z = raw(logged(model, 1, 1500), 5), []
    where = [PARAMETERS.index(name) for name in ("ZZ", "MX", "MY", "M")]
    for seed in range(50):
        rng = np.random.default_rng(seed)
        bare = logged(model, 1, 1500, 0.5, rng)
        full = logged(carrying, 2, 1500, 0.5, rng)
        reference = bare if together else fit(model, bare, processing=choices)
        options = {"processing": choices} if together else {}
        found = identify_payload(model, full, reference, **options)
        z.append((found.values - TRUE[where]) / found.deviations)
    scores = np.array(z)
    # a mean of 50 has a deviation of 0.14, their spread one of 0.1
    assert (np.abs(scores.mean(axis=0)) < 0.56).all()
    assert ((scores.std(axis=0) > 0.65) & (scores.std(axis=0) < 1.45)).all()


@pytest.mark.parametrize("locked", [0, 1, 3, 5])
def test_what_the_reference_did_not_move_is_unknown_and_not_the_loads(locked):
    """A joint that stood still without the load moves with it: no error goes to the load."""
    model = robot("rx90")
    rng = np.random.default_rng(4)
    q, v, a = (x.copy() for x in motion(6, 800, 1))
    q[:, locked], v[:, locked], a[:, locked] = 0.3, 0.0, 0.0
    bare = Log(DT, q, idm(model, q, v, a) + 0.02 * rng.normal(size=q.shape), v, a)
    full = logged(with_payload(model, MASS, COM, INERTIA), 2, 800, 0.02, rng)
    reference = fit(model, bare, processing=raw(bare), checked=False)
    assert reference.unseen
    found = identify_payload(model, full, reference)
    np.testing.assert_allclose(found.sigma, 0.02, rtol=0.15)
    where = [PARAMETERS.index(name) for name in found.identifiable]
    alone = [found.names.index(name) for name in found.identifiable]
    score = (found.parameters[where] - TRUE[where]) / found.deviations[alone]
    assert {"MX", "MY", "MZ", "M"} <= set(found.identifiable)
    assert (np.abs(score) < 4.5).all()
    together = identify_payload(model, full, bare, processing=raw(bare))
    np.testing.assert_allclose(found.values, together.values, rtol=1e-9, atol=1e-12)


def test_what_was_not_essential_in_the_reference_is_not_the_loads():
    model = robot("rx90")
    rng = np.random.default_rng(5)
    bare = logged(model, 1, 800, 0.5, rng)
    full = logged(with_payload(model, MASS, COM, INERTIA), 2, 800, 0.5, rng)
    reference = fit(model, bare, processing=raw(bare), essential=True)
    assert reference.not_essential
    found = identify_payload(model, full, reference)
    assert found.status is PayloadStatus.COMPLETE
    assert (np.abs((found.parameters - TRUE) / found.deviations) < 4.5).all()
    np.testing.assert_allclose(found.sigma, 0.5, rtol=0.1)


def test_a_robot_without_load_shows_none():
    model = robot("planar_2r")
    rng = np.random.default_rng(3)
    found = identify_payload(
        model, logged(model, 2, 800, 0.3, rng), logged(model, 1, 800, 0.3, rng),
        processing=raw(logged(model, 1)),
    )  # fmt: skip
    assert found.status is PayloadStatus.NOT_SEEN


def test_a_real_body_where_least_squares_give_none():
    pytest.importorskip("clarabel")
    model = robot("tx40")
    rng = np.random.default_rng(1)
    light = with_payload(model, 0.3, [0.0, 0.0, 0.02], np.diag([1e-4] * 3))
    bare, full = logged(model, 1, 800, 0.3, rng), logged(light, 2, 800, 0.3, rng)
    free = identify_payload(model, full, bare, processing=raw(bare))
    report = InertialParameters(free.parameters[None]).consistency()
    assert not report.is_physical
    held = identify_payload(model, full, bare, consistent=True, processing=raw(bare))
    assert InertialParameters(held.parameters[None]).consistency().is_physical
    assert 0.0 < held.cost < 0.05
    assert held.carried.n == 6
    assert abs(held.mass - 0.3) < 4.0 * held.deviations[9]
