"""Laws, simulations and estimated poses: closed forms, published cases, statuses."""

import pickle

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from test_visual_servoing import SQUARE, pose, seen_after

import robotmodels as rm
from robotmodels import visual_servoing as vs
from robotmodels.errors import InvalidValueError
from robotmodels.se3 import inverse, rotation, translation

GOAL = translation(0.0, 0.0, 0.5)
START = translation(0.1, -0.05, 0.9) @ rotation("x", 0.4) @ rotation("y", -0.3) @ rotation("z", 0.8)
POINTS = vs.Points(SQUARE)
HALF_TURN = GOAL @ rotation("z", np.pi)
S = vs.ServoStatus


# --- laws ----------------------------------------------------------------------------------------


def test_three_dimensional_servoing_decays_exponentially():
    run = vs.servo(vs.task_3d(GOAL, gain=0.5), START, duration=4.0, step=0.05)
    assert run.reason().startswith("The law was followed to the end: no proof of convergence.")
    for part in (run.error[:, :3], run.error[:, 3:]):
        size = np.linalg.norm(part, axis=1)
        assert size == pytest.approx(size[0] * np.exp(-0.5 * run.t), abs=1e-8)
    # + for the current camera in the desired one: the camera turns back
    step = vs.camera_velocity(vs.task_3d(GOAL), GOAL @ rotation("z", 0.2))
    assert step.error[3:] == pytest.approx([0, 0, -0.2])
    assert step.v == pytest.approx([0, 0, 0, 0, 0, 0.1], abs=1e-12)


@pytest.mark.parametrize("interaction", ["current", "desired", "mean"])
def test_four_points_converge(interaction):
    run = vs.servo(vs.Task(POINTS, GOAL, 1.0, interaction), START, duration=16.0, step=0.05)
    assert run.status is S.CONVERGES
    assert abs(run.T[-1] - GOAL).max() < 1e-6
    task = run.task
    run, again = (vs.servo(task, START, duration=0.5, noise=1e-3, rng=1) for _ in range(2))
    assert (run.s == again.s).all()
    for value in (run, task, vs.camera_velocity(task, START), vs.Camera()):
        assert pickle.loads(pickle.dumps(value)) == value
        assert len(repr(value).splitlines()) <= 6


def test_simulated_poses_are_poses_and_of_order_four():
    lines = vs.Lines([SQUARE[:2], SQUARE[1:3], SQUARE[2:]])
    run = vs.servo(vs.Task(lines, GOAL, 3.0), START, duration=6.0, step=0.5)
    R = run.T[:, :3, :3]
    assert abs(R @ R.swapaxes(1, 2) - np.eye(3)).max() < 1e-9
    last = [
        vs.servo(vs.Task(POINTS, GOAL, 1.0), START, duration=1.6, step=h).T[-1]
        for h in (0.2, 0.1, 0.0125)
    ]
    assert abs(last[0] - last[2]).max() > 12.0 * abs(last[1] - last[2]).max()


def test_matrices_of_the_law():
    L, goal = POINTS.interaction(START), POINTS.interaction(GOAL)
    e = POINTS.measure(START) - POINTS.measure(GOAL)
    depths = np.repeat(0.5, 4), np.repeat(0.8, 4)
    x, y = POINTS.measure(START).reshape(4, 2).T
    fixed = [np.vstack(vs.interaction_point(x, y, Z)) for Z in depths]
    pinv = np.linalg.pinv
    cases = {
        ("current", "true"): pinv(L), ("desired", "true"): pinv(goal),
        ("mean", "true"): 0.5 * (pinv(L) + pinv(goal)), ("current", "desired"): pinv(fixed[0]),
        ("current", 0.8): pinv(fixed[1]), ("mean", 0.8): 0.5 * (pinv(fixed[1]) + pinv(goal)),
    }  # fmt: skip
    for (interaction, depth), inverse_matrix in cases.items():
        task = vs.Task(POINTS, GOAL, 0.7, interaction, depth)
        assert vs.camera_velocity(task, START).v == pytest.approx(-0.7 * inverse_matrix @ e)
    measured = vs.Task(POINTS, POINTS.measure(GOAL), 0.7, depth=0.8)
    assert vs.camera_velocity(measured, POINTS.measure(START)).v == pytest.approx(
        -0.7 * pinv(fixed[1]) @ e
    )


