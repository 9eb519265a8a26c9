"""Flexible robots at rest, in motion and under control: published values and closed forms."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from test_flexible import INF, ONE, PIVOT, close, random_arm

import robotmodels as rm
from robotmodels import DHTable, DriveParameters, InertialParameters, RobotModel, flexible, se3
from robotmodels.flexible import (
    DeflectionStatus,
    FlexibleMotionStatus,
    RestStatus,
    SpinStatus,
    TipStatus,
)


def swinging(**options):
    """One beam that turns about a vertical axis."""
    return flexible.FlexibleRobot(
        PIVOT, {1: flexible.beam(1.0, EI=(INF, 9.0), hub=0.1, modes=2, **options)}
    )


# --- statics --------------------------------------------------------------------------


def test_elastica_of_bisshopp_and_drucker():
    for load, y in ((1, 0.30172), (2, 0.49346), (5, 0.71379), (10, 0.81061)):
        found = flexible.elastica(2.0, 3.0, force=load * 3.0 / 4.0)
        assert found.tip[1, 3] / 2.0 == pytest.approx(y, abs=2e-5)
        # the first integral of the equation: the lever of the force
        assert found.tip[0, 3] / 2.0 == pytest.approx(np.sqrt(2.0 * np.sin(found.angle[-1]) / load))
        steps = np.linalg.norm(np.diff(found.points, axis=0), axis=1)
        assert steps.sum() == pytest.approx(2.0, rel=1e-4)
    found = flexible.elastica(2.0, 3.0, moment=2 * np.pi * 3.0 / 2.0)  # bent to a circle
    np.testing.assert_allclose(found.tip, np.eye(4), atol=1e-9)
    assert found.angle[-1] == pytest.approx(2 * np.pi)
    mirrored = flexible.elastica(1.0, 1.0, force=-2.0, moment=0.5)
    np.testing.assert_allclose(flexible.elastica(1, 1, 2.0, -0.5).tip[1, 3], -mirrored.tip[1, 3])


def test_modes_bend_as_the_elastica_until_a_tenth_of_the_length():
    arm = flexible.FlexibleRobot(PIVOT, {1: flexible.beam(1.0, EI=(INF, 2.0), modes=4)})
    loads = np.array([0.1, 0.3, 0.55, 1.5])
    wrench = np.zeros((4, 6))
    wrench[:, 1] = -loads  # on the environment
    found = flexible.static_deflection(arm, [0.0], wrench)
    exact = [flexible.elastica(1.0, 2.0, force=load).tip[1, 3] for load in loads]
    tips = flexible.dgm(arm, np.zeros((4, 1)), found.e)[:, 1, 3]
    np.testing.assert_allclose(tips[:3], exact[:3], rtol=1e-2)
    small, large = DeflectionStatus.SMALL, DeflectionStatus.LARGE
    assert found.status.tolist() == [small, small, small, large]
    np.testing.assert_allclose(found.tau[:2, 0], -loads[:2], rtol=2e-2)


def test_equilibrium_is_where_nothing_accelerates(rng):
    arm = random_arm(rng, joint_stiffness=200.0)
    q, w = rng.normal(size=(2, arm.n)), rng.normal(size=(2, 6))
    found = flexible.static_deflection(arm, q, w)
    a, ea = flexible.ddm(arm, q, found.e, 0 * q, None, found.tau, w)  # offsets included
    assert max(np.abs(a).max(), np.abs(ea).max()) < 1e-6
    # beyond the load of buckling by Euler it is unstable
    loads = np.array([[0.99], [1.01]]) * np.pi**2 * 9.0 / 4.0 * np.eye(6)[0]
    found = flexible.static_deflection(swinging(stiffening=True), [0.0], loads)
    assert found.status.tolist() == [DeflectionStatus.SMALL, DeflectionStatus.UNSTABLE]


# --- frequencies, poles and zeros -----------------------------------------------------


def test_segments_approach_the_beam_with_the_square_of_their_number():
    tip, pose = (0.3, (0.1, 0, 0), 0.02), se3.translation(0.1, 0.2, 0.3)
    pose[:3, :3] = rm.dgm(rm.load("rx90"), np.ones(6))[:3, :3]
    model = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 2], d=[0, 0.3]))
    link = flexible.beam(
        1.0, (2.0, 1.0), GJ=1.0, hub=0.1, modes=3, tip=tip, pose=pose, gyration=0.01
    )
    arm = flexible.FlexibleRobot(model, {2: link})
    exact = flexible.natural_frequencies(arm, [0.4])[:5]
    errors = []
    for count in (10, 20, 40):
        segmented, stiffness = flexible.lumped(arm, count)
        q = np.where(stiffness == 0.0, 0.4, 0.0)
        close(rm.dgm(segmented, q), flexible.dgm(arm, [0.4]), 1e-12)
        free = stiffness > 0.0
        M = rm.mass_matrix(segmented, q)
        close(M[0, 0], flexible.mass_matrix(arm, [0.4])[0, 0], 1e-9)
        K = np.diag(stiffness)[np.ix_(free, free)]
        found = np.sqrt(eigh(K, M[np.ix_(free, free)], eigvals_only=True)[:5])
        errors.append(np.abs(found / exact - 1.0))
    assert (errors[2][:3] < 1e-3).all()
    np.testing.assert_allclose(np.log2(errors[0][:3] / errors[1][:3]), 2.0, atol=0.3)


def test_zeros_of_the_hub_are_the_clamped_frequencies():
    found = flexible.linearize(ONE, [0.3])
    w = ONE.links[1].frequencies
    np.testing.assert_allclose(np.sort(-(found.zeros**2).real)[::2], w**2, rtol=1e-6)
    free = flexible.natural_frequencies(ONE, [0.3], "free")
    np.testing.assert_allclose(np.sort(found.poles.imag)[-2:], free[1:], rtol=1e-8)


def test_zeros_of_the_tip_lie_in_the_right_half_plane():
    exact = 4 * brentq(lambda x: np.tan(x) + np.tanh(x), 2.0, 2.9) ** 4  # EI / (rho L^4) = 1
    for modes in (1, 2, 6):
        beam = flexible.beam(1.0, EI=(INF, 1.0), hub=0.1, modes=modes)
        arm = flexible.FlexibleRobot(PIVOT, {1: beam})
        squared = flexible.linearize(arm, [0.0], "tip").zeros ** 2
        if modes < 3:
            assert (np.abs(squared.imag) < 1e-9).all()
            assert (squared.real > 0.0).all()
    real = squared.real[np.abs(squared.imag) < 1e-6]
    assert real[real > 0].min() == pytest.approx(exact, rel=1e-3)


def test_a_linear_model_is_the_derivative_of_the_accelerations(rng):
    arm = random_arm(rng, joint_stiffness=300.0, joint_damping=0.2, modal_damping=0.05)
    arm = flexible.FlexibleRobot(
        arm.model.with_drive(DriveParameters(*np.ones((2, 3)), *np.zeros((2, 3)))), arm.links,
        arm.joint_stiffness, arm.joint_damping, arm.modal_damping,
    )  # fmt: skip
    q, n, k = rng.normal(size=3), 3, 3 + arm.m
    found = flexible.linearize(arm, q)
    hold = flexible.static_deflection(arm, q).tau
    x, h = np.concatenate([q, found.e, np.zeros(k)]), 1e-6

    def rate(x, tau=hold):
        parts = np.split(x, [n, k, k + n])
        return np.concatenate([x[k:], *flexible.ddm(arm, *parts, tau)])

    A = np.stack([(rate(x + h * u) - rate(x - h * u)) / (2 * h) for u in np.eye(2 * k)], -1)
    close(found.A, A, 1e-6)
    B = np.stack([(rate(x, hold + u) - rate(x, hold - u)) / 2 for u in np.eye(n)], -1)
    close(found.B, B, 1e-9)
    assert found.C.shape == (n, 2 * k)
    close(np.prod(found.poles - 10.0), np.linalg.det(A - 10.0 * np.eye(2 * k)), 1e-5)


# --- motion --------------------------------------------------------------------------


@pytest.mark.parametrize("stiffening", [False, True])
def test_a_free_body_keeps_its_momenta_and_energy(stiffening):
    tip = (0.2, (0.1, 0.05, 0), 0.02)
    link = flexible.beam(1.0, (4.0, 6.0), tip=tip, modes=1, stiffening=stiffening, gyration=0.05)
    found = flexible.free_body(link, [0.02, 0.01], [0.1, 0.2, 0.3, 0.2, 0.1, 0.6], 10.0)
    assert found.status == FlexibleMotionStatus.FINISHED
    assert found.energy_drift < 1e-8
    assert found.momentum_drift < 1e-8


def test_modes_bent_beyond_the_second_order_of_stiffening_are_named():
    link = flexible.beam(1.0, (4.0, 6.0), tip=0.2, modes=2, stiffening=True, gyration=0.05)
    found = flexible.free_body(link, 0.05 * np.ones(4), [0, 0, 0, 0.1, 0.2, 0.3], 1.0)
    assert found.status == FlexibleMotionStatus.LARGE_DEFLECTION
    arm = flexible.FlexibleRobot(PIVOT, {1: link})
    e = [[0.0] * 4, [0.3] * 4]
    status = flexible.ddm(arm, np.zeros((2, 1)), e, np.zeros((2, 1)), None, [0.0]).status
    assert status.tolist() == [SpinStatus.STIFF, SpinStatus.LARGE_DEFLECTION]
    for law in (None, lambda t: [0.0]):
        bent = flexible.simulate(arm, [0.0], control=law, e0=0.1 * np.ones(4))
        assert bent.status == FlexibleMotionStatus.LARGE_DEFLECTION


def test_an_arm_keeps_the_balance_of_energy_and_momenta():
    model = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], alpha=[0, 1], d=[0, 1]))
    links = {1: flexible.beam(1.0, (20.0, 30.0), modes=1, gyration=0.05), 2: swinging().links[1]}
    arm = flexible.FlexibleRobot(model, links)
    free = flexible.simulate(arm, [0.0, 0.0], [0.3, 0.5], t=0.5, rtol=1e-11, atol=1e-13)
    assert free.status == FlexibleMotionStatus.FINISHED
    assert np.ptp(free.energy) < 1e-8 * np.abs(free.kinetic).max()
    model = model.with_drive(DriveParameters(*np.full((2, 2), 0.2), *np.zeros((2, 2))))
    arm = flexible.FlexibleRobot(model, links, [INF, 20.0], 0.1, 0.05)
    loaded = flexible.simulate(
        arm, [0.0, 0.1], control=lambda t, q, v, e, e_v: -q - v, t=np.linspace(0, 0.5, 7),
        wrench=[1, 2, 3, 0.1, 0.2, 0.3], e0=0.01 * np.ones(arm.m), e_v0=np.zeros(arm.m),
    )  # fmt: skip
    assert loaded.q.shape == (7, 2)
    assert loaded.energy_drift < 1e-7
    assert loaded.momentum_drift < 1e-7
    few = flexible.simulate(arm, [0.0, 0.0], t=1.0, max_evaluations=50)
    assert few.status == FlexibleMotionStatus.NOT_CONVERGED
    assert few.t[-1] < 1.0


def test_constant_torques_move_an_arm_as_functions_of_time_do(rng):
    """Compiled steps beside SciPy's, with springs, friction and damping, at steps and at times."""
    for _ in range(3):
        arm = random_arm(rng, joint_stiffness=[INF, 30.0, INF], joint_damping=0.2)
        q0, v0, tau = rng.normal(size=(3, 3))
        start = {"e0": 0.02 * rng.normal(size=arm.m), "e_v0": rng.normal(size=arm.m)}
        for t in (0.1, np.linspace(0.3, 0.4, 23), [0.0, 0.1], [0.2]):
            done = []
            runs = [
                flexible.simulate(arm, q0, v0, law, t, **start, progress=done.append)
                for law in (tau, lambda t, tau=tau: tau)
            ]
            assert [run.status for run in runs] == [FlexibleMotionStatus.FINISHED] * 2
            assert done[-1:] == ([1.0] if np.ptp(t) or np.ndim(t) == 0 else [])
            if np.ndim(t):
                np.testing.assert_array_equal(runs[0].t, t)
                for name in ("q", "v", "e", "e_v", "tau", "work", "impulse"):
                    close(getattr(runs[0], name), getattr(runs[1], name), 1e-6)
            assert runs[0].t[-1] == runs[1].t[-1]
            close(runs[0].e[-1], runs[1].e[-1], 1e-6)
            assert runs[0].energy_drift < 1e-6
            assert runs[0].momentum_drift < 1e-6


