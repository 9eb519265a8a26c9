"""The border of the regressors: columns and their names, batches, chunks, errors."""

import pickle
import tracemalloc

import numpy as np
import pytest
from identities.random_robots import random_model, random_state
from scipy import signal

import robotmodels as rm
from robotmodels.drive import DriveKind
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import (
    LowPass,
    energy_difference_regressor,
    energy_difference_regressor_chunks,
    energy_parameter_names,
    energy_regressor_chunks,
    filtered_regressor,
    filtered_regressor_chunks,
    joint_work,
    momentum_regressor,
    momentum_regressor_chunks,
    power_regressor,
    power_regressor_chunks,
)
from robotmodels.regressors.low_pass import FilterRun

FUNCTIONS = {
    "torque": (rm.torque_regressor, 3),
    "torque without drives": (lambda m, *x: rm.torque_regressor(m, *x, drive=False), 3),
    "power": (power_regressor, 3),
    "momentum": (lambda m, *x: momentum_regressor(m, *x).momentum, 2),
    "momentum's force": (lambda m, *x: momentum_regressor(m, *x).force, 2),
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
        "power": (10 * f + 4 * n,),
        "momentum": (n, 10 * f + 4 * n),
        "momentum's force": (n, 10 * f + 4 * n),
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


def test_a_log_without_samples_is_named(model):
    """What consumes a log refuses an empty one; what maps rows returns none."""
    q, v, a = states(model, 3, 0)
    t, names = np.zeros(0), "the log is empty; expected at least"
    for function, rows in (
        (rm.torque_regressor_chunks, (q, v, a)),
        (power_regressor_chunks, (q, v, a)),
        (energy_regressor_chunks, (q, v)),
        (momentum_regressor_chunks, (q, v)),
    ):
        with pytest.raises(InvalidValueError, match=rf"^q, v.*: {names} one sample"):
            function(model, *rows)
    for function in (filtered_regressor, filtered_regressor_chunks):
        with pytest.raises(InvalidValueError, match=rf"^q, v: {names} one sample"):
            function(model, 0.1, q, v, FILTER)
    for function in (energy_difference_regressor, energy_difference_regressor_chunks):
        with pytest.raises(InvalidValueError, match=rf"^t: {names} 2 samples"):
            function(model, t, q, v)
    with pytest.raises(InvalidValueError, match=rf"^t: {names} 2 samples"):
        joint_work(t, v, v)
    p = rm.parameter_vector(model).size
    assert rm.torque_regressor(model, q, v, a).shape == (0, model.n, p)
    assert power_regressor(model, q, v, a).shape == (0, p)
    assert rm.energy_regressor(model, q, v).shape == (0, len(energy_parameter_names(model)))
    assert momentum_regressor(model, q, v).momentum.shape == (0, model.n, p)


def test_a_chunk_of_one(model):
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


FILTER = LowPass.first_order(30.0)


def chunked(model, q, v, a, size):
    """Of every form: all at once, and the pieces."""
    t = np.cumsum(np.full(len(q), 0.01))
    knots = np.unique(np.append(np.arange(0, len(q), 3), len(q) - 1))
    momentum = momentum_regressor(model, q, v)
    momenta = [(rows, P.copy(), S.copy())
               for rows, (P, S) in momentum_regressor_chunks(model, q, v, size=size)]  # fmt: skip
    return {
        "torque": (
            rm.torque_regressor(model, q, v, a),
            rm.torque_regressor_chunks(model, q, v, a, size=size),
        ),
        "torque of some columns": (
            rm.torque_regressor(model, q, v, a, columns=[3, 70, 9]),
            rm.torque_regressor_chunks(model, q, v, a, size=size, columns=[3, 70, 9]),
        ),
        "power": (
            power_regressor(model, q, v, a),
            power_regressor_chunks(model, q, v, a, size=size),
        ),
        "energy": (
            rm.energy_regressor(model, q, v),
            energy_regressor_chunks(model, q, v, size=size),
        ),
        "momentum": (momentum.momentum, [(rows, P) for rows, P, _ in momenta]),
        "momentum's force": (momentum.force, [(rows, S) for rows, _, S in momenta]),
        "energy difference": (
            energy_difference_regressor(model, t, q, v),
            energy_difference_regressor_chunks(model, t, q, v, size=size),
        ),
        "energy difference between knots": (
            energy_difference_regressor(model, t, q, v, knots=knots),
            energy_difference_regressor_chunks(model, t, q, v, size=size, knots=knots),
        ),
        "filtered": (
            filtered_regressor(model, 0.01, q, v, FILTER),
            filtered_regressor_chunks(model, 0.01, q, v, FILTER, size=size),
        ),
    }


@pytest.mark.parametrize("N", [2, 7, 300])
@pytest.mark.parametrize("size", [1, 4, 1000])
def test_pieces_of_every_form_are_the_whole(model, N, size):
    for form, (whole, chunks) in chunked(model, *states(model, 3, N), size).items():
        seen = np.zeros(len(whole), dtype=int)
        for rows, part in chunks:
            assert 0 < len(part) <= size
            np.testing.assert_allclose(part, whole[rows], rtol=1e-12, atol=1e-12, err_msg=form)
            seen[rows] += 1
        assert (seen == 1).all()


def test_no_form_needs_the_whole_stack(model):
    q, v, a = states(model, 3, 4000)
    for _, chunks in chunked(model, q[:8], v[:8], a[:8], 64).values():
        list(chunks)  # compile
    t = np.linspace(0.0, 1.0, 4000)
    stack = 8 * q.size * rm.parameter_vector(model).size
    calls = {
        "power": lambda: power_regressor_chunks(model, q, v, a, size=64),
        "energy": lambda: energy_regressor_chunks(model, q, v, size=64),
        "momentum": lambda: momentum_regressor_chunks(model, q, v, size=64),
        "difference": lambda: energy_difference_regressor_chunks(model, t, q, v, size=64),
        "filtered": lambda: filtered_regressor_chunks(model, 0.01, q, v, FILTER, size=64),
    }
    for name, call in calls.items():
        tracemalloc.start()
        try:
            for _ in call():
                pass
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < stack / 10, name


# --- columns ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("columns", "error", "words"),
    [
        (["ZZ1", "ZZ1"], InvalidValueError, "twice"),
        ([3, 3], InvalidValueError, "twice"),
        (["Zz1"], InvalidValueError, "'Zz1'.*ZZ1"),
        ([-1], InvalidValueError, "from 0 to"),
        ([10_000], InvalidValueError, "from 0 to"),
        ([0.5], InvalidValueError, "numbers or names"),
        ([True], InvalidValueError, "numbers or names"),
        ("ZZ1", InvalidValueError, "columns"),
        (3, InvalidValueError, "columns"),
        (np.ones(3, dtype=bool), ShapeError, "mask"),
    ],
    ids=str,
)
def test_columns_that_are_not_there_are_named(case, model, columns, error, words):
    function, count = case
    if function not in (rm.torque_regressor, rm.energy_regressor, power_regressor):
        function, count = momentum_regressor, 2
    with pytest.raises(error, match=words):
        function(model, *states(model, count), columns=columns)


