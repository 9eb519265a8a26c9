"""The border of poses and Jacobians: shapes, batches, kinds of input, errors."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state, table_poses

import robotmodels as rm
from robotmodels.errors import FrameNotFoundError, InvalidValueError, RobotModelsError, ShapeError

# name: function of the model and its joint vectors, how many of these, shape of the result
FUNCTIONS = {
    "dgm": (rm.dgm, 1, (4, 4)),
    "dgm of a frame": (lambda m, q: rm.dgm(m, q, 2), 1, (4, 4)),
    "link_poses": (rm.link_poses, 1, ("f", 4, 4)),
    "jacobian": (rm.jacobian, 1, (6, "n")),
    "local jacobian": (lambda m, q: rm.jacobian(m, q, 1, "local"), 1, (6, "n")),
    "spatial jacobian": (lambda m, q: rm.jacobian(m, q, reference="world"), 1, (6, "n")),
    "jacobian_rate": (rm.jacobian_rate, 2, (6, "n")),
    "dkm": (rm.dkm, 2, (6,)),
}


@pytest.fixture(params=FUNCTIONS)
def case(request):
    return FUNCTIONS[request.param]


@pytest.fixture(scope="module")
def model():
    """A tree that Pinocchio orders otherwise, with fixed frames."""
    model = random_model(np.random.default_rng(3), f=7, tree=True, fixed=True, drive=True)
    assert model.n >= 3
    assert not model.twin.in_table_order
    return model


def shape_of(core, model):
    return tuple({"n": model.n, "f": model.f}.get(k, k) for k in core)


def states(model, count, *batch):
    return random_state(model, np.random.default_rng(5), *batch)[:count]


@pytest.mark.parametrize("batch", [(), (1,), (3,), (2, 3), (0,), (2, 0, 3)], ids=str)
def test_leading_axes_are_the_batch(case, model, batch):
    function, count, core = case
    vectors = states(model, count, *batch)
    result = function(model, *vectors)
    assert result.shape == (*batch, *shape_of(core, model))
    assert result.dtype == np.float64
    assert result.flags.c_contiguous
    for index in np.ndindex(*batch):
        single = function(model, *(x[index] for x in vectors))
        np.testing.assert_allclose(result[index], single, rtol=0, atol=1e-12)


def bad_vectors(n):
    good = np.zeros(n)
    nan, infinite = np.zeros(n), np.zeros((3, n))
    nan[-1], infinite[1, 0] = np.nan, -np.inf
    return {
        "too long": (np.zeros(n + 1), ShapeError, f"(..., {n})"),
        "too short": (np.zeros((4, n - 1)), ShapeError, f"got (4, {n - 1})"),
        "column": (good[:, None], ShapeError, "ravel"),
        "columns": (np.zeros((n, 50)), ShapeError, ".T"),
        "number": (0.0, ShapeError, "got ()"),
        "nothing": ([], ShapeError, "got (0,)"),
        "NaN": (nan, InvalidValueError, f"[{n - 1}]"),
        "NaN in a list": (nan.tolist(), InvalidValueError, "nan"),
        "infinity": (infinite, InvalidValueError, "[1, 0]"),
        "text": (["0"] * n, InvalidValueError, "real numbers"),
        "complex": (good + 0j, InvalidValueError, "complex"),
        "truth": (good > 1, InvalidValueError, "bool"),
        "None": (None, InvalidValueError, "real numbers"),
        "ragged": ([[0.0] * n, [0.0]], InvalidValueError, "regular"),
        "mapping": ({"q": good}, InvalidValueError, "real numbers"),
    }


@pytest.mark.parametrize("fault", bad_vectors(2))
def test_a_bad_vector_is_named(case, model, fault):
    function, count, _ = case
    bad, error, words = bad_vectors(model.n)[fault]
    for position in range(count):
        vectors = list(states(model, count))
        vectors[position] = bad
        with pytest.raises(error) as caught:
            function(model, *vectors)
        assert isinstance(caught.value, (RobotModelsError, ValueError))
        assert words in str(caught.value)
        assert str(caught.value).startswith("qv"[position])


def test_frames_by_name_by_number_and_the_tool(model):
    q = states(model, 1)[0]
    poses = np.concatenate([[model.base], table_poses(model, q)])
    np.testing.assert_allclose(rm.dgm(model, q, 0), model.base, atol=1e-15)
    np.testing.assert_allclose(rm.dgm(model, q, "base"), model.base, atol=1e-15)
    np.testing.assert_array_equal(rm.dgm(model, q, "tool"), rm.dgm(model, q))
    for j in range(1, model.f + 1):
        for frame in (j, np.int64(j), model.table.names[j - 1]):
            np.testing.assert_allclose(rm.dgm(model, q, frame), poses[j], atol=1e-12)


@pytest.mark.parametrize("frame", ["J99", "", -1, 8, True, 1.0, 2.5, ["tool"], np.nan], ids=repr)
def test_an_unknown_frame_is_refused_whatever_was_asked_before(model, frame):
    q, v = states(model, 2)
    rm.dgm(model, q, 1)
    for call in (
        lambda: rm.dgm(model, q, frame),
        lambda: rm.dgm(model, [q], frame),
        lambda: rm.jacobian(model, q, frame),
        lambda: rm.jacobian_rate(model, q, v, frame),
        lambda: rm.dkm(model, q, v, frame),
    ):
        with pytest.raises(FrameNotFoundError, match="Known"):
            call()


@pytest.mark.parametrize("reference", ["LOCAL", "", None, 0, ["local"]], ids=repr)
def test_an_unknown_reference_is_refused(model, reference):
    q, v = states(model, 2)
    for call in (
        lambda: rm.jacobian(model, q, reference=reference),
        lambda: rm.jacobian(model, [q], reference=reference),
        lambda: rm.jacobian_rate(model, q, v, reference=reference),
        lambda: rm.dkm(model, q, v, reference=reference),
    ):
        with pytest.raises(InvalidValueError, match="world_aligned"):
            call()


@pytest.mark.parametrize("sigma", [[0], [1], [2, 0, 2]], ids=str)
def test_one_joint(case, sigma):
    function, count, core = case
    rows = [{"sigma": s, "d": 0.2, "alpha": 0.3, "r": 0.1} for s in [*sigma, 2]]
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    vectors = [[0.4], [1.5]][:count]
    single = function(model, *vectors)
    assert single.shape == shape_of(core, model)
    batch = function(model, *([x] for x in vectors))
    np.testing.assert_allclose(single, batch[0], rtol=0, atol=1e-15)


def test_no_joint_at_all(case):
    function, count, core = case
    rows = [{"sigma": 2, "d": 0.2}, {"sigma": 2, "r": 0.5}]
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    single = function(model, *([[]] * count))
    assert single.shape == shape_of(core, model)
    batch = function(model, *[np.zeros((3, 0))] * count)
    assert batch.shape == (3, *single.shape)
    np.testing.assert_allclose(batch, np.broadcast_to(single, batch.shape), atol=1e-15)
