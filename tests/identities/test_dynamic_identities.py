"""Physics on random robots: inverse and direct dynamics, energy, power and gravity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import (
    any_models,
    close,
    models,
    random_bodies,
    random_pose,
    random_state,
    seeds,
)
from numpy.polynomial import chebyshev

import robotmodels as rm
from robotmodels.dynamics import (
    base_model,
    christoffel_blocks,
    idm,
    idm_from_base,
    with_payload,
    without_payload,
)
from robotmodels.friction import AsymmetricFriction
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import parameter_vector, torque_regressor


def singles(function, *arrays):
    """A function called once for each row, the way that goes through Pinocchio."""
    return np.array([function(*rows) for rows in zip(*arrays, strict=True)])


def derivative(function, rate):
    """Derivative at 0 of smooth ``function(t (k,)) -> (k, ...)``, to about 1e-13 times the rate.

    The Chebyshev series on an interval in which a motion of the given rate turns by less than one
    radian: sixteen terms leave less than rounding.
    """
    half = 0.5 / max(1.0, rate)
    x = np.cos(np.pi * (np.arange(16) + 0.5) / 16)
    values = np.asarray(function(half * x))
    series = chebyshev.chebfit(x, values.reshape(16, -1), 15)
    slope = chebyshev.chebval(0.0, chebyshev.chebder(series)) / half
    return slope.reshape(values.shape[1:])


def rate_of(v):
    """How fast the quickest term of an energy turns along a motion."""
    return 2.0 * np.abs(v).sum()


def rotor_matrix(model):
    """Rotor inertia from its definition in `Transmission`."""
    rotor = np.diag(model.drive.Ia)
    if model.transmission is not None:
        turns = np.linalg.inv(model.transmission.matrix)
        for m, Iam in enumerate(model.transmission.Iam):
            w = turns[m] / turns[m, m]
            rotor = rotor + Iam * (np.outer(w, w) - np.diag(w**2))
    return rotor


# --- Pinocchio and the kernels ---------------------------------------------------------------


@given(model=models(max_frames=10), seed=seeds)
def test_single_calls_equal_batches(model, seed):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    w = rng.normal(size=(3, 6))
    for drive in (True, False):
        tau = rm.idm(model, q, v, a, w, drive=drive)
        close(singles(lambda *x, d=drive: rm.idm(model, *x, drive=d), q, v, a, w), tau)
        M = rm.mass_matrix(model, q, drive)
        close(singles(lambda x, d=drive: rm.mass_matrix(model, x, d), q), M)
        kinetic = rm.kinetic_energy(model, q, v, drive)
        close(singles(lambda *x, d=drive: rm.kinetic_energy(model, *x, d), q, v), kinetic)
        accelerations = rm.ddm(model, q, v, tau, w, drive=drive)
        tolerance = 1e-13 * np.linalg.cond(M).max()
        found = singles(lambda *x, d=drive: rm.ddm(model, *x, drive=d), q, v, tau, w)
        close(found, accelerations, tolerance)
    C = rm.coriolis_matrix(model, q, v)
    close(singles(lambda *x: rm.coriolis_matrix(model, *x), q, v), C)
    close(singles(lambda x: rm.gravity_torque(model, x), q), rm.gravity_torque(model, q))
    close(singles(lambda x: rm.potential_energy(model, x), q), rm.potential_energy(model, q))


# --- inverse and direct ----------------------------------------------------------------------


@given(model=models(), seed=seeds, external=st.booleans(), drive=st.booleans())
def test_direct_dynamics_inverts_inverse_dynamics(model, seed, external, drive):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    w = rng.normal(size=(3, 6)) if external else np.zeros((3, 6))
    given_wrench = w if external else None
    tau = rm.idm(model, q, v, a, given_wrench, drive)
    M = rm.mass_matrix(model, q, drive)
    # rounding of the torques, magnified by the solution
    tolerance = 1e-14 * np.linalg.cond(M).max() * max(1.0, np.abs(tau).max()) + 1e-12
    close(rm.ddm(model, q, v, tau, given_wrench, drive), a, tolerance)
    back = singles(lambda *x: rm.ddm(model, *x, drive=drive), q, v, tau, w)
    close(back, a, tolerance)


@given(model=any_models(tip="any"), seed=seeds)
def test_torque_is_mass_coriolis_gravity_drive_and_wrench(model, seed):
    """With the slopes of the energies below this is the balance of power as well."""
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng)
    w = rng.normal(size=6)
    drive, coupling = model.drive, np.zeros(model.n)
    if model.transmission is not None:
        turns = np.linalg.inv(model.transmission.matrix)
        for m in range(model.n):
            row = turns[m] / turns[m, m]
            cross = np.outer(row, row) - np.diag(row**2)
            coupling += model.transmission.Iam[m] * cross @ a
            coupling += model.transmission.Fvm[m] * cross @ v
            coupling += model.transmission.Fcm[m] * row * np.sign(row @ v)
    expected = (
        rm.mass_matrix(model, q, drive=False) @ a
        + rm.coriolis_matrix(model, q, v) @ v
        + rm.gravity_torque(model, q)
        + rm.jacobian(model, q).T @ w
        + drive.Ia * a + drive.Fv * v + drive.Fc * np.sign(v) + drive.offset
        + coupling
    )  # fmt: skip
    close(rm.idm(model, q, v, a, w), expected)
    close(rm.idm(model, [q], [v], [a], [w])[0], expected)


@given(model=any_models(), seed=seeds)
def test_mass_matrix_is_symmetric_and_holds_the_rotors(model, seed):
    q, v, _ = random_state(model, np.random.default_rng(seed), 2)
    rigid, loaded = rm.mass_matrix(model, q, drive=False), rm.mass_matrix(model, q)
    for M in (rigid, loaded, rm.mass_matrix(model, q[0])):
        np.testing.assert_array_equal(M, np.swapaxes(M, -1, -2))
    close(loaded - rigid, np.tile(rotor_matrix(model), (2, 1, 1)), 1e-13 * np.abs(loaded).max())
    for M, drive in ((rigid, False), (loaded, True)):
        quadratic = 0.5 * np.einsum("ki,kij,kj->k", v, M, v)
        close(rm.kinetic_energy(model, q, v, drive), quadratic)
        columns = [rm.idm(model, q, 0 * v, e, drive=drive) for e in np.eye(model.n)]
        still = rm.idm(model, q, 0 * v, 0 * v, drive=drive)
        close(np.moveaxis(np.array(columns) - still, 0, -1), M)


# --- Coriolis --------------------------------------------------------------------------------


@given(model=any_models(), seed=seeds)
def test_mass_matrix_rate_less_twice_coriolis_is_skew(model, seed):
    q, v, _ = random_state(model, np.random.default_rng(seed))
    rate = derivative(lambda t: rm.mass_matrix(model, q + np.outer(t, v)), rate_of(v))
    for C in (rm.coriolis_matrix(model, q, v), rm.coriolis_matrix(model, [q], [v])[0]):
        close(C + C.T, rate, 1e-11 * max(1.0, rate_of(v)))
        skew = rate - 2 * C
        close(skew, -skew.T, 1e-11 * max(1.0, rate_of(v)))


@given(model=any_models(max_frames=5), seed=seeds)
def test_coriolis_matrix_is_made_of_christoffel_symbols(model, seed):
    q, v, _ = random_state(model, np.random.default_rng(seed))
    n = model.n
    # dM[k] is the derivative of M with respect to q_k
    dM = np.array([
        derivative(lambda t, k=k: rm.mass_matrix(model, q + np.outer(t, np.eye(n)[k])), 2.0)
        for k in range(n)
    ])  # fmt: skip
    symbols = 0.5 * (np.einsum("kij->ijk", dM) + np.einsum("jik->ijk", dM) - dM)
    close(rm.coriolis_matrix(model, q, v), symbols @ v, 1e-11)
    close(rm.coriolis_matrix(model, [q], v)[0], symbols @ v, 1e-11)
    j, k = np.triu_indices(n, 1)
    B, C = christoffel_blocks(model, q[None])
    close(B[0] @ (v[j] * v[k]) + C[0] @ v**2, symbols @ v @ v, 1e-11)


# --- gravity ---------------------------------------------------------------------------------


@given(model=any_models(), seed=seeds)
def test_gravity_torque_is_the_slope_of_the_potential(model, seed):
    q, v, _ = random_state(model, np.random.default_rng(seed))
    g = rm.gravity_torque(model, q)
    n = model.n
    slope = [
        derivative(lambda t, k=k: rm.potential_energy(model, q + np.outer(t, np.eye(n)[k])), 1.0)
        for k in range(n)
    ]
    scale = max(1.0, abs(rm.potential_energy(model, q)))
    close(g, slope, 1e-12 * scale)
    close(rm.gravity_torque(model, [q])[0], g)
    close(rm.idm(model, q, 0 * v, 0 * v, drive=False), g)


@given(model=any_models(), seed=seeds)
def test_turning_the_whole_world_changes_no_torque(model, seed):
    """Base, gravity and wrench turned together; where the base stands never matters."""
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng)
    w = rng.normal(size=6)
    Z = random_pose(rng)
    R = Z[:3, :3]
    turned = model.with_base(Z @ model.base).with_gravity(R @ model.gravity)
    w_turned = (w.reshape(2, 3) @ R.T).ravel()
    shifted = model.with_base(model.base + np.pad(rng.normal(size=(3, 1)), ((0, 1), (3, 0))))
    for x in ((q, v, a), ([q], [v], [a])):
        tau = rm.idm(model, *x, w)
        close(rm.idm(turned, *x, w_turned), tau)
        close(rm.idm(shifted, *x, w), tau)
        close(rm.coriolis_matrix(turned, *x[:2]), rm.coriolis_matrix(model, *x[:2]))
        close(rm.mass_matrix(turned, x[0]), rm.mass_matrix(model, x[0]))


# --- units -----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1e-4, 1e4])
@given(model=models(drive=False, transmission=False), seed=seeds)
def test_numbers_keep_their_digits_at_any_size(size, model, seed):
    """A robot a size larger, in a gravity larger by as much: torques grow by its square."""
    table, bodies = model.table, model.inertia.values
    large = table.replace(**{key: size * getattr(table, key) for key in ("b", "d", "r")})
    power, place = np.repeat([2, 1, 0], [6, 3, 1]), model.base.copy()
    place[:3, 3] *= size
    other = model.with_table(large).with_inertia(rm.InertialParameters(bodies * size**power))
    other = other.with_gravity(size * model.gravity).with_base(place)
    stroke = np.where(table.sigma[table.joint_rows] == 1, size, 1.0)
    torque, entry = size**2 / stroke, size**2 / np.outer(stroke, stroke)
    states = random_state(model, np.random.default_rng(seed), 2)
    for q, v, a in (states, [x[0] for x in states]):
        x, dx, ddx = stroke * q, stroke * v, stroke * a
        tau, M = rm.idm(model, q, v, a), rm.mass_matrix(model, q)
        close(rm.idm(other, x, dx, ddx) / torque, tau)
        close(rm.mass_matrix(other, x) / entry, M)
        close(rm.coriolis_matrix(other, x, dx) / entry, rm.coriolis_matrix(model, q, v))
        tolerance = 1e-14 * np.linalg.cond(M).max() * max(1.0, np.abs(tau).max()) + 1e-12
        close(rm.ddm(other, x, dx, torque * tau) / stroke, a, tolerance)


# --- friction, payloads and base parameters ------------------------------------------------------


@given(model=models(tip="any"), seed=seeds)
def test_a_payload_is_added_to_the_link_that_carries_it(model, seed):
    rng = np.random.default_rng(seed)
    mass, com, inertia = rng.uniform(0.1, 1.0), rng.normal(size=3), random_bodies(rng, 1).tensors[0]
    body = rm.InertialParameters.from_com([mass], [com], [inertia])
    for frame in (None, int(rng.integers(1, model.f + 1))):
        loaded = with_payload(model, mass, com, inertia, frame)
        expected = model.inertia.values.copy()
        place = model.tool if frame is None else np.eye(4)
        expected[(model.tip if frame is None else frame) - 1] += body.moved(place[None]).values[0]
        close(loaded.inertia.values, expected)
        back = without_payload(loaded, mass, com, inertia, frame)
        close(back.inertia.values, model.inertia.values, 1e-13)


@given(
    model=models(max_frames=6), seed=seeds, drive=st.sampled_from([True, False, ("Ia",), ("Fv",)])
)
def test_base_parameters_alone_are_a_model(model, seed, drive):
    """The recursion with skips, the model of zeros and the reduced regressor are one."""
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    w = rng.normal(size=6)
    base = base_parameters(model, drive=drive)
    values = base.values(model)
    tau = idm_from_base(model, base, values, q, v, a)
    robot = base_model(model, base, values)
    close(tau, idm(robot, q, v, a))
    rest = idm(model, q, v, a) - torque_regressor(model, q, v, a, drive) @ parameter_vector(
        model, drive
    )
    close(tau, torque_regressor(model, q, v, a, drive, columns=base) @ values + rest, 1e-12)
    friction = AsymmetricFriction(*rng.uniform(0.1, 3, (4, model.n)))
    close(
        idm_from_base(model, base, values, q[0], v[0], a[0], w, friction),
        tau[0] + idm(model, q[0], v[0], a[0], w, friction=friction) - idm(model, q[0], v[0], a[0]),
        1e-11,
    )
    zeros = np.setdiff1d(np.arange(base.matrix.shape[1]), base.kept)
    assert not parameter_vector(robot, drive)[zeros].any()
