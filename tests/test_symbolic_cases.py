"""Angles of the symbolic direct model: exact parts of a turn."""

from fractions import Fraction
from math import pi

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.symbolic_dgm._angles import exact_turns, wrapped


@pytest.mark.parametrize(
    ("turns", "expected"),
    [("3/2", "-1/2"), ("-3/2", "1/2"), ("1", "1"), ("-1", "1"), ("2", "0"), ("7/4", "-1/4"),
     ("-5/6", "-5/6"), ("5", "1")],
)  # fmt: skip
def test_whole_turns_are_taken_off(turns, expected):
    """In units of pi, in (-1, 1]."""
    assert wrapped(Fraction(turns)) == Fraction(expected)


@pytest.mark.parametrize(
    ("angle", "expected"),
    [(pi / 2, "1/2"), (-pi / 3, "-1/3"), (pi / 4, "1/4"), (pi / 6, "1/6"), (0.0, "0")],
)
def test_fractions_of_pi_are_exact(angle, expected):
    assert exact_turns(angle) == Fraction(expected)
    assert exact_turns(angle + 1e-6) is None


def test_a_twelfth_of_a_turn_less_is_none_of_the_fractions():
    assert exact_turns(pi / 12) is None
    assert exact_turns(5 * pi / 12) is None


def test_offsets_that_add_up_to_more_than_half_a_turn_are_written_within_it():
    """Two parallel joints with offsets of 3/4 pi each are one of -pi/2."""
    rows = [{"sigma": 0, "theta": 0.75 * pi}, {"sigma": 0, "theta": 0.75 * pi, "d": 0.4}]
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    found = rm.explain_dgm(arm)
    assert "3π/2" not in found.text
    q = np.array([[0.3, -0.4], [1.0, 2.0]])
    np.testing.assert_allclose(found.evaluate(q), rm.dgm(arm, q), rtol=0, atol=1e-14)
