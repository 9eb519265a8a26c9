"""Methods that simulate the controlled robot recover what they were made of."""

import importlib
import pickle

import numpy as np
import pytest
from identities.random_robots import random_bodies, random_model

import robotmodels as rm
from robotmodels.drive import DriveParameters, Transmission
from robotmodels.errors import InertiaError, InvalidValueError, ShapeError
from robotmodels.estimation.estimate import EstimateStatus
from robotmodels.identification import Log, choose_processing, equations, reduce_equations
from robotmodels.identification.closed_loop import (
    Controller,
    Didim,
    Instrumental,
    OutputError,
    closed_loop,
    hausman_test,
    simulated_log,
    tuned_controller,
)
from robotmodels.identification.closed_loop.loop import friction_rates, robot_of
from robotmodels.identification.closed_loop.simulation import (
    ClosedLoopSimulator,
    SimulationDivergedError,
    with_enough_steps,
)
from robotmodels.identification.fit import _identifiable
from robotmodels.identification.signals import central_differences
from robotmodels.inertia import InertialParameters


def robot(kind):
    """A robot with drives whose bodies are physical."""
    rng = np.random.default_rng(7)
    if kind == "tx40":
        arm = rm.load("tx40")
        wrist = arm.transmission
        # the shipped model has what was published of the motors; friction so that joints move
        return arm.with_transmission(
            Transmission(
                wrist.matrix, wrist.offset, Iam=[0, 0, 0, 0, 0, 0.01], Fvm=[0, 0, 0, 0, 0, 0.7],
                Fcm=[0, 0, 0, 0, 0, 1.1],
            )
        )  # fmt: skip
    if kind == "rx90":
        arm = rm.load("rx90")
    elif kind == "gantry":
        arm = rm.load("gantry")
        arm = arm.with_inertia(random_bodies(rng, arm.f))
    elif kind == "prismatic":
        arm = random_model(np.random.default_rng(3), f=4, name="prismatic")
        assert 1 in arm.table.sigma
    else:
        arm = random_model(np.random.default_rng(5), f=6, tree=True, fixed=True, name="tree")
        assert 2 in arm.table.sigma
        assert len(set(arm.table.antecedent)) < arm.f
    n = arm.n
    drive = DriveParameters(
        Ia=rng.uniform(0.1, 0.3, n), Fv=rng.uniform(0.5, 2.0, n), Fc=rng.uniform(0.5, 2.0, n),
        offset=rng.uniform(-0.5, 0.5, n),
    )  # fmt: skip
    return arm.with_drive(drive)


def other(arm, seed=1, spread=0.2):
    """A robot of the same kind whose bodies and drives are others, physical still."""
    rng = np.random.default_rng(seed)

    def scaled(x):
        return x * rng.uniform(1.0 - spread, 1.0 + spread, (len(x),) + (1,) * (x.ndim - 1))

    drive = DriveParameters(**{k: scaled(getattr(arm.drive, k)) for k in ("Ia", "Fv", "Fc")},
                            offset=scaled(arm.drive.offset))  # fmt: skip
    out = arm.with_inertia(InertialParameters(scaled(arm.inertia.values))).with_drive(drive)
    if (K := arm.transmission) is not None:
        terms = {k: scaled(getattr(K, k)) for k in ("Iam", "Fvm", "Fcm")}
        out = out.with_transmission(Transmission(K.matrix, K.offset, **terms))
    return out


def motion(n, seconds, dt, rng, size=0.8):
    """References: sums of sines whose velocities are exact."""
    t = np.arange(0.0, seconds, dt)[:, None]
    q, v = np.zeros((len(t), n)), np.zeros((len(t), n))
    for k in range(1, 5):
        w = 2.0 * np.pi * k * 0.35
        c, p = rng.normal(size=n) * size / k, rng.uniform(0, 2 * np.pi, n)
        q += c * np.sin(w * t + p)
        v += c * w * np.cos(w * t + p)
    return q, v


