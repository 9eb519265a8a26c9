"""Physically consistent identification: the least torque residuals of physical robots."""

import sys
from typing import Any

import numpy as np
import pytest
from identification_fleet import odd_robots
from identities.random_robots import random_bodies, random_drive, random_model, random_state

import robotmodels as rm
from robotmodels.errors import InvalidValueError, MissingExtraError, ShapeError
from robotmodels.friction import AsymmetricFriction, StribeckFriction, TorqueOffset, ViscousFriction
from robotmodels.minimal_parameters import (
    CenterOfMassBox,
    CenterOfMassEllipsoid,
    PhysicalStatus,
    base_parameters,
    fit_consistent,
    physical,
    uniform_bodies,
)

EXACT, CONSTRAINED = PhysicalStatus.EXACT, PhysicalStatus.CONSTRAINED
PROVED = 3e-4  # part of the squares within which a converged fit is known to be the best
ROBOTS = odd_robots()


def weighted(base, motion, tau=None, sigma=1.0):
    """Factor, right side, squares outside it, rows, reduced regressor (N n, b) and torques."""
    W = base.reduce(
        rm.torque_regressor(base.model, *motion, drive=base.drive, friction=base.friction)
    )
    W = (W / np.broadcast_to(sigma, W.shape[1])[:, None]).reshape(-1, len(base))
    y = W @ base.values(base.model) if tau is None else (tau / sigma).ravel()
    Q, R = np.linalg.qr(W)
    z = Q.T @ y
    return R, z, float(np.sum((y - Q @ z) ** 2)), W, y


def noisy(model, rng, noise, samples=60):
    """Base parameters of a robot, and `weighted` of torques with noise."""
    base = base_parameters(model, drive=True)
    motion = random_state(model, rng, samples)
    *_, tau = weighted(base, motion)
    tau = tau + noise * np.sqrt(np.mean(tau**2)) * rng.normal(size=len(tau))
    return base, *weighted(base, motion, tau.reshape(samples, -1))


def arm(rng, name="planar_2r"):
    model = rm.load(name)
    model = model.with_inertia(random_bodies(rng, model.f))
    return model.with_drive(random_drive(rng, model.n))


@pytest.mark.parametrize("kind", ROBOTS)
def test_a_physical_robot_is_found_without_residuals(kind, rng):
    model = ROBOTS[kind]
    base = base_parameters(model, drive=True)
    values = base.values(model)
    prior = uniform_bodies(model, 3.0 * model.f)
    R, y, rest, W, _ = weighted(base, random_state(model, rng, 60))
    found = fit_consistent(base, R, y, rest=rest, rows=len(W), prior=prior)
    assert (found.status, found.residual_increase, found.fit.gap) == (EXACT, 0.0, 0.0)
    sizes = np.maximum(abs(values), 1e-3 * abs(values).max())
    assert (abs(found.base_values - values) <= 1e-8 * sizes).all()
    assert found.inertia.is_physical.all()
    for part in (found.drive.Ia, found.drive.Fv, found.drive.Fc):
        assert (part >= 0.0).all()
    q, v, a = random_state(model, rng, 20)
    torque = rm.idm(model, q, v, a)
    assert abs(rm.idm(found.of(model), q, v, a) - torque).max() <= 1e-8 * abs(torque).max()


def test_bounds_on_masses_are_kept_and_named(rng):
    model = arm(rng, "rx90")
    base, R, y, rest, *_ = noisy(model, rng, 0.01)
    prior = uniform_bodies(model, 20.0)
    loose = fit_consistent(base, R, y, rest=rest, prior=prior)
    bounds = np.tile([-np.inf, np.inf], (6, 1))
    bounds[1] = 0.5, 0.5
    bounds[2, 0] = loose.inertia.mass[2] * 1.2
    bounds[3] = 0.0, 0.3
    found = fit_consistent(base, R, y, rest=rest, prior=prior, mass_bounds=bounds, total_mass=9.0)
    assert found.status in (EXACT, CONSTRAINED)
    mass = found.inertia.mass
    assert (mass[1], mass.sum()) == pytest.approx((0.5, 9.0), rel=1e-7)
    assert mass[2] >= bounds[2, 0] * (1 - 1e-7)
    assert mass[3] <= 0.3 * (1 + 1e-7)
    assert found.inertia.is_physical.all()
    assert "The mass of link 4 is at its upper bound, 0.3 kg." in found.fit.active
    assert found.fit.squares >= loose.fit.squares * (1 - 1e-5)
    between = fit_consistent(base, R, y, rest=rest, prior=prior, total_mass=[30.0, 40.0])
    assert between.inertia.mass.sum() >= 30.0 * (1 - 1e-7)