def test_base_parameters_choose_columns_of_their_own_robot_alone(model):
    """Another length, and other columns are dependent: the names alone do not tell."""
    q, v, a = states(model, 3, 2)
    base = base_parameters(model)
    longer = model.with_table(model.table.replace(d=model.table.d + 0.1))
    calls = (
        lambda m: rm.torque_regressor(m, q, v, a, columns=base),
        lambda m: rm.torque_regressor_chunks(m, q, v, a, columns=base),
        lambda m: power_regressor(m, q, v, a, columns=base),
        lambda m: momentum_regressor(m, q, v, columns=base),
        lambda m: filtered_regressor(m, 0.01, q, v, FILTER, columns=base),
        lambda m: rm.parameter_names(m, columns=base),
    )
    for call in calls:
        call(model.with_inertia(None).with_tool(None))
        with pytest.raises(InvalidValueError, match="base parameters of"):
            call(longer)


def test_columns_of_some_links_are_those_of_all(model):
    """Links that no wanted column needs are not walked; what is left is the same to the bit."""
    q, v, a = states(model, 3, 3)
    W = rm.torque_regressor(model, q, v, a)
    names = rm.parameter_names(model)
    rng = np.random.default_rng(0)
    choices = [[k] for k in range(10 * model.f)]
    choices += [rng.permutation(len(names))[: rng.integers(1, 12)].tolist() for _ in range(40)]
    for columns in choices:
        some = rm.torque_regressor(model, q, v, a, columns=columns)
        np.testing.assert_array_equal(some, W[..., columns])