def recorded(kind, seconds=3.0, dt=2e-3, seed=0, substeps=1):
    """A robot, its controller, its log without noise, and how wide its dry friction is at rest."""
    arm = robot(kind)
    q_ref, v_ref = motion(arm.n, seconds, dt, np.random.default_rng(seed))
    # a controller that another robot was the model of: it does not follow too well
    control = tuned_controller(other(arm, 11), q_ref, 4.0, period=dt, feed_forward=False)
    width = dt / substeps * friction_rates(arm, q_ref).dry
    log = simulated_log(arm, control, q_ref, v_ref, dt, width=width, substeps=substeps)
    return arm, control, log, width


def problem(arm, log, width=0.0, decimation=1):
    choices = choose_processing(
        log, decimation=decimation, dead_band=width, edges=0.0, filtered=False
    )
    base = rm.base_parameters(arm, drive=True)
    system = equations(base, log, choices)
    system, factors, _, _ = _identifiable(system, reduce_equations(system))
    return system, factors


def values_of(system, arm):
    found = dict(zip(system.base.names, system.base.values(arm), strict=True))
    return np.array([found[name] for name in system.names])


def off(found, truth, factors):
    """Largest error, as a part of the value that would explain the whole torque."""
    R = np.vstack(factors.factors)
    size = np.linalg.norm(R[:, -1]) / np.linalg.norm(R[:, :-1], axis=0)
    return float((np.abs(found - truth) / np.maximum(size, np.abs(truth))).max())


KINDS = ("rx90", "gantry", "prismatic", "tree", "tx40")


@pytest.mark.parametrize("kind", KINDS)
def test_simulated_accelerations_are_those_of_the_direct_model(kind):
    arm, control, log, width = recorded(kind, 0.3, substeps=2)
    fast = (np.abs(log.v) > width).all(axis=1)
    if arm.transmission is not None:
        fast &= (np.abs(log.v @ arm.transmission.weights.T) > width).all(axis=1)
    assert fast.sum() > 20
    a = rm.ddm(arm, log.q[fast], log.v[fast], log.tau[fast])
    assert np.allclose(log.a[fast], a, rtol=1e-9, atol=1e-9 * np.abs(a).max())
    asked = control.kp * (log.q_ref - log.q) + control.kd * (log.v_ref - log.v)
    assert np.allclose(log.tau, asked, rtol=1e-12, atol=1e-12 * np.abs(asked).max())


def test_the_motion_is_that_of_simulate_and_steps_converge_with_order_four():
    arm = robot("rx90")
    arm = arm.with_drive(replace_drive(arm, Fc=0.0))
    q_ref, v_ref = motion(6, 0.2, 1e-2, np.random.default_rng(0))
    control = tuned_controller(arm, q_ref, 4.0, period=1e-2, feed_forward=False)
    logs = [simulated_log(arm, control, q_ref, v_ref, 1e-2, substeps=s) for s in (1, 2, 16)]
    t = 1e-2 * np.arange(len(q_ref))

    def law(time, q, v):
        return logs[2].tau[min(int(time / 1e-2 + 1e-9), len(t) - 1)]

    exact = rm.simulate(arm, q_ref[0], v_ref[0], law, t, breaks=t[1:-1], rtol=1e-11, atol=1e-12)
    errors = [float(np.abs(log.q - exact.q).max()) for log in logs]
    assert errors[2] < 1e-9
    assert errors[0] / errors[1] > 10.0


def replace_drive(arm, **terms):
    own = {k: getattr(arm.drive, k) for k in ("Ia", "Fv", "Fc", "offset")}
    return DriveParameters(**{**own, **{k: np.full(arm.n, x) for k, x in terms.items()}})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", [Instrumental, Didim], ids=["iv", "didim"])
def test_exact_parameters_from_a_log_without_noise(kind, method):
    arm, control, log, width = recorded(kind)
    system, factors = problem(arm, log, width)
    truth, start = values_of(system, arm), values_of(system, other(arm))
    assert off(start, truth, factors) > 1e-3
    loop = closed_loop(system, start, control, width=width, substeps=1)
    found = method(start=start, loop=loop).solve(system, factors)
    assert found.status is EstimateStatus.SOLVED
    assert off(found.values, truth, factors) < 1e-8
    assert found.details.strength > 0.9