@pytest.mark.sampled(8)
@pytest.mark.parametrize(
    "feature",
    [
        vs.Lines([[SQUARE[0], SQUARE[1]], [SQUARE[1], SQUARE[2]], [SQUARE[2], SQUARE[3]]]),
        vs.Segments([[SQUARE[0], SQUARE[1]], [SQUARE[1], SQUARE[2]]]),
        vs.Circle([0, 0, 0], [0, 0, 1], 0.1),
        vs.Sphere([0, 0, 0], 0.1),
        vs.Cylinder([0, 0, 0], [0.2, 1, 0], 0.05),
        vs.Moments(points=[*SQUARE, [0.2, 0.3, 0.0]], components=("xn", "yn", "an", "alpha")),
        vs.Plane3D([0, 0, 1], 0.0),
        vs.PointAndRotation([0.1, 0, 0], GOAL),
    ],
    ids=lambda f: type(f).__name__,
)
@pytest.mark.parametrize("depth", ["true", "desired", 0.6])
def test_every_feature_is_regulated(feature, depth):
    if depth == 0.6 and isinstance(feature, vs.Circle | vs.Moments):
        # the matrix of a parallel plane is singular where the image is centred
        centred = vs.Task(vs.Circle([0, 0, 0], [0, 0, 1], 0.1), np.zeros(5), depth=0.5)
        assert vs.camera_velocity(centred, [0, 0, 0.01, 0.01, 0]).status is S.SINGULAR
        return
    start = translation(0.05, -0.04, 0.7) @ rotation("x", 0.2) @ rotation("z", 0.4)
    goal = GOAL @ rotation("y", 0.15)
    run = vs.servo(vs.Task(feature, goal, 1.0, depth=depth), start, duration=12.0, step=0.1)
    assert run.status in (S.CONVERGES, S.SINGULAR)
    assert abs(run.error[-1]).max() < 1e-3 * abs(run.error[0]).max()


def test_half_a_turn_about_the_optical_axis():
    back = vs.camera_velocity(vs.Task(POINTS, GOAL), HALF_TURN)
    assert back.v[2] < -0.1
    assert np.delete(back.v, 2) == pytest.approx(np.zeros(5), abs=1e-12)
    assert back.rank == 6
    forwards = vs.camera_velocity(vs.Task(POINTS, GOAL, interaction="desired"), HALF_TURN)
    assert forwards.v[2] > 0.1
    mean = vs.camera_velocity(vs.Task(POINTS, GOAL, interaction="mean"), HALF_TURN)
    assert mean.status is S.SINGULAR
    assert abs(mean.v).max() < 1e-12
    assert mean.rank == 4
    turn = GOAL @ rotation("z", 3.1)
    run = vs.servo(vs.task_2_1_2d(SQUARE, GOAL, 1.0), turn, duration=6.0, step=0.05)
    assert np.ptp(run.T[:, 2, 3]) < 1e-6  # no retreat
    retreat = vs.servo(vs.Task(POINTS, GOAL, 1.0), turn, duration=6.0, step=0.05)
    assert retreat.T[:, 2, 3].max() > 5.0


def test_two_and_a_half_dimensional_servoing():
    run = vs.servo(vs.task_2_1_2d(SQUARE, GOAL, 1.0), START, duration=6.0, step=0.05)
    x = run.s[:, :2] - run.task.s_desired[:2]
    assert abs(x[:, 0] * x[0, 1] - x[:, 1] * x[0, 0]).max() < 1e-7  # a straight image path
    assert abs(run.task.feature.interaction(START)[3:, :3]).max() == 0.0  # block triangular
    assert run.error == pytest.approx(np.exp(-run.t)[:, None] * run.error[0], abs=1e-6)


