"""Arrays of wrong shapes and kinds at the borders of the main functions: refused, or computed."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from robustness.inputs import planar
from robustness.outcomes import Outcome, outcome

import robotmodels as rm
from robotmodels import calibration, identification, trajectories

# torques that have nothing to do with the motion are as good as any here
pytestmark = pytest.mark.filterwarnings("ignore:Poor prediction")

BAD = (
    None, True, "a", "", b"1", 1j, object(), float("nan"), float("inf"), -1e308, 1e308, 10**400, 3,
    [], [[]], [1.0], [1.0, 2.0, 3.0], ["a", "b"], [None, 1.0], [[1.0], [1.0, 2.0]], {}, {"a": 1.0},
    np.array([1.0, np.nan]), np.array([np.inf, 1.0]), np.array([1e308, -1e308]),
    np.array([1.0, 2.0], dtype=object), np.array(["1", "2"]), np.array([1j, 2.0]),
    np.array([True, False]), np.zeros((0, 2)), np.zeros((2, 0)), np.zeros((3, 1)), np.zeros((2, 3)),
    np.zeros((1, 1, 1, 1, 2)), np.ma.masked_array([1.0, 2.0], [True, False]),
    np.array([1, 2], dtype=np.int8), np.array([1.0, 2.0], dtype=np.float16),
    np.array([5e-324, 0.0]), np.datetime64("2020-01-01"), np.zeros(2, "V8"), range(2), (0.0, 1.0),
    iter([1.0, 2.0]), np.eye(4), np.zeros((4, 4)), np.full((4, 4), np.nan), np.eye(4)[None] * 2.0,
    np.zeros((4, 4, 3)), np.eye(3), 1e308 * np.eye(4), lambda: 0, np.zeros((3, 2))[::-1], set(),
)  # fmt: skip


@cache
def arm():
    """Two joints with inertia and friction."""
    model = planar()
    return model.with_inertia(rm.uniform_bodies(model, 4.0))


def _good():
    return np.array([0.3, 0.4]), np.array([0.1, -0.2]), np.array([0.5, 0.6])


Q, V, A = _good()
T = rm.dgm(planar(), Q)
LOG_T = 0.01 * np.arange(60)[:, None]
TIMES = 0.01 * np.arange(400)[:, None]
CALLS = {
    "dgm": (lambda q: rm.dgm(arm(), q), [Q]),
    "link_poses": (lambda q: rm.link_poses(arm(), q), [Q]),
    "link_transforms": (lambda q: rm.link_transforms(arm().table, q), [Q]),
    "jacobian": (lambda q, frame: rm.jacobian(arm(), q, frame), [Q, None]),
    "jacobian_rate": (lambda q, v: rm.jacobian_rate(arm(), q, v), [Q, V]),
    "dkm": (lambda q, v: rm.dkm(arm(), q, v), [Q, V]),
    "ikm": (lambda q, w: rm.ikm(arm(), q, w), [Q, np.zeros(6)]),
    "idm": (lambda q, v, a, w: rm.idm(arm(), q, v, a, w), [Q, V, A, np.zeros(6)]),
    "ddm": (lambda q, v, u: rm.ddm(arm(), q, v, u), [Q, V, A]),
    "mass_matrix": (lambda q: rm.mass_matrix(arm(), q), [Q]),
    "coriolis_matrix": (lambda q, v: rm.coriolis_matrix(arm(), q, v), [Q, V]),
    "gravity_torque": (lambda q: rm.gravity_torque(arm(), q), [Q]),
    "kinetic_energy": (lambda q, v: rm.kinetic_energy(arm(), q, v), [Q, V]),
    "torque_regressor": (lambda q, v, a: rm.torque_regressor(arm(), q, v, a), [Q, V, A]),
    "energy_regressor": (lambda q, v: rm.energy_regressor(arm(), q, v), [Q, V]),
    "igm": (lambda T, r: rm.igm(arm(), T, r, mask=[1, 1, 0, 0, 0, 0]), [T, Q]),
    "igm_mask": (lambda T, m: rm.igm(arm(), T, mask=m), [T, [1, 1, 0, 0, 0, 0]]),
    "igm_numeric": (lambda T, q0: rm.igm_numeric(arm(), T, q0, rng=0), [T, Q]),
    "base_parameters": (lambda method: rm.base_parameters(arm(), method), ["symbolic"]),
    "pose_from_coordinates": (lambda x, k: rm.pose_from_coordinates(x, k), [np.zeros(6), "rpy"]),
    "operational_coordinates": (lambda T, k: rm.operational_coordinates(T, k), [T, "rpy"]),
    "joint_trajectory": (
        lambda a, b, N: trajectories.joint_trajectory(a, b, N), [Q, V, 5],
    ),
    "cartesian_trajectory": (lambda a, b, N: trajectories.cartesian_trajectory(a, b, N), [T, T, 5]),
    "with_inertia": (
        lambda x: arm().with_inertia(rm.InertialParameters(x)), [np.zeros((2, 10))],
    ),
    "gravity": (lambda x: arm().with_gravity(x), [[0.0, 0.0, -9.81]]),
    "tool": (lambda x: arm().with_tool(x), [np.eye(4)]),
    "simulate": (
        lambda q, v, t: rm.simulate(arm(), q, v, None, t, max_evaluations=2000),
        [Q, V, np.linspace(0.0, 0.02, 3)],
    ),
    "log": (lambda dt, q, tau: identification.Log(dt, q, tau), [0.01, LOG_T * Q, LOG_T * V]),
    "fit": (
        lambda q, tau: identification.fit(
            arm(), identification.Log(0.01, q, tau), checked=False
        ),
        [np.sin(TIMES * [3.0, 2.0]), np.cos(TIMES * [2.0, 2.5])],
    ),
    "position": (lambda q, p: calibration.Position(q, p), [LOG_T * Q, LOG_T * [1.0, 2.0, 3.0]]),
    "calibrate": (
        lambda q, p: calibration.fit(
            arm(), calibration.Position(q, p), parameters=("theta2",), base=False, tool=False
        ),
        [LOG_T[::4] * Q * 3.0, rm.dgm(planar(), LOG_T[::4] * Q * 3.0)[:, :3, 3]],
    ),
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


@pytest.fixture(scope="module", autouse=True)
def compiled_before():
    # what is compiled at a first call is not interrupted by the limit of time
    for call, good in CALLS.values():
        call(*good)
    for name in ("igm", "igm_mask"):  # the base itself is met by a whole family of postures
        call, good = CALLS[name]
        call(np.eye(4), *good[1:])


@pytest.mark.parametrize("name", list(CALLS))
def test_good_arguments_are_answered(name):
    call, good = CALLS[name]
    assert outcome(lambda: call(*good), check_numbers, ()) is Outcome.ANSWERED


@pytest.mark.parametrize("name", list(CALLS))
def test_bad_arguments_are_refused_or_answered(name):
    call, good = CALLS[name]
    for place in range(len(good)):
        for bad in BAD:
            arguments = [*good]
            arguments[place] = bad
            large = overflows(bad) and name in OVERFLOWING
            check = (lambda answer: None) if large else check_numbers
            try:
                outcome(lambda arguments=arguments: call(*arguments), check, ())
            except Exception as error:
                if large and isinstance(error, RuntimeWarning) and "overflow" in str(error):
                    continue
                raise AssertionError(
                    f"{name}, argument {place} = {bad!r:.80}: {error!r}"
                ) from error