@pytest.mark.parametrize(
    ("options", "v0", "torque", "more", "status"),
    [
        ({}, 3.0, 1.0, {"max_evaluations": 500}, FlexibleMotionStatus.NOT_CONVERGED),
        ({}, 15.0, 0.1, {"t": 3.0}, FlexibleMotionStatus.SOFTENED),
        ({}, 0.0, 1e5, {}, FlexibleMotionStatus.SOFTENED),
        ({"stiffening": True}, 0.0, 500.0, {"rtol": 1e-6}, FlexibleMotionStatus.DIVERGED),
    ],
)
def test_constant_torques_end_with_the_status_of_functions(options, v0, torque, more, status):
    arm = swinging(**options)
    runs = [
        flexible.simulate(arm, [0.0], [v0], law, **more) for law in ([torque], lambda t: [torque])
    ]
    assert [run.status for run in runs] == [status] * 2
    assert abs(runs[0].t[-1] - runs[1].t[-1]) < 0.05
    assert np.isfinite(runs[0].e).all()


@pytest.mark.nightly
def test_spin_up_of_kane_ryan_and_banerjee():
    """Their beam of 8 m, brought to 6 rad/s in 15 s; its first frequency is 2.9 rad/s."""
    plain, stiff = (
        flexible.beam(8.0, EI=(INF, 7e10 * 8.2181e-9), density=2766.67 * 7.2968e-5, stiffening=on)
        for on in (False, True)
    )
    speed, T = 6.0, 15.0

    def law(t):
        s = min(t / T, 1.0)
        turn = s - np.sin(2 * np.pi * s) / (2 * np.pi)
        angle = T * (s * s / 2 + (np.cos(2 * np.pi * s) - 1) / (4 * np.pi**2)) + max(t - T, 0.0)
        return [speed * angle], [speed * turn], [speed / T * (1 - np.cos(2 * np.pi * s))]

    found = []
    for link in (plain, stiff):
        arm = flexible.FlexibleRobot(PIVOT, {1: link})
        control = flexible.joint_tracking(arm, law, 100.0, 20.0)
        found.append(
            flexible.simulate(arm, [0.0], control=control, t=np.linspace(0, 20, 101), rtol=1e-7)
        )
    tips = [run.e @ link.tip.Phi[:, 1] for run, link in zip(found, (plain, stiff), strict=True)]
    assert np.abs(tips[0]).max() > 8.0  # without bound
    assert found[0].status == FlexibleMotionStatus.SOFTENED
    assert found[1].status == FlexibleMotionStatus.FINISHED
    assert 0.4 < np.abs(tips[1]).max() < 0.8  # 0.6 m published
    assert np.abs(tips[1][-20:]).max() < 0.05 * np.abs(tips[1]).max()
    # and by the status of the direct model, at the link's own speed
    arm, w = flexible.FlexibleRobot(PIVOT, {1: plain}), plain.frequencies[0]
    status = flexible.ddm(arm, [[0.0], [0.0]], None, [[0.99 * w], [1.01 * w]], None, [0.0]).status
    assert status.tolist() == [SpinStatus.STIFF, SpinStatus.SOFTENED]


