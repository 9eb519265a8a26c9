"""Simulation against closed forms, conservation laws and the inverse model."""

from itertools import cycle

import numpy as np
import pytest
from identities.random_robots import random_model, random_state
from scipy.special import ellipj, ellipk

import robotmodels as rm
from robotmodels.errors import (
    InertiaError,
    InvalidValueError,
    ShapeError,
    SingularMassMatrixError,
)
from robotmodels.friction import (
    CoulombFriction,
    FrictionSum,
    StribeckFriction,
    ViscousFriction,
)
from robotmodels.inertia import InertiaWarning
from robotmodels.simulation import (
    SimulationEventKind,
    SimulationStatus,
    dynamics_map,
    simulate,
    torque_parts,
)

G = 9.81
KINDS = SimulationEventKind


def robot(*masses, sigma=0, size=0.0, d=0.0, inertia=0.0, gravity=G, **drive):
    """Links that are points, or small bodies, at these lengths, moving in a vertical plane."""
    n = len(masses)
    com, tensor = np.zeros((n, 3)), np.tile(np.diag([0.0, inertia, inertia]), (n, 1, 1))
    com[:, 0] = size
    table = rm.DHTable(antecedent=np.arange(n), sigma=[sigma] * n, d=[0.0, d][:n],
                       lower=[-1.0] * sigma or None, upper=[0.5] * sigma or None)  # fmt: skip
    bodies = rm.InertialParameters.from_com(masses, com, tensor)
    drives = rm.DriveParameters(**drive) if drive else None
    return rm.RobotModel.from_table(table, bodies, drives, gravity=(0, -gravity, 0))


def pendulum(length=0.4, **drive):
    """Hangs down at q = -pi/2."""
    return robot(2.0, size=length, **drive)


def slider(**drive):
    """A mass of 2 kg on a level rail."""
    return robot(2.0, sigma=1, gravity=0.0, **drive)


def double_pendulum(**drive):
    return robot(1.0, 0.8, size=[0.25, 0.2], d=0.5, inertia=0.02, **drive)


def holds(model, sim, wrench=None, drive=True):
    """The motion is the one of its torques: inverse model plus what friction took."""
    bare = model.with_drive(rm.DriveParameters(Ia=model.drive.Ia, offset=model.drive.offset))
    if model.transmission is not None:
        K = model.transmission
        bare = bare.with_transmission(rm.Transmission(K.matrix, K.offset, Iam=K.Iam))
    return rm.idm(bare, sim.q, sim.v, sim.a, wrench=wrench, drive=drive) + sim.friction - sim.tau


# --- closed forms ------------------------------------------------------------------------------


def test_pendulum_swings_as_the_elliptic_functions_say():
    length, start, t = 0.4, 1.9, np.linspace(0.0, 3.0, 61)  # from the vertical
    k = np.sin(start / 2)
    sn, _, _, _ = ellipj(ellipk(k * k) - np.sqrt(G / length) * t, k * k)
    for method, rtol, tolerance in (("DOP853", 1e-10, 1e-9), ("radau", 1e-8, 1e-6)):
        sim = simulate(pendulum(length=length), [start - np.pi / 2], t=t, method=method, rtol=rtol)
        assert np.abs(sim.q[:, 0] - (2.0 * np.arcsin(k * sn) - np.pi / 2)).max() < tolerance
        assert sim.status is SimulationStatus.FINISHED


# --- dry friction ------------------------------------------------------------------------------


def test_slider_on_dry_friction_stops_stays_and_breaks_away():
    mass, Fc, slope, speed = 2.0, 3.0, 4.1, 1.45
    begin = 2.0  # the force grows from then on
    t = np.linspace(0.0, 4.0, 401)
    sim = simulate(slider(Fc=[Fc]), [0.0], [speed],
                   lambda t, q, v: [slope * max(t - begin, 0)], t, breaks=[begin])  # fmt: skip
    stop, away = speed * mass / Fc, begin + Fc / slope
    assert [(e.kind, e.joint, e.motor) for e in sim.events] == [
        (KINDS.STUCK, 0, False), (KINDS.BROKE_AWAY, 0, False)]  # fmt: skip
    assert sim.events[0].t == pytest.approx(stop, abs=1e-12)
    assert sim.events[1].t == pytest.approx(away, abs=1e-8)
    after = np.maximum(t - away, 0.0)
    moving = np.minimum(t, stop)
    expected = speed * moving - 0.5 * Fc / mass * moving**2 + slope * after**3 / 6 / mass
    assert np.abs(sim.q[:, 0] - expected).max() < 1e-8
    rest = (t > stop) & (t <= away)
    assert (sim.v[rest] == 0.0).all()
    assert (sim.a[rest] == 0.0).all()
    assert np.array_equal(sim.sticking[:, 0], rest)
    assert np.allclose(sim.friction[rest], sim.tau[rest])
    assert np.allclose(sim.friction[t < stop], Fc)
    assert sim.relative_drift < 1e-12


