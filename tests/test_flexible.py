"""Flexible robots: published values, identities on random arms, an assembly of point masses."""

import pickle

import numpy as np
import pytest
from identities.random_robots import random_pose
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import robotmodels as rm
from robotmodels import DHTable, DriveParameters, InertialParameters, RobotModel, flexible, se3
from robotmodels.errors import RobotModelsError
from robotmodels.flexible.models import forces

INF = np.inf
PIVOT = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]), gravity=(0, 0, 0))
BEAM = flexible.beam(1.0, EI=(INF, 1.0), hub=0.1, modes=2)
ONE = flexible.FlexibleRobot(PIVOT, {1: BEAM})


def random_model(rng, n, tree=False, flex=(), drive=True):
    """A robot with every entry of its table, of revolute joints at flexible rows."""
    antecedent = [0, *(int(rng.integers(0, j + 1)) if tree else j for j in range(1, n))]
    sigma = [0 if j + 1 in flex else int(rng.integers(0, 2)) for j in range(n)]
    sizes = np.array([[4], [4], [1], [1], [1], [4], [1]])
    alpha, theta, d, r, beta, gamma, b = rng.uniform(-0.5, 0.5, (7, n)) * sizes
    table = DHTable(
        antecedent=antecedent, sigma=sigma, alpha=alpha, theta=theta, d=d, r=r, beta=beta,
        gamma=gamma * tree, b=b * tree,
    )  # fmt: skip
    S = (A := 0.1 * rng.normal(size=(n, 3, 3))) @ A.swapaxes(1, 2)
    J = np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) - S
    inertia = InertialParameters.from_com(rng.uniform(0.5, 3, n), rng.uniform(-0.2, 0.2, (n, 3)), J)
    drives = DriveParameters(*rng.uniform(0.1, 1, (4, n))) if drive else DriveParameters.zeros(n)
    tool, base = se3.translation(*rng.uniform(-0.3, 0.3, 3)), random_pose(rng)
    return RobotModel.from_table(table, inertia, drives, base, tool, gravity=5 * rng.normal(size=3))


def random_arm(rng, n=3, flex=(1, 3), **options):
    model = random_model(rng, n, flex=flex, drive=options.pop("drive", True))
    links = {
        row: flexible.beam(
            rng.uniform(0.3, 1), EI=rng.uniform(30, 60, 2), GJ=rng.uniform(30, 60),
            density=rng.uniform(0.2, 2), tip=(0.3, (0.02, 0.03, 0.01), (0.01, 0.012, 0.013)),
            modes=1, stiffening=bool(rng.integers(2)),
        )
        for row in flex
    }  # fmt: skip
    return flexible.FlexibleRobot(model, links, **options)


def states(rng, arm, N=4):
    q, v, a = rng.normal(size=(3, N, arm.n))
    e, ev = 0.05 * rng.normal(size=(2, N, arm.m))
    return q, e, v, ev, a


def close(found, wanted, tolerance):
    scale = np.abs(wanted).max(initial=1e-12)
    assert np.abs(np.asarray(found) - wanted).max(initial=0.0) <= tolerance * scale


def element(h, EI, rho):
    """Stiffness and mass of a finite element of a beam: displacement and slope of both ends."""
    k = [[12, 6*h, -12, 6*h], [6*h, 4*h*h, -6*h, 2*h*h], [-12, -6*h, 12, -6*h],
         [6*h, 2*h*h, -6*h, 4*h*h]]  # fmt: skip
    m = [[156, 22*h, 54, -13*h], [22*h, 4*h*h, 13*h, -3*h*h], [54, 13*h, 156, -22*h],
         [-13*h, -3*h*h, -22*h, 4*h*h]]  # fmt: skip
    return EI / h**3 * np.array(k), rho * h / 420 * np.array(m)


# --- beams ---------------------------------------------------------------------------------------


