"""Parallel robots: statics, singular positions, workspaces, dynamics, loops, calibration."""

import pickle

import looped_robots
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_parallel import GOOD, RING, ROBOTS, TURN, moved, poses_near_home, twists

from robotmodels import parallel as pr
from robotmodels import performance, viz
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.geometry import DHTable
from robotmodels.inertia import InertialParameters
from robotmodels.kinematics import dgm
from robotmodels.loops import Closure, LoopedRobot
from robotmodels.model import RobotModel
from robotmodels.parallel import SingularityKind as Kind


def leg_directions(robot, T):
    d = robot.platform @ np.swapaxes(T[:, :3, :3], 1, 2) + T[:, None, :3, 3] - robot.base
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


# --- statics -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_forces_do_the_work_of_the_wrench(name):
    robot, rng = ROBOTS[name], np.random.default_rng(2)
    T, V = poses_near_home(robot, 5), twists(robot, 5)
    W = rng.normal(size=(5, 6))
    found = pr.leg_forces(robot, T, W)
    assert (found.status == pr.ForceStatus.BALANCED).all()
    rates = pr.ikm(robot, T, V)
    work = np.einsum("ni,ni->n", found.forces, rates)
    np.testing.assert_allclose(work, np.einsum("ni,ni->n", W, V), atol=1e-11)
    J = pr.inverse_jacobian(robot, T)
    kept = list(robot.columns)
    balance = np.einsum("nij,ni->nj", J, found.forces)
    np.testing.assert_allclose(balance[:, kept], W[:, kept], atol=1e-10)
    # energy of elastic actuators
    k = rng.uniform(1.0, 2.0, robot.m)
    K = pr.stiffness(robot, T, k)
    energy = np.einsum("ni,nij,nj->n", V, K, V)
    np.testing.assert_allclose(energy, (k * rates**2).sum(axis=1), rtol=1e-12)


def test_indices_of_the_velocity_ellipsoid():
    T = poses_near_home(GOOD, 4)
    for length in (0.3, 1.0):
        J = np.linalg.inv(pr.inverse_jacobian(GOOD, T)) * np.repeat([1, length], 3)[:, None]
        s = np.linalg.svd(J, compute_uv=False)
        np.testing.assert_allclose(pr.condition(GOOD, T, length), s[:, 0] / s[:, -1], rtol=1e-9)
        np.testing.assert_allclose(pr.maneuverability(GOOD, T, length=length), s.prod(axis=1))
    turned = GOOD.pose([0, 0, 1, 0, 0, np.pi / 2])
    assert pr.condition(GOOD, turned) > 1e14
    assert pr.leg_forces(GOOD, turned, np.ones(6)).status == pr.ForceStatus.UNBOUNDED
    assert np.isfinite(pr.dkm(GOOD, turned, np.ones(6))).all()


# --- singular positions --------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [np.pi / 2, -np.pi / 2])
@pytest.mark.parametrize("height", [0.7, 1.0, 2.3])
def test_symmetric_platforms_turned_by_a_right_angle_are_singular(yaw, height):
    """E. Fichter, "A Stewart platform-based manipulator", IJRR 5 (1986)."""
    for base_angle in (0.2, 0.5):
        robot = pr.gough_symmetric(1.0, 0.5, base_angle, 0.3)
        T = robot.pose([0, 0, height, 0, 0, yaw])
        assert abs(pr.determinant(robot, T)) < 1e-12
        found = pr.classify_singularity(robot, T)
        assert (found.kind, found.variety) == (Kind.PARALLEL, "5a")
        assert found.motion.shape == (1, 6)
        np.testing.assert_allclose(pr.ikm(robot, T, found.motion[0]), 0.0, atol=1e-12)
        assert abs(found.motion[0, 5]) > 0.1  # a screw about the vertical
    near = pr.classify_singularity(robot, robot.pose([0, 0, height, 0, 0, yaw * 0.999]))
    assert near.kind == Kind.REGULAR
    assert near.motion.shape == (0, 6)


