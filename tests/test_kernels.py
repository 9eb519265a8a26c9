"""The kernels against Pinocchio on random trees, and each other where Pinocchio cannot follow."""

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest

import robotmodels as rm
from robotmodels.kernels import Chain
from robotmodels.kernels.decimation import add_rows
from robotmodels.kernels.erroneous_poses import erroneous_poses
from robotmodels.kernels.jerk_phases import polished_phases
from robotmodels.kernels.mass import coriolis_matrices, joint_accelerations, mass_matrices
from robotmodels.kernels.poses import (
    improper_pose,
    jacobian_rates,
    jacobians,
    link_poses,
    tip_poses,
)
from robotmodels.kernels.regressor_gradient import regressor_gradients
from robotmodels.kernels.regressors import energy_regressors, torque_regressors
from robotmodels.kernels.torques import energies, joint_torques
from robotmodels.se3 import from_rpy

N = 4
R, P, F = 0, 1, 2
REFERENCES = [pin.LOCAL_WORLD_ALIGNED, pin.LOCAL, pin.WORLD]

# Each robot: antecedents and joint types, frame by frame
CHAINS = {
    "one revolute": ([0], [R]),
    "one prismatic": ([0], [P]),
    "six revolute": ([0, 1, 2, 3, 4, 5], [R] * 6),
    "prismatic first": ([0, 1, 2, 3], [P, R, P, R]),
    "fixed inside": ([0, 1, 2, 3, 4], [R, F, P, F, R]),
    "fixed at the tip": ([0, 1, 2, 3], [R, R, F, F]),
    "fixed first": ([0, 1, 2], [F, R, R]),
    "base branches": ([0, 0, 0, 1, 2, 3], [R, P, F, R, R, R]),
    "branches that interleave": ([0, 1, 1, 2, 3, 2, 3], [R, R, P, R, R, F, P]),
}


class Robot(NamedTuple):
    """A random chain with the same robot in Pinocchio."""

    chain: Chain
    pi: np.ndarray
    gravity: np.ndarray
    path: np.ndarray
    tool: pin.SE3
    model: Any
    columns: np.ndarray  # Pinocchio's index of each joint
    supports: list  # (joint id, placement in it) of each frame; [0] is the base
    rng: np.random.Generator

    @property
    def n(self):
        return len(self.columns)

    @property
    def f(self):
        return len(self.chain.sigma)

    def samples(self, count=3, rows=N):
        return (self.rng.uniform(-3, 3, (rows, self.n)) for _ in range(count))

    def to_pin(self, x):
        y = np.empty(self.n)
        y[self.columns] = x
        return y

    def tip(self):
        return (self.path, self.tool.rotation.copy(), self.tool.translation.copy())

    def tool_frame(self):
        joint, placement = self.supports[self.path[-1] if len(self.path) else 0]
        return joint, placement * self.tool


def random_inertia(rng):
    mass, com = rng.uniform(0.5, 3.0), rng.uniform(-0.5, 0.5, 3)
    half = rng.normal(size=(3, 3))
    moments = half @ half.T
    about_com = 0.1 * (np.trace(moments) * np.eye(3) - moments)
    return pin.Inertia(mass, com, about_com)


def khalil(inertia):
    m, mx, my, mz, xx, xy, yy, xz, yz, zz = inertia.toDynamicParameters()
    return np.array([xx, xy, xz, yy, yz, zz, mx, my, mz, m])


def make_robot(antecedent, sigma, seed, tip=None, inertias=None):
    rng = np.random.default_rng(seed)
    f = len(sigma)
    pin.seed(seed)
    base, tool, *placements = [pin.SE3.Random() for _ in range(f + 2)]
    drawn = [random_inertia(rng) for _ in range(f)]
    inertias = drawn if inertias is None else inertias
    gravity = rng.uniform(-10, 10, 3)
    joint = np.full(f, -1)
    joint[np.array(sigma) != F] = np.arange(np.sum(np.array(sigma) != F))

    # Pinocchio wants its joints depth first
    model = pin.Model()
    model.gravity.linear = gravity
    supports: list = [(0, base)] + [None] * f
    columns = np.zeros(joint.max(initial=-1) + 1, dtype=int)

    def attach(number):
        for k in range(f):
            if antecedent[k] != number:
                continue
            parent, placement = supports[number]
            placement = placement * placements[k]
            if sigma[k] == F:
                supports[k + 1] = (parent, placement)
            else:
                kind = pin.JointModelRZ() if sigma[k] == R else pin.JointModelPZ()
                parent = model.addJoint(parent, kind, placement, f"joint {k + 1}")
                columns[joint[k]] = model.joints[parent].idx_v
                supports[k + 1] = (parent, pin.SE3.Identity())
            model.appendBodyToJoint(parent, inertias[k], supports[k + 1][1])
            attach(k + 1)

    attach(0)
    tip = f if tip is None else tip
    path = []
    while tip > 0:
        path.insert(0, tip)
        tip = antecedent[tip - 1]
    chain = Chain(
        np.array(antecedent),
        np.array(sigma),
        joint,
        np.array([T.rotation for T in placements]),
        np.array([T.translation for T in placements]),
        base.rotation.copy(),
        base.translation.copy(),
    )
    for array in chain:
        array.flags.writeable = False  # as in a frozen table
    pi = np.array([khalil(inertia) for inertia in inertias])
    path = np.array(path, dtype=np.int64)
    return Robot(chain, pi, gravity, path, tool, model, columns, supports, rng)