def test_clamped_beam_has_the_roots_of_its_frequency_equation():
    link = flexible.beam(2.0, EI=(7.0, 3.0), density=0.5, modes=4)
    brackets = ((1.8, 2.0), (4.5, 4.9), (7.7, 8.0), (10.9, 11.1))
    roots = [brentq(lambda b: np.cos(b) * np.cosh(b) + 1, *x, xtol=1e-14) for x in brackets]
    np.testing.assert_allclose(roots, [1.87510407, 4.69409113, 7.85475744, 10.99554073], atol=1e-8)
    b = 2.0 * (link.frequencies.reshape(2, 4) ** 2 * 0.5 / np.array([[7.0], [3.0]])) ** 0.25
    np.testing.assert_allclose(b, [roots, roots], rtol=1e-10)


@pytest.mark.parametrize(("hub", "tip"), [(0.1, None), (0.0, 0.4), (0.7, (0.5, (0.1, 0, 0), 0.03))])
def test_hub_beam_has_the_roots_of_its_determinant(hub, tip):
    L, EI, rho = 1.3, 2.0, 1.4
    link = flexible.beam(L, (INF, EI), density=rho, tip=tip, hub=hub, modes=3, ends="pinned-hub")
    m, c, J = (0, 0, 0) if tip is None else (tip, 0, 0) if tip == 0.4 else (0.5, 0.1, 0.03)

    def determinant(w):
        b = (w * w * rho / EI) ** 0.25
        at = lambda x: np.array([np.cos(b * x), np.sin(b * x), np.cosh(b * x), np.sinh(b * x)])  # noqa: E731
        D = b * np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]])
        w0, w1, w2, w3 = (np.linalg.matrix_power(D, k) @ at(L) for k in range(4))
        z0, z1, z2 = (np.linalg.matrix_power(D, k) @ at(0.0) for k in range(3))
        rows = [
            z0, EI * z2 + w * w * hub * z1,
            EI * w2 - w * w * (m * c * (w0 + c * w1) + J * w1), EI * w3 + w * w * m * (w0 + c * w1),
        ]  # fmt: skip
        return np.linalg.det([row / np.linalg.norm(row) for row in rows])

    for w in link.frequencies:
        assert determinant(0.9999999 * w) * determinant(1.0000001 * w) < 0.0
    # with a free joint these are the frequencies of the arm
    arm = flexible.FlexibleRobot(PIVOT, {1: link})
    close(flexible.natural_frequencies(arm, [0.0], "free")[1:], link.frequencies, 1e-8)


def test_modes_of_a_loaded_beam_are_orthogonal_and_the_body_is_the_beam():
    tip = (2.0, (0.05, 0, 0), (0.1, 0.07, 0.08))
    link = flexible.beam(1.3, (1.0, 2.0), GJ=3.0, density=1.4, tip=tip, modes=3)
    inv = link.invariants
    values = np.sqrt(eigh(inv.modal_stiffness, inv.modal_mass, eigvals_only=True))
    np.testing.assert_allclose(values, np.sort(link.frequencies), rtol=1e-9)
    assert inv.mass == pytest.approx(1.4 * 1.3 + 2.0)
    assert inv.first_moment[0] == pytest.approx(1.4 * 1.3**2 / 2 + 2.0 * 1.35)
    k = 1.3 / 50
    assert inv.inertia[0, 0] == pytest.approx(1.4 * 1.3 * k**2 + 0.1)
    section = 1.4 * 1.3 * k**2 / 2
    assert inv.inertia[2, 2] == pytest.approx(1.4 * 1.3**3 / 3 + 2 * 1.35**2 + 0.08 + section)
    assert np.abs(inv.gyroscopic + inv.gyroscopic.swapaxes(0, 1)).max() < 1e-15  # no stiffening