def on_lines(points, directions, rng):
    """A platform whose legs are on these lines where its frame is that of the world."""
    d = np.array(directions, float)
    d /= np.linalg.norm(d, axis=1)[:, None]
    p = np.array(points, float)
    s, t = rng.uniform(0.5, 1.0, (2, 6, 1))
    return pr.gough(p - s * d, p + t * d)


def lines_of(kind, rng):
    """Points and directions of lines of a variety, and how many of the six."""
    p, d = rng.normal(size=(2, 6, 3))
    if kind == "1":
        p[1], d[1] = p[0] + 0.3 * d[0], d[0]
    elif kind == "2b":
        p[1] = p[2] = p[0]
        d[2] = d[0] - 0.7 * d[1]
    elif kind == "3a":  # a hyperboloid of one sheet
        a = rng.uniform(0, 6, 4)
        p[:4] = np.c_[np.cos(a), np.sin(a), 0 * a]
        d[:4] = np.c_[-np.sin(a), np.cos(a), 1 + 0 * a]
    elif kind == "3b":  # pencils in two planes with the line of their centres in common
        p[1] = p[0]
        p[3] = p[2] = p[0] + (axis := rng.normal(size=3))
        d[1], d[3] = 0.4 * d[0] + axis, d[2] - 0.3 * axis
    elif kind == "3c":
        p[:4] = p[0]
    elif kind == "3d":
        p[:4, 2] = d[:4, 2] = 0.0
    elif kind == "4a":  # a spread: two skew conjugate-complex lines
        p[:5, 2] = 0.0
        d[:5] = np.c_[-p[:5, 1], p[:5, 0], np.ones(5)]
    elif kind == "4b":
        first, second = rng.normal(size=(2, 2, 3))
        p[:5] = first[0] + rng.normal(size=(5, 1)) * first[1]
        d[:5] = second[0] + rng.normal(size=(5, 1)) * second[1] - p[:5]
    elif kind == "4d":  # in a plane, or through one of its points
        p[:2] = 0.0
        p[2:5, 2] = d[2:5, 2] = 0.0
    elif kind == "5a":  # a null plane for each point of a screw of pitch 0.4
        null = np.cross(p, [0, 0, 1.0])
        null[:, 2] -= 0.4
        d -= (d * null).sum(1)[:, None] * null / (null * null).sum(1)[:, None]
    elif kind == "5b":  # K. Hunt: all legs meet a line
        p[:] = p[0] + rng.normal(size=(6, 1)) * d[0]
        d[0] = rng.normal(size=3)
    return p, d, {"1": 2, "2b": 3}.get(kind, int(kind[0]) + 1)


