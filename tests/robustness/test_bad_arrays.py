"""Arrays of wrong shapes and kinds at the borders of the main functions: refused, or computed."""

import dataclasses

import numpy as np
import pytest
from looped_robots import four_bar
from robustness.inputs import planar
from robustness.outcomes import Outcome, outcome

import robotmodels as rm
from robotmodels import (
    calibration,
    control,
    flexible,
    identification,
    loops,
    parallel,
    performance,
    trajectories,
)
from robotmodels import visual_servoing as vs
from robotmodels.obstacles import Sphere, clearance

# torques that have nothing to do with the motion are as good as any here
pytestmark = [pytest.mark.nightly, pytest.mark.filterwarnings("ignore:Poor prediction")]

BAD = (
    None, True, "a", 1j, object(), float("nan"), float("inf"), -1e308, 10**400, 3, [], [[]], [1.0],
    [1.0, 2.0, 3.0], ["a", "b"], [None, 1.0], [[1.0], [1.0, 2.0]], {"a": 1.0},
    np.array([1.0, np.nan]), np.array([1e308, -1e308]), np.array([1.0, 2.0], dtype=object),
    np.array([True, False]), np.zeros((0, 2)), np.zeros((3, 1)), np.zeros((2, 3)),
    np.zeros((1, 1, 1, 1, 2)), np.ma.masked_array([1.0, 2.0], [True, False]),
    np.array([1, 2], dtype=np.int8), np.array([5e-324, 0.0]), np.datetime64("2020-01-01"),
    np.zeros(2, "V8"), range(2), iter([1.0, 2.0]), np.eye(4), np.zeros((4, 4)),
    np.full((4, 4), np.nan), np.zeros((4, 4, 3)), 1e308 * np.eye(4), lambda: 0,
    np.zeros((3, 2))[::-1], set(),
)  # fmt: skip
MODEL = planar()
ARM = MODEL.with_inertia(rm.uniform_bodies(MODEL, 4.0))
Q, V, A = np.array([0.3, 0.4]), np.array([0.1, -0.2]), np.array([0.5, 0.6])
T = rm.dgm(MODEL, Q)
LOG_T = 0.01 * np.arange(60)[:, None]
TIMES = 0.01 * np.arange(400)[:, None]
LIMITS = trajectories.MotionLimits(velocity=1.0, acceleration=2.0)

HEXAPOD = parallel.gough_symmetric(1.0, lower=0.8, upper=1.5)
PLATE = HEXAPOD.pose([0.1, 0.05, 1.0, 0.1, 0.2, 0.1])
LEGS = parallel.igm(HEXAPOD, PLATE).q[0]
TWIST = np.array([0.1, 0.0, 0.2, 0.1, 0.1, 0.0])

FOUR_BAR = four_bar(np.random.default_rng(0))
BAR = loops.close(FOUR_BAR, [0.6]).q
REST, STARTS = np.zeros(3), loops.velocity_map(FOUR_BAR, BAR) @ [0.5]

POINTS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
SQUARE, GOAL = vs.Points(POINTS), rm.se3.translation(0, 0, 0.5)
SEEN = rm.se3.translation(0.1, 0, 0.9) @ rm.se3.rotation("x", 0.6)
IMAGE = SQUARE.measure(SEEN).reshape(4, 2)

LINK = flexible.beam(0.5, EI=(np.inf, 1.0), density=0.2, hub=0.1)
BENT = flexible.FlexibleRobot(MODEL, {1: LINK, 2: LINK})
E = np.zeros(BENT.m)

