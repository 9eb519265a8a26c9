"""Errors: one family, each a standard kind too, that carry facts and travel between processes."""

import inspect
import pickle

import pytest

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