def test_three_points_are_singular_on_their_cylinder():
    rng = np.random.default_rng(0)
    for _ in range(50):
        tri = rng.uniform(-0.3, 0.3, (3, 3))
        a, b = tri[1] - tri[0], tri[2] - tri[0]
        n = np.cross(a, b)
        centre = tri[0] + np.cross(n, (b @ b) * -a + (a @ a) * b) / (-2.0 * (n @ n))
        radius = np.linalg.norm(tri[0] - centre)
        assert np.linalg.norm(tri - centre, axis=1) == pytest.approx([radius] * 3)
        n, side = n / np.linalg.norm(n), np.cross(n, a)
        u = rng.normal() * a + rng.normal() * side
        for factor in (1.0, 1.3):
            eye = centre + factor * radius * u / np.linalg.norm(u) + rng.uniform(0.5, 1.5) * n
            T = looking(eye, tri.mean(axis=0))
            if ((tri @ T[:3, :3].T + T[:3, 3])[:, 2] < 0.1).any():
                continue
            sizes = np.linalg.svd(vs.Points(tri).interaction(T), compute_uv=False)
            step = vs.camera_velocity(vs.Task(vs.Points(tri), np.zeros(6), depth="true"), T)
            if factor == 1.0:
                assert sizes[-1] < 1e-12 * max(1.0, sizes[0])
                assert step.status is S.SINGULAR
                assert step.rank == 5
            else:
                assert sizes[-1] > 1e-6
                assert step.status is S.CONVERGES


