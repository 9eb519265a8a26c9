"""The generalised differential model: every parameter and law, on every structure of robot."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state
from test_calibration_measurements import slope

import robotmodels as rm
from robotmodels.calibration import (
    ErrorLaw,
    GeometricParameter,
    GeometricParameters,
    candidate_parameters,
    differential_model,
    skeleton_of,
)
from robotmodels.calibration.extended_table import Element
from robotmodels.calibration.joined import side_by_side
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError
from robotmodels.geometry import FIXED, PRISMATIC

STRUCTURES = {
    "serial": {"f": 6},
    "revolute": {"f": 7, "prismatic": False},
    "one_joint": {"f": 1},
    "tree": {"f": 8, "tree": True},
    "fixed_frames": {"f": 8, "fixed": True, "tip": "any"},
    "tree_with_everything": {"f": 9, "tree": True, "fixed": True, "tip": "any"},
    "plain_base_and_tool": {"f": 5, "base": False, "tool": False},
}


def every_parameter(model, frames):
    """Every element of every row, and every law of every joint, couplings included."""
    skeleton = skeleton_of(model, frames)
    entries = [
        GeometricParameter(row, element, source=row)
        for row in range(skeleton.rows)
        for element in Element
    ]
    moving = [r for r in range(skeleton.rows) if skeleton.sigma[r] != FIXED]
    for law in ErrorLaw:
        if law is ErrorLaw.CONSTANT:
            continue
        for r in moving:
            own = Element.R if skeleton.sigma[r] == PRISMATIC else Element.THETA
            entries.append(GeometricParameter(r, own, law, r))
            if law is ErrorLaw.GAIN:
                entries += [GeometricParameter(r, own, law, s) for s in moving if s != r]
    return GeometricParameters(skeleton, tuple(entries))


def skew_part(A):
    return np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2


# --- Psi -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("structure", "deviated"), [*((name, True) for name in STRUCTURES), ("tree", False)]
)
def test_psi_is_the_derivative_of_the_pose(structure, deviated):
    rng = np.random.default_rng(len(structure) + deviated)
    model = random_model(rng, **STRUCTURES[structure])
    frames = (None, int(rng.integers(0, model.f + 1)))
    parameters = every_parameter(model, frames)
    torque = max(
        1.0, float(np.abs(rm.gravity_torque(model, random_state(model, rng, 20)[0])).max())
    )
    # a compliance of 1 rad/(N m) would turn a joint round many times
    unit = np.array(
        [1 / torque if e.law is ErrorLaw.COMPLIANCE else 1.0 for e in parameters.entries]
    )
    xi = 0.05 * deviated * unit * rng.normal(size=len(parameters))
    q = random_state(model, rng, 1)[0]
    for frame in frames:
        T, psi = differential_model(parameters, q, xi, frame)
        worst = 0.0
        for k in range(len(parameters)):
            x = xi / unit
            rate = slope(lambda x, f=frame: differential_model(parameters, q, x * unit, f).T, x, k)
            found = psi[..., k] * unit[k]
            size = max(1.0, np.abs(found).max())
            for i in range(len(q)):
                w = skew_part(rate[i, :3, :3] @ T[i, :3, :3].T)
                worst = max(worst, np.abs(np.r_[rate[i, :3, 3], w] - found[i]).max() / size)
        assert worst < 1e-7


def test_parameters_off_the_path_and_couplings_to_other_branches():
    table = rm.DHTable(antecedent=[0, 1, 1], sigma=[0, 0, 1], d=[0, 0.3, 0.2], alpha=[0, 1.0, 0.5])
    model = rm.RobotModel.from_table(table)
    parameters = every_parameter(model, (2, 3))
    q = np.array([[0.3, 0.4, 0.5]])
    psi = differential_model(parameters, q, None, 2).psi[0]
    for k, entry in enumerate(parameters.entries):
        if entry.law is ErrorLaw.COMPLIANCE:
            continue  # this robot has no masses
        on_path = entry.row in parameters.skeleton.path(2)
        assert np.any(psi[:, k]) == on_path, entry.name
    # the reading of joint 3, on the other branch, moves joint 2 by a coupling
    coupling = parameters.names.index("gain2_3")
    np.testing.assert_allclose(psi[:, coupling], 0.5 * psi[:, parameters.names.index("theta2")])


# --- poses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("structure", STRUCTURES)
def test_without_deviations_poses_are_those_of_the_direct_geometric_model(structure):
    rng = np.random.default_rng(17)
    for _ in range(5):
        model = random_model(rng, **STRUCTURES[structure])
        q = random_state(model, rng, 3, 2)[0]
        frames = (None, *range(model.f + 1))
        candidates = candidate_parameters(model, frames)
        for frame in frames:
            T, psi = differential_model(candidates, q, None, frame)
            np.testing.assert_allclose(T, rm.dgm(model, q, frame), atol=1e-12)
            assert psi.shape == (3, 2, 6, len(candidates))


@pytest.mark.parametrize("structure", STRUCTURES)
def test_deviations_of_elements_are_those_of_a_changed_table(structure):
    rng = np.random.default_rng(23)
    model = random_model(rng, **STRUCTURES[structure])
    parameters = every_parameter(model, (None,))
    xi = np.zeros(len(parameters))
    columns = {e.word: getattr(model.table, e.word).copy() for e in Element}
    for k, entry in enumerate(parameters.entries):
        if entry.law is ErrorLaw.CONSTANT and 1 <= entry.row <= model.f:
            xi[k] = 0.1 * rng.normal()
            columns[entry.element.word][entry.row - 1] += xi[k]
    changed = model.with_table(model.table.replace(**columns))
    q = random_state(model, rng, 4)[0]
    found = differential_model(parameters, q, xi).T
    np.testing.assert_allclose(found, rm.dgm(changed, q), atol=1e-12)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_laws_are_changes_of_the_joint_variables(structure):
    rng = np.random.default_rng(29)
    model = random_model(rng, **STRUCTURES[structure])
    parameters = every_parameter(model, (None,))
    q = random_state(model, rng, 4)[0]
    tau = rm.gravity_torque(model, q)
    xi, moved = np.zeros(len(parameters)), q.copy()
    joint = parameters.skeleton.joint
    for k, entry in enumerate(parameters.entries):
        if entry.law is ErrorLaw.CONSTANT:
            continue
        j, s = joint[entry.row], joint[entry.source]
        x = q[:, s]
        factor = {
            ErrorLaw.GAIN: x, ErrorLaw.COMPLIANCE: -tau[:, s], ErrorLaw.SINE: np.sin(x),
            ErrorLaw.COSINE: np.cos(x), ErrorLaw.SINE_2: np.sin(2 * x),
            ErrorLaw.COSINE_2: np.cos(2 * x),
        }[entry.law]  # fmt: skip
        xi[k] = 0.02 * rng.normal()
        moved[:, j] += xi[k] * factor
    found = differential_model(parameters, q, xi).T
    np.testing.assert_allclose(found, rm.dgm(model, moved), atol=1e-11)


def test_an_empty_batch_and_one_configuration():
    candidates = candidate_parameters(rm.load("rx90"))
    P = len(candidates)
    T, psi = differential_model(candidates, np.zeros((0, 6)))
    assert T.shape == (0, 4, 4)
    assert psi.shape == (0, 6, P)
    T, psi = differential_model(candidates, np.zeros(6))
    assert T.shape == (4, 4)
    assert psi.shape == (6, P)


def test_mistakes_are_named():
    candidates = candidate_parameters(rm.load("rx90"))
    with pytest.raises(ShapeError, match="q"):
        differential_model(candidates, np.zeros(5))
    with pytest.raises(ShapeError, match="deviation"):
        differential_model(candidates, np.zeros(6), np.zeros(3))
    with pytest.raises(InvalidValueError, match="finite"):
        differential_model(candidates, np.full(6, np.nan))
    with pytest.raises(InvalidValueError, match="measured ends"):
        differential_model(candidates, np.zeros(6), frame=3)


# --- two robots ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_two_robots_side_by_side_move_as_they_did(seed):
    rng = np.random.default_rng(seed)
    a = random_model(rng, f=4, tree=seed % 2 == 0, fixed=True, drive=True, transmission=seed > 3)
    b = random_model(rng, f=5, fixed=seed % 2 == 0, drive=True, tip="any").with_gravity(a.gravity)
    place = [None, np.eye(4), a.base, b.base, a.base @ rm.se3.translation(1, 0, 0), a.base][seed]
    pair = side_by_side(a, b, place)
    b = b if place is None else b.with_base(place)
    assert pair.n == a.n + b.n
    q, v, acceleration = random_state(pair, rng, 5)
    qa, qb = q[:, : a.n], q[:, a.n :]
    np.testing.assert_allclose(rm.dgm(pair, q, "a_tool"), rm.dgm(a, qa), atol=1e-12)
    np.testing.assert_allclose(rm.dgm(pair, q), rm.dgm(a, qa), atol=1e-12)
    np.testing.assert_allclose(rm.dgm(pair, q, "b_tool"), rm.dgm(b, qb), atol=1e-12)
    for prefix, robot, own in (("a", a, qa), ("b", b, qb)):
        for name in robot.table.names:
            there = rm.dgm(robot, own, name)
            np.testing.assert_allclose(rm.dgm(pair, q, f"{prefix}_{name}"), there, atol=1e-12)
    np.testing.assert_allclose(rm.dgm(pair, q, "b_base")[0], b.base, atol=1e-12)
    np.testing.assert_allclose(rm.dgm(pair, q, "a_base")[0], a.base, atol=1e-12)
    torque = np.hstack([
        rm.idm(a, qa, v[:, : a.n], acceleration[:, : a.n]),
        rm.idm(b, qb, v[:, a.n :], acceleration[:, a.n :]),
    ])  # fmt: skip
    np.testing.assert_allclose(rm.idm(pair, q, v, acceleration), torque, atol=1e-9)
    np.testing.assert_array_equal(pair.lower, np.r_[a.lower, b.lower])
    np.testing.assert_array_equal(pair.table.effort, np.r_[a.table.effort, b.table.effort])


def test_robots_read_from_urdf_keep_their_frames_side_by_side():
    panda = rm.load("erd:panda")
    pair = side_by_side(
        panda, panda, rm.se3.translation(0.0, 1.0, 0.0) @ panda.base, ("left", "right")
    )
    q = np.random.default_rng(0).uniform(-1, 1, (3, panda.n))
    both = np.hstack([q, q])
    for frame in panda.frames:
        there = rm.dgm(panda, q, frame.name)
        np.testing.assert_allclose(rm.dgm(pair, both, f"left_{frame.name}"), there, atol=1e-12)
        there[:, 1, 3] += 1.0
        np.testing.assert_allclose(rm.dgm(pair, both, f"right_{frame.name}"), there, atol=1e-12)
    assert len(pair.visuals) == 2 * len(panda.visuals)


def test_what_cannot_stand_side_by_side_is_named():
    arm = rm.load("rx90")
    with pytest.raises(InvalidValueError, match="two different texts"):
        side_by_side(arm, arm, names=("a", "a"))
    with pytest.raises(InvalidValueError, match="its gravity"):
        side_by_side(arm, arm.with_gravity([0, 9.81, 0]))
    with pytest.raises(NotARotationError):
        side_by_side(arm, arm, 2 * np.eye(4))
