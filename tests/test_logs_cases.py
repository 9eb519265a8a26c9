"""Logs that cannot be one: what is wrong, and what to give."""

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.logs import Log

Q = np.zeros((4, 2))


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"dt": 0.0}, InvalidValueError, "dt: expected the sampling period in seconds"),
        ({"dt": [0.1, 0.1]}, InvalidValueError, "dt: expected the sampling period"),
        ({"q": np.zeros(4)}, ShapeError, r"q: expected samples of shape \(N, n\)"),
        ({"q": np.zeros((0, 2))}, InvalidValueError, "q: the log is empty"),
        ({"tau": np.zeros((3, 2))}, ShapeError, r"tau: expected shape \(4, 2\) as q has it"),
        ({"v": np.zeros((4, 1))}, ShapeError, r"v: expected shape \(4, 2\)"),
        ({"names": ("one",)}, ShapeError, "names: expected 2 names of joints, got 1"),
        ({"starts": (1,)}, InvalidValueError, "starts: expected ascending numbers"),
        ({"starts": (0, 2, 2)}, InvalidValueError, "ascending"),
        ({"starts": (0, 4)}, InvalidValueError, "below 4"),
        ({"starts": ()}, InvalidValueError, "starts"),
        ({"starts": (0.0, 2.0)}, InvalidValueError, "starts"),
    ],
)
def test_what_is_no_log_is_named(given, error, words):
    parts = {"dt": 0.1, "q": Q, "tau": Q} | given
    with pytest.raises(error, match=words):
        Log(**parts)


def test_rows_that_are_none_are_named_and_recordings_are_counted():
    log = Log(0.1, Q, Q, starts=(0, 3))
    with pytest.raises(InvalidValueError, match="rows: none from 3 to 3; the log has 4 rows"):
        log.rows(3, 3)
    assert log.duration == pytest.approx(0.4)
    np.testing.assert_allclose(log.t, [0.0, 0.1, 0.2, 0.3])
    assert "4 samples of 2 joints at 10 Hz, 0.4 s in 2 recordings" in repr(log)
    assert "recordings" not in repr(log.rows(0, 3))