def coupled_wrist(Fcm=0.5, Fc=(0.3, 0.2)):
    """Two joints whose second motor turns with both, as a TX40's wrist."""
    K = rm.Transmission([[1.0, 0.0], [-1.0, 1.0]], Iam=[0, 0.05], Fvm=[0, 0.1], Fcm=[0, Fcm])
    return double_pendulum(Ia=[0.1, 0.1], Fv=[0.05, 0.05], Fc=Fc).with_transmission(K)


@pytest.mark.parametrize("Fc", [(0.0, 0.0), (0.3, 0.2)])
def test_shafts_of_coupled_motors_stick(Fc):
    model = coupled_wrist(Fc=Fc)
    sim = simulate(model, [-0.7, 0.5], [0.0, 0.0], t=np.linspace(0.0, 5.0, 251))
    assert np.abs(holds(model, sim)).max() < 1e-9
    assert sim.relative_drift < 1e-8
    assert any(e.motor and e.kind is KINDS.STUCK for e in sim.events)
    w = model.transmission.weights[1]
    if any(Fc):
        assert sim.sticking[-1].all()  # all three hold: one more than there are joints
        assert np.abs(rm.gravity_torque(model, sim.q[-1])).max() > 0.05
        assert not sim.v[-1].any()
    else:
        slips = np.abs(sim.v @ w) > 1e-6
        dry = (np.sign(sim.v @ w) * 0.5)[:, None] * w
        viscous = sim.v @ model.drive_matrices.viscous
        assert np.allclose(sim.friction[slips], (viscous + dry)[slips], atol=1e-10)


def test_more_friction_than_joints_holds_and_breaks_away():
    model = coupled_wrist().with_gravity((0, 0, 0))
    sim = simulate(model, [0, 0], [0, 0], lambda t, q, v: [0.0, 0.2 * t], np.linspace(0, 6, 121))
    assert sim.events
    assert sim.events[0].kind is KINDS.BROKE_AWAY
    # joint 2 has 0.2 of its own, and 0.5 of the shaft that is carried on by joint 1: at most 0.3
    # of it is held there, the rest against the shaft
    assert sim.events[0].t == pytest.approx(0.5 / 0.2, abs=1e-6)
    assert np.abs(holds(model, sim)).max() < 1e-9


# --- the motion against the models ---------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_motion_fits_the_inverse_model(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=5, tree=seed % 2 == 1, fixed=seed % 3 == 1, drive=True,
                         transmission=seed % 3 == 2)  # fmt: skip
    q, v, _ = random_state(model, rng)
    force = rng.normal(size=6)
    t = np.linspace(0.0, 0.4, 21)
    A, B = rng.normal(size=(2, model.n))
    sim = simulate(model, q, v, lambda t, q, v: A * np.sin(5 * t) - B * q - v, t, force)
    assert sim.status is SimulationStatus.FINISHED
    assert np.array_equal(sim.t, t)
    size = np.abs(sim.tau).max() + np.abs(sim.friction).max() + 10.0
    assert np.abs(holds(model, sim, force)).max() < 1e-9 * size
    assert sim.relative_drift < 1e-8
    moving = ~sim.sticking.any(axis=1) & (np.abs(sim.v) > 1e-6).all(axis=1)
    a = rm.ddm(model, sim.q[moving], sim.v[moving], sim.tau[moving], wrench=force)
    assert np.abs(a - sim.a[moving]).max(initial=0.0) < 1e-8 * np.abs(sim.a).max()


