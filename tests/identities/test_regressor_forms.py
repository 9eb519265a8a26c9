"""Power, energy, momentum and filtered forms of the dynamic model, on random robots."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import (
    any_models,
    close,
    models,
    random_state,
    seeds,
)
from scipy.signal import butter

import robotmodels as rm
from robotmodels.dynamics import idm
from robotmodels.friction import AsymmetricFriction
from robotmodels.regressors import (
    energy_difference_regressor,
    energy_parameter_names,
    energy_regressor,
    filtered_regressor,
    filtered_torque,
    joint_work,
    momentum_regressor,
    parameter_names,
    parameter_vector,
    power_regressor,
    torque_regressor,
)


def random_friction(rng, n):
    """A friction model whose names the drives do not have."""
    return AsymmetricFriction(*rng.uniform(0.1, 3.0, (4, n)))


def motion(model, rng, t):
    """A smooth motion q(t) with its derivatives, each (N, n)."""
    q0, v0, _ = random_state(model, rng)
    rate = rng.uniform(0.5, 1.5, model.n)
    phase = np.outer(t, rate) + v0
    return q0 + np.sin(phase), rate * np.cos(phase), -(rate**2) * np.sin(phase)


@given(model=any_models(), seed=seeds, drive=st.booleans())
def test_power_is_the_torque_regressor_on_the_velocity(model, seed, drive):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    friction = random_friction(rng, model.n)
    W = torque_regressor(model, q, v, a, drive, friction=friction)
    d = power_regressor(model, q, v, a, drive, friction=friction)
    close(d, np.einsum("kj,kjp->kp", v, W))
    parameters = parameter_vector(model, drive, friction)
    assert parameters.shape == (len(parameter_names(model, drive, friction)),)
    tau = idm(model, q, v, a, drive=drive, friction=friction)
    close(W @ parameters, tau)
    close(d @ parameters, (tau * v).sum(axis=1), 1e-11)


@given(model=any_models(), seed=seeds, drive=st.booleans())
def test_momentum_form_is_the_torque_without_acceleration(model, seed, drive):
    """P pi = A v; S pi = C^T v - Q - friction; dP/dt - S is the torque regressor."""
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 2)
    friction = random_friction(rng, model.n)
    P, S = momentum_regressor(model, q, v, drive, friction=friction)
    parameters = parameter_vector(model, drive, friction)
    close(P @ parameters, np.einsum("kij,kj->ki", rm.mass_matrix(model, q, drive), v))
    C = rm.coriolis_matrix(model, q, v)
    resistance = idm(model, q, v, 0 * v, drive=drive, friction=friction)
    resistance -= idm(model, q, v, 0 * v, drive=False)
    expected = np.einsum("kji,kj->ki", C, v) - rm.gravity_torque(model, q) - resistance
    close(S @ parameters, expected, 1e-11)
    h = 1e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}

    def momentum(t):
        return momentum_regressor(
            model, q + v * t + a * t**2 / 2, v + a * t, drive, friction=friction
        ).momentum

    slope = sum(w * (momentum(k * h) - momentum(-k * h)) for k, w in weights.items()) / h
    W = torque_regressor(model, q, v, a, drive, friction=friction)
    scale = 1.0 + np.linalg.norm(v) + np.linalg.norm(a)
    close(slope - S, W, 1e-11 * scale**2)


@given(model=any_models(), seed=seeds)
def test_any_subset_of_columns_is_that_of_the_whole(model, seed):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 2)
    names = parameter_names(model)
    some = rng.permutation(len(names))[: rng.integers(0, len(names) + 1)]
    chosen = [names[k] for k in some]
    mask = np.isin(np.arange(len(names)), some)
    for function, x in (
        (torque_regressor, (q, v, a)),
        (power_regressor, (q, v, a)),
        (lambda *y, **k: momentum_regressor(*y, **k).momentum, (q, v)),
        (lambda *y, **k: momentum_regressor(*y, **k).force, (q, v)),
    ):
        whole = function(model, *x)
        for columns in (some, chosen):
            np.testing.assert_array_equal(function(model, *x, columns=columns), whole[..., some])
        np.testing.assert_array_equal(function(model, *x, columns=mask), whole[..., mask])
    stored = energy_parameter_names(model)
    part = [name for name in chosen if name in stored]
    whole = energy_regressor(model, q, v)[..., [stored.index(name) for name in part]]
    np.testing.assert_array_equal(energy_regressor(model, q, v, columns=part), whole)
    assert parameter_names(model, columns=some) == tuple(chosen)


@given(model=models(max_frames=5, transmission=True, drive=True), seed=seeds)
def test_energy_differences_are_the_work_of_the_torques(model, seed):
    """Along a motion, over long stretches and short ones, drives included."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 1001)
    q, v, a = motion(model, rng, t)
    tau = idm(model, q, v, a)
    work = np.trapezoid((tau * v).sum(axis=1), t)
    row = energy_difference_regressor(model, t, q, v, knots=[0, 1000])
    assert row.shape == (1, len(parameter_names(model)))
    power = np.abs(tau * v).sum(axis=1).max()
    assert abs(row[0] @ parameter_vector(model) - work) < 1e-5 * power
    np.testing.assert_allclose(joint_work(t, v, tau, [0, 1000]), [work], atol=1e-5 * power)
    rows = energy_difference_regressor(model, t, q, v)
    close(rows.sum(axis=0), row[0], 1e-11)
    knots = np.r_[0, 1 + np.flatnonzero(rng.random(999) < 0.05), 1000]
    parts = energy_difference_regressor(model, t, q, v, knots=knots)
    close(parts, np.add.reduceat(rows, knots[:-1]), 1e-11)