CALLS = {
    "dgm": (lambda q: rm.dgm(ARM, q), [Q]),
    "link_poses": (lambda q: rm.link_poses(ARM, q), [Q]),
    "link_transforms": (lambda q: rm.link_transforms(ARM.table, q), [Q]),
    "jacobian": (lambda q, frame: rm.jacobian(ARM, q, frame), [Q, None]),
    "jacobian_rate": (lambda q, v: rm.jacobian_rate(ARM, q, v), [Q, V]),
    "dkm": (lambda q, v: rm.dkm(ARM, q, v), [Q, V]),
    "ikm": (lambda q, w: rm.ikm(ARM, q, w), [Q, np.zeros(6)]),
    "idm": (lambda q, v, a, w: rm.idm(ARM, q, v, a, w), [Q, V, A, np.zeros(6)]),
    "ddm": (lambda q, v, u: rm.ddm(ARM, q, v, u), [Q, V, A]),
    "mass_matrix": (lambda q: rm.mass_matrix(ARM, q), [Q]),
    "coriolis_matrix": (lambda q, v: rm.coriolis_matrix(ARM, q, v), [Q, V]),
    "gravity_torque": (lambda q: rm.gravity_torque(ARM, q), [Q]),
    "kinetic_energy": (lambda q, v: rm.kinetic_energy(ARM, q, v), [Q, V]),
    "torque_regressor": (lambda q, v, a: rm.torque_regressor(ARM, q, v, a), [Q, V, A]),
    "energy_regressor": (lambda q, v: rm.energy_regressor(ARM, q, v), [Q, V]),
    "igm": (lambda T, r: rm.igm(ARM, T, r, mask=[1, 1, 0, 0, 0, 0]), [T, Q]),
    "igm_mask": (lambda T, m: rm.igm(ARM, T, mask=m), [T, [1, 1, 0, 0, 0, 0]]),
    "igm_numeric": (lambda T, q0: rm.igm_numeric(ARM, T, q0, rng=0), [T, Q]),
    "base_parameters": (lambda method: rm.base_parameters(ARM, method), ["symbolic"]),
    "pose_from_coordinates": (lambda x, k: rm.pose_from_coordinates(x, k), [np.zeros(6), "rpy"]),
    "operational_coordinates": (lambda T, k: rm.operational_coordinates(T, k), [T, "rpy"]),
    "joint_trajectory": (
        lambda a, b, N: trajectories.joint_trajectory(a, b, N), [Q, V, 5],
    ),
    "cartesian_trajectory": (lambda a, b, N: trajectories.cartesian_trajectory(a, b, N), [T, T, 5]),
    "with_inertia": (
        lambda x: ARM.with_inertia(rm.InertialParameters(x)), [np.zeros((2, 10))],
    ),
    "gravity": (lambda x: ARM.with_gravity(x), [[0.0, 0.0, -9.81]]),
    "tool": (lambda x: ARM.with_tool(x), [np.eye(4)]),
    "simulate": (
        lambda q, v, t: rm.simulate(ARM, q, v, None, t, max_evaluations=2000),
        [Q, V, np.linspace(0.0, 0.02, 3)],
    ),
    "log": (lambda dt, q, tau: identification.Log(dt, q, tau), [0.01, LOG_T * Q, LOG_T * V]),
    "fit": (
        lambda q, tau: identification.fit(
            ARM, identification.Log(0.01, q, tau), checked=False
        ),
        [np.sin(TIMES * [3.0, 2.0]), np.cos(TIMES * [2.0, 2.5])],
    ),
    "position": (lambda q, p: calibration.Position(q, p), [LOG_T * Q, LOG_T * [1.0, 2.0, 3.0]]),
    "calibrate": (
        lambda q, p: calibration.fit(
            ARM, calibration.Position(q, p), parameters=("theta2",), base=False, tool=False
        ),
        [LOG_T[::4] * Q * 3.0, rm.dgm(MODEL, LOG_T[::4] * Q * 3.0)[:, :3, 3]],
    ),
    "workspace": (
        lambda limits, n: performance.workspace(ARM, limits=limits, resolution=n), [False, 8],
    ),
    "accessibility": (
        lambda T: performance.accessibility(ARM, T, limits=False, mask=[1, 1, 0, 0, 0, 0]),
        [rm.dgm(ARM, Q)[None]],
    ),
    "isotropy_index": (
        lambda q, mask, length: performance.isotropy_index(ARM, q, mask, length),
        [Q, [1, 1, 0, 0, 0, 0], 1.0],
    ),
    "polytope": (
        lambda q, mask: performance.polytope(rm.load("ur5e"), q, mask=mask),
        [np.array([0.1, -1.0, 0.8, 0.2, 0.5, 0.1]), [1, 1, 1, 0, 0, 0]],
    ),
    "time_optimal": (
        lambda a, b: trajectories.time_optimal(trajectories.quintic(a, b, duration=1.0), LIMITS),
        [Q, V],
    ),
    "clearance": (
        lambda q, p, r: clearance(ARM, q, [Sphere(p, r)], 0.05), [Q, [3.0, 0.0, 0.0], 0.1],
    ),
    "parallel.igm": (lambda T: parallel.igm(HEXAPOD, T), [PLATE]),
    "parallel.dgm": (lambda q, T0: parallel.dgm(HEXAPOD, q, T0), [LEGS, PLATE]),
    "assembly_modes": (lambda q: parallel.assembly_modes(HEXAPOD, q), [LEGS]),
    "parallel.ikm": (lambda T, V: parallel.ikm(HEXAPOD, T, V), [PLATE, TWIST]),
    "parallel.dkm": (lambda T, v: parallel.dkm(HEXAPOD, T, v), [PLATE, TWIST]),
    "leg_forces": (lambda T, f: parallel.leg_forces(HEXAPOD, T, f), [PLATE, TWIST]),
    "stiffness": (lambda T, k: parallel.stiffness(HEXAPOD, T, k), [PLATE, np.ones(6)]),
    "condition": (lambda T, L: parallel.condition(HEXAPOD, T, L), [PLATE, 1.0]),
    "gough": (lambda b, p: parallel.gough(b, p), [HEXAPOD.base, HEXAPOD.platform]),
    "five_bar": (
        lambda b, p, d: parallel.five_bar(b, p, d),
        [[[-0.5, 0.0], [0.5, 0.0]], [1.0, 1.0], [1.2, 1.2]],
    ),
    "loops.close": (lambda q, near: loops.close(FOUR_BAR, q, near), [BAR[:1], BAR]),
    "loops.mobility": (lambda q: loops.mobility(FOUR_BAR, q), [BAR]),
    "loops.idm": (lambda q, v, a: loops.idm(FOUR_BAR, q, v, a), [BAR, REST, STARTS]),
    "loops.ddm": (lambda q, v, tau: loops.ddm(FOUR_BAR, q, v, tau), [BAR, REST, [0.5]]),
    "ComputedTorque": (
        lambda w, q, v: control.run(
            ARM, control.ComputedTorque(Q, omega=w, model=ARM), q, v, t=0.02, max_evaluations=3000
        ),
        [10.0, Q, V],
    ),
    "DecentralizedPID": (
        lambda kp, ki, kd: control.run(
            ARM, control.DecentralizedPID(Q, kp, ki, kd), Q, t=0.02, max_evaluations=3000
        ),
        [[9.0, 9.0], [1.0, 1.0], [2.0, 2.0]],
    ),
    "SpringWall": (
        lambda p, n, k: control.SpringWall(p, n, k), [np.zeros(3), [0, 0, 1.0], 1e3],
    ),
    "pid_gains": (lambda a, F, w: control.pid_gains(a, F, w), [1.0, 0.5, 10.0]),
    "Points": (vs.Points, [POINTS]),
    "camera_velocity": (lambda T: vs.camera_velocity(vs.Task(SQUARE, GOAL), T), [SEEN]),
    "servo": (
        lambda goal, T: vs.servo(vs.task_3d(goal), T, duration=0.2), [GOAL, SEEN],
    ),
    "pnp": (vs.pnp, [POINTS, IMAGE]),
    "p3p": (vs.p3p, [POINTS[:3], IMAGE[:3]]),
    "homography": (vs.homography, [IMAGE, SQUARE.measure(GOAL).reshape(4, 2)]),
    "interaction_point": (vs.interaction_point, [0.1, 0.2, 1.0]),
    "beam": (
        lambda L, EI, d: flexible.beam(L, EI=EI, density=d), [0.5, 1.0, 0.2],
    ),
    "flexible.idm": (
        lambda q, e, v, a: flexible.idm(BENT, q, e, v, None, a), [Q, E, V, A],
    ),
    "flexible.ddm": (
        lambda q, e, v, tau: flexible.ddm(BENT, q, e, v, None, tau), [Q, E, V, A],
    ),
    "flexible.dgm": (lambda q, e: flexible.dgm(BENT, q, e), [Q, E]),
    "static_deflection": (
        lambda q, f: flexible.static_deflection(BENT, q, f), [Q, 0.01 * TWIST],
    ),
    "flexible.simulate": (
        lambda q, tau: flexible.simulate(BENT, q, None, tau, 0.01, max_evaluations=2000), [Q, A],
    ),
    "input_shaper": (lambda f, z: flexible.input_shaper(f, z), [3.0, 0.05]),
    "elastica": (lambda L, EI, f: flexible.elastica(L, EI, f), [1.0, 1.0, 0.5]),
}  # fmt: skip
# squares of velocities near the largest float are infinite, which no border is asked to foresee
OVERFLOWING = ("idm", "ddm", "coriolis_matrix", "kinetic_energy", "torque_regressor",
               "energy_regressor")  # fmt: skip