def random_robot(seed):
    rng = np.random.default_rng(seed)
    f = int(rng.integers(3, 10))
    antecedent = [int(rng.integers(0, j)) for j in range(1, f + 1)]
    sigma = rng.choice([R, R, P, F], f).tolist()
    sigma[int(rng.integers(0, f))] = R
    return make_robot(antecedent, sigma, seed, tip=int(rng.integers(0, f + 1)))


@pytest.fixture(params=[*CHAINS, *range(8)], ids=str)
def robot(request):
    if request.param in CHAINS:
        return make_robot(*CHAINS[request.param], seed=len(request.param))
    return random_robot(request.param)


def close(actual, expected, tolerance=1e-12):
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


def run(kernel, *args, out):
    """Call a kernel on an output full of NaN, so that an entry it forgets shows."""
    out = np.full(out, np.nan)
    kernel(*args, out)
    return out


def all_of(robot, pi, q, v, a):
    """Everything that is linear in the inertial parameters."""
    c, g, n = robot.chain, robot.gravity, robot.n
    rows = len(q)
    return {
        "torques": run(joint_torques, q, v, a, c, pi, g, out=(rows, n)),
        "masses": run(mass_matrices, q, c, pi, out=(rows, n, n)),
        "coriolis": run(coriolis_matrices, q, v, c, pi, out=(rows, n, n)),
        "kinetic": run(energies, q, v, c, pi, g, out=(rows, 2))[:, 0],
        "potential": run(energies, q, v, c, pi, g, out=(rows, 2))[:, 1],
    }


def test_poses(robot):
    (q,) = robot.samples(1)
    links = run(link_poses, q, robot.chain, out=(N, robot.f, 4, 4))
    tips = run(tip_poses, q, robot.chain, *robot.tip(), out=(N, 4, 4))
    data = robot.model.createData()
    for i in range(N):
        pin.forwardKinematics(robot.model, data, robot.to_pin(q[i]))
        for k in range(robot.f):
            joint, placement = robot.supports[k + 1]
            close(links[i, k], (data.oMi[joint] * placement).homogeneous)
        joint, placement = robot.tool_frame()
        close(tips[i], (data.oMi[joint] * placement).homogeneous)


@pytest.mark.parametrize("reference", range(3), ids=["world aligned", "local", "world"])
def test_jacobians_and_their_rates(robot, reference):
    q, v = robot.samples(2)

    def jacobian(q):
        return run(jacobians, q, robot.chain, *robot.tip(), reference, out=(N, 6, robot.n))

    J = jacobian(q)
    dJ = run(jacobian_rates, q, v, robot.chain, *robot.tip(), reference, out=(N, 6, robot.n))
    step = 1e-6
    close(dJ, (jacobian(q + step * v) - jacobian(q - step * v)) / (2 * step), 1e-7)
    joint, placement = robot.tool_frame()
    model = robot.model.copy()
    frame = model.addFrame(pin.Frame("tool", joint, 0, placement, pin.OP_FRAME))
    data = model.createData()
    for i in range(N):
        pin.computeJointJacobiansTimeVariation(model, data, robot.to_pin(q[i]), robot.to_pin(v[i]))
        pin.updateFramePlacements(model, data)
        kind = REFERENCES[reference]
        expected = pin.getFrameJacobian(model, data, frame, kind)
        rate = pin.getFrameJacobianTimeVariation(model, data, frame, kind)
        # With one joint Pinocchio returns a flat array
        close(J[i], expected.reshape(6, -1)[:, robot.columns])
        close(dJ[i], rate.reshape(6, -1)[:, robot.columns])


