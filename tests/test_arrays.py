"""The border: what comes in as numbers, and what is refused with a sentence."""

import copy
import pickle

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import kinematics as kin
from robotmodels._arrays import (
    as_vector,
    same_value,
    value_hash,
)
from robotmodels.errors import InvalidValueError, ShapeError


@pytest.mark.parametrize(("bad", "n"), [(np.nan, 3), (-np.inf, 1)])
def test_the_first_number_that_is_not_finite_is_located(bad, n):
    value = np.zeros((2, n))
    value[1, n - 1] = bad
    with pytest.raises(InvalidValueError, match=rf"^q: .* got {bad} at index \[1, {n - 1}\]"):
        as_vector(value, n, "q")
    with pytest.raises(InvalidValueError, match=rf"index \[{n - 1}\]"):
        as_vector(value[1], n, "q")


@pytest.mark.parametrize(
    ("shape", "advice"),
    [((3,), ""), ((6, 1), "ravel"), ((6, 5), "transposed"), ((), ""), ((5, 7), "")],
)
def test_wrong_shapes_say_what_came_and_what_to_do(shape, advice):
    with pytest.raises(ShapeError, match=r"^q: expected shape \(\.\.\., 6\), got") as caught:
        as_vector(np.zeros(shape), 6, "q")
    assert str(shape) in str(caught.value)
    assert advice in str(caught.value)


def test_equal_values_hash_alike():
    """-0.0 equals 0.0, so it must hash like it; shapes tell arrays apart."""
    a, b = np.array([0.0, 1.0]), np.array([-0.0, 1.0])
    assert same_value(a, b)
    assert value_hash("x", a) == value_hash("x", b)
    assert not same_value(a, a[None])
    assert not same_value(a, np.array([0.0, 2.0]))


def test_values_are_read_only_after_a_copy_too():
    model = rm.load("rx90")
    values = (
        kin.JointBounds(velocity=[1.0] * 6, step=0.1),
        kin.JointTask([0.0], joints=(2,)),
        rm.static_wrench(model, [0.1] * 6, [0.0] * 6),
        rm.ikm(model, [0.1] * 6, [0.0] * 6),
        rm.base_parameters(model),
        rm.classify_singularity(model, [0.1, 0.5, 0.4, 0.3, 0.0, 0.2]),
        rm.velocity_ellipsoid(model, [0.1] * 6),
        rm.manipulability(model, [0.1] * 6),
    )
    for value in values:
        for again in (pickle.loads(pickle.dumps(value)), copy.deepcopy(value)):
            assert type(again) is type(value)
            for name in value.__dataclass_fields__:
                field = getattr(again, name)
                if isinstance(field, np.ndarray):
                    assert not field.flags.writeable, (type(value).__name__, name)
                    np.testing.assert_array_equal(field, getattr(value, name))


def test_results_print_six_digits():
    text = repr(rm.ikm(rm.load("rx90"), [0.1, -0.2, 0.3, 0.4, 0.5, 0.6], [0.1, 0, 0, 0, 0, 0]))
    assert "v=[-0.0252038, -0.0231064, -0.203729, -0.132374, 0.209909, 0.179416]" in text
