"""Exciting trajectories: gradients, limits, quality beside random motions, files, the command."""

import json

import numpy as np
import pytest
import yaml
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.errors import FrameNotFoundError, InvalidValueError, ShapeError
from robotmodels.identification import exciting_trajectory, write_trajectory
from robotmodels.identification.excitation.exciting import (
    excitation_limits,
    excitation_torques,
    origin_distances,
)
from robotmodels.identification.excitation.motions import MotionBasis
from robotmodels.identification.excitation.objective import ExcitationProblem
from robotmodels.obstacles import Box, Plane, Sphere
from robotmodels.trajectories import MotionLimits, quintic

ROBOTS = {
    "serial": {"f": 4},
    "coupled wrist": {"prismatic": False, "transmission": True, "f": 4},
    "tree with fixed frames": {"tree": True, "fixed": True, "f": 6, "tip": "any"},
}


def robot(kind, seed=0):
    return random_model(np.random.default_rng(seed), drive=True, **ROBOTS[kind])


def quick(name="planar_2r", **options):
    few = {"starts": 1, "baseline": 3, "iterations": 20, "rng": 0}
    return exciting_trajectory(rm.load(name), **{**few, **options})


BODIES = Box([-0.2] * 3, [0.4] * 3), Sphere([0.3, 0.0, 0.2], 0.2)


@pytest.mark.parametrize(
    ("name", "kind", "criterion"),
    [
        ("serial", "fourier", "condition"),
        ("coupled wrist", "spline", "log_det"),
        ("tree with fixed frames", "fourier", "condition"),
    ],
)
def test_gradient_of_the_search(name, kind, criterion):
    model, rng = robot(name, 8), np.random.default_rng(6)
    base = rm.base_parameters(model, drive=("Ia", "Fv", "Fc"))
    limits = MotionLimits(2.0, 8.0, 80.0, lower=-1.5, upper=2.0).for_joints(model.n)
    torques = np.abs(rm.idm(model, *random_state(model, rng, 200))).mean(axis=0)
    weight, basis = rng.uniform(0.5, 2.0, (model.n, len(base))), MotionBasis(kind, 4.0, 4)

    def distances(q):
        return origin_distances(model, (1, None), Box([-0.3] * 3, [0.3, 0.3, 9.0]), BODIES, q)

    problem = ExcitationProblem(
        model, basis, base, criterion, limits, torques, distances, 40, weight, 0.01
    )
    x = 0.6 * rng.normal(size=problem.units.size)
    value, gradient = problem.value(x, 8.0, 50.0)
    assert value > problem.value(x, 8.0, 0.0)[0] + 1.0  # every limit is exceeded somewhere
    for _ in range(3):
        d = rng.normal(size=x.size)
        ends = [problem.value(x + h * d, 8.0, 50.0)[0] for h in (2e-7, -2e-7)]
        expected = (ends[0] - ends[1]) / 4e-7
        assert np.isclose(gradient @ d, expected, rtol=3e-5, atol=1e-5 * np.linalg.norm(gradient))


# --- results --------------------------------------------------------------------------------------


def keeps_limits(found):
    """Configurations on a fine grid, where every limit is tested."""
    t = np.linspace(0.0, found.basis.duration, 6007)
    q, v, a = (f(t) for f in (found.trajectory.q, found.trajectory.v, found.trajectory.a))
    of, room = found.limits.motion.limits, 1.0 + 1e-9
    assert found.limits.kept, found.limits.violations()
    assert ((q <= of.upper + 1e-9) & (q >= of.lower - 1e-9)).all()
    rest = np.stack((v[[0, -1]], a[[0, -1]]))
    assert np.allclose(q[0], q[-1])
    assert np.allclose(rest, 0.0, atol=1e-9)
    assert ((np.abs(v) <= room * of.velocity) & (np.abs(a) <= room * of.acceleration)).all()
    torque = np.abs(rm.idm(found.model, q, v, a)).max(axis=0)
    assert (torque <= room * np.minimum(found.limits.torque_limits, found.limits.torque)).all()
    return q


@pytest.fixture(scope="module")
def rx90():
    return quick("rx90", starts=2, baseline=20, iterations=60)