def test_dynamics(robot):
    q, v, a = robot.samples()
    ours = all_of(robot, robot.pi, q, v, a)
    model, order = robot.model, robot.columns
    data = model.createData()
    # Pinocchio leaves out what is fixed to the base
    still = sum(
        -robot.gravity @ placement.homogeneous[:3] @ robot.pi[k, 6:]
        for k, (joint, placement) in enumerate(robot.supports[1:])
        if joint == 0
    )
    for i in range(N):
        x, dx, ddx = (robot.to_pin(s[i]) for s in (q, v, a))
        close(ours["torques"][i], pin.rnea(model, data, x, dx, ddx)[order])
        M = pin.crba(model, data, x)
        M = np.triu(M) + np.triu(M, 1).T
        close(ours["masses"][i], M[np.ix_(order, order)])
        C = pin.computeCoriolisMatrix(model, data, x, dx)
        close(ours["coriolis"][i], C[np.ix_(order, order)])
        close(ours["kinetic"][i], pin.computeKineticEnergy(model, data, x, dx))
        close(ours["potential"][i], pin.computePotentialEnergy(model, data, x) + still)


def test_direct_dynamics(robot):
    q, v, tau = robot.samples()
    rotor = robot.rng.uniform(0.1, 1.0, robot.n)
    a = np.full((N, robot.n), np.nan)
    args = (robot.pi, robot.gravity, np.diag(rotor), a)
    assert joint_accelerations(q, v, tau, robot.chain, *args) == -1
    model = robot.model.copy()
    model.armature = robot.to_pin(rotor)
    data = model.createData()
    for i in range(N):
        x, dx, t = (robot.to_pin(s[i]) for s in (q, v, tau))
        close(a[i], pin.aba(model, data, x, dx, t)[robot.columns])
    close(all_of(robot, robot.pi, q, v, a)["torques"] + a * rotor, tau, 1e-11)


def test_regressors_reproduce_torques_and_energies_of_any_parameters(robot):
    q, v, a = robot.samples()
    pi = robot.rng.normal(size=(robot.f, 10))
    ours = all_of(robot, pi, q, v, a)
    c, g, every = robot.chain, robot.gravity, np.arange(10 * robot.f)
    Y = run(torque_regressors, q, v, a, c, g, every, out=(N, robot.n, 10 * robot.f))
    h = run(energy_regressors, q, v, c, g, every, out=(N, 1, 10 * robot.f))[:, 0]
    close(Y @ pi.ravel(), ours["torques"])
    close(h @ pi.ravel(), ours["kinetic"] + ours["potential"])
    for k in range(robot.f):
        path = [k + 1]
        while path[-1] > 0:
            path.append(int(robot.chain.antecedent[path[-1] - 1]))
        loaded = [robot.chain.joint[j - 1] for j in path[:-1]]
        others = np.setdiff1d(np.arange(robot.n), loaded)
        assert not Y[:, others, 10 * k : 10 * k + 10].any()


def test_dynamics_are_linear_down_to_links_without_mass(robot):
    q, v, a = robot.samples()
    other = np.array([khalil(random_inertia(robot.rng)) for _ in range(robot.f)])
    other[:, 9] = robot.pi[:, 9]
    full, rest = all_of(robot, robot.pi, q, v, a), all_of(robot, other, q, v, a)
    massless = all_of(robot, robot.pi - other, q, v, a)
    for name, value in massless.items():
        close(value, full[name] - rest[name], 1e-11)


def test_direct_dynamics_of_links_without_mass(robot):
    q, v, a = robot.samples()
    pi = robot.rng.normal(size=(robot.f, 10))
    pi[:, 9] = 0.0
    M = all_of(robot, pi, q, v, a)["masses"]
    tau = all_of(robot, pi, q, v, a)["torques"]
    # Rotors make the matrix regular and leave it indefinite, which the answer tells
    rotor = np.diag(20.0 * robot.rng.choice([-1.0, 1.0], robot.n))
    out = np.full((N, robot.n), np.nan)
    tau += a @ rotor
    args = (q, v, tau, robot.chain, pi, robot.gravity, rotor, out)
    negative = np.flatnonzero(np.linalg.eigvalsh(M + rotor)[:, 0] < 0.0)
    assert joint_accelerations(*args) == (-2 - negative[0] if negative.size else -1)
    close(out, a, 1e-13 * max(10.0, np.linalg.cond(M + rotor).max()))


