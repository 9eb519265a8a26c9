"""Robots with loops for the tests: random planar and spatial mechanisms of several structures."""

import numpy as np

import robotmodels as rm
from robotmodels import loops
from robotmodels.geometry import DHTable

QUARTER = np.pi / 2


def bodies(f, rng):
    """Physical inertial parameters of f frames."""
    A = 0.3 * rng.normal(size=(f, 3, 3))
    inertia = A @ A.swapaxes(1, 2) + 0.05 * np.eye(3)
    return rm.InertialParameters.from_com(
        rng.uniform(0.5, 3.0, f), 0.2 * rng.normal(size=(f, 3)), inertia
    )


def model(rows, rng, tilt=QUARTER, **options):
    """A model of table rows with random inertia; planar robots move in a vertical plane."""
    table = DHTable.from_rows(rows)
    base = np.eye(4)
    base[:3, :3] = [[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]]
    return rm.RobotModel.from_table(table, bodies(table.f, rng), base=base, **options)


def four_bar(rng, crank=0.3, coupler=0.9, rocker=0.7, ground=1.0, **options):
    """Crank, coupler and rocker: joints 1 (crank), 2 (rocker), 3 (coupler, on the crank)."""
    rows = [
        {"antecedent": 0, "sigma": 0},
        {"antecedent": 0, "sigma": 0, "d": ground},
        {"antecedent": 1, "sigma": 0, "d": crank},
        {"antecedent": 3, "sigma": 2, "d": coupler},
        {"antecedent": 2, "sigma": 2, "d": rocker},
    ]
    cut = loops.Closure("cut", frames=(4, 5), kind=options.pop("kind", "revolute"))
    return loops.LoopedRobot(model(rows, rng, **options), [cut], actuated=[0])


def parallelogram(rng, length=0.5, ground=1.0, **options):
    """A four-bar whose opposite links are equal."""
    return four_bar(rng, crank=length, coupler=ground, rocker=length, ground=ground, **options)


def slider_crank(rng, crank=0.3, rod=0.8, **options):
    """Crank, rod, and a slider along x; joints 1 (crank), 2 (slider), 3 (rod)."""
    rows = [
        {"antecedent": 0, "sigma": 0},
        {"antecedent": 0, "sigma": 1, "gamma": QUARTER, "alpha": QUARTER},
        {"antecedent": 1, "sigma": 0, "d": crank},
        {"antecedent": 3, "sigma": 2, "d": rod},
        {"antecedent": 2, "sigma": 2, "alpha": -QUARTER},
    ]
    return loops.LoopedRobot(
        model(rows, rng, **options), [loops.Closure("pin", frames=(4, 5))], actuated=[0]
    )


def five_bar(rng, **options):
    """Two cranks and two rods: joints 1 and 2 (cranks), 3 and 4 (rods)."""
    rows = [
        {"antecedent": 0, "sigma": 0},
        {"antecedent": 0, "sigma": 0, "d": 0.6},
        {"antecedent": 1, "sigma": 0, "d": 0.5},
        {"antecedent": 2, "sigma": 0, "d": 0.5},
        {"antecedent": 3, "sigma": 2, "d": 0.7},
        {"antecedent": 4, "sigma": 2, "d": 0.7},
    ]
    tree = model(rows, rng, tip=5, **options)
    return loops.LoopedRobot(tree, [loops.Closure("tip", frames=(5, 6))], actuated=[0, 1])