def test_friction_models_beside_the_drives():
    t, rail = np.linspace(0.0, 2.0, 41), slider()

    def push(t, q, v):
        return [0.5 * np.sin(3 * t)]

    own = simulate(slider(Fv=[0.4], Fc=[1.0]), [0.0], [0.9], push, t)
    model = FrictionSum((ViscousFriction([0.4]), CoulombFriction([1.0])))
    given = simulate(rail, [0.0], [0.9], push, t, friction=model)
    assert np.allclose(own.q, given.q, atol=1e-10)
    assert np.array_equal(own.sticking, given.sticking)
    assert own.sticking[-1, 0]
    # Stribeck: static friction first, then less
    falling = StribeckFriction(Fv=[0.0], Fc=[1.0], Fs=[2.0], vs=[0.05])
    slow = simulate(rail, [0.0], [0.0], lambda t, q, v: [2.0 * t], t=t, friction=falling)
    assert [e.kind for e in slow.events] == [KINDS.BROKE_AWAY]
    assert slow.events[0].t == pytest.approx(1.0, abs=1e-8)
    assert 0.8 < slow.v[-1, 0] < 1.0  # 0.5 m/s with Fc = 2 always, 1 m/s with Fc = 1
    creeping = simulate(pendulum(Fc=[8.0]), [0.0], [0.0], t=1.0, smoothing=[0.01], method="Radau")
    # tanh(v / w) = load / Fc, where it has crept to
    weight = rm.gravity_torque(pendulum(), creeping.q[-1])[0]
    assert creeping.v[-1, 0] == pytest.approx(-0.01 * np.arctanh(weight / 8.0), rel=1e-4)


# --- energy and ends -----------------------------------------------------------------------------


def test_falling_arms_keep_their_energy_and_return_when_time_is_reversed():
    for model, q, T in ((double_pendulum(), [0.0, 0.3], 2.0), (rm.load("panda"), [0.2] * 7, 0.5)):
        sim = simulate(model, q, np.zeros(model.n), t=T)
        assert sim.kinetic.max() > 1.0
        assert sim.relative_drift < 1e-9
        assert np.abs(sim.energy - sim.energy[0]).max() < 1e-9 * np.ptp(sim.potential)
        back = simulate(model, sim.q[-1], -sim.v[-1], t=T)
        assert np.abs(back.q[-1] - q).max() < 1e-6
    resting = simulate(pendulum(), [-np.pi / 2], [0.0], t=1.0)  # moves by rounding errors
    assert resting.relative_drift < 1e-15


def test_a_limit_stops_the_motion():
    free = simulate(slider(), [0.0], [1.0], t=[0.0, 2.0])
    assert free.q[-1, 0] == pytest.approx(2.0)
    for q, v, end in ((0.0, 1.0, 0.5), (0.5, 1.0, 0.0), (0.5, -1.0, 1.0)):
        sim = simulate(slider(), [q], [v], t=1.0, stop_at_limits=True)
        stopped = sim.status is SimulationStatus.LIMIT_REACHED
        assert stopped == ("joint 1 reaches a limit" in str(sim)) == (end < 1.0)
        assert sim.t[-1] == pytest.approx(end, abs=1e-9)


def test_ends_before_the_end_have_a_status():
    few = simulate(double_pendulum(), [0, 0], [0, 0], t=10.0, max_evaluations=100)
    assert few.status is SimulationStatus.NOT_CONVERGED
    assert 0 < few.t[-1] < 10.0
    wild = simulate(slider(), [0.0], [1.0], lambda t, q, v: [np.exp(min(q[0], 700.0))], t=10.0)
    assert wild.status is SimulationStatus.STEP_TOO_SMALL
    assert np.isfinite(wild.q).all()
    signs = cycle([5.0, -5.0])  # a torque that is another one at each evaluation
    torn = simulate(slider(Fc=[1.0]), [0.0], [0.0], lambda t, q, v: [next(signs)], t=1.0)
    assert torn.status is SimulationStatus.CHATTERING
    # parameters of no body: the mass matrix vanishes on the way, and nothing is followed past it
    ghost = rm.RobotModel.from_table(
        rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 1.0]),
        rm.InertialParameters(
            [[0, 0, 0, 0, 0, 0.5, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1.0, 1.0, 0, 0, 0]]
        ),
        gravity=(0, 0, 0),
    )
    lost = simulate(ghost, [0.0, np.pi / 2], [0.0, -1.0], t=10.0)
    assert lost.status in (SimulationStatus.SINGULAR, SimulationStatus.STEP_TOO_SMALL)
    assert np.linalg.eigvalsh(rm.mass_matrix(ghost, lost.q)).min() > 0.0