# --- control --------------------------------------------------------------------------


def test_shapers_have_their_closed_forms():
    zv, zvd = (flexible.input_shaper(3.0, kind=kind) for kind in ("ZV", "ZVD"))
    errors = np.linspace(-0.3, 0.3, 7)
    np.testing.assert_allclose(
        zv.residual(errors), np.abs(np.cos(np.pi / 2 * (1 + errors))), atol=1e-14
    )
    np.testing.assert_allclose(
        zvd.residual(errors), np.cos(np.pi / 2 * (1 + errors)) ** 2, atol=1e-14
    )
    for damping in (0.0, 0.2):
        for kind in ("ZV", "ZVD"):
            shaper = flexible.input_shaper(3.0, damping, kind)
            assert shaper.residual() < 1e-15
            assert shaper.amplitudes.sum() == pytest.approx(1.0)
        assert shaper.residual(1e-5) < 1e-9  # its derivative is zero as well
    stairs = zvd.shaped(lambda t: (t >= 0.0).astype(float))(zvd.times + 1e-9)
    np.testing.assert_allclose(stairs, [0.25, 0.75, 1.0])


def test_laws_of_the_joints_end_at_the_goal_and_decay_as_given():
    beam = flexible.beam(1.0, (INF, 30.0), hub=0.1)
    arm = flexible.FlexibleRobot(PIVOT.with_gravity((0, -9.81, 0)), {1: beam}, modal_damping=0.05)
    rest = flexible.static_deflection(arm, [0.0]).e
    law = flexible.regulator(arm, 20.0, 8.0, [0.5])
    run = flexible.simulate(arm, [0.0], control=law, t=6.0, e0=rest, rtol=1e-7)
    assert abs(run.q[-1, 0] - 0.5) < 1e-4
    np.testing.assert_allclose(run.e[-1], flexible.static_deflection(arm, [0.5]).e, atol=1e-5)
    arm, motion = swinging(stiffening=True), rm.trajectories.quintic([0.0], [1.0], duration=1.0)
    law, t = flexible.joint_tracking(arm, motion, 100.0, 20.0), np.linspace(0.0, 1.0, 21)
    run = flexible.simulate(arm, [0.1], control=law, t=t)
    error = run.q[:, 0] - motion.q(t)[:, 0]
    np.testing.assert_allclose(error, 0.1 * (1 + 10 * t) * np.exp(-10 * t), atol=1e-7)


