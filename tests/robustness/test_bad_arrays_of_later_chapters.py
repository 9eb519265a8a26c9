"""Arrays of wrong shapes and kinds in chapters 2 to 7 and in loops: refused, or computed."""

import numpy as np
import pytest
from looped_robots import four_bar
from robustness.inputs import planar
from robustness.outcomes import Outcome, outcome
from robustness.test_bad_arrays import BAD, check_numbers, overflows

import robotmodels as rm
from robotmodels import control, flexible, loops, parallel, performance, trajectories
from robotmodels import visual_servoing as vs
from robotmodels.obstacles import Sphere, clearance

MODEL = planar()
ARM = MODEL.with_inertia(rm.uniform_bodies(MODEL, 4.0))
Q, V, A = np.array([0.3, 0.4]), np.array([0.1, -0.2]), np.array([0.5, 0.6])
LIMITS = trajectories.MotionLimits(velocity=1.0, acceleration=2.0)

HEXAPOD = parallel.gough_symmetric(1.0, lower=0.8, upper=1.5)
T = HEXAPOD.pose([0.1, 0.05, 1.0, 0.1, 0.2, 0.1])
LEGS = parallel.igm(HEXAPOD, T).q[0]
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
    "parallel.igm": (lambda T: parallel.igm(HEXAPOD, T), [T]),
    "parallel.dgm": (lambda q, T0: parallel.dgm(HEXAPOD, q, T0), [LEGS, T]),
    "assembly_modes": (lambda q: parallel.assembly_modes(HEXAPOD, q), [LEGS]),
    "parallel.ikm": (lambda T, V: parallel.ikm(HEXAPOD, T, V), [T, TWIST]),
    "parallel.dkm": (lambda T, v: parallel.dkm(HEXAPOD, T, v), [T, TWIST]),
    "leg_forces": (lambda T, f: parallel.leg_forces(HEXAPOD, T, f), [T, TWIST]),
    "stiffness": (lambda T, k: parallel.stiffness(HEXAPOD, T, k), [T, np.ones(6)]),
    "condition": (lambda T, L: parallel.condition(HEXAPOD, T, L), [T, 1.0]),
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


@pytest.mark.parametrize("name", list(CALLS))
def test_good_arguments_are_answered(name):
    call, good = CALLS[name]
    call(*good)  # compiled here, not within the limit of time
    assert outcome(lambda: call(*good), check_numbers, ()) is Outcome.ANSWERED


@pytest.mark.parametrize("name", list(CALLS))
def test_bad_arguments_are_refused_or_answered(name):
    call, good = CALLS[name]
    call(*good)
    found = []
    for place in range(len(good)):
        for bad in BAD:
            arguments = [*good]
            arguments[place] = bad
            try:
                outcome(lambda arguments=arguments: call(*arguments), check_numbers, ())
            except Exception as error:  # noqa: BLE001  what else comes is counted
                if not (overflows(bad) and "overflow" in str(error)):
                    found.append(f"argument {place} = {bad!r:.80}: {error!r:.200}")
    assert not found, f"{name}:\n" + "\n".join(found)