def test_two_link_arm_of_de_luca_and_siciliano():
    """1991: clamped links with the masses and inertias behind them, without their mass offset."""
    behind = (1.0 + 0.5 + 0.1, 0.1 + 0.0083 + 0.1 * 0.5**2 + 0.0005)  # hub, link 2, payload
    first = flexible.beam(0.5, EI=(INF, 10.0), density=1.0, tip=behind)
    second = flexible.beam(0.5, EI=(INF, 10.0), density=1.0, tip=(0.1, 0.0005))
    found = np.concatenate([first.frequencies, second.frequencies]) / (2 * np.pi)
    np.testing.assert_allclose(found, [1.40, 5.12, 5.20, 32.46], rtol=5e-3)


# --- models --------------------------------------------------------------------------------------


def test_rigid_arms_are_those_of_the_rigid_models(rng):
    for i in range(50):
        n = int(rng.integers(1, 8))
        model = random_model(rng, n, tree=bool(i % 2))
        arm = flexible.FlexibleRobot(model, {})
        q, v, a = rng.normal(size=(3, 3, n))
        w = rng.normal(size=(3, 6))
        tau = rm.idm(model, q, v, a, w)
        close(flexible.idm(arm, q, None, v, None, a, w)[0], tau, 1e-12)
        close(flexible.ddm(arm, q, None, v, None, tau, w)[0], a, 1e-9)
        close(flexible.mass_matrix(arm, q), rm.mass_matrix(model, q), 1e-12)
        close(flexible.jacobian(arm, q), rm.jacobian(model, q), 1e-12)
        close(flexible.dgm(arm, q), rm.dgm(model, q), 1e-12)
        close(flexible.link_poses(arm, q), rm.link_poses(model, q), 1e-12)
        kinetic, potential = flexible.energies(arm, q, None, v)
        close(kinetic, rm.kinetic_energy(model, q, v), 1e-12)
        close(potential, rm.potential_energy(model, q), 1e-12)
    # stiff beams, whose elastic coordinates follow the load without vibration
    stiff = flexible.beam(0.6, EI=1e13, density=1.2, gyration=0.02, modes=2)
    inv, rows = stiff.invariants, (1, 2, 3)
    body = (*inv.inertia[np.triu_indices(3)], *inv.first_moment, inv.mass)
    model = random_model(rng, 3, flex=rows).with_inertia(InertialParameters([body] * 3))
    arm = flexible.FlexibleRobot(model, dict.fromkeys(rows, stiff))
    q, v, a = rng.normal(size=(3, 1, 3))
    none = np.zeros((1, arm.m))
    load = forces(arm, *(np.hstack([x, none]) for x in (q, v, a)))[0][0, 3:]
    e = -np.linalg.solve(np.kron(np.eye(3), inv.modal_stiffness), load)[None]
    tau = flexible.idm(arm, q, e, v, None, a)[0]
    close(tau, rm.idm(model, q, v, a), 1e-8)
    close(flexible.ddm(arm, q, e, v, None, tau)[0], a, 1e-8)
    beam = flexible.beam(0.6, INF, density=1.2, gyration=0.02)
    rigid = flexible.FlexibleRobot(model, dict.fromkeys(rows, beam))
    assert rigid.m == 0
    close(flexible.idm(rigid, q, None, v, None, a)[0], rm.idm(model, q, v, a), 1e-12)


