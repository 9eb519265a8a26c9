"""Properties that controllers rely on: Christoffel blocks, passivity, bounds, payloads."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import any_models, models, random_drive, random_state, seeds

import robotmodels as rm
from robotmodels.dynamics import (
    base_model,
    christoffel_blocks,
    ddm,
    idm,
    idm_from_base,
    with_payload,
    without_payload,
)
from robotmodels.friction import AsymmetricFriction, StribeckFriction
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import parameter_vector, torque_regressor


def close(actual, expected, tolerance=1e-12):
    """Equal relative to the largest number, at least one."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


@given(model=any_models(), seed=seeds)
def test_christoffel_blocks_are_the_coriolis_torques(model, seed):
    q, v, _ = random_state(model, np.random.default_rng(seed), 3)
    B, C = christoffel_blocks(model, q)
    j, k = np.triu_indices(model.n, 1)
    torque = np.einsum("sip,sp->si", B, v[:, j] * v[:, k]) + np.einsum("sij,sj->si", C, v**2)
    close(torque, np.einsum("sij,sj->si", rm.coriolis_matrix(model, q, v), v), 1e-12)
    for one, many in zip(christoffel_blocks(model, q[0]), (B[0], C[0]), strict=True):
        np.testing.assert_array_equal(one, many)


@given(model=models(max_frames=5), seed=seeds)
def test_christoffel_blocks_are_slopes_of_the_mass_matrix(model, seed):
    q, _, _ = random_state(model, np.random.default_rng(seed))
    B, C = christoffel_blocks(model, q)
    n, h = model.n, 1e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    slope = np.stack(
        [
            sum(
                w * (rm.mass_matrix(model, q + m * h * e) - rm.mass_matrix(model, q - m * h * e))
                for m, w in weights.items()
            )
            / h
            for e in np.eye(n)
        ],
        axis=-1,
    )  # slope[i, j, k] = dM_ij / dq_k
    for i in range(n):
        pairs = zip(*np.triu_indices(n, 1), strict=True)
        for p, (j, k) in enumerate(pairs):
            symbol = (slope[i, j, k] + slope[i, k, j] - slope[j, k, i]) / 2
            close(B[i, p], 2 * symbol, 1e-10)
        for j in range(n):
            close(C[i, j], slope[i, j, j] - slope[j, j, i] / 2, 1e-10)