def test_no_column_at_all(model):
    q, v, a = states(model, 3, 2)
    assert rm.torque_regressor(model, q, v, a, columns=[]).shape == (2, model.n, 0)
    assert power_regressor(model, q, v, a, columns=[]).shape == (2, 0)
    assert filtered_regressor(model, 0.1, q, v, FILTER, columns=[]).shape == (2, model.n, 0)


@pytest.mark.parametrize("name", ["random", "tx40"])
def test_kinds_of_drives_have_columns_of_their_own(model, name):
    """Any collection of kinds gives the columns that it names, of every form."""
    model = rm.load("tx40") if name == "tx40" else model
    q, v, a = states(model, 3, 4)
    t = np.arange(4.0)
    every = rm.parameter_names(model)
    forms = (
        lambda d: rm.torque_regressor(model, q, v, a, drive=d),
        lambda d: power_regressor(model, q, v, a, drive=d),
        lambda d: momentum_regressor(model, q, v, drive=d).momentum,
        lambda d: momentum_regressor(model, q, v, drive=d).force,
        lambda d: energy_difference_regressor(model, t, q, v, drive=d),
        lambda d: filtered_regressor(model, 0.1, q, v, FILTER, drive=d),
    )
    for kinds in ((), ("Ia",), ("Fc", "Ia"), (DriveKind.FV, "offset"), ("Ia", "Fv", "Fc")):
        names = rm.parameter_names(model, drive=kinds)
        words = {k.value if isinstance(k, DriveKind) else k for k in kinds}
        words |= {f"{word}m" for word in words} - {"offsetm"}
        at = [every.index(name) for name in names]
        assert at == [
            k for k, name in enumerate(every)
            if k < 10 * model.f or name.rstrip("0123456789") in words
        ]  # fmt: skip
        for form in forms:
            np.testing.assert_array_equal(form(kinds), form(True)[..., at])
        np.testing.assert_array_equal(
            rm.parameter_vector(model, kinds), rm.parameter_vector(model)[at]
        )
        h = rm.energy_regressor(model, q, v, drive=kinds)
        assert h.shape[-1] == len(energy_parameter_names(model, kinds))
        assert (h.shape[-1] > 10 * model.f) == ("Ia" in words)
    assert rm.parameter_names(model, drive="Ia") == rm.parameter_names(model, drive=DriveKind.IA)
    with pytest.raises(InvalidValueError, match=r"drive: expected one of 'ia', .* got 'Iam'"):
        rm.parameter_names(model, drive=("Iam",))
    with pytest.raises(InvalidValueError, match="drive: expected True, False, or kinds"):
        rm.torque_regressor(model, q, v, a, drive=None)
    for function in (rm.idm, rm.ddm):
        with pytest.raises(InvalidValueError, match="drive: expected True or False here"):
            function(model, q, v, a, drive=("Ia",))
    for function in (rm.mass_matrix, lambda m, q, drive: rm.kinetic_energy(m, q, v, drive)):
        with pytest.raises(InvalidValueError, match="drive: expected True or False here"):
            function(model, q, drive=("Ia",))


def test_energy_of_base_parameters_with_rotors(model):
    q, v, _ = states(model, 3, 2)
    base = base_parameters(model, drive="Ia")
    h = rm.energy_regressor(model, q, v, columns=base)
    assert h.shape == (2, len(base))
    np.testing.assert_array_equal(h, base.reduce(rm.energy_regressor(model, q, v)))
    energy = rm.kinetic_energy(model, q, v) + rm.potential_energy(model, q)
    change = (h[0] - h[1]) @ base.values(model)
    np.testing.assert_allclose(change, energy[0] - energy[1], rtol=1e-9)
    whole = base_parameters(model, drive=True)
    with pytest.raises(InvalidValueError, match=r"have no column here: Fv.*drive=\('Ia',\)"):
        rm.energy_regressor(model, q, v, columns=whole)
    with pytest.raises(ShapeError, match=r"An energy has no columns of Fv, Fc, offset.*'Ia'"):
        whole.reduce(rm.energy_regressor(model, q, v))


