"""The result of all inverse models: shapes, sentences, the nearest posture, pickling."""

import pickle

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.igm import IGMSolutions, IGMStatus

NAN = np.nan


def solutions(**changes):
    """Three poses of a robot of two joints: two postures, one, none."""
    q = np.array([[[0.1, 0.2], [3.0, -0.2]], [[1.0, 1.0], [NAN, NAN]], [[NAN, NAN]] * 2])
    valid = np.isfinite(q[..., 0])
    fields = {
        "q": q,
        "valid": valid,
        "residual": np.where(valid, 1e-14, NAN),
        "within_limits": valid & (q[..., 0] < 2),
        "code": np.where(valid, [[0, 1]] * 3, -1),
        "labels": ("front", "back"),
        "status": [IGMStatus.REACHED, IGMStatus.REACHED_FAMILY, IGMStatus.TOO_FAR],
        "double": np.zeros((3, 2), bool),
        "free_joints": np.zeros((3, 2, 2), bool),
        "family_joints": np.zeros((3, 2, 2), bool),
        "method": "by hand",
        "periodic": [True, False],
    }
    return IGMSolutions(**{**fields, **changes})


def test_results_are_frozen_and_pickled():
    found = solutions(error=np.zeros((3, 2, 6)), closest=np.zeros((3, 2)))
    assert found.count.tolist() == [2, 1, 0]
    assert found.branch.tolist() == [["front", "back"], ["front", ""], ["", ""]]
    again = pickle.loads(pickle.dumps(found))
    for name in IGMSolutions.__dataclass_fields__:
        a, b = getattr(found, name), getattr(again, name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, strict=True)
            assert not a.flags.writeable
            assert not b.flags.writeable
        else:
            assert a == b
    with pytest.raises(AttributeError):
        found.q = None


def test_reasons_give_what_is_missing_of_the_requested_components():
    error = np.zeros((3, 2, 6))
    error[:, 0] = [0.3, 0.4, 9.0, 0, np.pi, 0]
    far = solutions(status=[IGMStatus.TOO_FAR] * 3, error=error, mask=[1, 1, 0, 1, 1, 1])
    assert far.reason(1).endswith("misses it by 0.5 m.")
    lost = solutions(status=[IGMStatus.NOT_CONVERGED] * 3, error=error, mask=[0, 0, 0, 1, 1, 1])
    assert lost.reason((0,)).endswith("misses it by 180 deg.")
    assert solutions().reason(-1) == IGMStatus.TOO_FAR.sentence
    for wrong in (3, (0, 0), (), "first", 1.5, slice(2), None):
        with pytest.raises(InvalidValueError, match="one pose"):
            far.reason(wrong)


def test_nearest():
    """Revolute joints by the shorter way round, sliding ones not; NaN without a solution."""
    found = solutions()
    near = found.nearest([-3.1, 0.0])
    np.testing.assert_array_equal(near, [[3.0, -0.2], [1.0, 1.0], [NAN, NAN]])
    literal = solutions(periodic=[False, False]).nearest([-3.1, 0.0])
    np.testing.assert_array_equal(literal[0], [0.1, 0.2])
    assert found.nearest(np.zeros((5, 1, 2))).shape == (5, 3, 2)
    for wrong, error in (([0.0], ShapeError), ([NAN, 0], InvalidValueError),
                         (np.zeros((2, 2)), ShapeError)):  # fmt: skip
        with pytest.raises(error):
            found.nearest(wrong)
