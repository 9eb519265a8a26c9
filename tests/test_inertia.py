"""Inertial parameters: frames they move between, and what a real body can have."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import (
    random_rotation,
    seeds,
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


@pytest.mark.parametrize("unit", [1.0, 180 / np.pi])
@given(seed=seeds)
def test_classical_inertia_is_that_of_frames_at_the_far_ends_of_links(unit, seed):
    rng = np.random.default_rng(seed)
    alpha, a = rng.normal(size=(2, 5))
    rows = [{"sigma": j % 2, "alpha": alpha[j] * unit, "a": a[j], "d": 0.3} for j in range(5)]
    bodies = central(rng, 5)
    links = rm.InertialParameters.from_standard(rows, *bodies, degrees=unit != 1.0)
    ends = [se3.translation(a[j], 0, 0) @ se3.rotation("x", alpha[j]) for j in range(5)]
    wanted = rm.InertialParameters.from_com(*bodies).moved(np.array(ends))
    np.testing.assert_allclose(links.values, wanted.values, atol=1e-12)


# --- physical consistency ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([0.1, 0, 0, 0.1, 0, 0.3, 0, 0, 0, 2.0], "triangle inequality fails by 0.1 kg m^2"),
        ([-0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0, 2.0], "a principal moment is -0.1 kg m^2"),
        ([0.1, 0, 0, 0.1, 0, 0.1, 1.0, 0, 0, 2.0], "a principal moment"),
        ([1, 0, 0, 1, 0, 1, 0.5, 0, 0, 0], "first moments without mass"),
        ([1, 0, 0, 1, 0, 1, 0, 0, 0, -1.0], "negative mass -1 kg"),
        ([0.0] * 10, "no mass"),
    ],
)
def test_what_no_body_has_is_reported(values, words):
    links = rm.InertialParameters([values])
    assert links.is_physical.tolist() == [False]
    assert str(links.consistency()).startswith("link 1: not physical: ")
    assert words in str(links.consistency())


# --- mistakes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "value", "error", "words"),
    [
        (0, [-1.0], InertiaError, "Link 1: a mass cannot be negative, got -1.0 kg"),
        (0, [1.0, 2.0], ShapeError, r"com: expected shape \(2, 3\)"),
        (1, [[0.1, 0]], ShapeError, "com: expected shape"),
        (2, [np.triu(np.ones((3, 3)))], InertiaError, "must be symmetric"),
        (2, [np.full((3, 3), np.inf)], InvalidValueError, "inertia: .* got inf"),
    ],
)
def test_mistakes_in_bodies(place, value, error, words):
    arguments = [[1.0], [[0.1, 0, 0]], [np.eye(3)]]
    arguments[place] = value
    for make in (
        rm.InertialParameters.from_com,
        partial(rm.InertialParameters.from_standard, [{}]),
    ):
        with pytest.raises(error, match=words):
            make(*arguments)
