"""Robots with loops: closing, constraints, dynamics, base parameters, simulation, mistakes."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from looped_robots import (
    five_bar,
    four_bar,
    gough,
    palletiser,
    parallelogram,
    seven_revolutes,
    slider_crank,
    spatial_four_bar,
)

import robotmodels as rm
from robotmodels import loops
from robotmodels.errors import InvalidValueError, LoopError
from robotmodels.logs import Log
from robotmodels.logs.log import RefusedRows
from robotmodels.loops import ClosingStatus
from robotmodels.loops.constraints import row_rates
from robotmodels.loops.dynamics import engine_of, projected


def driven(robot, rng):
    """The same robot with drives on all joints."""
    values = rng.uniform(0.1, 1.0, (4, robot.n))
    drive = rm.DriveParameters(**dict(zip(("Ia", "Fv", "Fc", "offset"), values, strict=True)))
    return loops.LoopedRobot(robot.tree.with_drive(drive), robot.closures, robot.actuated)


def fleet():
    """(robot, actuated positions, guess) of every structure."""
    rng = np.random.default_rng(3)
    yield four_bar(rng), [0.7], [1.2, -0.5]
    yield four_bar(rng, kind="point"), [0.7], [1.2, -0.5]
    yield parallelogram(rng), [0.7], [0.7, -0.7]
    yield slider_crank(rng), [0.7], [1.0, -0.3]
    yield five_bar(rng), [2.0, 1.0], [-1.0, 1.0]
    yield spatial_four_bar(rng)
    yield gough(rng)[0], np.full(6, 1.2), None
    yield driven(five_bar(rng), rng), [2.0, 1.0], [-1.0, 1.0]
    yield seven_revolutes(rng)
    yield seven_revolutes(rng, kind="full")


FLEET = [(robot, loops.close(robot, q_a, guess).q) for robot, q_a, guess in fleet()]
NIGHTLY = pytest.mark.nightly
ids = [f"{k}-{robot.n} joints" for k, (robot, _) in enumerate(FLEET)]
every_robot = pytest.mark.parametrize(("robot", "q_ref"), FLEET, ids=ids)


def motion(robot, q_ref, rng, N=5):
    """Closed postures near a reference, velocities and accelerations that keep the loops closed."""
    by = 0.1 * rng.uniform(-1.0, 1.0, (N, len(robot.actuated)))
    found = loops.close(robot, q_ref[robot.actuated] + by, q_ref)
    assert (found.status == ClosingStatus.CLOSED).all()
    G = loops.velocity_map(robot, found.q)
    v_a, a_a = rng.normal(size=(2, N, len(robot.actuated)))
    v = np.einsum("kij,kj->ki", G, v_a)
    rate = loops.velocity_map_rate(robot, found.q, v)
    return found.q, v, np.einsum("kij,kj->ki", G, a_a) + np.einsum("kij,kj->ki", rate, v_a)


def gap(robot, q):
    """Largest distance or angle between frames that should coincide, by the direct model."""
    most = 0.0
    for closure in robot.closures:
        first, second = (rm.dgm(robot.tree, q, frame) for frame in closure.frames)
        most = max(most, np.abs(first[..., :3, 3] - second[..., :3, 3]).max())
        columns = {"point": [], "revolute": [2], "full": [0, 1, 2]}[closure.kind]
        turned = np.abs(first[..., :3, columns] - second[..., :3, columns])
        most = max(most, turned.max(initial=0.0))
    return most


# --- closing -------------------------------------------------------------------------------------


@every_robot
def test_closed_postures_close_by_the_direct_model_alone_and_in_batches(robot, q_ref, rng):
    by = 0.1 * rng.normal(size=(2, 3, len(robot.actuated)))
    found = loops.close(robot, q_ref[robot.actuated] + by, q_ref)
    assert found.q.shape == (2, 3, robot.n)
    assert found.residual.shape == found.status.shape == (2, 3)
    assert gap(robot, found.q) < 1e-12
    assert np.array_equal(found.q[..., robot.actuated], q_ref[robot.actuated] + by)
    one = loops.close(robot, (q_ref[robot.actuated] + by[1, 2]).tolist(), q_ref.tolist())
    assert np.array_equal(one.q, found.q[1, 2])
    assert found.reason((0, 1)) == "The loops are closed."
    assert loops.close(robot, by[:0], q_ref).q.shape == (0, 3, robot.n)
    for value in (found, robot):
        again = pickle.loads(pickle.dumps(value))
        assert again == value
        assert hash(again) == hash(value)


def test_a_parallelogram_stays_one_all_around(rng):
    robot = parallelogram(rng)
    q = rng.uniform(0.02, np.pi - 0.02, (2000, 1)) * rng.choice([-1.0, 1.0], (2000, 1))
    for sign in (-1.0, 1.0):  # the flat posture between is a bifurcation
        rows = q[np.sign(q[:, 0]) == sign]
        found = loops.close(robot, rows, sign * np.array([0.7, 0.7, -0.7]))
        assert np.abs(found.q - rows * [1.0, 1.0, -1.0]).max() < 1e-12


def test_postures_that_cannot_close_are_at_the_positions_that_were_asked_for(rng):
    robot = four_bar(rng, crank=0.9, coupler=0.3, rocker=0.7, kind="point")
    q = loops.close(robot, [0.6], [1.2, 1.0]).q
    assert gap(robot, q) < 1e-12
    angles = np.linspace(1.2, 2.0 * np.pi - 1.2, 40)[:, None]
    found = loops.close(robot, angles, q)
    assert (found.status == ClosingStatus.CANNOT_CLOSE).all()
    assert np.array_equal(found.q[:, :1], angles)
    # what is left between the crank's end and the stretched coupler and rocker, by its larger entry
    ends = 0.9 * np.c_[np.cos(angles), np.sin(angles)]
    left = np.linalg.norm(ends - [1.0, 0.0], axis=1) - 1.0
    assert (found.residual < left + 1e-6).all()
    assert (found.residual > left / np.sqrt(2.0) - 1e-6).all()
    assert "m or rad" in found.reason(0)


def test_the_assembly_of_the_guess_is_kept(rng):
    robot = four_bar(rng)
    angles = np.linspace(-np.pi, np.pi, 400)[:, None]
    for guess in ([0.7, 1.2, -0.5], [0.7, -1.2, -2.0]):
        start = loops.close(robot, [0.7], guess[1:]).q
        found = loops.close(robot, angles, start)
        assert (found.status == ClosingStatus.CLOSED).all()
        steps = np.abs(np.diff(found.q, axis=0))
        assert steps.max() < 0.1  # one continuous motion
        assert np.allclose(np.sin(found.q[0]), np.sin(found.q[-1]), atol=1e-9)


def test_a_dead_point_is_closed_and_singular(rng):
    robot = slider_crank(rng)
    by_slider = loops.LoopedRobot(robot.tree, robot.closures, actuated=[1])
    stretched = loops.close(robot, [0.0], [1.1, 0.0]).q
    found = loops.close(by_slider, stretched[[1]], stretched)
    assert found.status == ClosingStatus.SINGULAR_THERE
    assert "do not determine" in found.reason()
    with pytest.raises(LoopError, match="dead point"):
        loops.velocity_map(by_slider, stretched)
    # the direct model has an answer there, and it is that of the crank
    v = np.zeros(3)
    a = loops.ddm(by_slider, stretched, v, [5.0])
    assert a == pytest.approx(loops.ddm(robot, stretched, v, [0.0]), abs=1e-9)


# --- constraints ---------------------------------------------------------------------------------


@every_robot
def test_velocity_maps_are_derivatives(robot, q_ref, rng):
    q, v, _ = motion(robot, q_ref, rng)
    h = 1e-6
    sides = [loops.close(robot, (q + s * v)[:, robot.actuated], q).q for s in (h, -h)]
    assert np.allclose((sides[0] - sides[1]) / (2 * h), v, atol=2e-8)
    rate = np.subtract(*(loops.velocity_map(robot, x) for x in sides)) / (2 * h)
    G, dG = loops.velocity_map(robot, q), loops.velocity_map_rate(robot, q, v)
    assert np.allclose(rate, dG, atol=1e-6 * (1.0 + np.abs(dG).max()))
    J = loops.closure_jacobian(robot, q)
    assert np.abs(J @ G).max() < 1e-11
    assert np.array_equal(G[:, robot.actuated], np.tile(np.eye(len(robot.actuated)), (5, 1, 1)))
    assert np.allclose(loops.velocity_map_rate(robot, q[3], v[3]), dG[3], atol=1e-10)


@every_robot
def test_rows_are_relative_twists_with_their_rates_and_their_rank(robot, q_ref, rng):
    q = motion(robot, q_ref, rng)[0]
    J = loops.closure_jacobian(robot, q)
    rows = iter(np.moveaxis(J, -2, 0))
    for closure in robot.closures:
        first, second = closure.frames
        R = rm.dgm(robot.tree, q, first)[:, :3, :3].swapaxes(1, 2)
        twists = np.subtract(*(rm.jacobian(robot.tree, q, frame) for frame in (second, first)))
        both = np.concatenate((R @ twists[:, :3], R @ twists[:, 3:]), axis=1)
        for k, name in enumerate(closure.rows):
            assert name.startswith(f"{closure.name}.")
            assert np.allclose(next(rows), both[:, k], atol=1e-11)
    assert len(robot.rows) == J.shape[1]
    x, v = rng.uniform(-1.0, 1.0, (2, 3, robot.n))  # open postures
    sides = [loops.closure_jacobian(robot, x + s * v) for s in (1e-6, -1e-6)]
    assert np.allclose(row_rates(robot, x, v), (sides[0] - sides[1]) / 2e-6, atol=1e-7)
    found = loops.mobility(robot, q)
    assert np.array_equal(np.asarray(found), robot.n - np.linalg.matrix_rank(J, tol=1e-9))
    assert (found == len(robot.actuated)).all()  # of a Bennett linkage too, in spite of five rows
    kept = [name not in found.redundant for name in robot.rows]
    assert np.linalg.matrix_rank(J[0][kept], tol=1e-9) == sum(kept) == robot.n - int(found.count[0])
    assert int(loops.mobility(robot, q[0])) == found.count[0]


def test_redundant_closures_and_planar_rows_are_named(rng):
    robot = four_bar(rng)
    twice = [*robot.closures, loops.Closure("again", frames=(4, 5))]
    double = loops.LoopedRobot(robot.tree, twice, actuated=[0])
    q = loops.close(double, [0.7], [1.2, -0.5]).q
    planar = ("cut.z", "cut.rx", "cut.ry")
    assert loops.mobility(robot, q).redundant == planar
    assert loops.mobility(double, q).redundant == planar + twice[1].rows
    assert np.allclose(loops.velocity_map(double, q), loops.velocity_map(robot, q), atol=1e-12)
    a = [loops.ddm(one, q, np.zeros(3), [1.0]) for one in (robot, double)]
    assert np.allclose(*a, atol=1e-9)


def test_antiparallel_axes_are_not_closed(rng):
    """A pin that would have to be turned over: origins meet, axes do not."""
    robot = four_bar(rng)
    tree = robot.tree.with_frames({"over": np.diag([1.0, -1.0, -1.0, 1.0])}, frame=5)
    turned = loops.LoopedRobot(tree, [loops.Closure("cut", (4, "over"))], actuated=[0])
    q = loops.close(robot, [0.7], [1.2, -0.5]).q
    found = loops.close(turned, [0.7], q)
    assert found.status in (ClosingStatus.CANNOT_CLOSE, ClosingStatus.NOT_CONVERGED)
    assert found.residual > 0.1


# --- dynamics ------------------------------------------------------------------------------------


@every_robot
def test_inverse_and_direct_models_are_inverse(robot, q_ref, rng):
    q, v, a = motion(robot, q_ref, rng)
    wrench = rng.normal(size=(5, 6))
    tau = loops.idm(robot, q, v, a, wrench=wrench)
    assert tau.shape == (5, len(robot.actuated))
    back = loops.ddm(robot, q, v, tau, wrench=wrench)
    size = 1.0 + np.abs(a).max()
    assert np.abs(back - a).max() < 1e-9 * size
    assert np.abs(loops.ddm(robot, q[2], v[2], tau[2], wrench[2]) - a[2]).max() < 1e-9 * size
    assert np.abs(loops.idm(robot, q[2], v[2], a[2], wrench[2]) - tau[2]).max() < 1e-9 * size
    assert loops.ddm(robot, q[:0], v[:0], tau[:0]).shape == (0, robot.n)
    with ThreadPoolExecutor(2) as pool:
        same = pool.submit(loops.ddm, robot, q, v, tau, wrench).result()
    assert np.array_equal(same, back)


def kkt(robot, q, v, tau):
    """Accelerations and closure forces of one sample, by the dense equations of motion."""
    J = loops.closure_jacobian(robot, q)
    h, c = 1e-6, len(J)
    bias = (loops.closure_jacobian(robot, q + h * v) - loops.closure_jacobian(robot, q - h * v)) @ v
    full = np.zeros(robot.n)
    full[robot.actuated] = tau
    M = rm.mass_matrix(robot.tree, q)
    rest = full - rm.idm(robot.tree, q, v, np.zeros(robot.n))
    A = np.block([[M, -J.T], [J, np.zeros((c, c))]])
    found = np.linalg.lstsq(A, np.concatenate((rest, -bias / (2 * h))), rcond=1e-13)[0]
    return found[: robot.n], found[robot.n :]


@every_robot
def test_the_direct_model_solves_the_dense_equations(robot, q_ref, rng):
    q, v, _ = motion(robot, q_ref, rng)
    tau = rng.normal(size=(5, len(robot.actuated)))
    still = np.zeros(robot.n)
    for k in range(5):
        a, forces = kkt(robot, q[k], still, tau[k])
        assert np.abs(loops.ddm(robot, q[k], still, tau[k]) - a).max() < 1e-12 * (
            1.0 + np.abs(a).max()
        ) * np.linalg.cond(rm.mass_matrix(robot.tree, q[k]))
        a = kkt(robot, q[k], v[k], tau[k])[0]  # its bias is a difference
        assert np.abs(loops.ddm(robot, q[k], v[k], tau[k]) - a).max() < 1e-7 * (
            1.0 + np.abs(a).max()
        )
        J = loops.closure_jacobian(robot, q[k])
        found = loops.closure_forces(robot, q[k], still, tau[k])
        assert np.allclose(J.T @ found, J.T @ forces, atol=1e-9 * (1.0 + np.abs(forces).max()))
    full = np.zeros((5, robot.n))
    full[:, robot.actuated] = tau
    if (d := robot.tree.drive_matrices) is not None:
        full -= d.torque(v, None)
    reference = projected(robot, q, v, full, engine_of(robot))
    found = loops.ddm(robot, q, v, tau)
    assert engine_of(robot).serves
    assert np.abs(found - reference).max() < 1e-10 * (1.0 + np.abs(reference).max())
    batch = loops.closure_forces(robot, q, v, tau)
    missing = rm.idm(robot.tree, q, v, loops.ddm(robot, q, v, tau))
    missing[:, robot.actuated] -= tau
    J = loops.closure_jacobian(robot, q)
    assert np.allclose(np.einsum("kij,ki->kj", J, batch), missing, atol=1e-8)


@every_robot
def test_power_is_the_change_of_energy(robot, q_ref, rng):
    q, v, a = motion(robot, q_ref, rng)
    tree, d = robot.tree, robot.tree.drive
    friction = v * d.Fv + np.sign(v) * d.Fc + d.offset
    power = (loops.idm(robot, q, v, a) * v[:, robot.actuated]).sum(1) - (friction * v).sum(1)
    h = 1e-5
    ends = [(q + s * v + s * s / 2 * a, v + s * a) for s in (h, -h)]
    energies = [rm.kinetic_energy(tree, *x) + rm.potential_energy(tree, x[0]) for x in ends]
    change = (energies[0] - energies[1]) / (2 * h)
    assert np.allclose(power, change, rtol=1e-7, atol=1e-7)


def test_velocities_that_no_acceleration_continues_are_refused(rng):
    robot, q = FLEET[5]
    for v in rng.normal(size=(2, robot.n)):  # the second call takes the quick way
        with pytest.raises(LoopError, match="velocities violate"):
            loops.ddm(robot, q, v, np.ones(1))
    assert np.isfinite(loops.ddm(robot, q, 0.0 * q, np.ones(1))).all()


# --- simulation ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("k", "until"),
    [(0, 10.0), (3, 10.0), *(pytest.param(*long, marks=NIGHTLY) for long in ((4, 10.0), (5, 3.0)))],
)
def test_simulated_loops_stay_closed_and_keep_their_energy(k, until):
    robot, q = FLEET[k]
    found = loops.simulate(robot, q, t=np.linspace(0.0, until, 101))
    assert found.status == rm.simulation.SimulationStatus.FINISHED
    assert np.ptp(found.q, axis=0).max() > 1.0
    assert gap(robot, found.q) < 1e-12
    assert np.abs(loops.closure_jacobian(robot, found.q) @ found.v[..., None]).max() < 1e-11
    assert found.relative_drift < 1e-8
    a = loops.ddm(robot, found.q, found.v, np.zeros((101, len(robot.actuated))))
    assert np.allclose(a, found.a, atol=1e-6 * (1.0 + np.abs(a).max()))
    assert len(repr(found).splitlines()) <= 6
    assert pickle.loads(pickle.dumps(found)) == found


def test_simulated_controls_wrenches_and_friction(rng):
    robot = driven(five_bar(rng), rng)
    q = FLEET[7][1]
    found = loops.simulate(
        robot, q, None, lambda t, q, v: -20.0 * v[[0, 1]] + [np.sin(t), 1.0], 0.5,
        wrench=[1.0, 0.0, 2.0, 0.0, 0.0, 0.0], smoothing=1e-2, rtol=1e-8,
    )  # fmt: skip
    assert found.tau[:, 2:].max() == found.tau[:, 2:].min() == 0.0
    assert found.tau[0, :2] == pytest.approx([0.0, 1.0])
    assert found.relative_drift < 1e-6


def test_a_simulation_leaves_a_singular_posture_and_ends_where_the_closures_become_singular(rng):
    found = loops.simulate(parallelogram(rng), np.zeros(3), [1.0, 1.0, -1.0], t=0.02)
    assert found.status == rm.simulation.SimulationStatus.FINISHED
    robot, q = FLEET[2]
    found = loops.simulate(robot, q, control=[0.0], t=20.0)
    # a parallelogram that falls flat may go on as an antiparallelogram
    assert found.status == rm.simulation.SimulationStatus.SINGULAR
    assert np.allclose(found.q, found.q[:, [0]] * [1, 1, -1], atol=1e-9)
    assert found.relative_drift < 1e-8


# --- base parameters -----------------------------------------------------------------------------


# the one motion of the loop of seven joints is short: its parameters have no clear rank
@pytest.mark.parametrize(
    ("robot", "q_ref"),
    [*FLEET[:6], *(pytest.param(*large, marks=NIGHTLY) for large in FLEET[6:-2])],
    ids=ids[:-2],
)
def test_base_parameters_span_the_reduced_regressor(robot, q_ref, rng):
    q, v, a = motion(robot, q_ref, rng, N=60)
    drive = ("Ia",) if robot.n > 20 else ("Ia", "Fv", "Fc")
    W = loops.torque_regressor(robot, q, v, a, drive=drive)
    values = rng.normal(size=W.shape[-1])
    base = loops.base_parameters(robot, q_ref, drive=drive)
    reduced = base.reduce(W)
    assert np.allclose(reduced @ (base.matrix @ values), W @ values, atol=1e-9 * np.abs(W).max())
    flat = reduced.reshape(-1, len(base))
    assert np.linalg.matrix_rank(flat / np.linalg.norm(flat, axis=0), tol=1e-9) == len(base)
    assert len(base) <= len(rm.base_parameters(robot.tree, drive=drive))
    own = loops.torque_regressor(robot, q, v, a)
    pi = rm.parameter_vector(robot.tree)
    assert np.allclose(own @ pi, loops.idm(robot, q, v, a), atol=1e-9)
    chosen = loops.torque_regressor(robot, q, v, a, drive=drive, columns=base)
    assert np.allclose(chosen, reduced)
    rows = base.torque_rows(q, v, a, base.names)  # closes the loops from the actuated joints
    assert np.allclose(rows[:, robot.actuated], reduced, atol=1e-9 * np.abs(W).max())
    assert not rows[:, robot.passive].any()
    assert loops.torque_regressor(robot, q[0], v[0], a[0]).shape == own.shape[1:]
    assert loops.torque_regressor(robot, q[:0], v[:0], a[:0]).shape == (0, *own.shape[1:])


def test_base_parameters_of_known_robots(rng):
    robot = parallelogram(rng)
    base = loops.base_parameters(robot, [0.7, 0.7, -0.7], drive=False)
    assert base.names == ("ZZ1", "MX1", "MY1")
    anti = loops.close(robot, [0.7], [-0.5, -1.0]).q
    assert abs(anti[0] - anti[1]) > 0.1
    assert len(loops.base_parameters(robot, anti, drive=False)) > 3
    assert base.regrouping["ZZ1"]["M3"] == pytest.approx(0.25)
    general = loops.base_parameters(four_bar(rng), FLEET[0][1], drive=False)
    assert len(general) < len(rm.base_parameters(FLEET[0][0].tree, drive=False))
    assert pickle.loads(pickle.dumps(general)) == general


def test_a_simulated_log_of_a_palletiser_gives_its_base_parameters_back(rng):
    robot, home = palletiser(rng)
    t = np.arange(0.0, 15.0, 0.004)[:, None, None]
    w = 2 * np.pi * np.array([[0.3, 0.4, 0.5], [0.7, 0.9, 1.1]])
    swing = np.array([[0.5, 0.2, 0.25], [0.2, 0.08, 0.08]]) * np.exp(1j * w * t)
    q_a, v_a, a_a = ((swing * (1j * w) ** k).sum(axis=1).imag for k in range(3))
    q = loops.close(robot, home[robot.actuated] + q_a, home).q
    G = loops.velocity_map(robot, q)
    v = np.einsum("kij,kj->ki", G, v_a)
    a = np.einsum("kij,kj->ki", G, a_a)
    a += np.einsum("kij,kj->ki", loops.velocity_map_rate(robot, q, v), v_a)
    tau = loops.idm(robot, q, v, a)
    base = loops.base_parameters(robot, home, drive=True)
    W = base.reduce(loops.torque_regressor(robot, q, v, a)).reshape(-1, len(base))
    beta = base.values(robot.tree)
    found = np.linalg.lstsq(W, tau.ravel(), rcond=None)[0]
    assert np.abs(found - beta).max() < 1e-8 * np.abs(beta).max()
    noise = 0.002 * np.abs(tau).max(axis=0) * rng.normal(size=tau.shape)
    refused = [RefusedRows("run.csv", (3, 4), "not a number")]
    log = Log(0.004, q[:, robot.actuated], tau + noise, refused=refused)
    training, rest = log.rows(0, 3000), log.rows(3000, len(log))
    result = rm.identification.fit(robot, training, "wls", base=base, test=rest)
    errors = result.values - result.base.values(robot.tree)
    assert (np.abs(errors) < 4.5 * result.standard_errors).all()
    assert result.standard_error("MX2") < 0.02 * result.value("MX2")
    assert (result.validation.held_out.relative[robot.actuated] < 0.05).all()
    assert result.equations.log.refused == log.refused
    predicted = rm.identification.predicted_torque(result, q[500:800], v[500:800], a[500:800])
    assert np.allclose(predicted[:, robot.actuated], tau[500:800], atol=0.01 * np.abs(tau).max())
    assert not predicted[:, robot.passive].any()


# --- mistakes ------------------------------------------------------------------------------------


FOUR, CUT = FLEET[0][0], loops.Closure("cut", (4, 5))


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: loops.LoopedRobot(FOUR.tree, [loops.Closure("cut", (2, 5))]), LoopError, "body"),
        (lambda: loops.LoopedRobot(FOUR.tree, [loops.Closure("cut", (0, 1))]), LoopError,
         "add no constraint"),
        (lambda: loops.LoopedRobot(FOUR.tree, [loops.Closure("cut", (4, 9))]),
         rm.errors.FrameNotFoundError, "9"),
        (lambda: loops.idm(FOUR, [0.0, 1.0, 0.0], np.zeros(3), np.zeros(3)), LoopError, "open"),
        (lambda: loops.simulate(*FLEET[7]), InvalidValueError, "smoothing"),
        (lambda: loops.simulate(*FLEET[7], np.eye(4)[0], smoothing=1e-2), LoopError, "v0"),
        (lambda: loops.ddm(loops.LoopedRobot(FOUR.tree.with_inertia(None), [CUT], [0]),
                           FLEET[0][1], np.zeros(3), [1.0]), rm.errors.SingularMassMatrixError,
         "inertial parameters"),
        (lambda: rm.identification.fit(FOUR, LOG, form="power", checked=False), InvalidValueError,
         "form='power'"),
        (lambda: rm.identification.fit(FOUR, LOG, "didim", checked=False), InvalidValueError,
         "method='didim'"),
    ],
)  # fmt: skip
def test_mistakes_are_named(call, error, words):
    with pytest.raises(error, match=words):
        call()


LOG = Log(0.01, np.full((500, 1), 0.7), np.ones((500, 1)))


def test_actuated_joints_that_do_not_determine_the_others(rng):
    robot, q = FLEET[0]
    for actuated, words in (([], "stand still"), ([0, 1], "depend on each other")):
        wrong = loops.LoopedRobot(robot.tree, robot.closures, actuated)
        with pytest.raises(LoopError, match=words):
            loops.velocity_map(wrong, np.stack((q, q)))
    none = loops.LoopedRobot(robot.tree, robot.closures, [])
    assert loops.close(none, [], q).status == ClosingStatus.SINGULAR_THERE
    table = robot.tree.table.replace(mu=[0, 1, 0, 0, 0])
    passive = robot.tree.with_table(table)
    assert loops.LoopedRobot(passive, robot.closures).actuated.tolist() == [1]


def test_a_four_bar_follows_freudenstein(rng):
    a, c, d = 0.3, 0.7, 1.0
    robot = four_bar(rng, crank=a, coupler=0.9, rocker=c, ground=d)
    q = loops.close(robot, rng.uniform(-3.0, 3.0, (50, 1)), [0.7, 1.2, -0.5]).q
    crank, rocker = q[:, 0], q[:, 1]
    K1, K2 = d / a, d / c
    slope = (np.sin(crank - rocker) + K2 * np.sin(crank)) / (
        np.sin(crank - rocker) + K1 * np.sin(rocker)
    )
    assert np.allclose(loops.velocity_map(robot, q)[:, 1, 0], slope, atol=1e-10)


def test_a_parallelogram_has_its_reduced_model(rng):
    length = 0.5
    robot = parallelogram(rng, length=length)
    ZZ, MX, MY, M = robot.tree.inertia.values[:, [5, 6, 7, 9]].T
    # the rocker carries frame 5 at its end; the coupler, of frames 3 and 4, does not turn
    inertia = ZZ[[0, 1, 4]].sum() + 2 * length * MX[4] + length**2 * M[2:].sum()
    X, Y = MX[[0, 1, 4]].sum() + length * M[2:].sum(), MY[[0, 1, 4]].sum()
    angle, rate, change = rng.uniform(0.2, 2.9, 20), *rng.normal(size=(2, 20))
    signs = np.array([1.0, 1.0, -1.0])
    q, v, a = (x[:, None] * signs for x in (angle, rate, change))
    expected = inertia * change + 9.81 * (X * np.cos(angle) - Y * np.sin(angle))
    assert np.allclose(loops.idm(robot, q, v, a)[:, 0], expected, rtol=1e-10, atol=1e-10)
