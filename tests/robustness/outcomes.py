"""What may come of an input: an answer of finite numbers, or a refusal. All else is a bug."""

import contextlib
import signal
import time
import warnings
from enum import Enum

import numpy as np

import robotmodels as rm
from robotmodels.errors import RobotModelsError, RobotModelsWarning

SECONDS = 5.0
"""Of processor time that an input may take."""


class Outcome(Enum):
    """What came of an input."""

    ANSWERED = "an answer of finite numbers"
    REFUSED = "an error of this package, in words"
    NOT_OPENED = "an OSError of a file"


class TookTooLongError(AssertionError):
    """An input that hangs, or nearly."""


def outcome(call, check, documented=(OSError,)):
    """Run a call and judge what came; anything that is neither answer nor refusal goes through.

    ``documented`` are built-in errors that the docstring of what is called promises.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a warning of NumPy is a number that nobody looked at
            warnings.simplefilter("ignore", RobotModelsWarning)
            with time_limit(SECONDS):
                answer = call()
    except RobotModelsError as error:
        check_sentence(error)
        return Outcome.REFUSED
    except documented:
        return Outcome.NOT_OPENED
    check(answer)
    return Outcome.ANSWERED


def check_sentence(error):
    """An error that says something, and can be read on a screen or two."""
    message = str(error)
    assert len(message) > 10, f"{type(error).__name__} says only {message!r}"
    assert " " in message, f"{type(error).__name__} says only {message!r}"
    assert len(message) < 20_000, f"{type(error).__name__} of {len(message)} letters"


@contextlib.contextmanager
def time_limit(seconds):
    """An error where something takes more processor time than this; in the main thread."""
    start = time.process_time()

    def stop(*_):
        raise TookTooLongError(f"still running after {seconds} s of processor time")

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    took = time.process_time() - start
    if took > seconds:  # compiled code is not interrupted
        raise TookTooLongError(f"took {took:.1f} s of processor time")


def check_model(model):
    """A robot whose numbers are finite and whose zero configuration has a pose."""
    table = model.table
    assert model.n >= 1
    for name in ("gamma", "b", "beta", "alpha", "d", "theta", "r"):
        assert np.isfinite(getattr(table, name)).all(), f"{name} of the table is not finite"
    for name in ("lower", "upper", "velocity", "effort"):
        assert not np.isnan(getattr(table, name)).any(), f"{name} of the table is NaN"
    for name, value in (
        ("base", model.base), ("tool", model.tool), ("gravity", model.gravity),
        ("inertia", model.inertia.values), ("Ia", model.drive.Ia), ("Fv", model.drive.Fv),
        ("Fc", model.drive.Fc), ("offset", model.drive.offset),
    ):  # fmt: skip
        assert np.isfinite(value).all(), f"{name} is not finite"
    if model.transmission is not None:
        assert np.isfinite(model.transmission.matrix).all()
    # lengths near the largest float have no sum that is a number: that is said or computed
    outcome(lambda: rm.dgm(model, np.zeros(model.n)), check_finite)
    assert (table.lower <= table.upper).all()


def check_finite(answer):
    """Finite numbers."""
    assert np.isfinite(np.asarray(answer)).all(), "the answer has NaN or infinity in it"


def check_log(log):
    """Samples that are finite, with rows that are numbered from 0."""
    for name in ("q", "tau", "v", "a", "q_ref", "v_ref"):
        value = getattr(log, name)
        if value is not None:
            assert np.isfinite(value).all(), f"{name} is not finite"
            assert value.shape == log.q.shape
    assert np.isfinite(log.dt)
    assert log.dt > 0.0
    assert len(log) >= 1


def check_table(table):
    """A geometric table of finite numbers."""
    for name in ("gamma", "b", "beta", "alpha", "d", "theta", "r"):
        assert np.isfinite(getattr(table, name)).all(), f"{name} is not finite"
