"""The generalised differential model: every parameter and law, on every structure of robot."""

import numpy as np
import pytest
from calibration_arms import slope
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.calibration import (
    GeometricParameters,
    combine_arms,
    differential_model,
)
from robotmodels.calibration.extended_table import Element, extend_table
from robotmodels.calibration.parameters import ErrorLaw, GeometricParameter
from robotmodels.geometry import FIXED, PRISMATIC

STRUCTURES = {
    "serial": {"f": 6},
    "one_joint": {"f": 1},
    "tree": {"f": 7, "tree": True},
    "everything": {"f": 8, "tree": True, "fixed": True, "tip": "any"},
    "plain_base_and_tool": {"f": 5, "base": False, "tool": False},
}


def every_parameter(model, frames):
    """Every element of every row, and every law of every joint, couplings included."""
    table = extend_table(model, frames)
    entries = [
        GeometricParameter(row, element, source=row)
        for row in range(table.rows)
        for element in Element
    ]
    moving = [r for r in range(table.rows) if table.sigma[r] != FIXED]
    for law in set(ErrorLaw) - {ErrorLaw.CONSTANT}:
        for r in moving:
            variable = Element.R if table.sigma[r] == PRISMATIC else Element.THETA
            sources = moving if law is ErrorLaw.GAIN else [r]
            entries += [GeometricParameter(r, variable, law, s) for s in sources]
    return GeometricParameters(table, tuple(entries))


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("structure", "corrected"), [*((name, True) for name in STRUCTURES), ("tree", False)]
)
def test_psi_is_the_derivative_of_the_pose(structure, corrected):
    rng = np.random.default_rng(len(structure) + corrected)
    model = random_model(rng, **STRUCTURES[structure])
    frames = (None, int(rng.integers(0, model.f + 1)))
    parameters = every_parameter(model, frames)
    torque = rm.gravity_torque(model, random_state(model, rng, 20)[0])
    # a compliance of 1 rad/(N m) would turn a joint round many times
    soft = 1.0 / max(1.0, float(np.abs(torque).max()))
    unit = np.array([soft if e.law is ErrorLaw.COMPLIANCE else 1.0 for e in parameters.entries])
    x = 0.05 * corrected * rng.normal(size=len(parameters))
    q = random_state(model, rng, 1)[0]
    for frame in frames:
        T, psi = differential_model(parameters, q, x * unit, frame)
        for k in range(len(parameters)):
            rate = slope(lambda x, f=frame: differential_model(parameters, q, x * unit, f).T, x, k)
            W = rate[0, :3, :3] @ T[0, :3, :3].T
            w = np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]) / 2
            column = psi[0, :, k] * unit[k]
            close = 1e-7 * max(1.0, np.abs(column).max())
            np.testing.assert_allclose(np.r_[rate[0, :3, 3], w], column, rtol=0, atol=close)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_corrections_are_a_changed_table_and_laws_changes_of_the_joint_variables(structure):
    rng = np.random.default_rng(23)
    model = random_model(rng, **STRUCTURES[structure])
    parameters = every_parameter(model, (None,))
    q = random_state(model, rng, 4)[0]
    factors = {
        ErrorLaw.GAIN: q, ErrorLaw.COMPLIANCE: -rm.gravity_torque(model, q),
        ErrorLaw.SINE: np.sin(q), ErrorLaw.COSINE: np.cos(q),
        ErrorLaw.SINE_2: np.sin(2 * q), ErrorLaw.COSINE_2: np.cos(2 * q),
    }  # fmt: skip
    assert set(factors) == set(ErrorLaw) - {ErrorLaw.CONSTANT}
    (table, laws), moved = np.zeros((2, len(parameters))), q.copy()
    columns = {e.word: getattr(model.table, e.word).copy() for e in Element}
    joint = parameters.table.joint
    for k, entry in enumerate(parameters.entries):
        if entry.law is not ErrorLaw.CONSTANT:
            laws[k] = 0.02 * rng.normal()
            moved[:, joint[entry.row]] += laws[k] * factors[entry.law][:, joint[entry.source]]
        elif 1 <= entry.row <= model.f:
            table[k] = 0.1 * rng.normal()
            columns[entry.element.word][entry.row - 1] += table[k]
    changed = model.with_table(model.table.replace(**columns))
    T = differential_model(parameters, q, table).T
    np.testing.assert_allclose(T, rm.dgm(changed, q), atol=1e-12)
    T = differential_model(parameters, q, laws).T
    np.testing.assert_allclose(T, rm.dgm(model, moved), atol=1e-11)


# --- two robots ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_two_robots_side_by_side_move_as_they_did(seed):
    rng = np.random.default_rng(seed)
    a = random_model(rng, f=4, tree=seed % 2 == 0, fixed=True, drive=True, transmission=seed > 3)
    b = random_model(rng, f=5, fixed=seed % 2 == 0, drive=True, tip="any").with_gravity(a.gravity)
    place = [None, np.eye(4), a.base, b.base, a.base @ rm.se3.translation(1, 0, 0), a.base][seed]
    pair = combine_arms(a, b, place)
    b = b if place is None else b.with_base(place)
    q, v, acceleration = random_state(pair, rng, 5)
    parts = (("a", a, slice(None, a.n)), ("b", b, slice(a.n, None)))
    np.testing.assert_allclose(rm.dgm(pair, q), rm.dgm(a, q[:, : a.n]), atol=1e-12)
    for prefix, robot, columns in parts:
        for name in ("tool", *robot.table.names):
            there = rm.dgm(robot, q[:, columns], None if name == "tool" else name)
            np.testing.assert_allclose(rm.dgm(pair, q, f"{prefix}_{name}"), there, atol=1e-12)
        np.testing.assert_allclose(rm.dgm(pair, q, f"{prefix}_base")[0], robot.base, atol=1e-12)
    torque = np.hstack([rm.idm(m, q[:, c], v[:, c], acceleration[:, c]) for _, m, c in parts])
    np.testing.assert_allclose(rm.idm(pair, q, v, acceleration), torque, atol=1e-9)
    np.testing.assert_array_equal(pair.lower, np.r_[a.lower, b.lower])
    np.testing.assert_array_equal(pair.table.effort, np.r_[a.table.effort, b.table.effort])