@pytest.mark.parametrize(
    ("kind", "output"), [("prismatic", "both"), ("tree", "torque"), ("tx40", "torque")]
)
def test_output_error_recovers_exact_parameters(kind, output):
    arm, control, log, width = recorded(kind, 1.2, 4e-3, substeps=2)
    system, factors = problem(arm, log, width)
    truth, start = values_of(system, arm), values_of(system, other(arm, spread=0.1))
    loop = closed_loop(system, start, control, width=width, substeps=2)
    found = OutputError(start=start, loop=loop, output=output).solve(system, factors)
    assert found.status is EstimateStatus.SOLVED
    assert off(found.values, truth, factors) < 1e-8
    assert len(found.sigma) == arm.n * (2 if output == "both" else 1)


def test_pieces_and_recordings_are_simulated_as_one_run_each(monkeypatch):
    arm, control, log, width = recorded("prismatic", 1.0)
    twice = Log(
        log.dt, *(np.vstack((x, x)) for x in (log.q, log.tau, log.v, log.a, log.q_ref, log.v_ref)),
        starts=(0, len(log)),
    )  # fmt: skip
    signals = importlib.import_module("robotmodels.identification.signals")
    monkeypatch.setattr(signals, "PIECE", 64)
    system, _ = problem(arm, twice, width, decimation=5)
    assert len(system.pieces()) > 10
    truth = values_of(system, arm)
    loop = closed_loop(system, truth, control, width=width, substeps=1)
    simulator = ClosedLoopSimulator(system, loop)
    signals = simulator.signals(truth)
    for piece in system.pieces():
        rows, inner = simulator.window(piece)
        found = signals[piece.begin]
        for name in ("q", "v", "a", "tau"):
            assert np.allclose(getattr(found, name)[inner], getattr(twice, name)[rows], rtol=1e-7,
                               atol=1e-7 * np.abs(getattr(twice, name)).max())  # fmt: skip


def test_a_robot_of_base_parameters_is_the_robot_without_what_the_equations_leave_out():
    arm = robot("tx40")
    base = rm.base_parameters(arm, drive=("Ia", "Fv"))
    q_ref, v_ref = motion(6, 0.2, 1e-3, np.random.default_rng(0))
    system = equations(base, Log(1e-3, q_ref, v_ref), choose_processing(Log(1e-3, q_ref, v_ref)))
    twin = robot_of(system, base.values(arm))
    assert not twin.drive.Fc.any()
    assert not twin.drive.offset.any()
    assert twin.transmission.Iam.any()
    assert not twin.transmission.Fcm.any()
    a = np.ones((200, 6))
    tau = rm.idm(twin, q_ref, v_ref, a)
    W = rm.torque_regressor(arm, q_ref, v_ref, a, drive=("Ia", "Fv"), columns=base.names)
    assert np.allclose(tau, W @ base.values(arm), rtol=1e-9, atol=1e-9)


def test_controllers_hold_limit_and_integrate():
    arm = robot("gantry")
    rest = np.zeros((400, 6))
    goal = rest + 0.2
    own = tuned_controller(arm, rest, 2.0, period=2e-3, feed_forward=False)
    start = np.vstack((rest[:1], goal[1:]))
    slow = replace_controller(own, period=8e-3)
    log = simulated_log(arm, slow, start, rest, 2e-3)
    held = log.tau.reshape(-1, 4, 6)
    assert (held == held[:, :1]).all()
    assert (np.diff(held[:, 0], axis=0) != 0.0).any()
    limited = replace_controller(own, limit=0.3 * np.abs(log.tau).max(axis=0))
    low = simulated_log(arm, limited, start, rest, 2e-3)
    assert (np.abs(low.tau) <= limited.limit).all()
    assert (np.abs(low.tau) == limited.limit).any()
    quick = replace_controller(own, period=1e-3)
    fine = simulated_log(arm, quick, start, rest, 2e-3)
    assert np.abs(fine.q - simulated_log(arm, own, start, rest, 2e-3).q).max() > 1e-6
    # gravity leaves an error that the integral takes away
    still = np.zeros((6000, 6))
    plain = simulated_log(arm, own, still, still, 2e-3)
    integral = replace_controller(own, ki=1.0 * own.kp)
    settled = simulated_log(arm, integral, still, still, 2e-3)
    worst = int(np.abs(plain.q[-1]).argmax())
    assert np.abs(settled.q[-1, worst]) < 0.1 * np.abs(plain.q[-1, worst])