@pytest.mark.parametrize(
    ("friction", "bad"),
    [
        (StribeckFriction([1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [0.1, 0.1]), "Fc1"),
        (AsymmetricFriction(*np.ones((4, 2))), "Fcn2"),
        (ViscousFriction([1.0, 1.0]) + TorqueOffset([-1.0, 2.0]), "Fv2"),
    ],
)
def test_friction_models_are_dissipative(friction, bad, rng):
    model = arm(rng)
    base = base_parameters(model, drive=("Ia",), friction=friction)
    values = base.values(model)
    values[base.names.index(bad)] = -2.0
    R, _, rest, *_ = weighted(base, random_state(model, rng, 60), np.zeros((60, 2)))
    y = R @ values
    found = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 6.0))
    assert found.status is CONSTRAINED
    assert found.values[list(base.parameter_names).index(bad)] == pytest.approx(0.0, abs=1e-4)
    assert f"{bad} is zero." in found.fit.active
    assert found.friction is not None
    if isinstance(friction, StribeckFriction):  # Fs below Fc is no Stribeck curve
        values[base.names.index("Fs2")], values[base.names.index("Fc1")] = 1.0, 3.0
        found = fit_consistent(base, R, R @ values, rest=rest, prior=uniform_bodies(model, 6.0))
        assert "Fs2 of Stribeck's curve is its Fc2." in found.fit.active
        StribeckFriction(*found.friction, vs=[0.1, 0.1])  # Fs >= Fc >= 0, or it is refused
    elif bad == "Fv2":  # an offset has either sign
        assert found.friction[-1, 0] == pytest.approx(-1.0, abs=0.1)
    else:
        assert (found.friction >= 0.0).all()


def test_the_weight_trades_residuals_for_nearness(rng):
    model = arm(rng, "rx90")
    base, R, y, rest, *_ = noisy(model, rng, 0.3, samples=20)
    prior = uniform_bodies(model, 20.0)
    fits = [fit_consistent(base, R, y, rest=rest, prior=prior, gamma=g) for g in (1e-2, 1.0, 100.0)]
    assert all(fit.status is PhysicalStatus.WEIGHTED for fit in fits)
    assert all(fit.fit.gap < 1e-7 for fit in fits)
    squares, distances = [f.fit.squares for f in fits], [f.distance for f in fits]
    assert squares == sorted(squares)
    assert distances == sorted(distances, reverse=True)
    assert squares[0] < squares[2]
    # where no constraint is active it is a linear ridge
    last = fit_consistent(base, R, y, rest=rest, prior=prior, gamma=1e9)
    assert last.distance < 1e-2
    assert not last.fit.active