@pytest.mark.parametrize("joints", [None, [INF, 40.0, 60.0]])
def test_inverse_and_direct_models_are_inverse(rng, joints):
    for _ in range(4):
        arm = random_arm(rng, joint_stiffness=joints, joint_damping=0.3, modal_damping=0.02)
        q, e, v, ev, a = states(rng, arm)
        w = rng.normal(size=(4, 6))
        tau, ea = flexible.idm(arm, q, e, v, ev, a, w)
        back = flexible.ddm(arm, q, e, v, ev, tau, w)
        close(back[0], a, 1e-9)
        close(back[1], ea, 1e-9)
        # the forces of all accelerations: those of the modes vanish in free motion
        rows = (np.hstack(pair) for pair in ((q, e), (v, ev), (a, ea)))
        Q, Qe = np.split(forces(arm, *rows, w)[0], [arm.n], axis=1)
        close(Q + arm.model.drive_matrices.torque(v, None), tau, 1e-10)
        assert np.abs(Qe).max() < 1e-9 * np.abs(tau).max()
        M = flexible.mass_matrix(arm, q, e)
        close(M, M.swapaxes(1, 2), 1e-12)
        kinetic, _ = flexible.energies(arm, q, e, v, ev)
        x = np.hstack([v, ev])
        close(0.5 * np.einsum("ni,nij,nj->n", x, M, x), kinetic, 1e-12)
    one = flexible.idm(arm, q[3].tolist(), e[3].tolist(), v[3], ev[3], a[3], w[3])
    np.testing.assert_array_equal(np.hstack(one), np.hstack([tau[3], ea[3]]))
    pairs = q.reshape(2, 2, -1), e.reshape(2, 2, -1), v[0], ev[0]
    assert flexible.idm(arm, *pairs, a[0])[0].shape == (2, 2, arm.n)
    assert flexible.ddm(arm, q[:0], e[:0], v[:0], None, q[:0])[1].shape == (0, arm.m)
    values = arm, BEAM, BEAM.invariants, flexible.linearize(ONE, [0.0]), flexible.elastica(1, 1, 1)
    still = flexible.ddm(ONE, [0.0], None, [0.0], None, [0.0])
    for value in (*values, still, flexible.static_deflection(ONE, [0.0])):
        assert len(str(value).splitlines()) <= 6
        assert pickle.loads(pickle.dumps(value)) == value
        assert hash(pickle.loads(pickle.dumps(value))) == hash(value)


def test_jacobian_is_the_derivative_of_the_pose(rng):
    arm = random_arm(rng, joint_stiffness=50.0)
    q, e, v, ev, _ = states(rng, arm, 2)
    J, T, h = flexible.jacobian(arm, q, e), flexible.dgm(arm, q, e), 1e-5
    after, before = (flexible.dgm(arm, q + s * h * v, e + s * h * ev) for s in (1, -1))
    rate = (after - before) / (2 * h)
    spin = rate[:, :3, :3] @ T[:, :3, :3].swapaxes(1, 2)
    twist = np.hstack([rate[:, :3, 3], np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], -1)])
    close(np.einsum("nij,nj->ni", J, np.hstack([v, ev])), twist, 1e-8)
    both = flexible.FlexibleRobot(PIVOT, {1: flexible.beam(1.0, EI=1.0, modes=1)})
    for column, axis in ((0, 2), (1, 1)):
        bent = flexible.dgm(both, [0.0], 0.1 * np.eye(2)[column])
        assert bent[axis, 3] == pytest.approx(0.1)
        assert np.arcsin(bent[axis, 0]) == pytest.approx(0.1376506, rel=1e-6)  # slope of the mode


