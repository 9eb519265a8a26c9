"""Inertial parameters: frames they move between, and what a real body can have."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import (
    random_angle,
    random_length,
    random_rotation,
    seeds,
    table_poses,
)

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import InertiaError, InvalidValueError, ShapeError


def central(rng, f):
    """Masses, centres of mass and tensors about them of f random solid boxes in random axes."""
    mass = rng.uniform(0.1, 5.0, size=f)
    sides = rng.uniform(0.05, 0.5, size=(f, 3)) ** 2
    R = np.array([random_rotation(rng) for _ in range(f)])
    moments = mass[:, None] / 12 * (sides.sum(axis=1)[:, None] - sides)
    tensor = R @ (moments[:, :, None] * np.eye(3)) @ np.swapaxes(R, 1, 2)
    return mass, rng.normal(size=(f, 3)), 0.5 * (tensor + np.swapaxes(tensor, 1, 2))


@given(seeds)
def test_from_com_is_the_parallel_axis_theorem(seed):
    """I_O = I_C + m (c.c 1 - c c^T), in Khalil's order; and back to the centre of mass."""
    mass, com, tensor = central(np.random.default_rng(seed), 4)
    links = rm.InertialParameters.from_com(mass, com, tensor)
    for j in range(4):
        c = com[j]
        about = tensor[j] + mass[j] * (c @ c * np.eye(3) - np.outer(c, c))
        XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = links.values[j]
        assert np.allclose([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]], about, atol=1e-14)
        assert np.allclose([MX, MY, MZ, M], [*(mass[j] * c), mass[j]], atol=1e-15)
    assert np.allclose(links.tensors[0], links.tensors[0].T)
    to_com = np.array([se3.translation(*-c) for c in links.first_moments / links.mass[:, None]])
    back = links.moved(to_com)
    assert np.allclose(back.tensors, tensor, atol=1e-13)
    assert np.allclose(back.first_moments, 0, atol=1e-14)
    assert links.is_physical.all()


@given(seeds)
def test_classical_inertia_keeps_the_bodies_where_they_are(seed):
    """In the world, each centre of mass and tensor is that of the classical table's frame."""
    rng = np.random.default_rng(seed)
    f = 5
    rows = [
        {"sigma": int(rng.integers(2)), "theta": random_angle(rng), "alpha": random_angle(rng),
         "d": random_length(rng), "a": random_length(rng), "offset": rng.normal()}
        for _ in range(f)
    ]  # fmt: skip
    mass, com, tensor = central(rng, f)
    table, tool = rm.DHTable.from_standard(rows)
    links = rm.InertialParameters.from_standard(rows, mass, com, tensor)
    turned = [{**r, "alpha": np.rad2deg(r["alpha"]), "theta": np.rad2deg(r["theta"])} for r in rows]
    degrees = rm.InertialParameters.from_standard(turned, mass, com, tensor, degrees=True)
    assert np.allclose(degrees.values, links.values, atol=1e-12)
    model = rm.RobotModel.from_table(table, inertia=links, tool=tool)
    q = rng.normal(size=f)
    ours = links.moved(table_poses(model, q))
    classical, T = [], np.eye(4)
    for row, qi in zip(rows, q, strict=True):
        turn = row["theta"] + (0 if row["sigma"] else row["offset"] + qi)
        shift = row["d"] + (row["offset"] + qi if row["sigma"] else 0)
        T = (
            T @ se3.rotation("z", turn) @ se3.translation(0, 0, shift)
            @ se3.translation(row["a"], 0, 0) @ se3.rotation("x", row["alpha"])
        )  # fmt: skip
        classical.append(T)
    wanted = rm.InertialParameters.from_com(mass, com, tensor).moved(np.array(classical))
    assert np.allclose(ours.values, wanted.values, atol=1e-11)


# --- physical consistency ------------------------------------------------------------------------


def body(moments, com=(0.0, 0.0, 0.0), mass=2.0, R=None):
    R = np.eye(3) if R is None else R
    return rm.InertialParameters.from_com([mass], [com], [R @ np.diag(moments) @ R.T])


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (body((0.1, 0.1, 0.3)).values, "triangle inequality fails by 0.1 kg m^2"),
        (body((-0.1, 0.1, 0.1)).values, "a principal moment is -0.1 kg m^2"),
        ([[0.1, 0, 0, 0.1, 0, 0.1, 1.0, 0, 0, 2.0]], "a principal moment"),
        ([[1, 0, 0, 1, 0, 1, 0.5, 0, 0, 0]], "first moments without mass"),
        ([[1, 0, 0, 1, 0, 1, 0, 0, 0, -1.0]], "negative mass -1 kg"),
        ([[0.0] * 10], "no mass"),
    ],
    ids=["triangle", "negative moment", "com too far", "moments", "negative mass", "nothing"],
)
def test_what_no_body_has_is_reported(values, words):
    links = rm.InertialParameters(values)
    report = links.consistency()
    assert links.is_physical.tolist() == [False]
    assert not report.is_physical
    assert words in str(report)
    assert str(report).startswith("link 1: not physical: ")


# --- mistakes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "value", "error", "words"),
    [
        (0, [-1.0], InertiaError, "Link 1: a mass cannot be negative, got -1.0 kg"),
        (0, [1.0, 2.0], ShapeError, "for 2 masses"),
        (1, [[0.1, 0]], ShapeError, "com: expected shape"),
        (2, [np.triu(np.ones((3, 3)))], InertiaError, "must be symmetric"),
        (2, [np.full((3, 3), np.inf)], InvalidValueError, "inertia: .* got inf"),
    ],
)
def test_mistakes_in_bodies(place, value, error, words):
    arguments = [[1.0], [[0.1, 0, 0]], [np.eye(3)]]
    arguments[place] = value
    with pytest.raises(error, match=words):
        rm.InertialParameters.from_com(*arguments)
    with pytest.raises(error):
        rm.InertialParameters.from_standard([{}], *arguments)