def test_rx90_is_excited_far_better_than_by_chance(rx90):
    assert rx90.condition < 32.0
    assert rx90.condition < 0.75 * rx90.baseline_conditions[0]
    assert len(rx90.baseline) == 20
    assert all(start.after.condition < start.before.condition for start in rx90.starts)
    assert sum(rx90.starts[0].stages) == len(rx90.starts[0].history)
    keeps_limits(rx90)
    assert "joint 1, 2, 3, 4, 5, 6" in rx90.notes[0]
    assert "Of 2 starts 2 ended within the limits, at condition numbers from" in rx90.notes[-1]
    # its numbers are those of the base regressor
    t = np.arange(500) * 0.02
    motion = [f(t) for f in (rx90.trajectory.q, rx90.trajectory.v, rx90.trajectory.a)]
    full = rm.torque_regressor(rx90.model, *motion, drive=("Ia", "Fv", "Fc"))
    W = rx90.base.reduce(full).reshape(-1, len(rx90.base))
    assert np.isclose(np.linalg.cond(W), rx90.condition, rtol=1e-9)
    assert np.isclose(np.linalg.cond(W / np.linalg.norm(W, axis=0)), rx90.scaled_condition)
    assert np.isclose(np.linalg.slogdet(W.T @ W / len(t))[1], rx90.log_det)


@pytest.mark.parametrize(("kind", "criterion"), [("fourier", "log_det"), ("spline", "condition")])
def test_tight_torques_and_distances_are_kept(kind, criterion):
    bodies = [Plane([0.0, 0.0, 0.1], [0.0, 0.0, 1.0]), Box([0.2, 0.2, -1.0], [2.0, 2.0, 2.0])]
    workspace, frames = Box([-1.2] * 3, [1.2] * 3), ("tool", "wrist_3_joint")
    torques = np.array([120.0, 130.0, 80.0, 20.0, 20.0, 20.0])
    limits = MotionLimits.of_model(rm.load("ur10e"), acceleration=5.0)
    found = quick(
        "ur10e", limits=limits, rng=3, kind=kind, criterion=criterion, torque_limits=torques,
        workspace=workspace, obstacles=bodies, frames=frames,
    )  # fmt: skip
    q = keeps_limits(found)
    assert np.array_equal(found.limits.torque_limits, torques)
    distances, _ = origin_distances(found.model, frames, workspace, bodies, q)
    assert distances.min() >= found.limits.clearance - 1e-9 >= 0.0
    assert found.quality.of(criterion) < min(quality.of(criterion) for quality in found.baseline)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("name", "b"), [("tx40", 61), ("panda", 69)])
def test_coupled_wrist_and_seven_joints(name, b):
    found = quick(name, drive=True, iterations=25)
    assert len(found.base) == b
    assert found.condition < 60.0
    keeps_limits(found)


def test_infeasible_limits_are_a_status_that_names_them():
    bodies, box = [Sphere([0, 0, 0], 9.0)], Box([-3, -3, 0.6], [3, 3, 0.8])
    weak = [330, 0.5, 0.5, 56, 56, 56]
    found = quick("ur10e", torque_limits=weak, workspace=box, obstacles=bodies, iterations=5)
    assert found.status.name == "INFEASIBLE"
    broken = " ".join(found.limits.violations())
    assert "allowed 0.5" in broken
    assert "workspace" in broken
    assert found.baseline == ()


def test_missing_limits_are_assumed_and_noted():
    limits, notes = excitation_limits(rm.load("stanford_arm"))
    assert np.isfinite([limits.lower, limits.upper, limits.velocity, limits.acceleration]).all()
    assert limits.velocity[[2, 0]].tolist() == [1.0, np.pi]
    assert len(notes) == 2
    given = MotionLimits(1.0, 3.0, lower=-1.0, upper=[1.0, np.inf])
    kept, notes = excitation_limits(rm.load("planar_2r"), given)
    assert kept.upper[1] == pytest.approx(2.0 * np.pi - 1.0)
    assert kept.acceleration.tolist() == [3.0, 3.0]
    assert notes == ("No limit of position is given for joint 2; 3.142 is taken.",)
    bare = rm.load("tx40").with_inertia(None)
    torques, notes = excitation_torques(bare, None)
    assert np.isinf(torques).all()
    assert "no inertial parameters" in notes[0]
    with pytest.raises(InvalidValueError, match="with_inertia"):
        excitation_torques(bare, 10.0)


