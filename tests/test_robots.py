"""The catalogue: its numbers against published ones, its URDF files, and example-robot-data.

The joint placements below are the facts of the makers' and ROS-Industrial's URDF files that
`source` names for each robot; the poses are a plain product of them, with no code of the package.
"""

import pickle
import re
from math import pi
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import robotmodels as rm
from robotmodels.robots import CATALOGUE, erd, load, source
from robotmodels.robots.generate import generate

ORACLES = Path(__file__).parent / "oracles"
URDF = Path(__file__).parents[1] / "urdf"

h = pi / 2
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
BACK, MY, DOWN = (-1, 0, 0), (0, -1, 0), (0, 0, -1)
FLAT = (0, 0, 0)

# robot: joints (xyz, rpy, axis), tool (xyz, rpy), joint variables at which the file is at zero
PLACEMENTS = {
    "irb120": (
        [((0, 0, 0), FLAT, Z), ((0, 0, 0.29), FLAT, Y), ((0, 0, 0.27), FLAT, Y),
         ((0, 0, 0.07), FLAT, X), ((0.302, 0, 0), FLAT, Y), ((0.072, 0, 0), FLAT, X)],
        ((0, 0, 0), (0, h, 0)),
    ),
    "irb140": (
        [((0, 0, 0.104), FLAT, Z), ((0.07, 0, 0.248), FLAT, Y), ((0, 0, 0.36), FLAT, Y),
         ((0.38, 0, 0), FLAT, X), ((0, 0, 0), FLAT, Y), ((0.065, 0, 0), FLAT, X)],
        ((0, 0, 0), (0, h, 0)),
    ),
    "irb6640": (
        [((0, 0, 0.78), FLAT, Z), ((0.32, 0, 0), FLAT, Y), ((0, 0, 1.075), FLAT, Y),
         ((0, 0, 0.2), FLAT, X), ((1.392, 0, 0), FLAT, Y), ((0.2, 0, 0), FLAT, X)],
        ((0, 0, 0), (0, h, 0)),
    ),
    "kr6_r900": (
        [((0, 0, 0.4), FLAT, DOWN), ((0.025, 0, 0), FLAT, Y), ((0.455, 0, 0), FLAT, Y),
         ((0, 0, 0.035), FLAT, BACK), ((0.42, 0, 0), FLAT, Y), ((0.08, 0, 0), FLAT, BACK)],
        ((0, 0, 0), (0, h, 0)),
    ),
    "crx10ia": (
        [((0, 0, 0), FLAT, Z), ((0, 0, 0), FLAT, Y), ((0, 0, 0.54), FLAT, MY),
         ((0, 0, 0), FLAT, BACK), ((0.54, 0, 0), FLAT, MY), ((0, -0.15, 0), FLAT, BACK)],
        ((0.16, 0, 0), (pi, -h, 0)),
    ),
    "crx10ia_l": (
        [((0, 0, 0), FLAT, Z), ((0, 0, 0), FLAT, Y), ((0, 0, 0.71), FLAT, MY),
         ((0, 0, 0), FLAT, BACK), ((0.54, -0.15, 0), FLAT, MY), ((0.16, 0, 0), FLAT, BACK)],
        ((0, 0, 0), (pi, -h, 0)),
    ),
    "lwr4_plus": (
        [((0, 0, 0.11), FLAT, Z), ((0, 0, 0.2005), FLAT, MY), ((0, 0, 0.2), FLAT, Z),
         ((0, 0, 0.2), FLAT, Y), ((0, 0, 0.2), FLAT, Z), ((0, 0, 0.19), FLAT, MY),
         ((0, 0, 0.078), FLAT, Z)],
        ((0, 0, 0), FLAT),
    ),
    "iiwa14": (  # iiwa_stack, another file than the one the inertia is from
        [((0, 0, 0.1575), FLAT, Z), ((0, 0, 0.2025), (h, 0, pi), Z),
         ((0, 0.2045, 0), (h, 0, pi), Z), ((0, 0, 0.2155), (h, 0, 0), Z),
         ((0, 0.1845, 0), (-h, pi, 0), Z), ((0, 0, 0.2155), (h, 0, 0), Z),
         ((0, 0.081, 0), (-h, pi, 0), Z)],
        ((0, 0, 0.045), (pi, pi, pi)),
    ),
    "xarm5": (
        [((0, 0, 0.267), FLAT, Z), ((0, 0, 0), (-h, 0, 0), Z), ((0.0535, -0.2845, 0), FLAT, Z),
         ((0.0775, 0.3425, 0), FLAT, Z), ((0.076, 0.097, 0), (-h, 0, 0), Z)],
        ((0, 0, 0), FLAT),
    ),
    "xarm6": (
        [((0, 0, 0.267), FLAT, Z), ((0, 0, 0), (-h, 0, 0), Z), ((0.0535, -0.2845, 0), FLAT, Z),
         ((0.0775, 0.3425, 0), (-h, 0, 0), Z), ((0, 0, 0), (h, 0, 0), Z),
         ((0.076, 0.097, 0), (-h, 0, 0), Z)],
        ((0, 0, 0), FLAT),
    ),
    "tx40": (  # the file has no flange; it is at zero where the maker's joints 2, 3 are at 90, -90
        [((0, 0, 0.32), FLAT, Z), ((0, 0, 0), (-h, 0, 0), Z), ((0.225, 0, 0.035), FLAT, Z),
         ((0, -0.225, 0), (h, 0, 0), Z), ((0, 0, 0), (-h, 0, 0), Z), ((0, 0, 0), (h, pi, 0), Z)],
        ((0, 0, 0.065), FLAT),
    ),
    "panda": (
        [((0, 0, 0.333), FLAT, Z), ((0, 0, 0), (-h, 0, 0), Z), ((0, -0.316, 0), (h, 0, 0), Z),
         ((0.0825, 0, 0), (h, 0, 0), Z), ((-0.0825, 0.384, 0), (-h, 0, 0), Z),
         ((0, 0, 0), (h, 0, 0), Z), ((0.088, 0, 0), (h, 0, 0), Z)],
        ((0, 0, 0.107), FLAT),
    ),
}  # fmt: skip
FILE_ZERO = {"tx40": np.array([0, h, -h, 0, 0, 0])}


