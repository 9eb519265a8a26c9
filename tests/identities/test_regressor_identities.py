"""Regressors of random robots: torque and energy are linear in the standard parameters."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import any_models, random_parameters, random_state, seeds

import robotmodels as rm


def close(actual, expected, tolerance=1e-12):
    """Equal relative to the largest number, at least one."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


@given(model=any_models(), seed=seeds, drive=st.booleans())
def test_torque_regressor_times_parameters_is_the_torque(model, seed, drive):
    q, v, a = random_state(model, np.random.default_rng(seed), 3)
    parameters = rm.parameter_vector(model, drive)
    names = rm.parameter_names(model, drive)
    assert len(set(names)) == len(names) == parameters.size
    tau = rm.idm(model, q, v, a, drive=drive)
    W = rm.torque_regressor(model, q, v, a, drive)
    close(W @ parameters, tau)
    close(rm.torque_regressor(model, q[0], v[0], a[0], drive) @ parameters,
          rm.idm(model, q[0], v[0], a[0], drive=drive))  # fmt: skip


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


@given(model=any_models(), seed=seeds)
def test_the_regressor_knows_no_parameters(model, seed):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 2)
    other = model.with_inertia(random_parameters(rng, model.f)).with_drive(None)
    np.testing.assert_array_equal(
        rm.torque_regressor(other, q, v, a), rm.torque_regressor(model, q, v, a)
    )
    np.testing.assert_array_equal(
        rm.energy_regressor(other, q, v), rm.energy_regressor(model, q, v)
    )


@given(model=any_models(), seed=seeds, drive=st.booleans())
def test_energy_regressor_times_parameters_is_the_energy(model, seed, drive):
    q, v, _ = random_state(model, np.random.default_rng(seed), 3)
    h = rm.energy_regressor(model, q, v, drive)
    # friction and offsets store no energy
    kept = [not name.startswith(("F", "offset")) for name in rm.parameter_names(model, drive)]
    parameters = rm.parameter_vector(model, drive)[kept]
    energy = rm.kinetic_energy(model, q, v, drive) + rm.potential_energy(model, q)
    close(h @ parameters, energy)
    row = rm.energy_regressor(model, q[0], v[0], drive)
    close(row @ parameters, rm.kinetic_energy(model, q[0], v[0], drive)
          + rm.potential_energy(model, q[0]))  # fmt: skip
