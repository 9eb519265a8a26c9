"""Consistent robots of noisy logs: the solver converges, or it is said what stops it."""

import numpy as np
import pytest
from identities.random_robots import random_bodies, random_model, random_state

import robotmodels as rm
from robotmodels.identification import Log, consistent_robot, fit
from robotmodels.minimal_parameters import (
    PhysicalStatus,
    base_parameters,
    fit_consistent,
    physical,
    uniform_bodies,
)

EXACT, CONSTRAINED = PhysicalStatus.EXACT, PhysicalStatus.CONSTRAINED
PROVED = 3e-4  # part of the squares within which a converged fit is known to be the best
QUARTER = np.pi / 2


def heavy_arm(rng):
    """An arm of a tonne with heavy drives, and the same without parameters (6 joints)."""
    s = rng.uniform(0.7, 1.3, 6)
    rows = [
        {"alpha": 0.0, "d": 0.0, "theta": 0.0, "r": 0.7 * s[0]},
        {"alpha": -QUARTER, "d": 0.35 * s[1], "theta": -QUARTER, "r": 0.0},
        {"alpha": 0.0, "d": 1.15 * s[2], "theta": 0.0, "r": 0.0},
        {"alpha": -QUARTER, "d": -0.05 * s[3], "theta": 0.0, "r": 1.2 * s[4]},
        {"alpha": QUARTER, "d": 0.0, "theta": 0.0, "r": 0.0},
        {"alpha": -QUARTER, "d": 0.0, "theta": 0.0, "r": 0.2 * s[5]},
    ]
    bare = rm.RobotModel.from_table(rm.DHTable.from_rows([{"sigma": 0, **row} for row in rows]))
    mass = np.array([400.0, 300.0, 250.0, 60.0, 30.0, 80.0]) * rng.uniform(0.6, 1.6, 6)
    size = np.array([0.4, 0.6, 0.4, 0.3, 0.15, 0.15])
    second = []
    for j in range(6):
        points = rng.normal(size=(12, 3)) * size[j] * rng.uniform(0.2, 0.6, 3)
        S = mass[j] * points.T @ points / 12.0
        second.append(np.trace(S) * np.eye(3) - S)
    com = rng.uniform(-0.5, 0.5, (6, 3)) * size[:, None]
    arm = bare.with_inertia(rm.InertialParameters.from_com(mass, com, np.array(second)))
    sizes = {
        "Ia": [150.0, 150.0, 100.0, 15.0, 10.0, 5.0],
        "Fv": [1200.0, 1500.0, 1000.0, 200.0, 150.0, 80.0],
        "Fc": [600.0, 700.0, 500.0, 150.0, 120.0, 60.0],
    }
    drive = {kind: np.array(size) * rng.uniform(0.3, 2.0, 6) for kind, size in sizes.items()}
    return arm.with_drive(rm.DriveParameters(**drive, offset=np.zeros(6))), bare


def slow_motion(rng, t):
    """Five harmonics of 0.1 Hz."""
    w = 0.2 * np.pi * np.arange(1.0, 6.0)[:, None]
    size = rng.normal(size=(5, 6)) * np.array([0.6, 0.4, 0.4, 0.8, 0.6, 1.0]) / 5.0
    phase = w * t[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, (5, 6))
    return (
        (size * np.sin(phase)).sum(axis=1),
        (size * w * np.cos(phase)).sum(axis=1),
        -(size * w**2 * np.sin(phase)).sum(axis=1),
    )


def measured(rng, model, motion, noise, unmodelled):
    """Torques with noise and with what no parameter explains, and the noise of each joint."""
    q, v, _ = motion
    tau = rm.idm(model, *motion)
    rms = np.sqrt(np.mean(tau**2, axis=0)) + 1e-9
    wrong = np.sin(3.0 * q) + 0.5 * np.tanh(20.0 * v) * np.cos(q)
    return tau + rms * (noise * rng.normal(size=tau.shape) + unmodelled * wrong), rms * noise


def weighted(base, motion, tau, sigma):
    """Factor, right side, squares that they do not hold, and number of rows."""
    W = base.reduce(rm.torque_regressor(base.model, *motion, drive=base.drive))
    W = (W / sigma[:, None]).reshape(-1, len(base))
    y = (tau / sigma).ravel()
    Q, R = np.linalg.qr(W)
    z = Q.T @ y
    return R, z, float(np.sum((y - Q @ z) ** 2)), len(y)