def test_printed_names_are_taken(model):
    q, v, a = states(model, 3, 2)
    base = base_parameters(model)
    name = next(n for n in base.names if len(base.regrouping[n]) > 1)
    assert base.regrouping[f"{name}R"] is base.regrouping[name]
    column = rm.torque_regressor(model, q, v, a, columns=[name])
    np.testing.assert_array_equal(rm.torque_regressor(model, q, v, a, columns=[f"{name}R"]), column)
    with pytest.raises(KeyError, match="No base parameter 'Q1'"):
        base.regrouping["Q1"]


def test_friction_is_no_energy(model):
    q, v, _ = states(model, 3)
    with pytest.raises(InvalidValueError, match=r"'Fv.*no"):
        rm.energy_regressor(model, q, v, columns=[f"Fv{model.table.joint_rows[0] + 1}"])
    with pytest.raises(InvalidValueError, match="energy"):
        rm.energy_regressor(model, q, v, columns=base_parameters(model))
    rigid = base_parameters(model, drive=False)
    h = rm.energy_regressor(model, [q, 0 * q], [v, 0 * v], columns=rigid)
    energy = [
        rm.kinetic_energy(model, x, y, drive=False) + rm.potential_energy(model, x)
        for x, y in ((q, v), (0 * q, 0 * v))
    ]
    np.testing.assert_allclose((h[0] - h[1]) @ rigid.values(model), energy[0] - energy[1],
                               rtol=1e-9)  # fmt: skip
    assert rm.energy_regressor(model, q, v).shape[-1] == len(energy_parameter_names(model))


# --- samples in time -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"t": [0.0, 1.0, 1.0]}, InvalidValueError, "ascending"),
        ({"t": [0.0, 1.0]}, ShapeError, "^q: expected shape"),
        ({"t": [[0.0]]}, ShapeError, "^t: "),
        ({"t": [0.0, np.nan, 1.0]}, InvalidValueError, "^t: "),
        ({"knots": [0, 3]}, InvalidValueError, "knots"),
        ({"knots": [1, 0]}, InvalidValueError, "knots"),
        ({"knots": [0.0, 1.0]}, InvalidValueError, "knots"),
    ],
    ids=str,
)
def test_mistakes_in_times(model, change, error, words):
    q, v, _ = states(model, 3, 3)
    arguments = {"t": [0.0, 1.0, 2.0], "knots": None} | change
    for function in (energy_difference_regressor, energy_difference_regressor_chunks):
        with pytest.raises(error, match=words):
            function(model, arguments["t"], q, v, knots=arguments["knots"])
    if "^q" not in words:
        with pytest.raises(error, match=words):
            joint_work(arguments["t"], v, v, arguments["knots"])


def test_hardly_any_samples(model):
    q, v, _ = states(model, 3, 3)
    p = rm.parameter_vector(model).size
    for function in (energy_difference_regressor, energy_difference_regressor_chunks):
        with pytest.raises(InvalidValueError, match="the log has 1 sample; expected at least 2"):
            function(model, [0.0], q[:1], v[:1])
        for knots in ([], [1]):
            with pytest.raises(InvalidValueError, match=rf"knots: .* got {len(knots)}\."):
                function(model, np.arange(3), q, v, knots=knots)
    with pytest.raises(InvalidValueError, match="the log has 1 sample"):
        joint_work([0.0], v[:1], v[:1])
    assert energy_difference_regressor(model, np.arange(3), q, v, knots=[0, 2]).shape == (1, p)
    one = filtered_regressor(model, 0.1, q[:1], v[:1], FILTER)
    assert not one.any()  # the filter starts from rest


# --- filters ---------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_filters_answer_as_their_transfer_functions(order):
    """A harmonic through a Butterworth filter, after the transient, and its derivative."""
    from scipy.signal import butter, freqs

    b, a = butter(order, 40.0, analog=True)
    omega, dt = 25.0, 2e-4
    t = np.arange(0.0, 1.5, dt)
    u = np.sin(omega * t)
    _, (H,) = freqs(b, a, [omega])
    late = t > 1.2
    for system in ((b, a), butter(order, 40.0, analog=True, output="zpk")):
        low_pass = LowPass.from_scipy(system)
        assert low_pass.order == order
        y = low_pass.filter(u, dt)
        expected = (H * np.exp(1j * omega * t)).imag
        np.testing.assert_allclose(y[late], expected[late], atol=3e-6)
        dy = np.empty((t.size, 1))
        FilterRun(low_pass, dt).derivatives(u[:, None], dy)
        dy = dy[:, 0]
        np.testing.assert_allclose(
            dy[late], (1j * omega * H * np.exp(1j * omega * t)).imag[late], atol=1e-4
        )
    assert LowPass.first_order(40.0).filter(np.ones((4, 2, 3)), dt).shape == (4, 2, 3)