def test_a_singular_matrix_is_reported_and_its_row_is_nan():
    # Two slides, parallel when the hinge between them is at zero; the last link has all mass
    robot = make_robot([0, 1, 2], [P, R, P], seed=3)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 6e-17, -1.0], [0.0, 1.0, 6e-17]])
    rotation = np.array([robot.chain.rotation[0], turn, turn.T])
    rotation.flags.writeable = False
    chain = robot.chain._replace(rotation=rotation)
    pi = np.zeros((3, 10))
    pi[2] = robot.pi[2]
    q, v, tau = robot.samples(rows=130)
    q[[70, 100], 1] = 0.0
    out = np.empty_like(q)
    args = (q, v, tau, chain, pi, robot.gravity, np.zeros((3, 3)), out)
    assert joint_accelerations(*args) == 70
    assert np.isnan(out[[70, 100]]).all()
    assert np.isfinite(np.delete(out, [70, 100], axis=0)).all()
    back = run(joint_torques, q, v, out, chain, pi, robot.gravity, out=q.shape)
    fine = np.abs(np.sin(q[:, 1])) > 0.1
    close(back[fine], tau[fine], 1e-10)

    args = (q, v, tau, chain, 0.0 * pi, robot.gravity, np.zeros((3, 3)), out)
    assert joint_accelerations(*args) == 0
    assert np.isnan(out).all()


def test_a_chain_without_joints_still_has_poses_and_energy():
    robot = make_robot([0, 1], [F, F], seed=2)
    links = run(link_poses, np.empty((1, 0)), robot.chain, out=(1, 2, 4, 4))[0]
    expected = [placement.homogeneous for _, placement in robot.supports[1:]]
    close(links, expected)
    q = np.empty((1, 0))
    energy = run(energies, q, q, robot.chain, robot.pi, robot.gravity, out=(1, 2))[:, 1]
    weights = [T[:3] @ p[6:] for T, p in zip(links, robot.pi, strict=True)]
    close(energy, [-robot.gravity @ sum(weights)])


# --- cases that no ordinary robot meets -------------------------------------------------------


def accelerations_of(mass, tau):
    """What `joint_accelerations` answers, and writes, for a mass matrix given as rotor inertia."""
    mass, tau = np.array(mass, dtype=float), np.atleast_2d(np.asarray(tau, dtype=float))
    n = len(mass)
    model = rm.RobotModel.from_table(rm.DHTable.from_rows([{"sigma": 1, "alpha": 0.3}] * n))
    rest, out = np.zeros(tau.shape), np.empty(tau.shape)
    code = joint_accelerations(
        rest, rest, tau, model.chain, np.zeros((n, 10)), model.gravity, mass, out
    )
    return code, out


@pytest.mark.parametrize(
    "mass",
    [
        # what is left of the second pivot is nothing, and the third row has to take its place
        [[1, 1, 0], [1, 1, 1], [0, 1, 1]],
        # nothing on the diagonal at all
        [[0, 2, 0], [2, 0, 0], [0, 0, 3]],
        [[0, 0, 5], [0, -1, 0], [5, 0, 0]],
    ],
)
@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e3, 1.0, 1e-3)], ids=["alike", "apart"])
def test_indefinite_mass_matrices_are_solved_by_exchanging_rows(mass, units):
    mass = np.array(mass) * np.outer(units, units)
    accelerations = np.array([[1.0, -2.0, 3.0], [0.5, 0.0, -4.0]]) / units
    code, out = accelerations_of(mass, accelerations @ mass)
    assert code == -2  # the first sample has a matrix with negative eigenvalues
    np.testing.assert_allclose(out * units, accelerations * units, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "mass",
    [
        [[1, 1, 0], [1, 1, 0], [0, 0, 1]],
        [[1, 2, 3], [2, 4, 6], [3, 6, 9]],
        [[0, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 2, 3], [2, 1, 3], [3, 3, 6]],  # indefinite, and the third row is the sum of the others
    ],
)
def test_singular_mass_matrices_are_told_whatever_their_sign(mass):
    code, out = accelerations_of(mass, [[1.0, 2.0, 3.0]])
    assert code == 0
    assert np.isnan(out).all()