@pytest.mark.parametrize("kind", ["1", "2b", "3a", "3b", "3c", "3d", "4a", "4b", "4d", "5a", "5b"])
def test_grassmann_varieties_of_constructed_legs(kind):
    """J.-P. Merlet, "Singular configurations of parallel manipulators and Grassmann geometry"."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        p, d, count = lines_of(kind, rng)
        order = rng.permutation(6)
        robot = on_lines(p[order], d[order], rng)
        found = pr.classify_singularity(robot, np.eye(4))
        assert found.form == kind
        assert found.variety == (kind if kind[0] == "5" else kind[0])
        assert sorted(order[list(found.legs)]) == list(range(count))
        assert found.kind == Kind.PARALLEL
        np.testing.assert_allclose(pr.ikm(robot, np.eye(4), found.motion[0]), 0.0, atol=1e-6)
        assert kind in found.reason()


def test_singular_positions_of_robots_with_cranks():
    five = pr.five_bar([[0, 0], [1.0, 0]], 0.3, 0.5)
    T = five.pose([0.5, 0.3])  # rods on one line
    assert pr.classify_singularity(five, five.pose([0.5, 0.6])).kind == Kind.REGULAR
    legs = pr.igm(five, T)
    up = int(legs.mode[np.sin(legs.q).sum(axis=1).argmax()])
    stretched = pr.classify_singularity(five, T, mode=up)
    assert (stretched.kind, stretched.variety) == (Kind.PARALLEL, "1")
    # knees of a Delta above the anchors: rods are parallel
    delta = pr.delta(0.1 * RING, 0.4 * RING, TURN, 0.3, 0.8)
    down = pr.classify_singularity(delta, delta.pose([0, 0, -0.8]))
    assert down.kind in (Kind.PARALLEL, Kind.CONSTRAINT)
    # a pair of rods along its own hip axis does not prevent a rotation
    flat = pr.classify_singularity(ROBOTS["delta"], ROBOTS["delta"].home)
    assert flat.kind == Kind.REGULAR
    both = pr.five_bar([[0, 0], [2.0, 0]], 0.4, 0.6)
    assert pr.classify_singularity(both, both.pose([1.0, 0.0])).kind == Kind.BOTH
    with pytest.raises(InvalidValueError, match="out of reach"):
        pr.classify_singularity(five, five.pose([5.0, 0]))


# --- workspaces ----------------------------------------------------------------------------------


def area_of_three_annuli(centres, inner, outer):
    """Area of an intersection of annuli: strips of exact widths, fine."""
    y = np.linspace(-4, 4, 400_001)
    ends = []
    low, high = np.full(y.size, -9.0), np.full(y.size, 9.0)
    for (a, b), r in zip(centres, outer, strict=True):
        half = np.sqrt(np.maximum(r * r - (y - b) ** 2, 0.0))
        low, high = np.maximum(low, a - half), np.minimum(high, a + half)
        high = np.where(np.abs(y - b) < r, high, -9.0)
    width = np.maximum(high - low, 0.0)
    for (a, b), r in zip(centres, inner, strict=True):
        half = np.sqrt(np.maximum(r * r - (y - b) ** 2, 0.0))
        ends.append((np.clip(a - half, low, high), np.clip(a + half, low, high)))
    # holes apart from each other
    width -= np.where(width > 0, sum(np.maximum(b - a, 0) for a, b in ends), 0)
    return np.trapezoid(width, y)


def test_area_of_a_constant_orientation():
    base = np.array([[0, 0], [2.0, 0], [1.0, 1.8]])
    platform = np.array([[0, 0], [0.5, 0], [0.2, 0.5]])
    robot = pr.planar_3rpr(base, platform, [0.3, 0.2, 0.25], [1.6, 1.7, 1.5])
    found = pr.workspace(robot, orientation=np.eye(3))
    exact = area_of_three_annuli(base - platform, robot.lower, robot.upper)
    assert found.area == pytest.approx(exact, rel=1e-4)
    assert isinstance(found, performance.Workspace)
    assert found.points.shape == (90_000, 2)
    assert set(found.count) == {0, 1}
    inside = pr.igm(robot, found.poses).within_limits[:, 0]
    np.testing.assert_array_equal(inside, found.count == 1)
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 3, (50, 2))
    legs = pr.igm(robot, robot.pose(np.c_[points, np.zeros(50)]))
    np.testing.assert_array_equal(found.contains(points), legs.within_limits[:, 0])
    every = pr.workspace(robot, "dexterous", resolution=60)
    some = pr.workspace(robot, "reachable", resolution=60)
    assert every.area < found.area < some.area
    assert np.isnan(found.volume)
    assert len(repr(found).splitlines()) <= 6
    assert pickle.loads(pickle.dumps(every)) == every


def test_shells_about_one_centre_have_a_known_volume():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(6, 3))
    robot = pr.gough(points, points, lower=0.3, upper=1.0, home=moved(np.eye(4), np.ones(6)))
    for resolution in (60, 61):
        found = pr.workspace(robot, orientation=np.eye(3), resolution=resolution)
        assert found.volume == pytest.approx(4 / 3 * np.pi * (1 - 0.027), rel=3e-3)
    robot = pr.gough_symmetric(1.0, lower=0.5, upper=1.2)
    section = pr.workspace(robot, height=float(robot.home[2, 3]), resolution=80)
    assert np.allclose(section.poses[:, 2, 3], robot.home[2, 3])
    inside = pr.igm(robot, section.poses).within_limits[:, 0]
    np.testing.assert_array_equal(inside, section.count == 1)


def test_cones_and_legs_that_touch_cut_the_workspace():
    robot = pr.gough_symmetric(1.0, lower=0.8, upper=1.5)
    options = {"height": 1.0, "resolution": 60}
    plain = pr.workspace(robot, **options)
    cone = pr.workspace(robot, joint_cone=0.25, **options)
    thick = pr.workspace(robot, leg_radius=0.12, **options)
    assert 0.0 < cone.area < plain.area
    assert thick.area < plain.area
    T = cone.poses[cone.count > 0]
    u, v = (leg_directions(robot, X) for X in (T, robot.home[None]))
    inside = np.arccos(np.clip((u * v).sum(axis=-1), -1, 1))
    assert inside.max() <= 0.25 + 1e-9
    turned = pr.workspace(robot, orientation=np.deg2rad(170), leg_radius=0.05, **options)
    assert turned.area == 0.0  # the legs cross
    assert turned.status == performance.WorkspaceStatus.EMPTY


def test_robots_with_cranks_count_working_modes():
    five = ROBOTS["five-bar"]
    found = pr.workspace(five, resolution=60)
    modes = pr.igm(five, found.poses)
    np.testing.assert_array_equal(found.count, modes.count)
    assert found.count.max() == 4
    limited = pr.five_bar([[0, 0], [0.5, 0]], 0.4, 0.6, lower=[4.0, -np.inf], upper=[5.0, 3.0])
    some = pr.workspace(limited, resolution=60)
    inside = pr.igm(limited, some.poses).within_limits.any(axis=-1)
    assert inside.sum() > 100
    np.testing.assert_array_equal(some.margin >= 0.0, inside)
    delta = ROBOTS["delta"]
    space = pr.workspace(delta, resolution=16)
    np.testing.assert_array_equal(space.count > 0, pr.igm(delta, space.poses).count > 0)


# --- dynamics ------------------------------------------------------------------------------------


def with_masses(robot, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3))
    return robot.with_masses(
        (3.0, 0.05 * rng.normal(size=3), A @ A.T + np.eye(3)),
        ((1.0, 0.2, 0.03), (0.8, 0.25, 0.02)), gravity=[0.5, -2.0, -9.81],
    )  # fmt: skip


@pytest.mark.parametrize("name", ROBOTS)
def test_dynamics_are_inverse_and_keep_the_balance_of_power(name):
    robot, h = with_masses(ROBOTS[name]), 1e-5
    T, V, A = poses_near_home(robot, 3), twists(robot, 3), twists(robot, 3, 4)
    W = np.random.default_rng(6).normal(size=(3, 6))
    for mode in (0, 2**robot.m - 1) if robot.has_cranks else (0,):
        tau = pr.idm(robot, T, V, A, W, mode)
        np.testing.assert_allclose(pr.ddm(robot, T, V, tau, W, mode), A, atol=1e-11)

        def energy(s, mode=mode):
            return sum(pr.energies(robot, moved(T, s * V + 0.5 * s * s * A), V + s * A, mode))

        power = np.einsum("ni,ni->n", tau, pr.ikm(robot, T, V, mode))
        power -= np.einsum("ni,ni->n", W[:, list(robot.columns)], V[:, list(robot.columns)])
        rate = (energy(h) - energy(-h)) / (2 * h)
        np.testing.assert_allclose(rate, power, atol=1e-6 * np.abs(power).max() + 1e-6)


@pytest.mark.parametrize("name", ["gough", "delta"])
def test_kinetic_energy_is_that_of_the_parts(name):
    robot, h = with_masses(ROBOTS[name]), 1e-5
    T, V = poses_near_home(robot, 1)[0], twists(robot, 1)[0]
    (m1, s1, i1), (m2, s2, i2) = robot.masses.first[0], robot.masses.second[0]

    def parts(X):
        anchor = robot.platform @ X[:3, :3].T + X[:3, 3]
        knee = robot.base
        if robot.has_cranks:
            q = pr.igm(robot, X).q[0]
            swing = np.cos(q)[:, None] * robot.outward + np.sin(q)[:, None] * robot.downward
            knee = robot.base + robot.crank[:, None] * swing
        u = (anchor - knee) / np.linalg.norm(anchor - knee, axis=1)[:, None]
        along = swing if robot.has_cranks else u
        second = knee + s2 * u if robot.has_cranks else anchor - s2 * u
        return robot.base + s1 * along, second, along, u

    rates = [
        (a - b) / (2 * h)
        for a, b in zip(parts(moved(T, h * V)), parts(moved(T, -h * V)), strict=True)
    ]
    weights = (m1, m2, i1, i2)
    legs = 0.5 * sum(w * (x**2).sum() for w, x in zip(weights, rates, strict=True))
    R, mass = T[:3, :3], robot.masses
    com = V[:3] + np.cross(V[3:], R @ mass.com)
    spin = R.T @ V[3:]
    expected = legs + 0.5 * mass.mass * com @ com + 0.5 * spin @ mass.inertia @ spin
    assert pr.energies(robot, T, V)[0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("name", ["SSM", "3-RRR", "delta"])
def test_simulation_keeps_the_energy(name):
    robot = with_masses(ROBOTS[name])
    motion = pr.simulate(
        robot, robot.home, 0.2 * twists(robot, 1)[0],
        control=lambda t, T, V: 4.0 * np.sin(9 * t) * np.ones(robot.m), t=np.linspace(0, 0.1, 6),
        wrench=[0.1, 0.2, 0.3, 0, 0, 0.1],
    )  # fmt: skip
    assert motion.status == pr.MotionStatus.FINISHED
    assert np.abs(motion.energy_drift).max() < 1e-6
    np.testing.assert_allclose(pr.igm(robot, motion.T).q[:, 0], motion.q, atol=1e-12)
    slope = (motion.T[1, :3, 3] - motion.T[0, :3, 3]) / 0.02
    middle = 0.5 * (motion.V[0, :3] + motion.V[1, :3])
    np.testing.assert_allclose(slope, middle, atol=0.02 * np.abs(motion.V).max())


def test_simulation_ends_at_singular_positions():
    robot = with_masses(pr.gough_symmetric(1.0))
    motion = pr.simulate(robot, robot.home, [0, 0, 0, 0, 0, 20.0], t=1.0)
    assert motion.status == pr.MotionStatus.SINGULAR
    assert motion.t[-1] < 0.5
    assert "singular" in motion.reason()
    five = with_masses(ROBOTS["five-bar"])
    assert pr.simulate(five, five.home, t=2.0).status == pr.MotionStatus.SINGULAR
    right = robot.pose([0, 0, 1, 0, 0, np.pi / 2])
    nothing, rest = (lambda t, T, V: np.full(6, np.nan if t >= 0.05 else 8.0)), np.zeros(6)
    for call, words in (
        (lambda: pr.idm(GOOD, GOOD.home, rest, rest), "with_masses"),
        (lambda: GOOD.with_masses((1.0, np.zeros(3), np.diag([1, 1, -1]))), "symmetric"),
        (lambda: pr.idm(robot, right, rest, rest), "singular"),
        (lambda: pr.simulate(robot, right), "singular"),
        (lambda: pr.simulate(robot, robot.home, control=lambda t, T, V: [1.0], t=0.1), "control"),
        (lambda: pr.simulate(robot, robot.home, None, nothing, 0.1), r"control.*finite"),
    ):
        with pytest.raises((InvalidValueError, ShapeError), match=words):
            call()


# --- kinematic loops -----------------------------------------------------------------------------


def test_a_five_bar_as_loops_is_the_five_bar():
    table = DHTable(
        antecedent=[0, 0, 1, 2, 3, 4], sigma=[0, 0, 0, 0, 2, 2], d=[0, 0.5, 0.4, 0.4, 0.6, 0.6]
    )
    loops = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (5, 6), "point")], [0, 1])
    looped, five = (
        pr.from_loops(loops, 5, [2.0, 1.0, -1.0, 1.0]),
        pr.five_bar([[0, 0], [0.5, 0]], 0.4, 0.6),
    )
    place = looped.home[:3, 3] + [0.02, -0.03, 0.0]
    T = five.pose(place[:2])
    q = pr.igm(looped, T).q[0]
    mode = int(np.abs(pr.igm(five, T).q - q).max(axis=1).argmin())
    np.testing.assert_allclose(pr.igm(five, T).q[mode], q, atol=1e-10)
    V = np.array([0.2, 0.1, 0, 0, 0, 0])
    J = pr.inverse_jacobian(looped, T)
    np.testing.assert_allclose(J, pr.inverse_jacobian(five, T, mode), atol=1e-9)
    np.testing.assert_allclose(
        pr.inverse_jacobian_rate(looped, T, V)[:, :2],
        pr.inverse_jacobian_rate(five, T, V, mode)[:, :2], atol=1e-8,
    )  # fmt: skip
    np.testing.assert_allclose(pr.dgm(looped, q, T).T[:3, 3], place, atol=1e-9)
    modes = pr.assembly_modes(looped, q)
    both = pr.assembly_modes(five, q)
    assert modes.status == pr.AssemblyStatus.SOME_LOST
    np.testing.assert_allclose(np.sort(modes.T[:, 1, 3]), np.sort(both.T[:, 1, 3]), atol=1e-8)
    assert pr.classify_singularity(looped, T).kind == Kind.REGULAR
    np.testing.assert_allclose(looped.coordinates(T), place[:2], atol=1e-12)
    with pytest.raises(InvalidValueError, match="mode"):
        pr.inverse_jacobian(looped, T, mode=3)
    lifted = np.array([T, T])
    lifted[1, 2, 3] = 0.1  # the position is that of the plane, the height is not
    assert pr.igm(looped, lifted).status.tolist() == [0, pr.LegStatus.OUT_OF_REACH]
    assert pr.dgm(looped, q, T).iterations == 1
    far = pr.igm(looped, five.pose([3.0, 0.0]))
    assert (far.count, far.status) == (0, pr.LegStatus.OUT_OF_REACH)


def gough_as_loops(robot):
    """Six legs of universal joint, slider and spherical joint, with the masses of the platform."""
    loops, _, _ = looped_robots.gough(np.random.default_rng(0), robot.base, robot.platform)
    tree, masses = loops.tree, robot.masses
    mass, com, inertia = np.zeros(27), np.zeros((27, 3)), np.zeros((27, 3, 3))
    for i in range(6):  # the cylinder is behind the universal joint, its axis is -y
        (m1, s1, i1), (m2, s2, i2) = masses.first[i], masses.second[i]
        mass[4 * i + 2], com[4 * i + 2] = m1, [0, -s1, 0]
        mass[4 * i + 3], com[4 * i + 3] = m2, [0, 0, -s2]
        inertia[4 * i + 2], inertia[4 * i + 3] = np.diag([i1, 0, i1]), np.diag([i2, i2, 0])
    mass[26], com[26], inertia[26] = masses.mass, masses.com - robot.platform[0], masses.inertia
    bodies = InertialParameters.from_com(mass, com, inertia)
    tree = tree.with_inertia(bodies).with_gravity(robot.gravity)
    loops = LoopedRobot(tree, loops.closures, loops.actuated)
    angle, start = np.arctan2(robot.base[:, 1], robot.base[:, 0]), np.zeros((7, 3))
    u = leg_directions(robot, robot.home[None])[0]
    out = u[:, 0] * np.cos(angle) + u[:, 1] * np.sin(angle)
    start[:6, 0] = np.arctan2(-u[:, 2], out)
    start[:6, 1] = np.arcsin(u[:, 1] * np.cos(angle) - u[:, 0] * np.sin(angle))
    start[:6, 2] = pr.igm(robot, robot.home).q[0]
    R = dgm(tree, start.ravel(), 4)[:3, :3].T @ np.diag([1, -1, -1])
    start[6] = Rotation.from_matrix(R).as_euler("ZYZ") * [1, -1, -1] - [0, np.pi / 2, 0]
    return pr.from_loops(loops, "center", start.ravel())


def test_a_gough_platform_as_loops_is_the_gough_platform():
    robot = with_masses(ROBOTS["SSM"])
    looped = gough_as_loops(robot)
    T, V, A = poses_near_home(robot, 3), twists(robot, 3), twists(robot, 3, 4)
    W = np.random.default_rng(6).normal(size=(3, 6))
    np.testing.assert_allclose(pr.igm(looped, T).q, pr.igm(robot, T).q, atol=1e-11)
    J = pr.inverse_jacobian(robot, T)
    np.testing.assert_allclose(pr.inverse_jacobian(looped, T), J, atol=1e-12)
    rate = pr.inverse_jacobian_rate(robot, T, V)
    np.testing.assert_allclose(pr.inverse_jacobian_rate(looped, T, V), rate, atol=1e-9)
    tau = pr.idm(robot, T, V, A, W)
    np.testing.assert_allclose(pr.idm(looped, T, V, A, W), tau, atol=1e-9)
    np.testing.assert_allclose(pr.ddm(looped, T, V, tau, W), A, atol=1e-9)
    np.testing.assert_allclose(pr.condition(looped, T, 0.6), pr.condition(robot, T, 0.6), rtol=1e-9)
    forces = pr.leg_forces(robot, T, W).forces
    np.testing.assert_allclose(pr.leg_forces(looped, T, W).forces, forces, atol=1e-9)
    assert pr.classify_singularity(looped, T[0]).kind == Kind.REGULAR
    np.testing.assert_allclose(looped.coordinates(T), robot.coordinates(T), atol=1e-12)
    assert pr.igm(looped, np.empty((0, 4, 4))).count.shape == (0,)


# --- pictures ------------------------------------------------------------------------------------


def test_pictures_show_the_legs_where_they_are():
    T = GOOD.pose([0.1, 0.0, 1.0, 0.1, 0.2, 0.3])
    scene = viz.show_parallel(GOOD, T)
    anchor = T[:3, :3] @ GOOD.platform[2] + T[:3, 3]
    np.testing.assert_allclose(scene.pose("piston_2")[:3, 3], anchor, atol=1e-12)
    np.testing.assert_allclose(scene.pose("platform"), T, atol=1e-12)
    assert viz.show_parallel(GOOD, np.stack((GOOD.home, T))).motion.samples == 2
    assert len(viz.jog_parallel(GOOD, T).sliders.data()["struts"]) == 6
    planar = viz.jog_parallel(ROBOTS["3-RPR"]).sliders.data()["joints"]
    assert [s["name"] for s in planar if s["leads"]] == ["x", "y", "yaw"]
    modes = pr.assembly_modes(ROBOTS["delta"], [0.1, 0.2, 0.3])
    assert len(viz.plot_assembly_modes(ROBOTS["delta"], modes).axes) == 2