# --- parts and maps ----------------------------------------------------------------------------


def test_parts_of_the_torque_make_the_whole(rng):
    model = random_model(rng, f=5, tree=True, fixed=True, drive=True, transmission=True)
    q, v, a = random_state(model, rng, 3, 2)
    w, friction = rng.normal(size=(2, 6)), CoulombFriction(np.ones(model.n))
    parts = torque_parts(model, q, v, a, w, friction=friction)
    whole = rm.idm(model, q, v, a, wrench=w, friction=friction)
    assert np.abs(parts.total - whole).max() < 1e-12 * np.abs(whole).max()
    assert np.allclose(parts.inertia, np.einsum("...ij,...j", rm.mass_matrix(model, q), a))
    assert np.array_equal(parts.gravity, rm.gravity_torque(model, q))
    assert np.allclose(torque_parts(model, q, 2 * v, a).coriolis, 4 * parts.coriolis)
    assert not torque_parts(model, q, v, a, drive=False).friction.any()


def test_maps_over_joints():
    arm, panda = rm.load("rx90"), rm.load("panda")
    face = dynamics_map(arm, (1, 2), q=np.full(6, 0.1), ranges=[[-1, 1], [0, 2]], samples=(3, 4))
    q = [0.1, 0.0, 2 / 3, 0.1, 0.1, 0.1]
    assert np.allclose(face.mass[1, 1], rm.mass_matrix(arm, q))
    assert np.allclose(face.gravity[1, 1], rm.gravity_torque(arm, q), atol=1e-12)
    assert np.allclose(np.einsum("...ii->...i", face.coupling), 1.0)
    assert np.abs(face.coupling).max() <= 1.0 + 1e-12
    with pytest.warns(InertiaWarning, match="no masses"):
        assert np.isnan(dynamics_map(rm.load("planar_2r"), 0, samples=2).coupling).all()
    for model, j, ends in (
        (panda, 3, [panda.lower[3], panda.upper[3]]), (pendulum(), 0, [-np.pi, np.pi]),
    ):  # fmt: skip
        assert dynamics_map(model, j, samples=2).ranges[0] == pytest.approx(ends)
    with pytest.raises(InvalidValueError, match="whole numbers"):
        dynamics_map(arm, (1, 2), samples=(3, 2.5))
    for joints in ([[0, 1]], [0.0], [0, 0], 6, -1, []):
        with pytest.raises(InvalidValueError, match="joints"):
            dynamics_map(arm, joints)


# --- feedback ----------------------------------------------------------------------------------


class WithIntegral:
    """A law of a slider of 2 kg whose closed loop has a triple pole at -w."""

    def __init__(self, w):
        self.w, self.state0 = w, np.array([0.5])

    def command(self, t, q, v, x):
        return -2.0 * (3.0 * self.w**2 * q + 3.0 * self.w * v + self.w**3 * x)

    def rate(self, t, q, v, x):
        return q


def test_the_state_of_a_control_is_integrated_along():
    w, t = 3.0, np.linspace(0.0, 2.0, 9)
    sim = simulate(slider(), [0.0], [0.0], WithIntegral(w), t)
    # x''' + 3 w x'' + 3 w^2 x' + w^3 x = 0 with x(0) = 1/2 and x'(0) = x''(0) = 0
    exact = 0.5 * (1.0 + w * t + 0.5 * (w * t) ** 2) * np.exp(-w * t)
    assert np.allclose(sim.state[:, 0], exact, atol=1e-10)
    assert np.allclose(sim.q[:, 0], -0.25 * w**3 * t**2 * np.exp(-w * t), atol=1e-10)
    assert sim.relative_drift < 1e-9
    assert simulate(slider(), [0.0], [0.0], [1.0], t).state.shape == (9, 0)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1, 0.23])
