"""Estimates and calibrated robots beside a truth that is known."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import calibration as cal
from robotmodels.calibration.alignment import true_errors

rng = np.random.default_rng(5)
Q = rng.uniform(-2.0, 2.0, (60, 6))


def rms(errors):
    return [e.rms["m"] for e in errors]


@pytest.fixture(scope="module")
def arm():
    return rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.02, 0.12))


def moved(arm, base=None, tool=None, d3=0.0):
    """The arm with another place, another tool and another length of the upper arm."""
    d = np.add(arm.table.d, [0.0, 0.0, d3, 0.0, 0.0, 0.0])
    found = arm.with_table(arm.table.replace(d=d))
    if base is not None:
        found = found.with_base(base @ arm.base)
    return found if tool is None else found.with_tool(arm.tool @ tool)


@pytest.mark.parametrize("far", [1e-3, 2.0])
def test_what_base_and_tool_explain_is_taken_away(arm, far):
    base = rm.se3.translation(far, -far, 0.3) @ rm.se3.rotation("z", far) @ rm.se3.rotation("x", 1)
    tool = rm.se3.translation(0.01, -0.02, 0.005)
    stands, placed, both = rms(true_errors(arm, moved(arm, base), Q))
    assert stands > 1e-3
    assert placed < 1e-14
    assert both < 1e-14
    stands, placed, both = rms(true_errors(arm, moved(arm, base, tool), Q))
    assert stands > 1e-3
    assert placed > 5e-3
    assert both < 1e-13


def test_the_least_errors_are_those_of_a_fit_of_base_and_tool(arm):
    real = moved(arm, rm.se3.rotation("y", 0.02), rm.se3.translation(0.004, 0.0, 0.01), 2e-3)
    truth = cal.Position(Q, rm.dgm(real, Q)[:, :3, 3])
    base = ("b0", "d0", "r0", "gamma0", "alpha0", "theta0")
    found = true_errors(arm, real, Q)
    for free, errors in ((base, found[1]), ((*base, "b7", "d7", "r7"), found[2])):
        fitted = cal.fit(arm, truth, parameters=free, folds=0, held_out=0.0)
        # the fit fixes what it cannot tell, which moves no position
        assert errors.rms["m"] == pytest.approx(fitted.validation.in_sample.rms["m"], rel=1e-9)
