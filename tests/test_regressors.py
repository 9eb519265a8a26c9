"""The border of the regressors: columns and their names, batches, chunks, errors."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state
from scipy import signal

import robotmodels as rm
from robotmodels.drive import DriveKind
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import (
    chunked,
    energy_difference_regressor,
    energy_parameter_names,
    energy_regressor,
    filtered_regressor,
    filtered_torque,
    joint_work,
    momentum_regressor,
    power_regressor,
    torque_regressor,
)

FILTER = signal.butter(1, 5.0, fs=100.0, output="sos")


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


# --- long logs -------------------------------------------------------------------------------


FORMS = {torque_regressor: 3, power_regressor: 3, energy_regressor: 2, momentum_regressor: 2}


@pytest.mark.parametrize(("N", "size"), [(7, 1), (300, 64), (7, 1000)])
@pytest.mark.parametrize("columns", [None, [3, 60, 9]], ids=str)
def test_pieces_of_every_form_are_the_whole(model, N, size, columns):
    vectors = states(model, 3, N)
    for form, count in FORMS.items():
        whole = np.asarray(form(model, *vectors[:count], columns=columns))
        seen = np.zeros(N, dtype=int)
        for rows, part in chunked(form, model, *vectors[:count], size=size, columns=columns):
            assert 0 < rows.stop - rows.start <= size
            wanted = whole[:, rows] if form is momentum_regressor else whole[rows]
            np.testing.assert_array_equal(np.asarray(part), wanted)
            seen[rows] += 1
        assert (seen == 1).all()


# --- columns ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("columns", "error", "words"),
    [
        (["ZZ1", "ZZ1"], InvalidValueError, "twice"),
        (["Zz1"], InvalidValueError, "'Zz1'.*ZZ1"),
        ([-1], InvalidValueError, "from 0 to"),
        ([0.5], InvalidValueError, "numbers or names"),
        (3, InvalidValueError, "columns"),
        (np.ones(3, dtype=bool), ShapeError, "mask"),
    ],
    ids=str,
)
def test_columns_that_are_not_there_are_named(model, columns, error, words):
    for function, count in FORMS.items():
        with pytest.raises(error, match=words):
            function(model, *states(model, count), columns=columns)


@pytest.mark.parametrize("name", ["random", "tx40"])
def test_kinds_of_drives_have_columns_of_their_own(model, name):
    """Any collection of kinds gives the columns that it names, of every form."""
    model = rm.load("tx40") if name == "tx40" else model
    vectors, t = states(model, 3, 4), np.arange(4.0)
    every = rm.parameter_names(model)
    forms = [
        *(lambda k, f=f, n=n: np.asarray(f(model, *vectors[:n], drive=k)) for f, n in FORMS.items()
          if f is not energy_regressor),
        lambda k: energy_difference_regressor(model, t, *vectors[:2], drive=k),
        lambda k: rm.parameter_vector(model, k),
    ]  # fmt: skip
    for kinds in ((), ("Ia",), ("Fc", "Ia"), (DriveKind.FV, "offset"), ("Ia", "Fv", "Fc")):
        words = {k.value if isinstance(k, DriveKind) else k for k in kinds}
        kept = {*words, *(f"{word}m" for word in words - {"offset"})}
        at = [k for k, name in enumerate(every)
              if k < 10 * model.f or name.rstrip("0123456789") in kept]  # fmt: skip
        assert rm.parameter_names(model, drive=kinds) == tuple(every[k] for k in at)
        for form in forms:
            np.testing.assert_array_equal(form(kinds), form(True)[..., at])
        h = rm.energy_regressor(model, *vectors[:2], drive=kinds)
        assert h.shape[-1] == len(energy_parameter_names(model, kinds))
        assert (h.shape[-1] > 10 * model.f) == ("Ia" in words)


# --- filters ---------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 3, 8])
def test_torques_through_a_filter_are_the_means_of_neighbours_through_it(order):
    """From rest: the first sample is zero, and a constant torque is a step at the second."""
    b, a = signal.butter(order, 8.0, fs=200.0)
    sections = signal.butter(order, 8.0, fs=200.0, output="sos")
    tau = np.random.default_rng(0).normal(size=(400, 2, 3))
    means = np.concatenate((np.zeros((1, 2, 3)), (tau[1:] + tau[:-1]) / 2))
    found = filtered_torque(tau, sections)
    np.testing.assert_allclose(found, signal.lfilter(b, a, means, axis=0), atol=1e-7)
    np.testing.assert_allclose(filtered_torque(np.ones(5000), sections)[-1], 1.0)
    assert not found[0].any()


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda m, q: energy_difference_regressor(m, [0, 1, 1], q, q), InvalidValueError, "ascend"),
        (lambda m, q: energy_difference_regressor(m, [0, 1], q, q), ShapeError, "^q: expected"),
        (lambda m, q: joint_work([0, 1, 2], q, q, [1, 0]), InvalidValueError, "knots"),
        (lambda m, q: filtered_torque(q, FILTER[0]), ShapeError, "^low_pass: expected second"),
        (lambda m, q: filtered_torque(q, [[1, 1, 0, 1, -1.5, 0]]), InvalidValueError, "not stable"),
        (lambda m, q: filtered_torque(q[:0], FILTER), InvalidValueError, "^tau: the log is emp"),
        (lambda m, q: filtered_regressor(m, 0.0, q, q, FILTER), InvalidValueError, "^dt: expect"),
        (lambda m, q: chunked(torque_regressor, m, q, q), InvalidValueError, "got 2 arrays"),
        (lambda m, q: rm.parameter_names(m, drive=("Iam",)), InvalidValueError, "one of 'ia', .*"),
        (
            lambda m, q: rm.energy_regressor(m, q, q, columns=base_parameters(m)),
            InvalidValueError,
            r"no column 'Fv.*drive=\('Ia',\)",
        ),
        (lambda m, q: rm.idm(m, q, q, q, drive=("Ia",)), InvalidValueError, "True or False here"),
    ],
)
def test_mistakes_in_logs_and_filters(model, call, error, words):
    with pytest.raises(error, match=words):
        call(model, states(model, 1, 3)[0])
