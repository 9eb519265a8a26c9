"""Errors: one family, each a standard kind too, that carry facts and travel between processes."""

import inspect
import pickle

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import errors
from robotmodels.errors import (
    FrameNotFoundError,
    RobotModelsError,
    RobotNotFoundError,
)

ERRORS = [
    value
    for _, value in inspect.getmembers(errors, inspect.isclass)
    if issubclass(value, RobotModelsError) and not value.__name__.startswith("_")
]
NAMED = [FrameNotFoundError, RobotNotFoundError]


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: e.__name__)
def test_every_error_is_of_the_family_and_of_a_standard_kind(error):
    """``except ValueError`` works as with NumPy, ``except RobotModelsError`` catches all."""
    assert issubclass(error, RobotModelsError)
    standard = (ValueError, KeyError, ImportError, FileNotFoundError)
    assert error is RobotModelsError or issubclass(error, standard)
    assert error.__doc__
    assert error.__name__ in errors.__all__


@pytest.mark.parametrize("error", NAMED, ids=lambda e: e.__name__)
def test_errors_about_names_carry_facts_and_pickle(error):
    raised = error("frame", "wrist_3", ["wrist_1_link", "wrist_3_link", "base"], "Look again.")
    assert raised.name == "wrist_3"
    assert raised.known == ("wrist_1_link", "wrist_3_link", "base")
    assert raised.nearest[0] == "wrist_3_link"
    assert str(raised) == (
        "No frame 'wrist_3'. Did you mean 'wrist_3_link', 'wrist_1_link'? "
        "Known: 'wrist_1_link', 'wrist_3_link', 'base'. Look again."
    )
    again = pickle.loads(pickle.dumps(raised))
    assert type(again) is error
    assert str(again) == str(raised)
    assert (again.name, again.known, again.nearest) == (raised.name, raised.known, raised.nearest)


def test_a_first_argument_that_is_no_model_is_named():
    rx90 = rm.load("rx90")
    q = np.zeros(6)
    mistakes = [
        (lambda: rm.dgm("rx90", q), "load\\('rx90'\\)"),
        (lambda: rm.idm(rx90.table, q, q, q), "from_table"),
        (lambda: rm.torque_regressor(rx90.pin_model, q, q, q), "Pinocchio"),
        (lambda: rm.to_urdf(5), "got int"),
        (lambda: rm.link_transforms(rx90, q), "pass model.table"),
    ]
    for call, words in mistakes:
        with pytest.raises(rm.errors.InvalidValueError, match=words):
            call()