@pytest.mark.parametrize("kind", ["link", "joint"])
def test_motion_from_rest_to_rest_leaves_no_vibration(kind):
    gravity = (0, -9.81, 0)
    if kind == "link":
        beam = flexible.beam(1.0, EI=(INF, 30.0), hub=0.1, modes=2)
        arm = flexible.FlexibleRobot(PIVOT.with_gravity(gravity), {1: beam})
    else:
        body = InertialParameters.from_com([1.0], [[0.3, 0, 0]], [0.1 * np.eye(3)])
        drive = DriveParameters(Ia=[0.5], Fv=[0.1], Fc=[0], offset=[0])
        model = RobotModel.from_table(
            DHTable(antecedent=[0], sigma=[0]), body, drive, gravity=gravity
        )
        arm = flexible.FlexibleRobot(model, {}, joint_stiffness=50.0)
    plan = flexible.rest_to_rest(arm, [0.0], [1.0], 0.7)
    assert plan.status == RestStatus.AT_REST
    t = np.array([0.0, 0.35, 0.7, 1.2])
    start, exact = plan.elastic(0.0)[0], {"rtol": 1e-12, "atol": 1e-14}
    run = flexible.simulate(
        arm, [0.0], control=lambda t, q, v: plan.torque(t), t=t, e0=start, **exact
    )
    peak = np.abs(plan.elastic(np.linspace(0, 0.7, 99))[0] - plan.elastic(0.7)[0]).max(axis=0)
    assert np.abs(run.q[2:] - 1.0).max() < 1e-8
    assert (np.abs(run.e[2:] - plan.elastic(0.7)[0]) < 1e-8 * peak).all()
    assert plan.torque(t).shape == (4, 1)