@given(model=models(max_frames=4), seed=seeds)
def test_friction_between_samples_is_exact_for_linear_velocity(model, seed):
    """Through zero as well; against a fine quadrature of the power."""
    rng = np.random.default_rng(seed)
    n = model.n
    t = np.array([0.0, 0.7, 1.0])
    v = rng.normal(size=(3, n))
    v[0, 0] = 0.0
    q = np.cumsum(np.r_[np.zeros((1, n)), np.diff(t)[:, None] * (v[1:] + v[:-1]) / 2], axis=0)
    friction = random_friction(rng, n)
    kinds = ("Fv", "Fc", "offset", "Fvm", "Fcm", *friction.kinds)
    names = [p for p in parameter_names(model, True, friction) if p.startswith(kinds)]
    rows = energy_difference_regressor(model, t, q, v, columns=names, friction=friction)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for k in range(2):
        # every joint and every coupled motor may turn in between: quadrature from turn to turn
        turns = {0.0, 1.0}
        w = np.eye(n) if model.transmission is None else model.transmission.weights
        for z in np.vstack([np.eye(n), w]) @ v[k : k + 2].T:
            if z[0] * z[1] < 0:
                turns.add(z[0] / (z[0] - z[1]))
        turns = sorted(turns)
        expected = 0.0
        for first, last in pairwise(turns):
            s = first + (last - first) * (nodes + 1) / 2
            speed = v[k] + s[:, None] * (v[k + 1] - v[k])
            power = power_regressor(
                model, 0 * speed, speed, 0 * speed, columns=names, friction=friction
            )
            expected = expected + (last - first) / 2 * (weights @ power)
        close(rows[k], (t[k + 1] - t[k]) * expected, 1e-12)


@pytest.mark.parametrize("order", [1, 4])
@given(model=models(max_frames=4), seed=seeds)
def test_filtered_form_is_the_filtered_torque(order, model, seed):
    """F(W) parameters = F(tau) from the first sample on, to the square of the period."""
    rng = np.random.default_rng(seed)
    errors = []
    state = rng.bit_generator.state
    smooth = [p for p in parameter_names(model) if not p.startswith(("Fc", "offset"))]
    for N in (201, 801):
        rng.bit_generator.state = state
        t = np.linspace(0.0, 1.0, N)
        low_pass = butter(order, 3.0, fs=N - 1, output="sos")
        q, v, a = motion(model, rng, t)
        W = filtered_regressor(model, t[1], q, v, low_pass, columns=smooth)
        direct = filtered_torque(torque_regressor(model, q, v, a, columns=smooth), low_pass)
        assert not W[0].any()
        errors.append(np.abs(W - direct).max() / max(1.0, np.abs(direct).max()))
    assert errors[1] < 1e-3
    assert errors[1] < errors[0] / 8 or errors[1] < 1e-12


# --- column by column -----------------------------------------------------------------------------


@given(model=any_models(), seed=seeds)
def test_each_column_is_the_torque_of_one_parameter(model, seed):
    """Column by column, so that no two faults cancel in the sum."""
    q, v, a = random_state(model, np.random.default_rng(seed))
    W = rm.torque_regressor(model, q, v, a)
    for k in range(10 * model.f):
        unit = np.zeros(10 * model.f)
        unit[k] = 1.0
        robot = model.with_inertia(rm.InertialParameters(unit.reshape(-1, 10)))
        close(W[:, k], rm.idm(robot, q, v, a, drive=False))
    idle = model.with_inertia(None).with_transmission(None)
    column = 10 * model.f
    for kind in ("Ia", "Fv", "Fc", "offset"):
        for j in range(model.n):
            drive = rm.DriveParameters(**{kind: np.eye(model.n)[j]})
            close(W[:, column], rm.idm(idle.with_drive(drive), q, v, a))
            column += 1
    idle = idle.with_drive(None)
    motors = () if model.transmission is None else model.transmission.coupled_motors
    for kind in ("Iam", "Fvm", "Fcm"):
        for m in motors:
            unit = rm.Transmission(model.transmission.matrix, **{kind: np.eye(model.n)[m - 1]})
            close(W[:, column], rm.idm(idle.with_transmission(unit), q, v, a))
            column += 1
    assert column == W.shape[-1]


@given(model=any_models(), seed=seeds, drive=st.booleans())
def test_energy_regressor_times_parameters_is_the_energy(model, seed, drive):
    q, v, _ = random_state(model, np.random.default_rng(seed), 3)
    h = rm.energy_regressor(model, q, v, drive)
    # friction and offsets store no energy
    kept = [not name.startswith(("F", "offset")) for name in rm.parameter_names(model, drive)]
    parameters = rm.parameter_vector(model, drive)[kept]
    energy = rm.kinetic_energy(model, q, v, drive) + rm.potential_energy(model, q)
    close(h @ parameters, energy)