def check_numbers(answer):
    """No NaN that nobody speaks of: arrays are finite, or their rows are marked."""
    if isinstance(answer, np.ndarray) and answer.dtype.kind == "f":
        assert np.isfinite(answer).all(), "NaN or infinity in the answer"
    if dataclasses.is_dataclass(answer) and hasattr(answer, "valid") and hasattr(answer, "q"):
        assert np.isfinite(answer.q[answer.valid]).all()


def overflows(bad):
    """Finite numbers whose squares and sums are none: what comes of them is the arithmetic's."""
    array = np.asarray(bad) if isinstance(bad, float | np.ndarray) else np.zeros(1)
    if array.dtype != np.float64:
        return False
    return bool((np.isfinite(array) & (np.abs(array) > 1e150)).any())


@pytest.mark.parametrize("name", list(CALLS))
def test_bad_arguments_are_refused_or_answered(name):
    call, good = CALLS[name]
    call(*good)  # compiled here, not within the limit of time
    if name in ("igm", "igm_mask"):  # the base itself is met by a whole family of postures
        call(np.eye(4), *good[1:])
    assert outcome(lambda: call(*good), check_numbers, ()) is Outcome.ANSWERED
    found = []
    for place in range(len(good)):
        for bad in BAD:
            arguments = [*good]
            arguments[place] = bad
            large = overflows(bad) and name in OVERFLOWING
            check = (lambda answer: None) if large else check_numbers
            try:
                outcome(lambda arguments=arguments: call(*arguments), check, ())
            except Exception as error:  # noqa: BLE001  what else comes is counted
                if not (overflows(bad) and "overflow" in str(error)):
                    found.append(f"argument {place} = {bad!r:.80}: {error!r:.200}")
    assert not found, f"{name}:\n" + "\n".join(found)