def test_tip_is_tracked_with_preview_and_causal_inversion_is_refused():
    arm = swinging()
    motion = rm.trajectories.quintic([0.0], [0.3], duration=1.0)
    refused = flexible.tip_tracking(arm, motion, method="causal")
    assert refused.status == TipStatus.NON_MINIMUM_PHASE
    assert refused.zeros.real.max() > 0.0
    plan = flexible.tip_tracking(arm, motion)
    assert plan.status == TipStatus.FOUND
    assert plan.t[0] <= -plan.preview < 0.0
    assert np.abs(plan.tau[plan.t < 0.0]).max() > 0.01 * np.abs(plan.tau).max()  # it acts before
    t = np.linspace(plan.t[0], plan.t[-1], 41)
    run = flexible.simulate(
        arm, plan.q[0], plan.v[0], plan.control(20.0, 2.0), t, e0=plan.e[0], e_v0=plan.e_v[0]
    )
    tip = flexible.dgm(arm, run.q, run.e)[:, :3, 3]
    angle = np.arctan2(tip[:, 1], tip[:, 0])
    assert np.abs(angle - motion.q(np.clip(t, 0, 1))[:, 0]).max() < 1e-4


@pytest.mark.parametrize("ends", [([0.5, -0.8], [0.7, -0.4]), ([0.0, 1.5], [0.6, 0.8])])
def test_tip_of_two_links_under_gravity_is_tracked(ends):
    """At the first pair of ends the zeros are real and almost imaginary, at the other complex."""
    table = DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5])
    link = flexible.beam(0.5, EI=(INF, 10.0), density=0.2, hub=0.1, tip=0.1)
    model = RobotModel.from_table(table, gravity=(0, -9.81, 0))
    arm = flexible.FlexibleRobot(model, {1: link, 2: link}, modal_damping=0.02)
    motion = rm.trajectories.quintic(*ends, duration=1.0)
    plan = flexible.tip_tracking(arm, motion)
    assert plan.status == TipStatus.FOUND
    assert np.abs(plan.e[0] - plan.e).max() > 0.003
    rigid = model.with_tool(se3.translation(0.5, 0, 0))
    wanted = rm.dgm(rigid, motion.q(np.clip(plan.t, 0.0, 1.0)))
    assert np.abs(flexible.dgm(arm, plan.q, plan.e) - wanted)[:, :2, 3].max() < 1e-9
    found = flexible.ddm(arm, plan.q, plan.e, plan.v, plan.e_v, plan.tau)
    for x, acceleration in zip((plan.q, plan.e), found, strict=True):
        close(acceleration[1:-1], np.diff(x, 2, axis=0) / (plan.t[1] - plan.t[0]) ** 2, 1e-6)
    close(plan.e[0], flexible.static_deflection(arm, plan.q[0]).e, 1e-5)  # the start is at rest
    # towards a posture with more unstable zeros there is no bounded motion
    other = rm.trajectories.quintic([0.5, -0.8], [0.0, 1.5], duration=1.0)
    assert flexible.tip_tracking(arm, other).status == TipStatus.NOT_FOUND