def looking(eye, target):
    """Pose of the world in a camera at a point that looks at another."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross([0.3, 1.0, 0.2], z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack((x, np.cross(z, x), z)), eye
    return inverse(T)


def test_a_local_minimum_of_four_points_is_recognised():
    """A tilted square looks nearly as one tilted the other way: SciPy finds the minimum there."""
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(12):
        turn = rotation("z", rng.uniform(-3, 3))
        tilt = rng.uniform(0.3, 0.8)
        goal = translation(0, 0, rng.uniform(0.8, 1.5)) @ turn @ rotation("x", tilt)
        other = translation(*goal[:3, 3]) @ turn @ rotation("x", -tilt)

        def error(x, other=other, goal=goal):
            return POINTS.measure(seen_after(other, x)) - POINTS.measure(goal)

        best = least_squares(error, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        T = seen_after(other, best.x)
        if abs(T - goal).max() < 0.1:
            continue  # so near there is one minimum
        found += 1
        step = vs.camera_velocity(vs.Task(POINTS, goal), T)
        assert np.linalg.norm(step.error) > 1e-5
        assert (step.status, step.rank) == (S.AT_MINIMUM, 6)
        beside = seen_after(T, 0.03 * rng.normal(size=6))
        nearby = vs.camera_velocity(vs.Task(POINTS, goal), beside)
        assert nearby.status is S.CONVERGES
        trapped = vs.servo(vs.Task(POINTS, goal), T @ rotation("x", 0.02), duration=20.0, step=0.2)
        assert trapped.status is S.AT_MINIMUM
    assert found >= 6


def test_statuses_out_of_sight_and_behind():
    camera = vs.Camera()
    task = vs.Task(POINTS, GOAL)
    aside = translation(0.45, 0.0, 1.0)
    assert vs.camera_velocity(task, aside, camera).status is S.OUT_OF_SIGHT
    assert vs.camera_velocity(task, aside).status is S.CONVERGES
    behind = vs.camera_velocity(task, translation(0, 0, -1.0), camera)
    assert (behind.status, behind.rank, abs(behind.v).max()) == (S.BEHIND, 0, 0.0)
    batch = vs.camera_velocity(task, [START, translation(0, 0, -1), GOAL])
    assert batch.v.shape == (3, 6)
    assert batch.status.tolist() == [S.CONVERGES, S.BEHIND, S.CONVERGES]
    assert batch.reason(1) == S.BEHIND.sentence
    assert vs.camera_velocity(task, np.empty((0, 4, 4))).v.shape == (0, 6)
    run = vs.servo(task, aside, camera, duration=1.0)
    assert run.status is S.OUT_OF_SIGHT
    assert len(run.t) == 1
    assert vs.servo(task, translation(0, 0, -1.0)).status is S.BEHIND
    for feature in (vs.Sphere([0, 0, 0], 0.1), vs.Lines([SQUARE[1:3]]), vs.PoseError()):
        law = vs.Task(feature, GOAL)
        assert vs.camera_velocity(law, aside, camera).status is S.OUT_OF_SIGHT
        assert vs.camera_velocity(law, GOAL, camera).status is S.CONVERGES


def test_angles_of_errors_take_the_short_way():
    line = vs.Lines([[[0.1, -1, 0], [0.1, 1, 0]]])
    for shift in (0.0, np.pi / 2, np.pi, -np.pi / 2):
        a, b = (GOAL @ rotation("z", shift + d) for d in (-0.05, 0.05))
        assert abs(vs.camera_velocity(vs.Task(line, a), b).error[1]) < 0.11


# --- hybrid tasks, targets -----------------------------------------------------------------------


def test_hybrid_task_along_a_line():
    line = vs.Task(vs.Lines([[[0, 0, 0], [1, 0, 0]]]), GOAL, gain=1.5)
    hybrid = vs.Hybrid(line, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    run = vs.servo(hybrid, START, duration=6.0, step=0.05)
    assert run.error == pytest.approx(np.exp(-1.5 * run.t)[:, None] * run.error[0], abs=1e-6)
    assert run.velocity[-1][0] == pytest.approx(0.1, abs=1e-3)
    free = vs.virtual_link(line.feature, GOAL).kernel_twists
    step = vs.camera_velocity(vs.Hybrid(line, np.arange(1.0, 7.0), weight=2.0), GOAL)
    assert step.v == pytest.approx(2.0 * free.T @ (free @ np.arange(1.0, 7.0)))
    # a task and a function as secondary motions: the primary error does not notice
    for secondary in (vs.Task(POINTS, GOAL @ translation(0, 0, 0.1)), lambda T: np.ones(6)):
        v = vs.camera_velocity(vs.Hybrid(line, secondary), START).v
        alone = vs.camera_velocity(line, START).v
        assert abs(v - alone).max() > 1e-3
        assert line.feature.interaction(START) @ (v - alone) == pytest.approx(np.zeros(2), abs=1e-9)


def test_moving_targets_are_tracked():
    twist, task = [0.02, 0.01, 0.0, 0.0, 0.0, 0.05], vs.Task(POINTS, GOAL, gain=1.0)
    options = {"duration": 10.0, "step": 0.05, "target": twist}
    lag = vs.servo(task, START, **options)
    assert abs(lag.error[-1]).max() > 0.02
    assert lag.status is S.STEADY_ERROR
    for tracker in (vs.TargetMotion(kalman=False), vs.TargetMotion()):
        assert abs(vs.servo(task, START, tracking=tracker, **options).error[-1]).max() < 1e-4
    noisy = [
        vs.servo(task, START, tracking=vs.TargetMotion(kalman, 0.1, 1e-3), noise=1e-3, rng=4,
                 **options)
        for kalman in (True, False)
    ]  # fmt: skip
    shake = [np.std(run.velocity[100:], axis=0).max() for run in noisy]
    assert shake[0] < 0.5 * shake[1]  # the filter pays


@pytest.mark.parametrize("seed", range(6))
def test_noise_leaves_an_error_and_exact_measurements_none(seed):
    rng = np.random.default_rng(seed)
    points, gain = vs.Points(rng.uniform(-0.1, 0.1, size=(5, 3))), rng.uniform(0.3, 2.0)
    T0 = translation(*0.03 * rng.normal(size=3)) @ GOAL @ rm.se3.from_rpy(0.2 * rng.normal(size=3))
    options = {"duration": 10.0 / gain, "step": 0.1 / gain, "rng": seed}
    for task in (vs.Task(points, GOAL, gain), vs.task_3d(GOAL, gain)):
        assert vs.servo(task, T0, **options).status is S.CONVERGES
        assert vs.servo(task, T0, noise=1e-3, **options).status is S.STEADY_ERROR


def test_the_kalman_gain_is_the_known_one():
    """Steady gains of a constant-slope filter: alpha-beta with the tracking index."""
    tracker, h = vs.TargetMotion(process=2.0, noise=1e-3), 0.02
    state = tracker.start([0.0])
    for _ in range(2000):
        state = tracker.update(state, [0.0], [0.0], h)
    P, r = state.covariance, 2.0 * (1e-3 / h) ** 2
    F = np.array([[1.0, h], [0.0, 1.0]])
    Q = 4.0 * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])
    before = F @ P @ F.T + Q
    K = before[:, :1] / (before[0, 0] + r)
    assert before - K @ before[:1] == pytest.approx(P, rel=1e-9)  # the Riccati equation
    assert np.linalg.eigvalsh(P).min() > 0.0


# --- robots --------------------------------------------------------------------------------------

UR5 = rm.load("ur5")
POSTURE = np.array([0.3, -1.2, 1.5, -1.8, -1.4, 0.2])
MOUNTINGS = [
    vs.EyeInHand(translation(0.0, 0.05, 0.05) @ rotation("z", 0.3)),
    vs.EyeToHand(translation(1.0, 0.0, 0.5) @ rotation("y", -1.5)),
]


@pytest.mark.parametrize("mounting", MOUNTINGS, ids=["eye in hand", "eye to hand"])
@pytest.mark.parametrize("law", [vs.Task(POINTS, GOAL, 1.5), vs.task_3d(GOAL, 1.5)], ids=["2", "3"])
def test_a_robot_follows(mounting, law):
    run = vs.servo(law, START, robot=UR5, q0=POSTURE, mounting=mounting, duration=12.0, step=0.05)
    assert run.status is S.CONVERGES
    assert abs(run.error[-1]).max() < 1e-6
    assert ((UR5.lower <= run.q) & (run.q <= UR5.upper)).all()
    # poses agree with the joints: what is fixed stays fixed
    tool = rm.dgm(UR5, run.q)
    held = mounting.T_tool_camera if isinstance(mounting, vs.EyeInHand) else None
    camera = (
        tool @ held if held is not None else np.broadcast_to(mounting.T_world_camera, tool.shape)
    )
    assert run.cameras == pytest.approx(camera)
    world = camera @ run.T
    fixed = world if held is not None else inverse(tool) @ world
    assert abs(fixed - fixed[0]).max() < 1e-9
    # the camera moves relative to the object as the law asks
    for k in (0, 40):
        after = seen_after(run.T[k], 0.05 * run.velocity[k])
        assert abs(after - run.T[k + 1]).max() < 5e-3 * abs(run.velocity[k]).max()


def test_limits_are_kept_and_named():
    narrow = rm.kinematics.JointBounds(
        lower=POSTURE - 0.05, upper=POSTURE + 0.05, step=0.05, velocity=0.5
    )
    run = vs.servo(
        vs.Task(POINTS, GOAL, 1.5), START, robot=UR5, q0=POSTURE, duration=4.0, step=0.05,
        limits=narrow,
    )  # fmt: skip
    assert abs(run.q - POSTURE).max() <= 0.05 + 1e-9
    assert abs(np.diff(run.q, axis=0)).max() <= 0.5 * 0.05 + 1e-9
    assert run.status is S.LIMITED
    assert abs(run.error[-1]).max() > 1e-3
    with pytest.raises(InvalidValueError, match="inside the limits"):
        vs.servo(vs.Task(POINTS, GOAL), START, robot=UR5, q0=np.full(6, 9.0))


# --- poses ---------------------------------------------------------------------------------------


def test_fischler_and_bolles():
    """Equilateral triangle of side 2 sqrt(3) and three legs of 4: four solutions."""
    side = 2.0 * np.sqrt(3.0)
    tri = side * np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0]])
    height = np.sqrt(16.0 - side**2 / 3.0)
    image = (tri - tri.mean(axis=0))[:, :2] / height
    found = vs.p3p(tri, image)
    legs = np.linalg.norm(tri @ found.T[:, :3, :3].swapaxes(1, 2) + found.T[:, None, :3, 3], axis=2)
    expected = [(1, 4, 4), (4, 1, 4), (4, 4, 1), (4, 4, 4)]
    assert sorted(map(tuple, legs.round(9))) == expected
    assert found.count == 4


@pytest.mark.parametrize("size", [1.0, 0.1, 0.01, 0.001])
def test_the_true_pose_is_among_those_of_three_points(size):
    rng = np.random.default_rng(5)
    P, T = size * rng.uniform(-1.0, 1.0, (2500, 3, 3)), np.tile(np.eye(4), (2500, 1, 1))
    T[:, :3, :3] = Rotation.random(2500, random_state=rng).as_matrix()
    T[:, :3, 3] = np.c_[rng.uniform(-1, 1, (2500, 2)), rng.uniform(2.5, 6, 2500)]
    X = P @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
    found = vs.p3p(P, X[..., :2] / X[..., 2:])
    off = np.nanmin(abs(found.T - T[:, None]).max(axis=(2, 3)), axis=1)
    assert off.max() < 1e-9
    assert found.residual[found.valid].max() < 1e-9
    assert np.isnan(found.T[~found.valid]).all()
    assert found.count.max() <= 4
    assert vs.p3p(P[:0], X[:0, :, :2]).T.shape == (0, 0, 4, 4)


def test_pose_of_many_points():
    rng = np.random.default_rng(6)
    both = 0
    for k in range(24):
        n, planar = int(rng.integers(4, 12)), bool(k % 2)
        P = rng.uniform(-0.3, 0.3, (n, 3)) * (1.0, 1.0, 0.0 if planar else 1.0)
        T = pose(rng, tilt=2.0)
        image = vs.Points(P).measure(T).reshape(n, 2)
        assert abs(vs.pnp(P, image).T[0] - T).max() < 1e-9
        noisy = image + 2e-3 * rng.normal(size=image.shape)
        found = vs.pnp(P, noisy)
        both += found.count == 2
        errors = []
        for minimum in found.T:  # no gradient at a minimum, and more error nearby
            s, L = vs.Points(P).measure(minimum), vs.Points(P).interaction(minimum)
            e = s - noisy.ravel()
            assert abs(L.T @ e).max() < 1e-8
            errors.append(e @ e)
            for twist in 1e-3 * np.vstack((np.eye(6), -np.eye(6))):
                f = vs.Points(P).measure(seen_after(minimum, twist)) - noisy.ravel()
                assert f @ f > e @ e
        assert errors == sorted(errors)
        near = vs.refine_pose(P, noisy, seen_after(found.T[0], 0.01 * rng.normal(size=6)))
        assert abs(near.T[0] - found.T[0]).max() < 1e-8
        assert near.status == vs.PoseStatus.FOUND
    assert both >= 6
    assert vs.pnp(P, np.stack((image, noisy))).T.shape[0] == 2
    assert vs.pnp(P[:3], image[:3]).count >= 1
    camera, X = vs.Camera(focal=(800, 600)), rng.uniform((-1, -1, 1), (1, 1, 3), (5, 4, 3))
    assert camera.normalise(camera.project(X)) == pytest.approx(X[..., :2] / X[..., 2:])


def test_a_square_far_away_has_two_minima():
    T = translation(0.1, 0.0, 4.0) @ rotation("x", 0.6)
    found = vs.pnp(SQUARE, POINTS.measure(T).reshape(4, 2))
    assert found.status == vs.PoseStatus.TWO_MINIMA
    assert abs(found.T[0] - T).max() < 1e-9
    normals = found.T[:, :3, 2]
    assert normals[0] @ normals[1] < np.cos(0.9)  # tilted the other way
    assert found.residual[1] > found.residual[0]


def test_homographies():
    rng = np.random.default_rng(7)
    for _ in range(100):
        n = rng.uniform((-0.7, -0.7, 1.0), (0.7, 0.7, 1.0))
        n, d = n / np.linalg.norm(n), rng.uniform(0.5, 2.0)
        R = Rotation.from_rotvec(0.3 * rng.normal(size=3)).as_matrix()
        t = 0.1 * rng.normal(size=3)
        x = rng.uniform(-0.3, 0.3, (8, 2))
        rays = np.c_[x, np.ones(8)]
        X = rays * (d / (rays @ n))[:, None]
        Y = X @ R.T + t
        H = vs.homography(x, Y[:, :2] / Y[:, 2:])
        assert pytest.approx(R + np.outer(t, n) / d, abs=1e-9) == H
        for motions, most in ((vs.decompose_homography(-3.0 * H), 4),
                              (vs.decompose_homography(H, x), 2)):  # fmt: skip
            assert 1 <= len(motions.R) <= most
            off = abs(motions.R - R).max(axis=(1, 2)) + abs(motions.t - t / d).max(axis=1)
            assert (off + abs(motions.n - n).max(axis=1)).min() < 1e-8
            back = motions.R + motions.t[:, :, None] * motions.n[:, None]
            assert back == pytest.approx(np.broadcast_to(H, back.shape), abs=1e-9)
    both = vs.decompose_homography(np.stack((R, H)), x)  # no translation, then two motions
    assert both.R[1] == pytest.approx(vs.decompose_homography(H, x).R)
    assert np.isnan(both.t[0, 1:]).all()
    n = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
    for size in (0.3, -0.3):  # translation along the normal
        R = rotation("z", 0.4)[:3, :3]
        both = vs.decompose_homography(R + np.outer(size * (R @ n), n))
        assert abs(both.R - R).max() < 1e-7
        assert both.R.shape == (2, 3, 3)
        assert abs(abs(both.n @ n) - 1.0).max() < 1e-9
        assert (both.n[0] == -both.n[1]).all()
    turn = vs.decompose_homography(rotation("x", 0.3)[:3, :3])
    assert turn.R.shape == (1, 3, 3)
    assert turn.t.tolist() == [[0.0, 0.0, 0.0]]
