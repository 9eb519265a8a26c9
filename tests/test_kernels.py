"""The kernels against Pinocchio on random trees, and each other where Pinocchio cannot follow."""

import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from robotmodels.kernels import Chain
from robotmodels.kernels.mass import coriolis_matrices, joint_accelerations, mass_matrices
from robotmodels.kernels.poses import jacobian_rates, jacobians, link_poses, tip_poses
from robotmodels.kernels.regressors import energy_regressors, torque_regressors
from robotmodels.kernels.torques import joint_torques, kinetic_energies, potential_energies

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
        "kinetic": run(kinetic_energies, q, v, c, pi, out=(rows,)),
        "potential": run(potential_energies, q, c, pi, g, out=(rows,)),
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


def test_coriolis_matrix_is_half_the_mass_matrix_rate_plus_a_skew_one(robot):
    q, v = robot.samples(2)
    step = 1e-6
    before, now, after = (all_of(robot, robot.pi, q + s * v, v, v) for s in (-step, 0.0, step))
    skew = (after["masses"] - before["masses"]) / (2 * step) - 2 * now["coriolis"]
    close(skew, -np.swapaxes(skew, 1, 2), 1e-6)


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


def check_every_kernel(robot, rows):
    q, v, a = robot.samples(rows=rows)
    c, g, n, f = robot.chain, robot.gravity, robot.n, robot.f
    all_of(robot, robot.pi, q, v, a)
    run(tip_poses, q, c, *robot.tip(), out=(rows, 4, 4))
    run(link_poses, q, c, out=(rows, f, 4, 4))
    every = np.arange(10 * f)
    run(torque_regressors, q, v, a, c, g, every, out=(rows, n, 10 * f))
    run(energy_regressors, q, v, c, g, every, out=(rows, 1, 10 * f))
    for reference in range(3):
        run(jacobians, q, c, *robot.tip(), reference, out=(rows, 6, n))
        run(jacobian_rates, q, v, c, *robot.tip(), reference, out=(rows, 6, n))
    out = np.empty((rows, n))
    assert joint_accelerations(q, v, a, c, robot.pi, g, np.eye(n), out) == -1


@pytest.mark.parametrize("chain", CHAINS)
def test_empty_batch(chain):
    check_every_kernel(make_robot(*CHAINS[chain], seed=1), rows=0)


def test_a_chain_without_joints_still_has_poses_and_energy():
    robot = make_robot([0, 1], [F, F], seed=2)
    check_every_kernel(robot, rows=2)
    links = run(link_poses, np.empty((1, 0)), robot.chain, out=(1, 2, 4, 4))[0]
    expected = [placement.homogeneous for _, placement in robot.supports[1:]]
    close(links, expected)
    energy = run(potential_energies, np.empty((1, 0)), robot.chain, robot.pi, robot.gravity, out=1)
    weights = [T[:3] @ p[6:] for T, p in zip(links, robot.pi, strict=True)]
    close(energy, [-robot.gravity @ sum(weights)])


def test_the_package_imports_no_numba():
    code = "import sys, robotmodels.kernels; sys.exit('numba' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
