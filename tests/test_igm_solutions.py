"""The result of all inverse models: shapes, sentences, the nearest posture, pickling."""

import pickle

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.igm import IGMSolutions, IGMStatus
from robotmodels.igm.solutions import posture_distance

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


def empty_batch(S):
    return IGMSolutions(
        q=np.empty((0, S, 2)), valid=np.empty((0, S)), residual=np.empty((0, S)),
        within_limits=np.empty((0, S)), code=np.empty((0, S)), labels=("front",),
        status=np.empty(0),
        double=np.empty((0, S)), free_joints=np.empty((0, S, 2)),
        family_joints=np.empty((0, S, 2)), method="by hand", periodic=[True, True],
    )  # fmt: skip


def test_statuses():
    """Small numbers with sentences that differ; zero and one are successes."""
    assert len({status.sentence for status in IGMStatus}) == len(IGMStatus)
    assert all(status.sentence.endswith(".") for status in IGMStatus)
    assert all(np.int8(status) == status for status in IGMStatus)
    assert IGMStatus(3) is IGMStatus.TOO_FAR
    assert pickle.loads(pickle.dumps(IGMStatus.TOO_FAR)) is IGMStatus.TOO_FAR


def test_fields_are_typed_and_frozen():
    found = solutions()
    assert found.status.dtype == np.int8
    assert found.count.tolist() == [2, 1, 0]
    assert found.branch.tolist() == [["front", "back"], ["front", ""], ["", ""]]
    for name in ("q", "valid", "residual", "status", "branch", "free_joints", "mask"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(found, name)[...] = 0
    with pytest.raises(AttributeError):
        found.q = None


def test_fields_must_fit():
    with pytest.raises(ShapeError, match="valid: expected shape"):
        solutions(valid=np.ones((3, 3), bool))
    with pytest.raises(ShapeError, match="error"):
        solutions(error=np.zeros((3, 6)))


def test_reasons():
    found = solutions()
    assert found.reason(0) == "The pose is reached."
    assert found.reason((2,)) == IGMStatus.TOO_FAR.sentence
    assert found.reason(-1) == found.reason(2)
    for wrong in (3, (0, 0), (), "first", 1.5, slice(2), None):
        with pytest.raises(InvalidValueError, match="one pose"):
            found.reason(wrong)


def test_reasons_say_what_is_missing():
    """With errors known, in the asked-for components only."""
    error = np.zeros((3, 2, 6))
    error[:, 0] = [0.3, 0.4, 9.0, 0, np.pi, 0]
    mask = [1, 1, 0, 1, 1, 1]
    codes = {
        IGMStatus.TOO_FAR: "misses it by 0.5 m.",
        IGMStatus.TOO_NEAR: "misses it by 0.5 m.",
        IGMStatus.ORIENTATION_NOT_AVAILABLE: "off by 180 deg.",
        IGMStatus.NOT_CONVERGED: "misses it by 0.5 m and 180 deg.",
        IGMStatus.OUTSIDE_LIMITS: "outside the joint limits.",
        IGMStatus.REACHED: "is reached.",
    }
    for code, end in codes.items():
        found = solutions(status=[code] * 3, error=error, mask=mask)
        assert found.reason(1).endswith(end)
    alone = solutions(status=[IGMStatus.NOT_CONVERGED] * 3, error=error, mask=[0, 0, 0, 1, 1, 1])
    assert alone.reason(0).endswith("misses it by 180 deg.")


def test_nearest():
    """Revolute joints by the shorter way round, sliding ones not; NaN without a solution."""
    found = solutions()
    near = found.nearest([-3.1, 0.0])
    np.testing.assert_array_equal(near, [[3.0, -0.2], [1.0, 1.0], [NAN, NAN]])
    literal = solutions(periodic=[False, False]).nearest([-3.1, 0.0])
    np.testing.assert_array_equal(literal[0], [0.1, 0.2])
    per_pose = found.nearest([[0, 0], [0, 0], [0, 0]])
    np.testing.assert_array_equal(per_pose[0], [0.1, 0.2])
    assert found.nearest(np.zeros((5, 1, 2))).shape == (5, 3, 2)
    for wrong, error in (([0.0], ShapeError), ([NAN, 0], InvalidValueError),
                         (np.zeros((2, 2)), ShapeError)):  # fmt: skip
        with pytest.raises(error):
            found.nearest(wrong)


@pytest.mark.parametrize("S", [0, 1, 2])
def test_empty_batches(S):
    found = empty_batch(S)
    assert found.count.shape == (0,)
    assert found.nearest([0, 0]).shape == (0, 2)
    assert "0 postures for 0 poses" in repr(found)


def test_no_solution_at_all():
    """S may be 0: then nearest is NaN."""
    found = IGMSolutions(
        q=np.empty((0, 2)), valid=np.empty(0), residual=np.empty(0), within_limits=np.empty(0),
        code=np.empty(0), labels=("front",), status=IGMStatus.TOO_NEAR, double=np.empty(0),
        free_joints=np.empty((0, 2)), family_joints=np.empty((0, 2)), method="by hand",
        periodic=[True, True],
    )  # fmt: skip
    assert found.count == 0
    assert np.isnan(found.nearest([0, 0])).all()
    assert found.reason() == IGMStatus.TOO_NEAR.sentence


def test_repr_is_for_people():
    text = repr(solutions())
    assert text.splitlines()[0] == "<IGMSolutions: 3 postures for 3 poses, method 'by hand'>"
    assert "pose 0: The pose is reached." in text
    assert "front  residual 1.0e-14" in text
    assert "back  residual 1.0e-14, outside the limits" in text
    many = solutions(
        **{name: np.concatenate([getattr(solutions(), name)] * 4) for name in (
            "q", "valid", "residual", "within_limits", "code", "status", "double", "free_joints",
            "family_joints")}
    )  # fmt: skip
    assert len(repr(many).splitlines()) == 4
    assert "4 x The position is out of reach: too far." in repr(many)


def test_pickles_stay_read_only():
    found = solutions(error=np.zeros((3, 2, 6)), closest=np.zeros((3, 2)))
    again = pickle.loads(pickle.dumps(found))
    for name in IGMSolutions.__dataclass_fields__:
        a, b = getattr(found, name), getattr(again, name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
            assert not b.flags.writeable
        else:
            assert a == b


def test_distance_between_postures():
    a, b = np.array([[3.0, 1.0], [0.0, 0.0]]), np.array([-3.0, 1.0])
    np.testing.assert_allclose(posture_distance(a, b, np.array([True, True])),
                               [2 * np.pi - 6, np.hypot(3, 1)])  # fmt: skip
    assert posture_distance(a, b, np.array([False, True]))[0] == 6