def test_mistakes_are_named(rng, monkeypatch):
    model = arm(rng)
    base, R, y, rest, *_ = noisy(model, rng, 0.1)
    b = len(base)
    prior = uniform_bodies(model, 6.0)
    for error, said, changes in (
        (ShapeError, "R: expected shape", {"R": R[:, :-1]}),
        (InvalidValueError, "R: every entry is zero", {"R": np.zeros((b, b))}),
        (InvalidValueError, "rest: expected a sum of squares", {"rest": -1.0}),
        (InvalidValueError, "gamma", {"gamma": -1.0}),
        (InvalidValueError, "prior: expected 2 links", {"prior": rm.InertialParameters.zeros(3)}),
        (ShapeError, r"mass_bounds: expected shape \(2, 2\)", {"mass_bounds": [1.0, 2.0]}),
        (InvalidValueError, "mass of link 2", {"mass_bounds": [[0, 1], [2, 1]]}),
        (
            InvalidValueError,
            "links 1 to 2",
            {"centre_bounds": [CenterOfMassBox(3, [0] * 3, [1] * 3)]},
        ),
    ):
        given: dict[str, Any] = {"R": R, "y": y, "rest": rest, "prior": prior} | changes
        with pytest.raises(error, match=said):
            fit_consistent(base, given.pop("R"), given.pop("y"), **given)
    with pytest.raises(InvalidValueError, match="low must not be above"):
        CenterOfMassBox(1, [1, 0, 0], [0, 1, 1])
    with pytest.raises(InvalidValueError, match="unit vectors"):
        CenterOfMassEllipsoid(1, [0, 0, 0], [1, 1, 1], 2 * np.eye(3))
    monkeypatch.setitem(sys.modules, "cvxpy", None)
    with pytest.raises(MissingExtraError, match=r"robotmodels\[cones\]"):
        fit_consistent(base, R, y, rest=rest, prior=prior)


# --- noisy logs ----------------------------------------------------------------------------------


def measured(rng, model, motion, noise, unmodelled):
    """Torques with noise and with what no parameter explains, and the noise of each joint."""
    q, v, _ = motion
    tau = rm.idm(model, *motion)
    rms = np.sqrt(np.mean(tau**2, axis=0)) + 1e-9
    wrong = np.sin(3.0 * q) + 0.5 * np.tanh(20.0 * v) * np.cos(q)
    return tau + rms * (noise * rng.normal(size=tau.shape) + unmodelled * wrong), rms * noise


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", range(24))
def test_robots_of_any_structure_converge_on_slow_motion(seed):
    """Priors 100 times too light or too heavy, motion that hardly shows the inertias."""
    rng = np.random.default_rng(seed)
    options = (
        {"prismatic": False},
        {},
        {"tree": True, "fixed": True},
        {"transmission": True, "prismatic": False},
    )[seed % 4]
    model = random_model(rng, f=int(rng.integers(4, 8)), drive=True, **options)
    model = model.with_inertia(random_bodies(rng, model.f))
    base = base_parameters(model, drive=True if seed % 3 else ("Ia", "Fv", "Fc"))
    q, v, a = random_state(model, rng, int(rng.integers(3, 30) * len(base) / model.n))
    w = 10.0 ** rng.uniform(-2.0, 0.5)
    motion = (q, w * v, w * w * a)
    tau, sigma = measured(rng, model, motion, rng.uniform(0.02, 0.4), rng.uniform(0.0, 0.5))
    R, y, rest, W, _ = weighted(base, motion, tau, sigma)
    mass = float(model.inertia.mass.sum()) * 10.0 ** rng.uniform(-2.0, 2.0)
    found = fit_consistent(base, R, y, rest=rest, rows=len(W), prior=uniform_bodies(model, mass))
    assert found.status in (EXACT, CONSTRAINED), found.reason()
    assert found.fit.gap <= PROVED
    truth = rest + np.sum((R @ base.values(model) - y) ** 2)
    assert found.fit.squares <= truth * (1.0 + PROVED)


def test_a_solver_that_stops_early_is_reported(monkeypatch):
    rng = np.random.default_rng(0)
    model = arm(rng, "rx90")
    base, R, y, rest, *_ = noisy(model, rng, 0.5, samples=15)
    best = fit_consistent(base, R, y, rest=rest, rows=90, prior=uniform_bodies(model, 20.0))
    assert best.residual_increase > 0.0
    assert best.rms == pytest.approx(np.sqrt(best.fit.squares / 90))
    monkeypatch.setitem(physical._SOLVER, "max_iter", 5)
    early = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 20.0))
    assert best.status is CONSTRAINED
    assert early.status is PhysicalStatus.INACCURATE
    assert early.fit.gap > best.fit.gap
    assert best.fit.squares >= early.fit.squares * (1.0 - early.fit.gap)  # the gap holds there too
    assert early.fit.stopped == "The solver stopped: MaxIterations after 5 iterations."
    assert early.fit.stopped in early.reason()