class Points:
    """Arm of point masses, in positions alone: an assembly that knows no recursion."""

    def __init__(self, rng, n, modes, stiffness):
        self.model = random_model(rng, n, flex=range(1, n + 1))
        self.links, self.clouds, N = {}, [], 5
        for j in range(n):
            X, mu = rng.uniform(-0.3, 0.6, (N, 3)), rng.uniform(0.1, 0.5, N)
            S = rng.normal(size=(3 * N, modes))
            S[:3] = 0.0
            M = np.diag(np.repeat(mu, 3))
            S = S @ np.linalg.inv(np.linalg.cholesky(S.T @ M @ S)).T
            w = rng.uniform(20, 40, modes)
            K = M @ S @ np.diag(w**2) @ S.T @ M
            self.links[j + 1] = flexible.from_modes(mu, K, S, X)
            self.clouds.append((mu, X, S.reshape(N, 3, modes), self.links[j + 1].tip.Psi, w))
        self.arm = flexible.FlexibleRobot(self.model, self.links, joint_stiffness=stiffness)

    def positions(self, x):
        """All points in the world; x (n + m,) may be complex."""
        n, m = self.model.n, self.arm.modes
        q, e = x[:n].copy(), x[n : n + m].reshape(n, -1)
        q[self.arm.joints] += x[n + m :]
        T, out = self.model.base.astype(x.dtype), []
        fixed = rm.link_transforms(self.model.table, np.zeros(n))
        before = np.eye(4)
        for j, (_, X, Phi, Psi, _) in enumerate(self.clouds):
            turn = expm(q[j] * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]]))
            move = np.eye(4, dtype=x.dtype)
            move[:3, :3] = turn
            T = T @ before @ fixed[j] @ move
            out.append((X + Phi @ e[j]) @ T[:3, :3].T + T[:3, 3])
            t = Psi.T @ e[j]
            section = np.eye(4, dtype=x.dtype)
            section[:3, :3] = expm(np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]]))
            section[:3, 3] = X[-1] + Phi[-1] @ e[j]
            before = section @ se3.translation(*-X[-1])
        return np.concatenate(out).ravel()

    def equations(self, x, dx):
        """Mass matrix and all other forces of Lagrange's equations."""
        size, h = len(x), 1e-30
        mu = np.repeat(np.concatenate([cloud[0] for cloud in self.clouds]), 3)
        J = np.stack([self.positions(x + 1j * h * row).imag / h for row in np.eye(size)], -1)
        rate = lambda s: self.positions(x + s * dx + 1j * h * dx).imag / h  # noqa: E731
        steps = ((1, 0.75), (2, -0.15), (3, 1 / 60))
        bias = sum(w * (rate(c * 1e-3) - rate(-c * 1e-3)) / 1e-3 for c, w in steps)
        M = J.T @ (mu[:, None] * J)
        rest = J.T @ (mu * (bias - np.tile(self.model.gravity, len(mu) // 3)))
        n, m, joints = self.model.n, self.arm.modes, self.arm.joints
        M[range(n), range(n)] += self.model.drive.Ia
        rest[n : n + m] += np.concatenate([c[4] ** 2 for c in self.clouds]) * x[n : n + m]
        rest[n + m :] += self.arm.joint_stiffness[joints] * x[n + m :]
        rest[:n] += self.arm.model.drive_matrices.torque(dx[:n], None)
        return M, rest


@pytest.mark.parametrize(("n", "modes"), [(1, 3), (2, 2), (3, 1), (4, 2)])
def test_recursion_is_the_assembly_of_point_masses(rng, n, modes):
    for stiffness in (None, 30.0):
        points = Points(rng, n, modes, stiffness)
        arm = points.arm
        q, e, v, ev, a = (x[0] for x in states(rng, arm, 1))
        M, rest = points.equations(np.concatenate([q, e]), np.concatenate([v, ev]))
        close(flexible.mass_matrix(arm, q, e), M, 1e-10)
        tau, ea = flexible.idm(arm, q, e, v, ev, a)
        wanted = np.linalg.solve(M[n:, n:], -M[n:, :n] @ a - rest[n:])
        close(ea, wanted, 1e-9)
        close(tau, M[:n, :n] @ a + M[:n, n:] @ wanted + rest[:n], 1e-9)
        found = np.concatenate(flexible.ddm(arm, q, e, v, ev, tau))
        close(found, np.linalg.solve(M, np.append(tau, np.zeros(arm.m)) - rest), 1e-9)


def test_finite_elements_and_their_reduction_are_the_beam():
    count, L, EI, rho = 12, 1.0, 2.0, 1.5
    h, c = L / count, 6 * (count + 1)
    M, K = np.zeros((2, c, c))
    Ke, Me = element(h, EI, rho)
    for i in range(count):
        for axis, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):
            rows = [6 * i + axis, 6 * i + turn, 6 * i + 6 + axis, 6 * i + 6 + turn]
            s = np.diag([1.0, sign, 1.0, sign])
            M[np.ix_(rows, rows)] += s @ Me @ s
            K[np.ix_(rows, rows)] += s @ Ke @ s
        for axis, stiff, mass in ((0, 1e6, 1.0), (3, 1e3, 1e-4)):
            rows = [6 * i + axis, 6 * i + 6 + axis]
            M[np.ix_(rows, rows)] += mass * rho * h / 6 * np.array([[2, 1], [1, 2]])
            K[np.ix_(rows, rows)] += stiff * np.array([[1, -1], [-1, 1]])
    nodes = np.outer(np.linspace(0, L, count + 1), [1, 0, 0])
    tip, root = np.arange(c - 6, c), np.arange(6)
    reduced = flexible.craig_bampton(M, K, tip, 8, clamped=root)
    beam = flexible.beam(L, EI=EI, density=rho, modes=2)
    close(reduced.frequencies[:4], np.sort(beam.frequencies), 3e-4)
    every = flexible.craig_bampton(M, K, tip, c - 12, clamped=root)
    full = eigh(K[6:, 6:], M[6:, 6:], eigvals_only=True)
    close(every.frequencies[:10], np.sqrt(full[:10]), 1e-9)
    link = flexible.from_modes(M, K, reduced.shapes[:, :4], nodes)
    arms = [flexible.FlexibleRobot(PIVOT, {1: x}) for x in (link, beam)]
    free = [flexible.natural_frequencies(arm, [0.0], "free") for arm in arms]
    close(free[0], free[1], 1e-3)
    assert link.invariants.inertia[2, 2] == pytest.approx(rho * L**3 / 3)
    sag = [flexible.static_deflection(arm, [0.0], [0, -0.1, 0, 0, 0, 0]).deflection for arm in arms]
    assert sag[0] == pytest.approx(sag[1], rel=1e-3)


# --- values and refusals -------------------------------------------------------------------------


SLIDE = RobotModel.from_table(DHTable(antecedent=[0], sigma=[1]))
NODES, STIFF = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.diag([1.0, 1, 1, 9, 4, 4])
SHAPE = np.eye(6)[:, 4:5]
beam, Robot, modes = flexible.beam, flexible.FlexibleRobot, flexible.from_modes


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: beam(1.0, EI=(0.0, 1.0)), "positive stiffness"),
        (lambda: beam(1.0, EI=1.0, tip=(1.0, (1.0, 0.1, 0.1))), "not a physical body"),
        (lambda: beam(1.0, EI=(INF, 1.0), density=1e-12, tip=1.0, modes=2), "too light"),
        (lambda: Robot(SLIDE, {1: BEAM}), "sliding joint"),
        (lambda: modes([1, 1], STIFF, np.eye(6)[:, 4:] + np.eye(6)[:, 3:5], NODES), "orthogonal"),
        (lambda: modes([1.0, 1.0], STIFF, np.eye(6)[:, 3:], NODES), "at most as many"),
        (lambda: modes(np.eye(6), STIFF, SHAPE, np.zeros((2, 3))), "same place"),
        (lambda: flexible.craig_bampton(np.eye(3), np.zeros((3, 3)), [2], 1), "singular"),
        (lambda: flexible.linearize(Robot(PIVOT, {}), [0.0]), "no inertia"),
        (lambda: flexible.elastica(1.0, 1.0, 1e3), "up to 100"),
        (lambda: flexible.ddm(Robot(PIVOT, {1: BEAM}, 10.0), [0], None, [0], None, [0]), "Ia"),
        (lambda: flexible.free_body(TURNING, [0.0], np.ones(6), 1.0), "rigid motion"),
    ],
)
def test_mistakes_are_refused(call, words):
    with pytest.raises(RobotModelsError, match=words):
        call()


LINE = np.outer(np.arange(3.0), [1, 0, 0])  # a shape of all nodes, turned about the root
TURNING = modes(np.ones(3), np.eye(9), LINE[:, [1, 0, 2]][:, :, None], LINE)