def test_a_sampled_control_holds_its_torque_and_advances_by_euler(delay):
    h, law, t = 0.05, WithIntegral(1.5), np.linspace(0.0, 1.0, 21)
    sim = simulate(slider(), [0.2], [0.0], law, t, period=h, delay=delay)
    # exact motion under held forces, on the grid of samples and of delayed torques
    grid = np.unique(np.round(np.concatenate([t, t + delay]), 9))
    sent, q, v, x, tau, found = [], 0.2, 0.0, law.state0, 0.0, []
    for k, now in enumerate(grid[grid <= 1.0]):
        if np.isclose(t, now).any():
            sent.append((now + delay, law.command(now, q, v, x)[0]))
            found.append((q, v, x[0]))
            x = x + h * q
        tau = next((u for start, u in reversed(sent) if start <= now + 1e-9), 0.0)
        step = grid[k + 1] - now if k + 1 < grid.size else 0.0
        q, v = q + step * v + 0.25 * step**2 * tau, v + 0.5 * step * tau
    q, v, x = np.array(found)[:-1].T
    assert np.allclose(sim.q[:-1, 0], q, atol=1e-11)
    assert np.allclose(sim.v[:-1, 0], v, atol=1e-11)
    assert np.allclose(sim.state[:-1, 0], x, atol=1e-11)
    late = int(np.ceil(delay / h - 1e-9))
    assert (sim.tau[:late] == 0.0).all()
    now = [law.command(0.0, *state) for state in zip(sim.q, sim.v, sim.state, strict=True)]
    assert np.allclose(sim.tau[late:-1], now[: 20 - late], atol=1e-11)
    assert sim.relative_drift < 1e-9


# --- mistakes ----------------------------------------------------------------------------------


class Broken(WithIntegral):
    def rate(self, t, q, v, x):
        return [np.nan]


def broken(t, q, v):
    return [1.0 / (t - t)]


MIMICS = double_pendulum().with_transmission(rm.Transmission([[1.0, 0.0], [1.0, 0.0]]))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"q0": [[0.0]]}, ShapeError, "q0: expected shape"),
        ({"t": [0.0, 1.0, 1.0]}, InvalidValueError, "ascending times, got 1.0 s and then 1.0 s"),
        ({"control": lambda t, q, v: [1.0, 2.0]}, ShapeError, r"at t = 0 s: expected shape \(1,\)"),
        ({"control": broken}, ZeroDivisionError, "division"),
        ({"v0": [1e200]}, InvalidValueError, r"v0: the accelerations or the energy of"),
        ({"friction": CoulombFriction([-1.0])}, InvalidValueError, "of joint 1 is negative"),
        ({"method": "euler"}, InvalidValueError, "method: expected one of 'dop853'"),
        ({"model": rm.load("planar_2r")}, SingularMassMatrixError, "moves no inertia"),
        ({"model": slider().with_inertia(rm.InertialParameters([[0] * 9 + [-1.0]]))}, InertiaError,
         "link 1: negative mass -1 kg"),
        ({"model": MIMICS}, InvalidValueError, "joints that mimic others, which simulate does"),
        ({"control": [1.0], "delay": 0.1}, InvalidValueError, "only a sampled control is delayed"),
        ({"control": WithIntegral(1.0), "model": slider(), "period": 0.1, "delay": 2.0},
         InvalidValueError, "less than the duration 1 s, got 2 s"),
        ({"period": 0.1}, InvalidValueError, "no control to sample"),
        ({"model": slider(), "control": Broken(1.0)}, InvalidValueError,
         r"control.rate at t = 0 s: expected finite"),
        ({"q0": [0.6], "model": slider(), "stop_at_limits": True}, InvalidValueError,
         r"joint 1 starts at 0\.6, outside its limits"),
        ({"stop_at_limits": True}, InvalidValueError, "stop_at_limits: no joint of .* finite lim"),
    ],
)  # fmt: skip
def test_mistakes_are_named(arguments, error, message):
    model = arguments.get("model", pendulum())
    given = {"model": model, "q0": np.zeros(model.n), "v0": np.zeros(model.n), "t": 1.0} | arguments
    with pytest.raises(error, match=message) as caught:
        simulate(**given)
    if arguments.get("control") is broken:
        assert caught.value.__notes__ == ["Raised by control at t = 0 s."]