def test_a_parameter_that_acts_on_several_elements_moves_the_end_by_all_of_them(rng):
    """One deviation that is added to elements of two rows, one of them twice, with factors."""
    nominal = rng.uniform(-1.0, 1.0, (3, 7))
    sigma, joint = np.array([0, 1, 0]), np.arange(3)
    path, q = np.arange(3), rng.uniform(-1.0, 1.0, (2, 3))
    owner = np.array([0, 0, 0, 0, 1])
    row, element = np.array([0, 1, 1, 2, 2]), np.array([5, 3, 4, 2, 0])
    factor = rng.uniform(0.5, 2.0, (2, 5))
    before, after = from_rpy([0.1, 0.2, 0.3], [1, 2, 3]), from_rpy([0.3, -0.5, 0.1], [0.2, 0, 1])

    def poses(deviation):
        T, psi = np.empty((2, 4, 4)), np.empty((2, 6, 2))
        erroneous_poses(
            q, nominal, sigma, joint, path,
            np.ascontiguousarray(before[:3, :3]), np.ascontiguousarray(before[:3, 3]),
            np.ascontiguousarray(after[:3, :3]), np.ascontiguousarray(after[:3, 3]),
            np.asarray(deviation, dtype=float), owner, row, element, factor, T, psi,
        )  # fmt: skip
        return T, psi

    x, h = np.array([0.02, -0.03]), 1e-6
    T, psi = poses(x)
    for k in range(2):
        ahead, behind = (poses(x + s * h * np.eye(2)[k])[0] for s in (1.0, -1.0))
        rate = (ahead - behind) / (2.0 * h)
        turn = rate[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)
        w = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=-1)
        np.testing.assert_allclose(psi[:, :3, k], rate[:, :3, 3], rtol=0, atol=1e-8)
        np.testing.assert_allclose(psi[:, 3:, k], w, rtol=0, atol=1e-8)


@pytest.mark.parametrize("piece", [1, 3, 5, 40])
def test_thinned_rows_are_the_weighted_sums_around_their_centres(rng, piece):
    """By the definition, whatever the pieces that rows come in, and for rows that are left out."""
    N, step, centre = 40, 3, 4
    rows, use = rng.normal(size=(N, 2, 3)), rng.random((N, 2)) < 0.8
    taps = np.array([0.1, 0.2, 0.5, 0.9, 0.5, 0.2, 0.1])
    sums, weights = np.zeros((9, 2, 3)), np.zeros((9, 2))
    for first in range(0, N, piece):
        some = slice(first, first + piece)
        kept = use[some].astype(np.int64).ravel()
        own = np.ascontiguousarray(rows[some])
        add_rows(own, kept, np.array([0, 1]), taps, step, first, centre, sums, weights)
    expected, total = np.zeros_like(sums), np.zeros_like(weights)
    for o in range(9):
        for away in range(-3, 4):
            i = centre + o * step + away
            if 0 <= i < N:
                expected[o] += taps[away + 3] * rows[i] * use[i][:, None]
                total[o] += taps[away + 3] * use[i]
    expected[:, 1, 0] = 0.0  # columns before the first one that counts are not touched
    np.testing.assert_allclose(sums, expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(weights, total, rtol=0, atol=1e-14)


@pytest.mark.parametrize("reference", ["world_aligned", "local", "world"])
@pytest.mark.parametrize("name", ["rx90", "stanford_arm"])
def test_a_tool_far_from_its_frame_accelerates_as_its_velocity_changes(rng, name, reference):
    model = rm.load(name)
    model = model.with_tool(from_rpy([0.3, -0.5, 0.9], [0.4, -0.7, 0.5]))
    q, v, a = rng.uniform(-1.0, 1.0, (3, 6, model.n)) * [[[1.0]], [[2.0]], [[3.0]]]
    h = 1e-5

    def twist(t):
        return rm.dkm(model, q + t * v + 0.5 * t * t * a, v + t * a, reference=reference)

    expected = (twist(h) - twist(-h)) / (2.0 * h)
    found = rm.dkm_second_order(model, q, v, a, reference=reference)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)


# --- derivatives -----------------------------------------------------------------------------


def small_tree():
    """Joints of both kinds behind and beside each other, one of them behind a fixed frame."""
    table = rm.DHTable(
        antecedent=[0, 1, 2, 2, 4, 5],
        sigma=[0, 1, 0, 2, 1, 0],
        alpha=[0.3, -0.7, 1.1, 0.4, -0.9, 0.6],
        d=[0.1, 0.4, -0.3, 0.2, 0.5, 0.3],
        theta=[0.0, 0.6, 0.0, -0.8, 0.5, 0.0],
        r=[0.2, 0.0, 0.3, -0.4, 0.0, 0.1],
    )
    model = rm.RobotModel.from_table(table)
    return model.with_base(from_rpy([0.3, -0.4, 0.8], [0.1, 0.2, 0.3]))