def test_a_ramp_and_its_derivative_are_exact():
    low_pass, dt = LowPass.first_order(3.0), 0.1
    t = np.arange(20) * dt
    ramp = 5.0 + 2.0 * t
    expected = 2.0 * (1.0 - np.exp(-3.0 * t))  # the derivative 2, filtered from rest
    slope = np.empty((20, 1))
    FilterRun(low_pass, dt).derivatives(ramp[:, None], slope)
    np.testing.assert_allclose(slope[:, 0], expected, atol=1e-13)
    step = 1.0 - np.exp(-3.0 * t)
    np.testing.assert_allclose(low_pass.filter(np.ones(20), dt), step, atol=1e-13)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: LowPass.first_order(0.0), InvalidValueError, "cutoff"),
        (lambda: LowPass(10.0), InvalidValueError, r"LowPass.first_order\(cutoff\)"),
        (lambda: LowPass.first_order([1.0]), InvalidValueError, "cutoff"),
        (lambda: LowPass([[1.0]], [1.0], [1.0]), InvalidValueError, "stable"),
        (lambda: LowPass([1.0], [1.0], [1.0]), ShapeError, "A:"),
        (lambda: LowPass([[-1.0]], [1.0, 2.0], [1.0]), ShapeError, "B:"),
        (lambda: LowPass.from_scipy(([1.0, 1.0], [1.0, 2.0])), InvalidValueError, "falls off"),
        (lambda: LowPass.from_scipy(([1.0], [1.0, -2.0])), InvalidValueError, "stable"),
        (lambda: LowPass.from_scipy("butter"), InvalidValueError, "SciPy"),
        (lambda: LowPass.from_scipy(3.0), InvalidValueError, "SciPy"),
        (lambda: FILTER.filter([1.0], 0.0), InvalidValueError, "dt"),
        (lambda: FILTER.filter(1.0, 1.0), ShapeError, "u:"),
    ],
)
def test_mistakes_in_filters(make, error, words):
    with pytest.raises(error, match=words):
        make()


def test_mistakes_in_filtered_regressors(model):
    q, v, _ = states(model, 3, 3)
    for function in (filtered_regressor, filtered_regressor_chunks):
        with pytest.raises(InvalidValueError, match="low_pass"):
            function(model, 0.1, q, v, 30.0)
        with pytest.raises(InvalidValueError, match="dt"):
            function(model, -0.1, q, v, FILTER)
        with pytest.raises(ShapeError, match="q, v"):
            function(model, 0.1, q[0], v[0], FILTER)
        with pytest.raises(ShapeError, match="q, v"):
            function(model, 0.1, q, v[:2], FILTER)


# --- discrete filters --------------------------------------------------------------------------

RATE = 200.0


def discrete_filters():
    """Of every form SciPy has: the object or arrays, and what it does as (b, a)."""
    b, a = signal.butter(4, 8.0, fs=RATE)
    third = signal.butter(3, 20.0, fs=RATE)
    eighth = signal.cheby1(8, 0.5, 15.0, fs=RATE, output="sos")
    average = np.ones(4) / 4
    return {
        "ba": ((b, a), 1 / RATE, (b, a)),
        "dlti": (signal.dlti(b, a, dt=1 / RATE), None, (b, a)),
        "zpk": (signal.butter(4, 8.0, fs=RATE, output="zpk"), 1 / RATE, (b, a)),
        "dlti of zpk": (signal.dlti(*signal.tf2zpk(*third), dt=1 / RATE), None, third),
        "space": (signal.dlti(*third, dt=1 / RATE).to_ss(), None, third),
        "sections": (eighth, 1 / RATE, signal.sos2tf(eighth)),
        "odd sections": (signal.tf2sos(*third), 1 / RATE, third),
        "moving average": ((average, [1.0, 0, 0, 0]), 1 / RATE, (average, [1.0])),
        "wide": (signal.butter(1, 0.45 * RATE, fs=RATE), 1 / RATE,
                 signal.butter(1, 0.45 * RATE, fs=RATE)),
    }  # fmt: skip