def gough(rng, base=None, platform=None):
    """Six legs (universal joint, slider, spherical joint); the first carries the platform.

    Joints of leg k: two of the universal joint and the slider; the platform's three come last.
    """
    if base is None:
        angles = np.deg2rad([0, 50, 120, 170, 240, 290]) + rng.uniform(-0.05, 0.05, 6)
        base = np.c_[np.cos(angles), np.sin(angles), 0.1 * rng.normal(size=6)]
        angles = np.deg2rad([20, 30, 140, 150, 260, 270]) + rng.uniform(-0.05, 0.05, 6)
        platform = 0.6 * np.c_[np.cos(angles), np.sin(angles), 0.1 * rng.normal(size=6)]
    rows = []
    for anchor in base:
        x, y, z = anchor
        radius, angle = np.hypot(x, y), np.arctan2(y, x)
        first = len(rows) + 1
        # x of the first frame towards the anchor; the axes of the universal joint are horizontal
        rows += [
            {"antecedent": 0, "sigma": 2, "theta": angle, "r": z},
            {"antecedent": first, "sigma": 0, "d": radius, "alpha": -QUARTER},
            {"antecedent": first + 1, "sigma": 0, "alpha": QUARTER, "theta": QUARTER},
            {"antecedent": first + 2, "sigma": 1, "alpha": QUARTER},
        ]
    top = 4
    rows += [
        {"antecedent": top, "sigma": 0},
        {"antecedent": 25, "sigma": 0, "alpha": QUARTER, "theta": QUARTER},
        {"antecedent": 26, "sigma": 0, "alpha": QUARTER},
    ]
    tree = model(rows, rng, tilt=0.0, tip=27)
    tree = tree.with_frames(
        {f"b{k}": platform[k] - platform[0] for k in range(6)} | {"center": -platform[0]}, frame=27
    )
    closures = [loops.Closure(f"leg{k}", (f"b{k}", 4 * k + 4), "point") for k in range(1, 6)]
    sliders = [3 * k + 2 for k in range(6)]
    return loops.LoopedRobot(tree, closures, actuated=sliders), base, platform


def spatial_four_bar(rng):
    """A Bennett linkage: four revolute axes, overconstrained; its twists and lengths alternate."""
    a, alpha, beta = 0.5, 0.6, 1.1
    b = a * np.sin(beta) / np.sin(alpha)
    rows = [
        {"antecedent": 0, "sigma": 0},
        {"antecedent": 1, "sigma": 0, "d": a, "alpha": alpha},
        {"antecedent": 2, "sigma": 0, "d": b, "alpha": beta},
        {"antecedent": 3, "sigma": 2, "d": a, "alpha": alpha},
        {"antecedent": 0, "sigma": 2, "d": -b, "alpha": -beta},
    ]
    robot = loops.LoopedRobot(model(rows, rng), [loops.Closure("cut", (4, 5))], actuated=[0])
    return robot, [0.8], [-2.0, 0.8]


def palletiser(rng):
    """A parallelogram arm whose crank drives the forearm, with its home posture."""
    rows = [
        {"sigma": 0},
        {"sigma": 0, "d": 0.15, "alpha": -QUARTER},
        {"sigma": 0, "d": 0.7},
        {"sigma": 0, "d": 0.15, "alpha": -QUARTER, "antecedent": 1},
        {"sigma": 0, "d": 0.25},
        {"sigma": 2, "d": 0.7},
        {"sigma": 2, "d": -0.25, "antecedent": 3},
    ]
    drive = rm.DriveParameters(Ia=[8, 8, 0, 6, 0], Fv=[5, 5, 0.5, 4, 0.3], Fc=[9, 8, 0, 7, 0])
    tree = model(rows, rng, tilt=0.0, tip=3, name="palletiser").with_drive(drive)
    robot = loops.LoopedRobot(tree, [loops.Closure("pin", frames=(6, 7))], actuated=[0, 1, 3])
    return robot, loops.close(robot, [0.3, -1.2, 3.3], [0.3, -1.2, 1.4, 3.3, -4.5]).q


def seven_revolutes(rng, kind="revolute"):
    """A spatial loop of seven revolute joints, the last one or the last body cut: one motion."""
    joints = 6 if kind == "revolute" else 7
    rows = [
        {"sigma": 0, "d": d, "alpha": alpha, "r": r}
        for d, alpha, r in zip(*rng.uniform(0.2, 0.6, (3, joints)) * [[1], [3], [1]], strict=True)
    ]
    tree = model([*rows, {"sigma": 2, "d": 0.3, "alpha": 0.7}], rng)
    q = rng.uniform(-1.0, 1.0, joints)
    socket = np.linalg.inv(tree.base) @ rm.dgm(tree, q)
    tree = tree.with_frames({"socket": socket}, frame=0)
    robot = loops.LoopedRobot(
        tree, [loops.Closure("cut", (joints + 1, "socket"), kind)], actuated=[0]
    )
    if np.abs(loops.velocity_map(robot, q)).max() > 1.5:  # too near to a dead point
        return seven_revolutes(rng, kind)
    return robot, q[:1], q