def replace_controller(own, **changes):
    terms = {k: getattr(own, k) for k in ("kp", "kd", "ki", "limit", "feed_forward", "period")}
    return Controller(**{**terms, **changes})


def test_feed_forward_of_the_robot_itself_follows_closely():
    arm = robot("tx40")
    q_ref, v_ref = motion(6, 1.0, 1e-3, np.random.default_rng(4))
    errors = []
    for ahead in (False, True):
        control = tuned_controller(arm, q_ref, 5.0, period=1e-3, feed_forward=ahead)
        log = simulated_log(arm, control, q_ref, v_ref, 1e-3)
        errors.append(np.abs(log.q - q_ref).max())
    assert errors[1] < 0.1 * errors[0]


def test_a_simulation_that_diverges_has_a_status_and_no_numbers():
    arm, control, log, width = recorded("prismatic", 1.0)
    system, factors = problem(arm, log, width)
    truth = values_of(system, arm)
    wild = replace_controller(control, kp=-50.0 * control.kp)
    for method, why in (
        (Instrumental(start=-truth), "not positive definite"),
        (Didim(start=-truth), "not positive definite"),
        (OutputError(start=-truth), "not positive definite"),
        (Instrumental(wild, start=truth), "it diverges"),
    ):
        found = method.solve(system, factors)
        assert found.status is EstimateStatus.UNSTABLE
        for numbers in (found.values, found.standard_errors, found.covariance, found.sigma):
            assert np.isnan(numbers).all()
        assert why in found.notes[-1]
    verdict = hausman_test(system, found)
    assert np.isnan(verdict.p)
    assert not verdict.biased
    assert "not tested" in verdict.sentence


def test_a_log_without_references_is_followed_and_told():
    arm, _, log, width = recorded("prismatic", 2.0)
    bare = Log(log.dt, log.q, log.tau, log.v, log.a)
    system, factors = problem(arm, bare, width)
    found = Instrumental(start=values_of(system, other(arm))).solve(system, factors)
    assert found.status is EstimateStatus.SOLVED
    # instruments of another controller, and wider friction at rest: consistent all the same
    assert off(found.values, values_of(system, arm), factors) < 1e-8
    told = " ".join(found.notes)
    assert "no references" in told
    assert "controller is unknown" in told


def test_mistakes_are_named():
    arm, control, log, width = recorded("prismatic", 0.4)
    system, _ = problem(arm, log, width)
    truth = values_of(system, arm)
    with pytest.raises(ShapeError, match="4 joints, got 2"):
        closed_loop(system, truth, Controller([1.0, 1.0], 1.0))
    with pytest.raises(InvalidValueError, match="multiple or a whole part"):
        closed_loop(system, truth, replace_controller(control, period=0.003))
    with pytest.raises(InvalidValueError, match="output"):
        OutputError(control, output="speed")
    with pytest.raises(InertiaError, match="not positive definite"):
        tuned_controller(robot_of(system, -truth), log.q, 3.0)
    with pytest.raises(InvalidValueError, match="limit"):
        Controller([1.0, 1.0], 1.0, limit=0.0)
    with pytest.raises(ShapeError, match="one length"):
        Controller([1.0, 1.0], [1.0, 2.0, 3.0])
    curved = rm.friction.ViscousFriction(np.ones(arm.n))
    rest = rm.base_parameters(arm, drive=("Ia",), friction=curved)
    with pytest.raises(InvalidValueError, match="friction: expected that of the drives"):
        closed_loop(equations(rest, log, system.processing), np.ones(len(rest)), control)
    with pytest.raises(InvalidValueError, match="simulation diverges"):
        simulated_log(arm, replace_controller(control, kd=1e9), log.q_ref, log.v_ref, log.dt)


def test_results_are_read_only_and_pickle():
    arm, control, log, width = recorded("prismatic", 1.0)
    system, factors = problem(arm, log, width)
    found = Instrumental(control, start=values_of(system, arm)).solve(system, factors)
    for one in (found, pickle.loads(pickle.dumps(found))):
        loop = one.details.loop
        arrays = one.values, one.details.iid_standard_errors, loop.width, loop.controller.kp
        assert not any(array.flags.writeable for array in arrays)