@pytest.mark.parametrize("seed", range(30))
def test_noisy_logs_of_heavy_arms_converge(seed):
    """180 to 1200 equations, noise of 5 to 30 %, unmodelled torques, a prior ten times light."""
    rng = np.random.default_rng(seed)
    arm, bare = heavy_arm(rng)
    unmodelled = rng.uniform(0.0, 0.3) if seed % 3 else 0.0
    motion = slow_motion(rng, np.linspace(0.0, 10.0, int(rng.integers(30, 200))))
    tau, sigma = measured(rng, arm, motion, rng.uniform(0.05, 0.3), unmodelled)
    drive = ("Ia", "Fv", "Fc")
    base = base_parameters(bare, drive=drive)
    R, y, rest, rows = weighted(base, motion, tau, sigma)
    found = fit_consistent(base, R, y, rest=rest, rows=rows, prior=uniform_bodies(bare, 100.0))
    assert found.status in (EXACT, CONSTRAINED), found.reason()
    assert found.fit.stopped == ""
    assert found.fit.gap <= PROVED
    assert found.inertia.is_physical.all()
    # the true robot is one of those that the proof is about, so consistency costs no more than it
    truth = base_parameters(arm, drive=drive).values(arm)
    squares = rest + np.sum((R @ truth - y) ** 2)
    assert found.fit.squares <= squares * (1.0 + found.fit.gap)
    if unmodelled == 0.0:
        assert found.residual_increase <= 100.0 * (np.sqrt(squares / found.fit.least) - 1.0) + 0.02
        assert found.residual_increase < 12.0


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
    R, y, rest, rows = weighted(base, motion, tau, sigma)
    mass = float(model.inertia.mass.sum()) * 10.0 ** rng.uniform(-2.0, 2.0)
    found = fit_consistent(base, R, y, rest=rest, rows=rows, prior=uniform_bodies(model, mass))
    assert found.status in (EXACT, CONSTRAINED), found.reason()
    assert found.fit.gap <= PROVED
    truth = rest + np.sum((R @ base.values(model) - y) ** 2)
    assert found.fit.squares <= truth * (1.0 + PROVED)


@pytest.mark.parametrize("seed", range(2))
def test_default_fit_then_consistent_robot(seed):
    """A log of 10 s at 250 Hz, ripple at 110 Hz: converged, and the bounds are named by joint."""
    rng = np.random.default_rng(seed)
    arm, bare = heavy_arm(rng)
    t = np.arange(0.0, 10.0, 0.004)
    motion = slow_motion(rng, t)
    tau, sigma = measured(rng, arm, motion, 0.1, 0.1)
    tau += 0.5 * sigma * np.sin(2.0 * np.pi * 110.0 * t)[:, None]
    result = fit(bare, Log(0.004, motion[0], tau), drive=("Ia", "Fv", "Fc"), checked=False)
    robot = consistent_robot(result, uniform_bodies(bare, 100.0))
    assert robot.status in (EXACT, CONSTRAINED), robot.reason()
    assert robot.fit.gap <= PROVED
    true = rm.idm(arm, *motion)
    error = rm.idm(robot.of(bare), *motion) - true
    assert np.sqrt(np.mean(error**2)) < 0.15 * np.sqrt(np.mean(true**2))
    assert all(sentence in robot.reason() for sentence in robot.fit.active)
    assert "link" in robot.reason()


def stopped_after(iterations, monkeypatch):
    monkeypatch.setitem(physical._SOLVER, "max_iter", iterations)
    rng = np.random.default_rng(0)
    arm, bare = heavy_arm(rng)
    motion = slow_motion(rng, np.linspace(0.0, 10.0, 60))
    tau, sigma = measured(rng, arm, motion, 0.2, 0.1)
    base = base_parameters(bare, drive=("Ia", "Fv", "Fc"))
    R, y, rest, _ = weighted(base, motion, tau, sigma)
    return fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(bare, 100.0))


def test_a_solver_that_stops_early_says_where(monkeypatch):
    best = stopped_after(500, monkeypatch)
    early = stopped_after(5, monkeypatch)
    assert best.status is CONSTRAINED
    assert early.status is PhysicalStatus.INACCURATE
    assert early.fit.gap > best.fit.gap
    assert best.fit.squares >= early.fit.squares * (1.0 - early.fit.gap)  # the gap holds there too
    assert early.fit.stopped == "The solver stopped: MaxIterations after 5 iterations."
    for text in (early.reason(), str(early)):
        assert early.fit.stopped in text
        assert f"The sum of squares is within {100.0 * early.fit.gap:.1g} % of the optimum." in text
    assert best.fit.stopped == ""
