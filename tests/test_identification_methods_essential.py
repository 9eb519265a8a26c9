"""Essential parameters: which are dropped, in which order, and when it ends."""

import numpy as np
import pytest
from identification_logs import clean_log, odd_robots

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.identification import (
    choose_processing,
    equations,
    reduce_equations,
    weighted,
)
from robotmodels.identification.methods.essential import EssentialRule, essential, with_columns
from robotmodels.identification.scale.reduction import Reduction
from robotmodels.minimal_parameters import base_parameters


def designed(rng, rows=2000, noise=1.0):
    """Columns of ones' length and values from large to none."""
    A = rng.normal(size=(rows, 8))
    x = np.array([100.0, 50.0, 20.0, 10.0, 0.0, 0.0, 0.0, 0.03])
    y = A @ x + noise * rng.normal(size=rows)
    factor = np.linalg.qr(np.column_stack((A, y)), mode="r")
    names = ("XX1", "XY1", "XZ1", "YZ1", "ZZ1", "MX1", "MY1", "Fv1")
    return Reduction(names, (factor,), np.array([rows]), np.array([0])), A, y


@pytest.mark.parametrize("rule", list(EssentialRule))
def test_what_is_not_there_is_dropped(rule):
    reduction, A, y = designed(np.random.default_rng(2))
    found = essential(reduction, rule=rule)
    assert found.names[:4] == ("XX1", "XY1", "XZ1", "YZ1")
    assert len(found) + len(found.dropped) == 8
    assert len(found) <= 6
    assert len(found.growth) == len(found.dropped) + 1
    assert found.growth[0] == 0.0
    assert (np.diff(found.growth) >= 0.0).all()
    if rule is EssentialRule.RATIO:
        assert found.ratio[-1] <= 30.0 < found.ratio[-2]
    # the residuals and the test by hand
    left = [reduction.names.index(name) for name in found.names]
    rest, whole = (np.linalg.lstsq(B, y, rcond=None)[1][0] for B in (A[:, left], A))
    assert abs(found.growth[-1] - (np.sqrt(rest / whole) - 1.0)) < 1e-9
    d = len(found.dropped)
    assert abs(found.f[-1] - (rest - whole) / d / (whole / 1992)) < 1e-6
    assert abs(found.aic[-1] - (2000 * np.log(rest / whole) - 2 * d)) < 1e-6
    reduced = found.reduce(reduction)
    assert reduced.names == found.names
    again = weighted(reduced)
    np.testing.assert_allclose(
        again.values, np.linalg.lstsq(A[:, left], y, rcond=None)[0], rtol=1e-9
    )


def test_the_order_is_that_of_relative_deviations():
    reduction, A, y = designed(np.random.default_rng(2))
    found = essential(reduction, ratio=1.0, growth=1e9)
    kept = list(range(8))
    for name, relative in zip(found.dropped, found.relative, strict=False):
        values, rest, *_ = np.linalg.lstsq(A[:, kept], y, rcond=None)
        spread = np.sqrt(rest[0] / (2000 - len(kept)))
        inverse = np.linalg.inv(A[:, kept].T @ A[:, kept])
        each = spread * np.sqrt(np.diag(inverse)) / np.abs(values)
        assert abs(relative / each.max() - 1.0) < 1e-8
        assert reduction.names[kept[int(np.argmax(each))]] == name
        kept.pop(int(np.argmax(each)))
    assert found.names == ("XX1",)


def test_a_log_that_shows_everything_keeps_it():
    model = odd_robots()["rx90"]
    log = clean_log(model, np.random.default_rng(3), 0.5, samples=2000, dt=4e-3)
    processing = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    reduction = reduce_equations(equations(base_parameters(model), log, processing))
    found = essential(reduction)
    assert 0.05 < found.growth[-1] <= 0.1
    assert essential(reduction, growth=0.001).growth[-1] <= 0.001
    tested = essential(reduction, rule="f_test")
    # what chance explains: none of the parameters that are seen well
    first = weighted(reduction)
    gone = [reduction.names.index(name) for name in tested.dropped]
    assert (first.relative_deviations[gone] > 0.2).all()
    akaike = essential(reduction, rule="aic")
    assert akaike.aic[-1] == akaike.aic.min() < 0.0
    assert akaike.growth[-1] < np.exp(len(akaike.dropped) / reduction.rows) - 1.0


def test_choices_that_make_no_sense():
    reduction, _, _ = designed(np.random.default_rng(2))
    for options in ({"ratio": 0.5}, {"growth": -1.0}, {"level": 1.0}, {"rule": "guess"}):
        with pytest.raises(InvalidValueError):
            essential(reduction, **options)
    with pytest.raises(InvalidValueError, match="XX9"):
        with_columns(reduction, ("XX9",))
    one = with_columns(reduction, ("XX1",))
    assert essential(one).names == ("XX1",)


# Essential parameters of the TX40's log as they were published with it (FIGAROH, file of 25
# essential parameters, ratio of relative deviations), by their standard names.
# fmt: off
PUBLISHED = {
    "ZZ1", "Fv1", "Fc1", "XX2", "XZ2", "ZZ2", "MX2", "Fv2", "Fc2", "XX3", "ZZ3", "MY3", "Ia3",
    "Fv3", "Fc3", "Ia4", "Fv4", "Fc4", "MY5", "Ia5", "Fv5", "Fc5", "Fv6", "Fvm6", "Fcm6",
}
# fmt: on


def test_the_published_essential_parameters_of_a_real_robot_are_found():
    data = rm.datasets.load_tx40()
    system = equations(base_parameters(data.model), data.log, choose_processing(data.log))
    reduction = reduce_equations(system)
    found = essential(reduction, growth=1e9)
    # the rotor of the last motor is a column of its own here
    assert set(found.names) == PUBLISHED | {"Ia6", "Iam6"}
    assert found.ratio[-1] <= 30.0 < found.ratio[-2]
    assert 0.03 < found.growth[-1] < 0.1
    assert essential(reduction).names == found.names