def stiff_robot(inertia, Fv, Fc):
    """Two links, the second with so little inertia that its friction stops it at once."""
    bodies = InertialParameters.from_com(
        [1.0, 0.01], [[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]], [0.05 * np.eye(3), inertia * np.eye(3)]
    )
    drive = DriveParameters(Ia=np.zeros(2), Fv=[2.0, Fv], Fc=[1.0, Fc], offset=np.zeros(2))
    return rm.load("planar_2r").with_inertia(bodies).with_drive(drive)


def moved(arm, seconds, dt, size=0.8):
    """Log of exact torques on a motion that is followed exactly."""
    q, v = motion(2, seconds, dt, np.random.default_rng(2), size)
    a = central_differences(v, dt)
    tau = rm.idm(arm, q, v, a)
    return Log(dt, q, tau, v, a, q, v)


@pytest.mark.parametrize(
    ("inertia", "Fv", "Fc", "dt"), [(2e-4, 2.0, 1.0, 1e-3), (0.01, 10.0, 1.0, 5e-3)]
)
def test_joints_that_friction_stops_within_a_sample_are_integrated_in_more_steps(
    inertia, Fv, Fc, dt
):
    arm = stiff_robot(inertia, Fv, Fc)
    log = moved(arm, 4.0, dt)
    system, factors = problem(arm, log, 0.02)
    truth = values_of(system, arm)
    loop = closed_loop(system, truth)
    assert dt / loop.substeps * Fv / inertia < 2.0
    assert (loop.width < 0.2 * np.abs(log.v).max(axis=0)).all()
    found = Instrumental(start=truth).solve(system, factors)
    assert found.status is EstimateStatus.SOLVED
    assert off(found.values, truth, factors) < 1e-8
    rough = closed_loop(system, truth, substeps=1)
    assert rough.substeps == 1
    assert "joint_2 is stiff" in " ".join(rough.notes)


def test_a_joint_too_stiff_for_any_steps_is_named_and_not_simulated():
    arm = stiff_robot(2e-6, 2.0, 0.0)
    log = moved(arm, 2.0, 1e-3)
    system, factors = problem(arm, log, 0.02)
    truth = values_of(system, arm)
    loop = closed_loop(system, truth)
    assert loop.substeps == 64
    assert "joint_2 is stiff" in loop.notes[-1]
    assert "simulation is not stable" in loop.notes[-1]
    found = Instrumental(start=truth).solve(system, factors)
    assert found.status is EstimateStatus.UNSTABLE
    assert "joint_2 is stiff" in " ".join(found.notes)
    with pytest.raises(InvalidValueError, match="substeps"):
        simulated_log(arm, loop.controller, log.q_ref, log.v_ref, log.dt)


def test_parameters_of_less_inertia_than_the_first_are_simulated_in_more_steps():
    arm = stiff_robot(2e-3, 2.0, 1.0)
    log = moved(arm, 2.0, 1e-3)
    system, _ = problem(arm, log, 0.02)
    loop = closed_loop(system, values_of(system, arm), width=0.05, substeps=1)
    finer = with_enough_steps(stiff_robot(2e-4, 2.0, 1.0), loop, log)
    assert 1e-3 / finer.substeps * 2.0 / 2e-4 < 2.0
    assert finer.hold == finer.substeps
    assert with_enough_steps(arm, loop, log) is loop
    with pytest.raises(SimulationDivergedError):
        with_enough_steps(stiff_robot(2e-6, 2.0, 1.0), loop, log)


def test_didim_that_wanders_says_so_with_finite_numbers():
    arm = stiff_robot(2e-4, 2.0, 1.0)
    log = moved(arm, 4.0, 1e-3)
    system, factors = problem(arm, log, 0.02, decimation=20)
    loop = closed_loop(system, values_of(system, arm), substeps=12)
    found = Didim(start=values_of(system, arm), loop=loop, iterations=4).solve(system, factors)
    assert found.status is EstimateStatus.NOT_CONVERGED
    assert "instrumental variables" in found.notes[-1]
    # held torques are not quite those of the log: the inertia of link 2 is lost in that
    assert off(found.values, values_of(system, arm), factors) < 0.02
    assert np.isfinite(found.standard_errors).all()
    assert found.details.condition < 1e3