@given(model=models(max_frames=5, transmission=False), seed=seeds)
def test_power_put_in_is_energy_stored_and_dissipated(model, seed):
    """Passivity along a simulated motion: work of the control = gain of energy + friction's work.

    A friction that resists takes energy and never gives it, so that the energy stored is never
    more than what was put in.
    """
    rng = np.random.default_rng(seed)
    n = model.n
    # rotors as heavy as links, so that a light wrist does not make the motion stiff
    drive = rm.DriveParameters(Ia=np.full(n, 2.0), Fv=rng.uniform(0.1, 1.0, n))
    model = model.with_drive(drive)
    q, v, _ = random_state(model, rng)
    amplitude = rng.normal(size=n)

    def rate(t, x):
        tau = amplitude * np.cos(3 * t)
        acceleration = ddm(model, x[:n], x[n : 2 * n], tau)
        speed = x[n : 2 * n]
        return np.r_[speed, acceleration, tau @ speed, drive.Fv @ speed**2]

    x, h = np.r_[q, v, 0.0, 0.0], 2e-3
    start = rm.kinetic_energy(model, q, v) + rm.potential_energy(model, q)
    size = max(1.0, abs(float(start)))
    for k in range(100):
        t = k * h
        k1 = rate(t, x)
        k2 = rate(t + h / 2, x + h / 2 * k1)
        k3 = rate(t + h / 2, x + h / 2 * k2)
        k4 = rate(t + h, x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    q, v, work, lost = x[:n], x[n : 2 * n], x[-2], x[-1]
    end = rm.kinetic_energy(model, q, v) + rm.potential_energy(model, q)
    assert lost >= 0.0
    size = max(size, float(rm.kinetic_energy(model, q, v)))
    assert abs(end - start - work + lost) < 1e-6 * size


@given(model=models(transmission=False), seed=seeds)
def test_the_mass_matrix_is_bounded_over_configurations(model, seed):
    """Positive definite everywhere, and never beyond the links stretched out as far as they go.

    The largest eigenvalue is at most the trace, and a link's share of it that of the link at the
    greatest distance from each axis that the lengths of the table and the strokes allow.
    """
    rng = np.random.default_rng(seed)
    n = model.n
    model = model.with_drive(rm.DriveParameters(Ia=np.full(n, 0.3)))
    q, _, _ = random_state(model, rng, 40)
    eigenvalues = np.linalg.eigvalsh(rm.mass_matrix(model, q))
    assert eigenvalues.min() >= 0.3 * (1 - 1e-9)  # rotors alone
    chain = model.chain
    stroke = np.abs(q).max(axis=0)
    bound = 0.3 * n
    for k in range(model.f):
        pi = model.inertia.values[k]
        reach = 0.0  # of the link's origin, from the axes that it passes on the way to the base
        frame = k + 1
        while frame:
            sigma, joint = model.table.sigma[frame - 1], chain.joint[frame - 1]
            if sigma == 0:
                # turned about any axis: rod to the origin, then the body about it
                rod = pi[9] * reach**2 + 2 * np.linalg.norm(pi[6:9]) * reach
                bound += rod + (pi[0] + pi[3] + pi[5])
            elif sigma == 1:
                bound += pi[9]
                reach += stroke[joint]
            reach += np.linalg.norm(chain.position[frame - 1])
            frame = int(model.table.antecedent[frame - 1])
    assert eigenvalues.max() <= bound * (1 + 1e-12)


@given(model=models(drive=True), seed=seeds, kind=st.booleans())
def test_friction_adds_its_torque_to_both_models(model, seed, kind):
    rng = np.random.default_rng(seed)
    n = model.n
    model = model.with_drive(random_drive(rng, n))
    q, v, a = random_state(model, rng, 3)
    Fv, Fc, fall, vs = rng.uniform(0.1, 3, (4, n))
    friction = (
        AsymmetricFriction(*rng.uniform(0.1, 3, (4, n)))
        if kind
        else StribeckFriction(Fv, Fc, Fc + fall, vs)
    )
    for drive in (True, False):
        plain = idm(model, q, v, a, drive=drive)
        tau = idm(model, q, v, a, drive=drive, friction=friction)
        close(tau, plain + friction.torque(v))
        close(idm(model, q[0], v[0], a[0], drive=drive, friction=friction), tau[0], 1e-11)
        np.testing.assert_array_equal(
            ddm(model, q, v, tau, friction=friction), ddm(model, q, v, tau - friction.torque(v))
        )
        assert ((friction.torque(v) * v) >= 0).all()
    close(ddm(model, q, v, tau, drive=False, friction=friction),
          ddm(model, q, v, plain, drive=False), 1e-9)  # fmt: skip


@given(model=models(tip="any"), seed=seeds)
def test_a_payload_is_a_body_on_a_fixed_frame(model, seed):
    """The same as a row more in the table that carries it; and taken off, and moved."""
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 2)
    points = rng.normal(size=(6, 3))
    masses = rng.uniform(0.1, 1.0, 6)
    mass = masses.sum()
    com = masses @ points / mass
    arms = points - com
    inertia = np.einsum("k,kij->ij", masses, [(x @ x) * np.eye(3) - np.outer(x, x) for x in arms])
    tau = rm.idm(model, q, v, a)
    for frame in (None, int(rng.integers(1, model.f + 1))):
        loaded = with_payload(model, mass, com, inertia, frame)
        # the wrench that holds the points one by one, through the Jacobian of the frame
        extra = np.zeros_like(tau)
        J = rm.jacobian(model, q, frame)
        dJ = rm.jacobian_rate(model, q, v, frame)
        twist, rate = (np.einsum("sij,sj->si", X, y) for X, y in ((J, v), (J, a)))
        rate = rate + np.einsum("sij,sj->si", dJ, v)
        R = rm.dgm(model, q, frame)[:, :3, :3]
        for m, point in zip(masses, points, strict=True):
            r = R @ point
            w, dw = twist[:, 3:], rate[:, 3:]
            acc = rate[:, :3] + np.cross(dw, r) + np.cross(w, np.cross(w, r)) - model.gravity
            extra += np.einsum("sij,si->sj", J, np.hstack([m * acc, np.cross(r, m * acc)]))
        close(rm.idm(loaded, q, v, a), tau + extra, 1e-11)
        back = without_payload(loaded, mass, com, inertia, frame)
        close(back.inertia.values, model.inertia.values, 1e-13)
        moved = with_payload(back, mass, com + 0.1, inertia, frame)
        again = with_payload(model, mass, com + 0.1, inertia, frame)
        close(moved.inertia.values, again.inertia.values, 1e-13)


@given(model=models(max_frames=6), seed=seeds, drive=st.booleans())
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
    rigid = 0.0 if drive else idm(model, q, v, a) - idm(model, q, v, a, drive=False)
    close(tau, torque_regressor(model, q, v, a, drive, columns=base) @ values + rigid, 1e-12)
    friction = AsymmetricFriction(*rng.uniform(0.1, 3, (4, model.n)))
    close(
        idm_from_base(model, base, values, q[0], v[0], a[0], w, friction),
        tau[0] + idm(model, q[0], v[0], a[0], w, friction=friction) - idm(model, q[0], v[0], a[0]),
        1e-11,
    )
    zeros = np.setdiff1d(np.arange(base.matrix.shape[1]), base.kept)
    assert not parameter_vector(robot, drive)[zeros].any()