@pytest.mark.parametrize("form", discrete_filters())
def test_a_discrete_filter_is_scipys(form):
    system, dt, (b, a) = discrete_filters()[form]
    low_pass = LowPass.from_scipy(system, dt)
    assert low_pass.period == 1 / RATE
    u = np.random.default_rng(0).normal(size=(400, 2))
    u[0] = 0.0
    expected = signal.lfilter(b, a, u, axis=0)
    np.testing.assert_allclose(low_pass.filter(u, 1 / RATE), expected, atol=1e-9)
    assert pickle.loads(pickle.dumps(low_pass)).period == low_pass.period
    # the derivative: the trapezoidal rule, 2 / dt (z - 1) / (z + 1), on the way
    omega = 2 * np.pi * 3.0
    t = np.arange(3000) / RATE
    slope = np.empty((t.size, 1))
    FilterRun(low_pass, 1 / RATE).derivatives(np.sin(omega * t)[:, None], slope)
    z = np.exp(1j * omega / RATE)
    H = np.polyval(b, z) / np.polyval(np.r_[a, np.zeros(len(b) - len(a))], z)
    wave = (H * 2 * RATE * (z - 1) / (z + 1) * np.exp(1j * omega * t)).imag
    np.testing.assert_allclose(slope[2000:, 0], wave[2000:], atol=1e-6)


def test_the_discrete_filtered_regressor_gives_the_filtered_torques(model):
    """Along a smooth motion sampled at 1 kHz: the torques through the same filter."""
    rng = np.random.default_rng(1)
    dt, n = 1e-3, model.n
    low_pass = LowPass.from_scipy(signal.butter(4, 12.0, fs=1 / dt, output="sos"), dt=dt)
    t = np.arange(2500)[:, None] * dt
    rate, size = rng.uniform(1.0, 6.0, n), rng.uniform(0.2, 0.6, n)
    q = size * np.sin(rate * t)
    v, a = size * rate * np.cos(rate * t), -size * rate**2 * np.sin(rate * t)
    tau = rm.idm(model.with_drive(None), q, v, a)
    W = filtered_regressor(model, dt, q, v, low_pass, drive=False)
    expected = low_pass.filter(tau, dt)
    found = W @ rm.parameter_vector(model, drive=False)
    scale = np.abs(tau).max()
    np.testing.assert_allclose(found, expected, atol=2e-5 * scale)
    base = base_parameters(model, drive=False)
    pieces = filtered_regressor_chunks(
        model, dt, q, v, low_pass, drive=False, columns=base, size=300
    )
    for rows, part in pieces:
        np.testing.assert_allclose(part @ base.values(model), expected[rows], atol=2e-5 * scale)
    with pytest.raises(InvalidValueError, match=r"^dt: .*period 0.001 s.*0.002 s"):
        filtered_regressor(model, 2 * dt, q, v, low_pass)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: (signal.dlti([1.0], [1.0, 0.5], dt=0.1), None), "half the sampling rate"),
        (
            lambda: (signal.ellip(3, 1, 20, 0.2, output="sos")[:, :6] * 1.0, None),
            "dt: second-order",
        ),
        (lambda: (signal.cheby2(4, 30, 0.3, output="sos"), 0.1), "half the sampling rate"),
        (lambda: (signal.dlti([1.0, 1.0], [1.0, 0.5]), None), "no sampling period"),
        (lambda: (signal.dlti([1.0, 1.0], [1.0, 0.5], dt=0.1), 0.2), "own period is 0.1"),
        (lambda: (signal.lti([1.0], [1.0, 0.5]), 0.1), "continuous"),
        (lambda: (([1.0, 1.0], [1.0, -1.5]), 0.1), "stable"),
        (lambda: (([1.0, 1.0], [1.0, 0.5]), -0.1), "dt: "),
        (lambda: (np.ones((2, 5)), 0.1), r"\(k, 6\)"),
        (lambda: ("butter", 0.1), "SciPy"),
    ],
)
def test_mistakes_in_discrete_filters(make, words):
    system, dt = make()
    with pytest.raises(InvalidValueError, match=words):
        LowPass.from_scipy(system, dt)
