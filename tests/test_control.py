"""Control laws against closed forms, identities and energies, on random and on plane robots."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from identities.random_robots import random_model, random_state
from scipy.spatial.transform import Rotation

from robotmodels import control, viz
from robotmodels.control import ControlStatus
from robotmodels.drive import DriveParameters
from robotmodels.dynamics import coriolis_matrix, gravity_torque, mass_matrix
from robotmodels.errors import InvalidValueError, ShapeError, SingularMassMatrixError
from robotmodels.geometry import DHTable
from robotmodels.inertia import InertialParameters
from robotmodels.kinematics import dgm, jacobian
from robotmodels.model import RobotModel
from robotmodels.regressors import parameter_vector, torque_regressor
from robotmodels.robots import load
from robotmodels.simulation import simulate
from robotmodels.trajectories import quintic, straight_line

DOWN = (0.0, -9.81, 0.0)
XY = [1, 1, 0, 0, 0, 0]
Q0 = np.array([0.4, 0.9])


def arm(gravity=DOWN, masses=(5.0, 3.0), **table):
    """A 2R arm in the vertical plane, links of 0.5 and 0.4 m."""
    bars = [
        np.diag([0.0, 0.01, m * long**2 / 12]) for m, long in zip(masses, (0.5, 0.4), strict=True)
    ]
    inertia = InertialParameters.from_com(masses, [[0.25, 0, 0], [0.2, 0, 0]], bars)
    tool = np.eye(4)
    tool[0, 3] = 0.4
    rows = DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0.0, 0.5], **table)
    return RobotModel.from_table(rows, inertia, gravity=gravity, tool=tool, name="2R")


def slider(mass=2.0, **drive):
    """A mass on a rail along z, without gravity."""
    inertia = InertialParameters.from_com([mass], [[0, 0, 0]], [np.zeros((3, 3))])
    model = RobotModel.from_table(DHTable([0], sigma=[1]), inertia, gravity=(0, 0, 0))
    return model.with_drive(DriveParameters(**drive)) if drive else model


def random_robot(seed, **options):
    """A generator and a robot without limits: chains, trees, sliding and fixed joints."""
    rng = np.random.default_rng(seed)
    tree = seed % 2 == 0
    return rng, random_model(rng, f=3 + seed, tree=tree, fixed=tree, limits=False, **options)


def moved(T, *by):
    T = np.array(T)
    T[:3, 3] += by
    return T


def critically_damped(t, e0, de0, w):
    t = np.asarray(t)[:, None]
    return (e0 + (de0 + w * e0) * t) * np.exp(-w * t)


# --- free space --------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("seed", range(4))
def test_computed_torque_makes_the_error_linear(seed):
    rng, model = random_robot(seed, drive=seed % 2 == 1, transmission=seed == 3)
    q, v, _ = random_state(model, rng)
    goal = quintic(q + 0.3, q - 0.2, duration=0.5)
    w = rng.uniform(5.0, 10.0, model.n)
    law = control.ComputedTorque(goal, omega=w, model=model)
    t = np.linspace(0.0, 0.5, 6)
    run = control.run(model, law, q, v, t)
    exact = critically_damped(t, run.error[0], -v, w)
    assert np.allclose(run.error, exact, atol=1e-6)
    assert run.status == ControlStatus.FOLLOWED
    assert np.allclose(run.error, goal.q(t) - run.q, atol=1e-12)


def test_joints_at_rest_get_the_dry_friction_of_their_way():
    model = arm().with_drive(DriveParameters(Fc=[3.0, 2.0], Ia=[0.1, 0.1]))
    weight, M = gravity_torque(model, Q0), mass_matrix(model, Q0)
    goal = Q0 + np.array([0.1, -0.2])
    friction = [3.0, -2.0]
    law = control.ComputedTorque(goal, omega=5.0, model=model)
    expected = weight + M @ [2.5, -5.0] + friction
    assert np.allclose(law.command(0.0, Q0, [0.0, 0.0]), expected, atol=1e-12)
    law = control.Passivity(goal, slope=2.0, gain=4.0, model=model)
    expected = weight + 4.0 * np.array([0.2, -0.4]) + friction
    assert np.allclose(law.command(0.0, Q0, [0.0, 0.0]), expected, atol=1e-12)


def turning(t):
    """Pose, twist and acceleration of a tool that moves and turns about changing axes."""
    w = np.array([0.3, -0.5, 0.9])
    first = Rotation.from_rotvec(w * t)
    R = (first * Rotation.from_rotvec([0.1 * t**2, 0, 0])).as_matrix()
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, [0.4 + 0.1 * np.sin(t), 0.2, 0.3 + 0.05 * t]
    add, gain = first.apply([0.2 * t, 0, 0]), first.apply([0.2, 0, 0])
    twist = np.r_[0.1 * np.cos(t), 0, 0.05, w + add]
    return T, twist, np.r_[-0.1 * np.sin(t), 0, 0, np.cross(w, add) + gain]


@pytest.mark.parametrize("goal", ["pose", "motion", "far", "line"])
def test_computed_torque_in_task_space(goal):
    model, w = load("erd:ur5"), 6.0
    q, v = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2]), np.full(6, 0.1)
    T = dgm(model, q + 0.2)
    far = T @ np.block(
        [[Rotation.from_rotvec([1.6, -1.5, 1.4]).as_matrix(), np.zeros((3, 1))], [0, 0, 0, 1]]
    )
    reference = {"pose": T, "motion": turning, "line": straight_line(T, moved(T, 0.1, 0, 0), 1.0)}
    law = control.ComputedTorque((reference | {"far": far})[goal], w, model=model, space="task")
    t, h = np.linspace(0.0, 0.5, 6), 1e-6
    motion = simulate(model.with_table(model.table), q, v, law, t)
    errors = np.array([law.error(*row) for row in zip(t, motion.q, motion.v, strict=True)])
    R = law._desired(0.0)[0][:3, :3] @ dgm(model, q)[:3, :3].T
    assert np.allclose(errors[0, 3:], Rotation.from_matrix(R).as_rotvec(), atol=1e-10)
    rate = np.array([-3, 4, -1]) @ [law.error(k * h, q + k * h * v, v) for k in range(3)] / (2 * h)
    assert np.allclose(errors, critically_damped(t, errors[0], rate, w), atol=1e-6)


def test_masks_choose_components_and_free_motions_are_damped():
    model = load("erd:ur5")
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])
    law = control.ComputedTorque(
        dgm(model, q + 0.1), omega=8.0, model=model, space="task", mask="position"
    )
    run = control.run(model, law, q, np.full(6, 0.3), np.linspace(0, 2, 5))
    assert run.error.shape == (5, 3)
    assert np.abs(run.error[-1]).max() < 1e-4
    assert np.abs(run.v[-1]).max() < 1e-3
    # without a mask: the first components that move independently
    assert control.Impedance(dgm(arm(), Q0), 1, 1, 1, model=arm()).rows.tolist() == [0, 1]
    assert control.Impedance(np.eye(4), 1, 1, 1, model=slider()).rows.tolist() == [2]


def test_a_wrong_mass_leaves_the_predicted_error():
    believed, plant, w = arm(), arm(masses=(6.0, 3.6)), 8.0
    law = control.ComputedTorque([0.5, -0.3], omega=w, model=believed)
    run = control.run(plant, law, [0, 0], t=np.linspace(0, 4, 41))
    q = run.q[-1]
    missing = gravity_torque(plant, q) - gravity_torque(believed, q)
    assert np.allclose(
        run.error[-1], np.linalg.solve(mass_matrix(believed, q), missing) / w**2, rtol=1e-4
    )
    assert np.abs(run.error).max() < 1.0


def test_pid_gains_give_a_triple_pole_and_the_border_of_stability():
    for a, f, w in ((2.0, 1.0, 5.0), (0.3, 0.0, 20.0)):
        gains = control.pid_gains(a, f, w)
        assert np.allclose(gains.poles, -w, rtol=1e-3)
        assert gains.margin == pytest.approx(gains.critical_ki / gains.ki)
        for factor in (0.999, 1.001):
            near = replace(gains, ki=factor * gains.critical_ki)
            assert (near.poles.real.max() > 0) == (factor > 1)
            assert (near.margin < 1) == (factor > 1)
    rail, t = slider(2.0, Fv=[1.0]), np.linspace(0, 2, 11)
    gains = control.pid_gains(2.0, 1.0, 5.0)
    law = control.DecentralizedPID([0.0], gains.kp, gains.ki, gains.kd)
    run = control.run(rail, law, [0.2], t=t)
    # x = integral of e has x(0) = 0, x'(0) = -0.2, x''(0) = 0
    exact = -0.2 * (t + 5.0 * t**2) * np.exp(-5.0 * t)
    assert np.allclose(run.state[:, 0], exact, atol=1e-9)
    unstable = control.DecentralizedPID([0.0], gains.kp, 1.3 * gains.critical_ki, gains.kd)
    assert control.run(rail, unstable, [0.2], t=8.0).status == ControlStatus.DIVERGED
    stable = control.DecentralizedPID([0.0], gains.kp, 0.7 * gains.critical_ki, gains.kd)
    assert control.run(rail, stable, [0.2], t=8.0).status == ControlStatus.FOLLOWED
    # growth of the reference is no divergence, and slow growth is
    rail, gains = slider(2.0), control.pid_gains(2.0, 0.0, 5.0)
    lag = control.DecentralizedPID(lambda t: ([t**4], [4 * t**3], [12 * t**2]), 500.0, 0.0, 50.0)
    assert control.run(rail, lag, [0.0], t=1.0).status == ControlStatus.FOLLOWED
    law = control.DecentralizedPID([0.1], gains.kp, 1.05 * gains.critical_ki, gains.kd)
    assert control.run(rail, law, [0.0], t=20.0).status == ControlStatus.DIVERGED


def test_pd_with_gravity_dissipates_and_without_it_is_off_by_gravity():
    model, kp, kd = arm(), np.array([100.0, 60.0]), np.array([20.0, 8.0])
    goal = np.array([0.5, -0.3])
    run = control.run(model, control.PDGravity(goal, kp, kd, model=model), [0, 0], t=2.0)
    assert (np.diff(run.lyapunov) <= 1e-12).all()
    power = -np.sum(run.v**2 * kd, axis=1)
    loss = np.trapezoid(power, run.t)
    assert run.lyapunov[-1] - run.lyapunov[0] == pytest.approx(loss, rel=1e-3)
    assert np.abs(run.error[-1]).max() < 1e-3
    plain = control.run(model, control.PDGravity(goal, kp, kd), [0, 0], t=6.0)
    assert np.allclose(plain.error[-1], gravity_torque(model, plain.q[-1]) / kp, atol=1e-4)
    assert plain.lyapunov is None


@pytest.mark.parametrize("seed", range(4))
def test_lyapunov_functions_fall_at_the_stated_rate(seed):
    """dV/dt along the closed loop, by a central difference, on random robots in motion."""
    rng, model = random_robot(seed)
    (q, v, _), h = random_state(model, rng), 1e-6
    k = rng.uniform(1.0, 9.0, (2, model.n))
    goal = quintic(q - 0.2, q + 0.4, duration=1.0)
    plus = control.PDGravity(goal, *k, model=model)
    passive = control.Passivity(goal, slope=k[0], gain=k[1], model=model)
    s, de = passive.surface(0.3, q, v), goal.v(0.3) - v
    for law, rate in ((plus, -de @ (k[1] * de)), (passive, -s @ (k[1] * s))):
        M = mass_matrix(model, q)
        rest = coriolis_matrix(model, q, v) @ v + gravity_torque(model, q)
        a = np.linalg.solve(M, law.command(0.3, q, v) - rest)

        def V(h, law=law, a=a):
            return law.lyapunov(model, 0.3 + h, q + h * v + h * h * a / 2, v + h * a, ())

        scale = abs(V(0.0)) / h * 1e-15 + 1e-8
        assert (V(h) - V(-h)) / (2 * h) == pytest.approx(rate, abs=100 * scale, rel=1e-7)


# --- sliding modes -----------------------------------------------------------------------------


def test_sliding_modes_reach_in_the_stated_time():
    K, D, h = 3.0, 2.0, 1e-3
    rng = np.random.default_rng(0)
    s0, pushes = rng.normal(size=1000), rng.uniform(-D, D, (4000, 1000))
    law = control.SlidingMode(None, slope=1.0, gain=K)
    s = control.first_order(law, s0, lambda t: pushes[min(round(t / h), 3999)], 4.0, h)
    assert s.shape == (4001, 1000)
    reached = np.argmax(np.abs(s) <= (K + D) * h, axis=0) * h
    assert (reached <= np.abs(s0) / (K - D) + h).all()
    worst = control.first_order(law, 1.0, D, 2.0, h)
    assert np.argmax(worst <= 0.0) * h == pytest.approx(1.0 / (K - D), abs=2 * h)
    layer = control.SlidingMode(None, slope=1.0, gain=K, layer=0.1)
    late = control.first_order(layer, 1.0, lambda t: D * np.sin(9 * t), 4.0, h)[2000:]
    assert np.abs(late).max() <= 0.1 * D / K
    assert control.first_order(layer, 1.0, D, 4.0, h)[-1] == pytest.approx(0.1 * D / K)


def test_super_twisting_is_of_second_order_in_the_step():
    late = {}
    for h in (1e-2, 1e-3):
        for name, law in (
            ("first", control.SlidingMode(None, 1.0, gain=3.0)),
            ("second", control.SuperTwisting(None, 1.0, k1=1.5, k2=1.1)),
        ):
            s = control.first_order(law, 0.5, np.sin, 10.0, h)
            late[name, h] = np.abs(s[len(s) // 2 :]).max()
    assert 5 < late["first", 1e-2] / late["first", 1e-3] < 20
    assert 40 < late["second", 1e-2] / late["second", 1e-3] < 250
    assert np.allclose(control.first_order(lambda s: -s, 1.0, None, 1.0, 0.5), [1.0, 0.5, 0.25])


def test_sliding_modes_of_a_robot_reject_disturbances():
    model, goal = arm(), np.array([0.5, -0.3])
    laws = [
        control.SlidingMode(goal, 5.0, 60.0, layer=0.1, model=model),
        control.SlidingMode(goal, 5.0, 60.0, model=model),
        control.SuperTwisting(goal, 5.0, 10.0, 40.0, model=model),
    ]
    options = {"t": 0.6, "period": 1e-3, "disturbance": lambda t, q, v: [2.0 * np.sin(3 * t), 0.5]}
    for law in laws:
        run = control.run(model, law, [0.45, -0.25], **options)
        assert np.abs(run.surface[-100:]).max() < 0.1
        assert np.abs(run.error[-1]).max() < 0.02
    plain = control.SlidingMode([0.0], 5.0, 4.0, layer=0.01)
    run = control.run(slider(), plain, [0.1], t=2.0, disturbance=[1.0])
    assert run.surface[-1, 0] == pytest.approx(-0.01 / 4.0, rel=1e-3)
    for law in laws[1:]:
        with pytest.raises(InvalidValueError, match="give a sampling period, or a boundary layer"):
            control.run(model, law, [0.0, 0.0])


# --- adaptive control --------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_the_regressor_of_slotine_and_li(seed):
    rng, model = random_robot(seed, drive=True, transmission=seed % 2 == 1)
    (q, v, a), v_r = random_state(model, rng), rng.normal(size=model.n)
    Y = control.slotine_li_regressor(model, q, v, v_r, a, drive=False)
    C = coriolis_matrix(model, q, v)
    tau = mass_matrix(model, q, drive=False) @ a + C @ v_r + gravity_torque(model, q)
    scale = 1.0 + np.abs(tau).max()
    assert np.allclose(Y @ parameter_vector(model, False), tau, atol=1e-12 * scale)
    same = control.slotine_li_regressor(model, [q, q], v, v, a)
    assert np.allclose(same[1], torque_regressor(model, q, v, a), atol=1e-11)
    assert control.slotine_li_regressor(model, np.zeros((0, model.n)), v, v, a).shape[0] == 0
    h = 1e-6
    dA = (mass_matrix(model, q + h * v) - mass_matrix(model, q - h * v)) / (2 * h)
    N = dA - 2 * C
    assert np.allclose(N, -N.T, atol=1e-6 * (1.0 + np.abs(N).max()))


def test_adaptive_control_learns_what_the_motion_excites():
    bar = InertialParameters.from_com([2.0], [[0.3, 0.1, 0]], [np.diag([0, 0.02, 0.02])])
    model = RobotModel.from_table(DHTable([0], sigma=[0]), bar, gravity=DOWN, name="pendulum")
    t = np.linspace(0, 10, 101)
    options = {"adaptation": [0.2, 0.5, 0.5], "model": model, "drive": False}

    def goal(t):
        a, b = np.array([1.3 * t]), np.array([2.9 * t])
        q, v = 1.5 * np.sin(a) + np.sin(b), 1.95 * np.cos(a) + 2.9 * np.cos(b)
        return q, v, -2.535 * np.sin(a) - 8.41 * np.sin(b)

    law = control.AdaptiveSlotineLi(goal, slope=5.0, gain=8.0, **options)
    run = control.run(model, law, *goal(0.0)[:2], t, rtol=1e-8, atol=1e-10, method="RK45")
    true = law.true_values(model)
    assert np.allclose(true, [0.22, 0.6, 0.2])
    assert np.abs(run.state[-1] - true).max() < 0.01 * true.max()
    assert (np.diff(run.lyapunov) <= 1e-7).all()
    assert run.rms(after=9.0) < 0.05 * np.abs(run.error[t < 1]).max()
    assert "too little" not in run.reason()
    # a constant goal: the parameters do not converge, and it says which
    still = control.AdaptiveSlotineLi([0.7], slope=10.0, gain=5.0, **options)
    run = control.run(model, still, [0.2], t=np.linspace(0, 6, 61), rtol=1e-8, atol=1e-10)
    assert np.abs(run.state[-1] - true).max() > 0.1
    assert "excites these parameters too little to estimate: ZZ1" in run.reason()


# --- contact -----------------------------------------------------------------------------------


def test_walls_push_slide_and_rub():
    wall = control.SpringWall([0.5, 0, 0], [-2, 0, 0], 1e4, damping=50.0, friction=0.3)
    T = moved(np.eye(4), 0.51, 0.2, 0)
    assert np.allclose(wall.normal, [-1, 0, 0])
    assert np.allclose(wall(0, T, [0, 0, 0, 9, 9, 9]), [100, 0, 0, 0, 0, 0])
    assert np.allclose(wall(0, T, [0.5, 0, 0, 0, 0, 0])[0], 125)
    sliding = wall(0, T, [0, 2.0, 0, 0, 0, 0])
    assert np.allclose(sliding, [100, 30, 0, 0, 0, 0], rtol=1e-6)
    assert not wall(0, T, [-3.0, 0, 0, 0, 0, 0]).any()  # it never pulls
    away = moved(np.eye(4), 0.49, 0, 0)
    assert not wall(0, away, [0, 1, 0, 0, 0, 0]).any()
    both = control.SpringWall([0.5, 0, 0], [-1, 0, 0], 1e4, bilateral=True)
    assert np.allclose(both(0, away, np.zeros(6))[0], -100)
    assert wall(0, [[T, away]] * 3, np.zeros(6)).shape == (3, 2, 6)


def test_contact_takes_energy_from_a_falling_arm():
    model = arm()
    floor = control.SpringWall([0, -0.45, 0], [0, 1, 0], 2e4, damping=40.0, friction=0.4)
    law = control.PDGravity([-0.9, 0.2], 30.0, 6.0, model=model)
    t = np.linspace(0, 1, 101)
    run = control.run(model, law, [0.0, 0.3], t=t, environment=floor, rtol=1e-8, atol=1e-10)
    sim = run.simulation
    assert sim.relative_drift < 1e-6
    assert sim.wrench_work[-1] > 0
    stored = run.lyapunov + np.maximum(floor.depth(dgm(model, run.q)), 0) ** 2 * 2e4 / 2
    assert (np.diff(stored) < 1e-6).all()
    assert run.wrench[-1, 1] < -1.0
    assert (run.wrench[:, 1] <= 1e-12).all()


def test_impedance_oscillates_and_gives_way_as_stated():
    model, M, B, K = arm(), 2.0, 8.0, 200.0
    T = dgm(model, Q0)
    law = control.Impedance(T, M, B, K, model=model, mask=XY)
    w, z = law.frequency[0], law.damping[0]
    assert (w, z) == (10.0, 0.2)
    t = np.linspace(0, 1, 11)
    run = control.run(model, law, [0.45, 0.85], t=t)
    wd = w * np.sqrt(1 - z**2)
    swing = np.exp(-z * w * t) * (np.cos(wd * t) + z * w / wd * np.sin(wd * t))
    assert np.allclose(run.error, run.error[0] * swing[:, None], atol=1e-6)
    # a constant force, and a spring at the tool
    law = control.Impedance(T, M, 2 * np.sqrt(K * M), K, model=model)
    pulled = control.run(
        model, law, Q0, t=np.linspace(0, 2, 3), environment=lambda t, T, w: [3, -2, 0, 0, 0, 0]
    )
    assert np.allclose(pulled.error[-1], [3 / K, -2 / K], atol=1e-6)
    ke, dx = 1e3, 0.03
    wall = control.SpringWall(T[:3, 3], [-1, 0, 0], ke, bilateral=True)
    for kind in (control.Impedance, control.Admittance):
        law = kind(moved(T, dx, 0, 0), M, 2 * np.sqrt(1200 * M), K, model=model, mask=XY)
        run = control.run(model, law, Q0, t=np.linspace(0, 4, 3), environment=wall)
        force = K * ke * dx / (K + ke)
        assert np.allclose(run.wrench[-1], [force, 0, 0, 0, 0, 0], atol=1e-5)


def test_admittance_moves_as_stated():
    T, M, B, K, f = dgm(arm(), Q0), 2.0, 24.0, 300.0, [3.0, -2.0, 0, 0, 0, 0]
    law = control.Admittance(T, M, B, K, model=arm(), omega=60.0, mask=XY)
    t = np.linspace(0, 0.3, 7)
    run = control.run(arm(), law, Q0, t=t, environment=lambda t, T, w: f)
    a, b = np.roots([M, B, K])
    way = 1 - ((a * np.exp(b * t) - b * np.exp(a * t)) / (a - b)).real
    assert np.allclose(run.error, np.outer(way, f[:2]) / K, atol=1e-9)


def test_impedance_of_the_orientation_and_of_another_frame():
    tool = moved(np.eye(4), 0.05, 0.1, 0.2)
    model, K = load("erd:ur5").with_tool(tool), np.array([300.0, 400.0, 500.0, 20.0, 30.0, 40.0])
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])
    for frame in (None, 6):
        T = dgm(model, q, frame)
        law = control.Impedance(T, 1.0, 2 * np.sqrt(K), K, model=model, frame=frame)
        f = np.array([3.0, -2.0, 1.0, 0.2, -0.3, 0.1])
        run = control.run(model, law, q, t=np.linspace(0, 3, 4), environment=lambda t, T, w, f=f: f)
        now, e = dgm(model, run.q[-1], frame), run.error[-1]
        lever = dgm(model, run.q[-1])[:3, 3] - now[:3, 3]
        moment = f[3:] + np.cross(lever, f[:3])
        assert np.allclose(K[:3] * e[:3], f[:3], atol=1e-5)
        # the work of the moment by a small turn of the tool is that of the spring
        assert np.allclose(now[:3, :3], Rotation.from_rotvec(-e[3:]).as_matrix() @ T[:3, :3])
        for axis in np.eye(3):
            turned = Rotation.from_rotvec(1e-6 * axis).as_matrix() @ now[:3, :3]
            de = Rotation.from_matrix(T[:3, :3] @ turned.T).as_rotvec() - e[3:]
            assert -(K[3:] * e[3:]) @ de / 1e-6 == pytest.approx(moment @ axis, abs=1e-4)


def test_force_of_a_mass_on_a_spring():
    m, ke, kp, push = 2.0, 500.0, 100.0, -1.5
    spring = control.SpringWall([0, 0, 0], [0, 0, -1], ke, bilateral=True)
    rail, f = slider(m), [0, 0, 5.0, 0, 0, 0]
    for word, missing in (("desired", 1.5 / (1 + m * kp / ke)), ("measured", 1.5 * ke / (m * kp))):
        law = control.ForceTracking(kp, 20.0, ke, word, reference=f, model=rail)
        t = np.linspace(0, 4, 3)
        run = control.run(rail, law, [0.0], t=t, environment=spring, disturbance=[push])
        assert run.error[-1, 2] == pytest.approx(missing, rel=1e-6)


WALL = control.SpringWall(dgm(arm(), Q0)[:3, 3], [-1, 0, 0], 2e4, damping=20.0)
PUSH = [10.0, 0, 0, 0, 0, 0]


def hybrid(**more):
    goal = moved(dgm(arm(), Q0), 0, 0.1, 0)
    given = {"selection": [1, 0, 0, 0, 0, 0], "task_frame": np.eye(4), "position": goal}
    given |= {"force": PUSH, "model": arm(), "mask": XY}
    return control.ParallelHybrid(**given | more)


def test_hybrid_control_of_position_and_force():
    model, t = arm(), np.linspace(0, 1.5, 16)
    run = control.run(model, hybrid(), Q0, t=t, environment=WALL)
    assert np.abs(run.error[-1]).max() < 1e-3
    assert np.allclose(run.wrench[-1], PUSH, atol=1e-2)
    exact = critically_damped(t, run.error[0], 0.0, 10.0)[:, 1]
    assert np.allclose(run.error[:, 1], exact, atol=1e-8)  # the force does not disturb the position
    decoupled = control.ConstrainedDecoupling(
        np.eye(4), hybrid().position, PUSH, model, selection=[1, 0, 0, 0, 0, 0]
    )
    again = control.run(model, decoupled, Q0, t=t, environment=WALL)
    assert np.allclose(again.q, run.q, atol=1e-9)
    # axes of the task
    R = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    law, f = hybrid(task_frame=R), np.array([3.0, 2.0, 0, 0, 0, 0])
    expected = [R[:, 0] @ (PUSH - f)[:3], R[1, 1] * 0.1]  # the pose is 0.1 m along y away
    assert np.allclose(law.error(0, Q0, [0, 0], f), expected, atol=1e-12)


def test_forces_of_the_consistent_form_do_no_work_on_positions():
    model = load("erd:ur5")
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])
    T, selection = dgm(model, q), np.array([0, 0, 1.0, 1, 0, 0])
    laws = [
        control.ParallelHybrid(selection, np.eye(4), T, f, model)
        for f in ([0, 0, 30.0, 2.0, 0, 0], np.zeros(6))
    ]
    tau = laws[0].command(0.0, q, np.zeros(6)) - laws[1].command(0.0, q, np.zeros(6))
    twist = jacobian(model, q) @ np.linalg.solve(mass_matrix(model, q), tau)
    assert np.abs(twist[selection == 0]).max() < 1e-9
    assert np.abs(twist[selection == 1]).min() > 1e-3


def growth(law, model, q, wall):
    """Largest real part of the poles of the joints about rest."""
    n, h = model.n, 1e-6

    def rate(y):
        q, v = y[:n], y[n:]
        J = jacobian(model, q)
        f = wall(0.0, dgm(model, q), J @ v)
        rest = coriolis_matrix(model, q, v) @ v + gravity_torque(model, q) + J.T @ f
        tau = law.command(0.0, q, v, (), f)
        return np.r_[v, np.linalg.solve(mass_matrix(model, q), tau - rest)]

    y = np.r_[q, np.zeros(n)]
    columns = [(rate(y + h * d) - rate(y - h * d)) / (2 * h) for d in np.eye(2 * n)]
    return np.linalg.eigvals(np.transpose(columns)).real.max()


def test_the_historical_hybrid_form_is_unstable_in_some_postures():
    model = arm(gravity=(0, 0, 0))
    for a, b, stable in ((0, 20, False), (30, 20, False), (60, 90, True), (30, 120, True)):
        q = np.radians([a, b])
        T = dgm(model, q)
        wall = control.SpringWall(T[:3, 3], [-1, 0, 0], 2e4, damping=20.0, bilateral=True)
        for inverse in ("consistent", "jacobian"):
            law = hybrid(position=T, force=np.zeros(6), model=model, inverse=inverse)
            rate = growth(law, model, q, wall)
            assert (rate < -1.0) == (stable or inverse == "consistent")
            if a == 0:
                law = hybrid(position=moved(T, 0, 0.01, 0), model=model, inverse=inverse)
                run = control.run(model, law, q, t=0.5, environment=wall, rtol=1e-5, atol=1e-7)
                assert (run.status == ControlStatus.DIVERGED) == (rate > 0.0)


@pytest.mark.parametrize("believed", [2e3, 2e4, 2e5])
def test_the_external_force_loop_holds_the_force_on_any_wall(believed):
    model, goal = arm(), moved(dgm(arm(), Q0), 0, 0.05, 0)
    inner = control.ComputedTorque(goal, omega=20.0, model=model, space="task", mask=XY)
    gain = 30.0 if believed > 1e5 else 10.0
    law = control.ExternalForceLoop(inner, believed, gain, force=PUSH, mask=[1, 0, 0, 0, 0, 0])
    start = np.array([0.41, 0.9])
    run = control.run(model, law, start, t=3.0, environment=WALL)
    assert np.abs(run.error[-1]).max() < 0.05
    assert run.wrench[-1, 0] == pytest.approx(10.0, abs=0.05)
    assert np.abs(dgm(model, run.q[-1])[1, 3] - goal[1, 3]) < 1e-6
    lost = np.flatnonzero(run.wrench[:, 0] > 0)[0]
    assert (run.wrench[lost:, 0] > 0).all()  # no bounce


def test_the_external_force_loop_moves_by_the_force_error_and_its_integral():
    goal, w, x = moved(dgm(arm(), Q0), 0.01, -0.02, 0), 20.0, np.array([0.003, 0.001])
    inner = control.ComputedTorque(goal, omega=w, model=arm(), space="task", mask=XY)
    law = control.ExternalForceLoop(inner, 2e3, 5.0, force=PUSH)
    f, J, rest = np.array([4.0, 1.0, 0, 0, 0, 0]), jacobian(arm(), Q0), np.zeros(2)
    tau = law.command(0.0, Q0, rest, x, f) - gravity_torque(arm(), Q0) - J.T @ f
    by = np.array([6.0, -1.0]) / 2e3
    expected = w**2 * (np.array([0.01, -0.02]) + x + by) + 2 * w * 5.0 * by
    assert np.allclose(J[:2] @ np.linalg.solve(mass_matrix(arm(), Q0), tau), expected, atol=1e-9)


# --- runs --------------------------------------------------------------------------------------


def test_sampling_delay_and_noise():
    model = arm()
    law = control.ComputedTorque(Q0, omega=10.0, model=model)
    t = np.linspace(0, 0.4, 41)
    runs = [
        control.run(model, law, Q0 - 0.2, t=t, period=h, delay=d)
        for h, d in ((2e-3, 0.0), (1e-3, 0.0), (1e-3, 5e-3))
    ]
    exact = critically_damped(t, np.full(2, 0.2), 0.0, 10.0)
    off = [np.abs(run.error - exact).max() for run in runs]
    assert 1.7 < off[0] / off[1] < 2.3  # of first order in the period
    assert off[2] > 3 * off[1]
    now = law.command(0.01, runs[1].q[1], runs[1].v[1])
    assert np.allclose(runs[1].tau[1], now, atol=1e-9)
    noisy = {"t": 0.2, "period": 1e-3, "noise": [1e-4, 1e-2]}
    first, again = (control.run(model, law, Q0, rng=1, **noisy) for _ in range(2))
    assert np.array_equal(first.q, again.q)
    spread = (first.tau - gravity_torque(model, first.q)) @ np.linalg.inv(mass_matrix(model, Q0))
    assert np.std(spread[:, 1]) == pytest.approx(np.hypot(100 * 1e-4, 20 * 1e-2), rel=0.3)


def test_statuses_name_what_happened():
    weak = arm(effort=[np.inf, 5.0], lower=[-3, -3], upper=[3, 3])
    law = control.ComputedTorque(Q0, model=weak)
    run = control.run(weak, law, Q0 - [0, 0.9], t=1.0)
    assert run.status == ControlStatus.SATURATED
    assert "joints 2" in run.reason()
    assert np.abs(run.tau[:, 1]).max() == 5.0
    far = control.ComputedTorque([0.4, 3.2], model=weak)
    run = control.run(arm(lower=[-3, -3], upper=[3, 3]), far, Q0, t=1.0)
    assert run.status == ControlStatus.LEFT_LIMITS
    short = control.run(arm(), law, Q0, t=1.0, max_evaluations=20)
    assert short.status == ControlStatus.DIVERGED
    assert "used up" in short.reason()


@pytest.mark.parametrize(("name", "joint"), [("rx90", 4), ("erd:ur5", 2)])
def test_singular_postures_and_those_beside_them_have_bounded_torques(name, joint):
    model, rest = load(name), np.zeros(6)
    for bend in [0.0, *np.logspace(-12, -1, 8)]:
        q = np.array([0.1, -0.3, 1.2, 0.2, 0.7, 0.1])
        q[joint] = bend
        goal = moved(dgm(model, q), 0.01, 0.01, 0.01)
        for law in (
            control.ComputedTorque(goal, model=model, space="task"),
            control.Impedance(goal, 2.0, 20.0, 200.0, model=model),
            control.ConstrainedDecoupling(np.eye(4), goal, np.zeros(6), model=model),
            control.ParallelHybrid([0, 0, 1, 0, 0, 0], np.eye(4), goal, np.zeros(6), model=model),
        ):
            assert np.abs(law.command(0.0, q, rest)).max() < 500.0
            near = "the posture is singular for the task, or nearly" in str(
                law.notes(np.zeros(1), q[None], rest)
            )
            assert near == (bend < 5e-3) or 1e-4 < bend < 2e-2


class Own:
    """A law of a user: proportional with an integral, sampled or not."""

    state0 = (0.0, 0.0)

    def command(self, t, q, v, x):
        return 60.0 * (Q0 - q) - 15.0 * v + x

    def rate(self, t, q, v, x):
        return 100.0 * (Q0 - q)


def laws():
    model, T = arm(), dgm(arm(), Q0)
    line = straight_line(T, moved(T, 0.1, 0, 0), 1.0)
    inner = control.ComputedTorque(line, model=model, space="task")
    return [
        control.ComputedTorque(Q0, model=model), inner, control.DecentralizedPID(Q0, 1, 2, 3),
        control.PDGravity(Q0, 1, 2, model), control.Passivity(Q0, 1, 2, model),
        control.SlidingMode(quintic(Q0, Q0 + 1, duration=1.0), 1, 2),
        control.SuperTwisting(Q0, 1, 2, 3, model=model),
        control.AdaptiveSlotineLi(Q0, 1, 2, 3, model=model, drive=False),
        control.Impedance(T, 1, 2, 3, model=model), control.Admittance(T, 1, 2, 3, model=model),
        control.ForceTracking(1, 2, 3, reference=PUSH, model=model), hybrid(),
        control.ConstrainedDecoupling(np.eye(3), T, PUSH, model, selection=[1, 0, 0, 0, 0, 0]),
        control.ExternalForceLoop(inner, 1e3, 2.0, force=PUSH), WALL, control.pid_gains(1, 0, 2),
    ]  # fmt: skip


def test_laws_and_runs_are_values():
    for law, same in zip(laws(), laws(), strict=True):
        again = pickle.loads(pickle.dumps(law))
        assert again == law == same
        assert hash(again) == hash(law)
        assert len(repr(law).splitlines()) <= 6
        if hasattr(law, "command"):
            x = law.state0
            assert law.rate(0.0, Q0, [0.1, 0.2], x).shape == x.shape
            assert np.array_equal(
                law.command(0.0, Q0, [0.1, 0], x), again.command(0.0, Q0, [0.1, 0], x)
            )
    run = control.run(arm(), laws()[0], Q0 - 0.1, t=0.2)
    assert pickle.loads(pickle.dumps(run)) == run
    assert len(repr(run).splitlines()) <= 6
    run = control.run(arm(), Own(), Q0, t=np.linspace(0, 3, 4))
    assert np.abs(run.q[-1] - Q0).max() < 0.05
    assert (run.error.shape, run.state.shape) == ((4, 0), (4, 2))


def ran(**given):
    return control.run(arm(), **{"law": laws()[0], "q0": Q0, "t": 0.1} | given)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: control.ComputedTorque(Q0, omega=0.0, model=arm()), "omega: expected gains above"),
        (lambda: control.ComputedTorque([0.0], model=arm()), "expected 2 joints"),
        (lambda: control.ComputedTorque(Q0, model=arm(), mask=XY), "space='joint' has no mask"),
        (lambda: control.ComputedTorque(np.eye(4), model=arm(), space="task",
                                        mask=[1, 1, 1, 0, 0, 0]), "3 components are more than"),
        (lambda: hybrid(selection=[0.5, 0, 0, 0, 0, 0]), "selection: expected zeros and ones"),
        (lambda: hybrid(selection=[0, 0, 1, 0, 0, 0]), "expected a force-controlled"),
        (lambda: hybrid(inverse="jacobian", mask=[1, 0, 0, 0, 0, 0]), "as many components"),
        (lambda: control.SpringWall([0, 0, 0], [0, 0, 0], 1.0), "normal: expected a vector"),
        (lambda: control.SpringWall([0, 0, 0], [0, 0, 1], 1.0, bilateral="no"), "bilateral: expec"),
        (lambda: control.AdaptiveSlotineLi(Q0, 5.0, 10.0, 1.0, model=arm()).regressor(
            0.0, np.zeros((3, 2)), np.zeros((3, 2))), r"q: expected shape \(2,\)"),
        (lambda: control.PIDGains(1, 2, 3, 0, 0).margin, "inertia: expected a finite number above"),
        (lambda: control.first_order(lambda s: [1, 2, 3], 1, 0, 1, 0.1), "expected one"),
        (lambda: hybrid(model=arm(masses=(0.0, 0.0))).command(0, Q0, Q0), "matrix is singular"),
        (lambda: ran(law="pid"), "law: expected a control law with command"),
        (lambda: ran(law=control.PDGravity([0.0], 1, 1)), "expected a law for 2 joints"),
        (lambda: ran(period=1e-3, delay=2.0), "delay: expected less than the duration"),
        (lambda: ran(noise=1e-3, period=1e-3), "noise: give rng"),
        (lambda: ran(environment=lambda t, T, w: [1.0]), r"environment\(t, T, twist\): expected"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_mistakes_are_named(make, message):
    with pytest.raises((InvalidValueError, ShapeError, SingularMassMatrixError), match=message):
        make()


# --- figures -----------------------------------------------------------------------------------


def test_figures_have_the_panels_of_the_law_and_the_force_is_an_arrow():
    pushed = control.run(arm(), hybrid(), Q0, t=np.linspace(0, 0.5, 51), environment=WALL)
    figure = viz.plot_control(pushed)
    assert [axes.get_ylabel() for axes in figure.axes] == ["error", "torque (N m)", "force (N)"]
    assert np.allclose(figure.axes[2].get_lines()[-1].get_ydata(), pushed.wrench[:, 0])
    law = control.SlidingMode(Q0, 5.0, 30.0, layer=0.1, model=arm())
    run = control.run(arm(), law, Q0 - 0.1, t=np.linspace(0, 0.2, 5))
    lines = viz.plot_surface(run).axes[0].get_lines()[-2:]
    assert np.allclose([line.get_ydata() for line in lines], run.surface.T)
    scene = viz.animate_control(pushed, walls=[WALL], length=0.5)
    assert any("force" in track.path for track in scene.motion.tracks)
    assert "walls/1" in scene.paths