def placement(xyz, rpy):
    T = np.eye(4)
    T[:3, :3] = pin.rpy.rpyToMatrix(*map(float, rpy))
    T[:3, 3] = xyz
    return T


def turn(axis, angle):
    T = np.eye(4)
    T[:3, :3] = pin.exp3(np.array(axis, dtype=float) * angle)
    return T


# --- the list ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_robot_is_a_value_has_a_source_and_prints(name):
    model = load(name)
    assert model.name == name
    assert "\nSource: " in source(name)
    assert model == load(name) == pickle.loads(pickle.dumps(model))
    text = str(model.table)
    assert len(text.splitlines()) > model.n
    assert np.isfinite(rm.dgm(model, model.configurations["zero"])).all()


# --- geometry against other descriptions --------------------------------------------------------


@pytest.mark.parametrize("name", PLACEMENTS)
def test_poses_are_those_of_the_published_urdf(name, rng):
    model = load(name)
    joints, tool = PLACEMENTS[name]
    for q in rng.uniform(-pi, pi, (5, model.n)):
        T = np.eye(4)
        for (xyz, rpy, axis), angle in zip(joints, q - FILE_ZERO.get(name, 0), strict=True):
            T = T @ placement(xyz, rpy) @ turn(axis, angle)
        np.testing.assert_allclose(rm.dgm(model, q), T @ placement(*tool), rtol=0, atol=1e-12)


# --- URDF files -----------------------------------------------------------------------------------


def tokens(text):
    return re.split(r"[\s\"<>=/]+", text)


def same(a, b):
    if a == b:
        return True
    try:
        return abs(float(a) - float(b)) <= 1e-12 * max(1.0, abs(float(a)))
    except ValueError:
        return False


def test_urdf_files_have_not_drifted(tmp_path):
    fresh = generate(tmp_path)
    assert {p.name for p in fresh} == {p.name for p in URDF.glob("*.urdf")}, (
        "run: python -m robotmodels.robots.generate urdf"
    )
    for path in fresh:
        new, kept = (tokens(p.read_text()) for p in (path, URDF / path.name))
        assert len(new) == len(kept), path.name
        assert all(map(same, new, kept)), f"{path.name}: run python -m robotmodels.robots.generate"


# --- example-robot-data ---------------------------------------------------------------------------


def test_fixed_base_robots_are_the_loaders():
    """Our table of files against what the package's loaders declare."""
    import example_robot_data

    loaders = example_robot_data.ROBOTS
    fixed = {name for name, c in loaders.items() if not c.free_flyer and c.urdf_filename}
    assert not fixed - set(erd.ERD_ARMS)
    for name in set(loaders) & set(erd.ERD_ARMS):
        loader = loaders["ur3_gripper" if name == "ur3" else name]
        declared = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
        if name == "ur3":  # the package's own table names the UR5 here
            assert loaders["ur3"].urdf_filename == "ur5_robot.urdf"
            declared = "ur_description/urdf/ur3_robot.urdf"
        assert erd.ERD_ARMS[name].urdf == declared
        assert erd.ERD_ARMS[name].base_link is None


@pytest.mark.parametrize(
    ("name", "other", "frame", "base_turn", "tolerance"),
    [("ur5", "erd:ur5", "ee_link", pi, 1e-10), ("panda", "erd:panda", "panda_link8", 0, 1e-14)],
)
def test_catalogue_and_example_robot_data_agree(name, other, frame, base_turn, tolerance, rng):
    """The same arm but for a turned base frame and the axes of the flange."""
    ours, theirs = load(name), load(other)

    def flange_axes(q):
        other_q = np.r_[q, np.zeros(theirs.n - ours.n)]
        turned = turn(Z, base_turn) @ rm.dgm(ours, q)
        return np.linalg.inv(rm.dgm(theirs, other_q, frame)) @ turned

    at_zero = flange_axes(np.zeros(ours.n))
    np.testing.assert_allclose(at_zero[:3, 3], 0, rtol=0, atol=tolerance)
    for q in rng.uniform(-2, 2, (5, ours.n)):
        np.testing.assert_allclose(flange_axes(q), at_zero, rtol=0, atol=tolerance)