def test_contracted_regressors_change_as_their_gradient_says(rng):
    model = small_tree()
    motion = rng.uniform(-1.0, 1.0, (3, 1, model.n))
    place = np.arange(10 * model.f)
    G = rng.normal(size=(1, model.n, place.size))
    found = np.zeros(motion.shape)
    arm = (model.chain, model.gravity, place)
    regressor_gradients(*motion, *arm, G, *found)

    def contracted(change):
        W = np.empty(G.shape)
        torque_regressors(*(motion + change), *arm, W)
        return (G * W).sum()

    expected, h = np.empty(motion.shape), 1e-5
    for place_of_one in np.ndindex(motion.shape):
        one = np.zeros(motion.shape)
        one[place_of_one] = h
        expected[place_of_one] = (contracted(one) - contracted(-one)) / (2.0 * h)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
    assert np.abs(expected).min() > 1e-3


# --- phases of constant jerk -----------------------------------------------------------------


def ends_of(durations, jerks, state):
    """States at the ends of phases, by summing the jerk's powers one after the other."""
    states = [np.array(state)]
    for t, j in zip(durations, jerks, strict=True):
        p, v, a = states[-1]
        states.append(np.array([p + v * t + a * t**2 / 2 + j * t**3 / 6, v + a * t + j * t**2 / 2,
                                a + j * t]))  # fmt: skip
    return np.array(states)


def test_phases_that_are_nearly_right_are_put_right(rng):
    """The goal is met to rounding, in the same time, and no phase without jerk accelerates more."""
    M = 6
    h = rng.uniform(0.2, 1.0, (M, 7))
    jerk = np.array([1.0, 0.0, -1.2, 0.0, -0.9, 0.0, 1.3]) * rng.uniform(0.5, 2.0, (M, 1))
    start = rng.normal(size=(M, 3))
    goal = np.array([ends_of(*one)[-1] for one in zip(h, jerk, start, strict=True)])
    near = h * (1.0 + 1e-6 * rng.normal(size=h.shape))
    near *= (h.sum(axis=1) / near.sum(axis=1))[:, None]
    level = np.array([ends_of(*one)[[1, 3, 5], 2] for one in zip(near, jerk, start, strict=True)])
    # the goal has to be met with the accelerations that the phases without jerk have
    for m in range(M):
        goal[m, 2] = level[m, 2] + jerk[m, 6] * near[m, 6]
    out, c = np.empty(h.shape), np.empty((M, 7, 4))
    polished_phases(near, jerk, start, goal, out, c)
    for m in range(M):
        states = ends_of(out[m], jerk[m], start[m])
        np.testing.assert_allclose(states[-1], goal[m], rtol=0, atol=3e-14)
        np.testing.assert_allclose(states[[1, 3, 5], 2], level[m], rtol=0, atol=1e-13)
        assert out[m].sum() == pytest.approx(near[m].sum(), rel=1e-14)
        np.testing.assert_allclose(out[m], near[m], rtol=1e-4)
        for k in range(7):
            np.testing.assert_allclose(c[m, k].sum(), states[k + 1, 0], rtol=0, atol=1e-13)
            slope = c[m, k, 1:] @ [1.0, 2.0, 3.0] / out[m, k]
            np.testing.assert_allclose(slope, states[k + 1, 1], rtol=0, atol=1e-12)


# --- postures and poses ----------------------------------------------------------------------


def test_poses_that_are_proper_to_rounding_and_others(rng):
    T = np.array([from_rpy(x[:3], x[3:]) for x in rng.uniform(-3.0, 3.0, (20, 6))])
    assert improper_pose(T) == -1
    assert improper_pose(T[:0]) == -1
    for change in range(7):
        bad = T.copy()
        if change == 0:
            bad[3, :3, 1] *= -1.0
        elif change == 1:
            bad[3, :3, 2] *= 1.0 + 1e-14
        elif change == 2:
            bad[3, :3, :3] = -bad[3, :3, :3]
        elif change == 3:
            bad[3, 3, 1] = 1e-300
        elif change == 4:
            bad[3, 1, 3] = np.nan
        elif change == 5:
            bad[3, 1, 1] = np.nan
        else:
            bad[3, :3, 0] += 1e-14 * bad[3, :3, 1]
        assert improper_pose(bad) == 3
        assert improper_pose(bad[4:]) == -1
