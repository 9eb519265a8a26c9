"""The border of the regressors: columns and their names, batches, chunks, errors."""

import tracemalloc

import numpy as np
import pytest
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError

FUNCTIONS = {
    "torque": (rm.torque_regressor, 3),
    "torque without drives": (lambda m, *x: rm.torque_regressor(m, *x, drive=False), 3),
    "energy": (rm.energy_regressor, 2),
    "energy without rotors": (lambda m, *x: rm.energy_regressor(m, *x, drive=False), 2),
}


@pytest.fixture(params=FUNCTIONS)
def case(request):
    return FUNCTIONS[request.param]


@pytest.fixture(scope="module")
def model():
    model = random_model(np.random.default_rng(3), f=7, tree=True, fixed=True, drive=True)
    assert model.n >= 3
    return model


def states(model, count, *batch):
    return random_state(model, np.random.default_rng(5), *batch)[:count]


def two_joints(**options):
    table = rm.DHTable.from_rows([{"sigma": 0}, {"sigma": 2, "d": 0.1}, {"sigma": 1, "d": 0.2}])
    return rm.RobotModel.from_table(table, **options)


def test_names_number_parameters_by_frame():
    names = rm.parameter_names(two_joints())
    links = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"]
    assert names[:30] == tuple(f"{p}{j}" for j in (1, 2, 3) for p in links)
    drives = ("Ia1", "Ia3", "Fv1", "Fv3", "Fc1", "Fc3", "offset1", "offset3")
    assert names[30:] == drives
    assert rm.parameter_names(two_joints(), drive=False) == names[:30]
    wrist = rm.Transmission([[1, 0], [-1, 1]], Iam=[0, 0.1], Fvm=[0, 0.2], Fcm=[0, 0.3])
    coupled = two_joints(transmission=wrist)
    assert rm.parameter_names(coupled) == (*names, "Iam3", "Fvm3", "Fcm3")
    np.testing.assert_array_equal(rm.parameter_vector(coupled)[-3:], [0.1, 0.2, 0.3])


def test_the_vector_is_the_models_parameters(model):
    values = dict(zip(rm.parameter_names(model), rm.parameter_vector(model), strict=True))
    frames = model.table.joint_rows + 1
    assert [values[f"MY{j}"] for j in range(1, model.f + 1)] == model.inertia.values[:, 7].tolist()
    for kind in ("Ia", "Fv", "Fc", "offset"):
        assert [values[f"{kind}{j}"] for j in frames] == getattr(model.drive, kind).tolist()
    vector = rm.parameter_vector(model)
    vector[...] = np.nan
    assert np.isfinite(rm.parameter_vector(model)).all()


@pytest.mark.parametrize("batch", [(), (1,), (3,), (2, 3), (0,), (2, 0, 3)], ids=str)
def test_leading_axes_are_the_batch(case, model, batch):
    function, count = case
    vectors = states(model, count, *batch)
    result = function(model, *vectors)
    n, f = model.n, model.f
    core = {
        "torque": (n, 10 * f + 4 * n),
        "torque without drives": (n, 10 * f),
        "energy": (10 * f + n,),
        "energy without rotors": (10 * f,),
    }[next(k for k, v in FUNCTIONS.items() if v == case)]
    assert result.shape == (*batch, *core)
    assert result.dtype == np.float64
    assert result.flags.c_contiguous
    for index in np.ndindex(*batch):
        np.testing.assert_array_equal(result[index], function(model, *(x[index] for x in vectors)))


def test_batches_broadcast(case, model):
    function, count = case
    vectors = states(model, count, 3)
    for k in range(count):
        mixed = [x if i == k else x[0] for i, x in enumerate(vectors)]
        full = [x if i == k else np.tile(x[0], (3, 1)) for i, x in enumerate(vectors)]
        np.testing.assert_array_equal(function(model, *mixed), function(model, *full))
        with pytest.raises(ShapeError, match="do not broadcast"):
            function(model, *(x[:2] if i == k else x for i, x in enumerate(vectors)))