def test_mistakes_are_named():
    for options, error, message in (
        ({"harmonics": 1}, InvalidValueError, "at least 2"),
        ({"kind": "spline", "rest": False}, InvalidValueError, "rest"),
        ({"kind": "bezier"}, InvalidValueError, "'fourier', 'spline'"),
        ({"samples": 3}, InvalidValueError, "take more"),
        ({"iterations": 1.5}, InvalidValueError, "iterations"),
        ({"torque_limits": [1.0, 2.0, 3.0]}, ShapeError, "torque_limits"),
        ({"limits": MotionLimits(0.0)}, InvalidValueError, "no range"),
        ({"frames": "hand"}, FrameNotFoundError, "hand"),
        ({"base": rm.base_parameters(rm.load("rx90"))}, InvalidValueError, "others"),
    ):
        with pytest.raises(error, match=message):
            quick(**options)


# --- files and the command ------------------------------------------------------------------------

SHORT = {"harmonics": 3, "baseline": 2, "iterations": 5}


@pytest.fixture(scope="module")
def stanford():
    return quick("stanford_arm", **SHORT)


@pytest.mark.parametrize("degrees", [False, True])
def test_csv_holds_samples_and_their_units(stanford, tmp_path, degrees):
    path = tmp_path / "a.csv"
    write_trajectory(stanford, path, rate=50.0, degrees=degrees)
    header = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    angle = "deg" if degrees else "rad"
    assert header[:4] == ["t (s)", f"q joint_1 ({angle})", f"q joint_2 ({angle})", "q joint_3 (m)"]
    assert header[18] == f"a joint_6 ({angle}/s^2)"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.allclose(rows[:, 0], np.arange(501) / 50.0)
    factor = np.where(np.arange(6) == 2, 1.0, 180.0 / np.pi if degrees else 1.0)
    for k, values in enumerate(
        (stanford.trajectory.q, stanford.trajectory.v, stanford.trajectory.a)
    ):
        expected = values(rows[:, 0]) * factor
        assert np.allclose(rows[:, 1 + 6 * k : 7 + 6 * k], expected, rtol=1e-10, atol=1e-10)


def test_npz_ros_and_other_trajectories(stanford, tmp_path):
    write_trajectory(stanford, tmp_path / "a.npz", rate=30.0)
    with np.load(tmp_path / "a.npz") as data:
        assert np.array_equal(data["q"], stanford.trajectory.q(data["t"]))
        assert data["units"].tolist() == ["rad", "rad", "m", "rad", "rad", "rad"]
    write_trajectory(stanford, tmp_path / "a.yaml", rate=30.0)
    message = yaml.safe_load((tmp_path / "a.yaml").read_text(encoding="utf-8"))
    assert message["joint_names"] == list(stanford.model.table.joint_names)
    assert len(message["points"]) == 301
    point = message["points"][100]
    assert point["time_from_start"] == {"sec": 3, "nanosec": 333333333}
    assert np.allclose(point["accelerations"], stanford.trajectory.a(100 / 30.0), atol=1e-10)
    assert set(point) == {"positions", "velocities", "accelerations", "time_from_start"}
    move = quintic([0.0, 1.0], [1.0, 2.0], duration=0.35)
    write_trajectory(move, tmp_path / "b.csv", rate=10.0, names=["x", "y"], turns=[True, False])
    rows = np.loadtxt(tmp_path / "b.csv", delimiter=",", skiprows=1)
    assert rows[:, 0].tolist() == [0.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize("kind", ["fourier", "spline"])
def test_json_makes_the_same_motion_bit_by_bit(kind, tmp_path):
    result = quick(kind=kind, **SHORT)
    write_trajectory(result, tmp_path / "a.json")
    data = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    again = getattr(rm.trajectories, data["motion"]["generator"])(**data["motion"]["arguments"])
    t = np.linspace(0.0, 10.0, 77)
    assert np.array_equal(again.q(t), result.trajectory.q(t))
    assert np.array_equal(again.a(t), result.trajectory.a(t))
    assert data["condition"] == result.condition
    assert data["limits"]["torque"] == [None, None]