@pytest.mark.parametrize("batch", [(), (2,)], ids=str)
def test_results_are_fresh_and_inputs_stay(case, model, batch):
    function, count = case
    vectors = [x.copy() for x in states(model, count, *batch)]
    copies = [x.copy() for x in vectors]
    first = function(model, *vectors)
    kept = first.copy()
    first[...] = np.nan
    np.testing.assert_array_equal(function(model, *vectors), kept)
    np.testing.assert_array_equal(vectors, copies)


def test_lists_and_integers_are_taken(case, model):
    function, count = case
    whole = [np.arange(2 * model.n).reshape(2, model.n) % 3 - 1] * count
    expected = function(model, *(x.astype(float) for x in whole))
    for kind in (lambda x: x, lambda x: x.tolist(), lambda x: np.asfortranarray(x.astype(float))):
        np.testing.assert_array_equal(function(model, *map(kind, whole)), expected)


@pytest.mark.parametrize(
    ("bad", "error"),
    [
        (lambda n: np.zeros(n + 1), ShapeError),
        (lambda n: np.zeros((n, 1)), ShapeError),
        (lambda n: np.full((2, n), np.nan), InvalidValueError),
        (lambda n: [np.inf] * n, InvalidValueError),
        (lambda n: ["a"] * n, InvalidValueError),
    ],
    ids=["too long", "column", "NaN", "infinity", "text"],
)
def test_a_bad_vector_is_named(case, model, bad, error):
    function, count = case
    chunks = (lambda m, *x: rm.torque_regressor_chunks(m, *x), 3)
    for call, arguments in ((function, count), chunks):
        for position in range(arguments):
            vectors = list(states(model, arguments))
            vectors[position] = bad(model.n)
            with pytest.raises(error, match=f"^{'qva'[position]}: "):
                call(model, *vectors)


def test_energy_of_a_coupled_wrist():
    """A motor that two joints turn stores energy for both: a column of its own."""
    wrist = rm.Transmission([[1, 0], [-1, 1]], Iam=[0, 0.1])
    model = random_model(np.random.default_rng(2), f=2, prismatic=False).with_transmission(wrist)
    model = model.with_drive(rm.DriveParameters(Ia=[0.3, 0.4]))
    names = rm.parameter_names(model)
    kept = [i for i, name in enumerate(names) if not name.startswith(("F", "offset"))]
    q, v, _ = random_state(model, np.random.default_rng(0), 4)
    h = rm.energy_regressor(model, q, v)
    assert h.shape == (4, len(kept))
    energy = rm.kinetic_energy(model, q, v) + rm.potential_energy(model, q)
    np.testing.assert_allclose(h @ rm.parameter_vector(model)[kept], energy, rtol=1e-13)
    assert rm.energy_regressor(model, q, v, drive=False).shape == (4, 20)


# --- long logs -------------------------------------------------------------------------------


def test_chunks_of_nothing_and_of_one(model):
    q, v, a = states(model, 3, 0)
    assert list(rm.torque_regressor_chunks(model, q, v, a)) == []
    q, v, a = states(model, 3)
    ((rows, W),) = rm.torque_regressor_chunks(model, q, v, a)
    assert (rows.start, rows.stop) == (0, 1)
    np.testing.assert_array_equal(W[0], rm.torque_regressor(model, q, v, a))


@pytest.mark.parametrize("size", [0, -3])
def test_a_chunk_holds_at_least_one_sample(model, size):
    q, v, a = states(model, 3, 2)
    with pytest.raises(InvalidValueError, match="size"):
        rm.torque_regressor_chunks(model, q, v, a, size=size)


def test_memory_does_not_grow_with_the_log(model):
    q, v, a = states(model, 3, 20_000)
    rows = 8 * q[0].size * rm.parameter_vector(model).size
    rm.torque_regressor(model, q[:1], v[:1], a[:1])
    tracemalloc.start()
    try:
        for _, W in rm.torque_regressor_chunks(model, q, v, a, size=64):
            W.sum()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 64 * 3 * rows < 20_000 * rows
