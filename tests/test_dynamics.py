"""The border of dynamic models and regressors: shapes, batches, singular matrices, errors."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.errors import (
    InertiaError,
    InvalidValueError,
    ShapeError,
    SingularMassMatrixError,
)
from robotmodels.inertia import InertiaWarning
from robotmodels.regressors import (
    energy_parameter_names,
    momentum_regressor,
    power_regressor,
)

# name: function of the model and its vectors, lengths of these, shape of the result
FUNCTIONS = {
    "idm": (rm.idm, "nnn", ("n",)),
    "idm with a wrench": (rm.idm, "nnn6", ("n",)),
    "ddm": (rm.ddm, "nnn", ("n",)),
    "ddm with a wrench": (rm.ddm, "nnn6", ("n",)),
    "mass_matrix": (rm.mass_matrix, "n", ("n", "n")),
    "coriolis_matrix": (rm.coriolis_matrix, "nn", ("n", "n")),
    "gravity_torque": (rm.gravity_torque, "n", ("n",)),
    "kinetic_energy": (rm.kinetic_energy, "nn", ()),
    "potential_energy": (rm.potential_energy, "n", ()),
    "torque_regressor": (rm.torque_regressor, "nnn", ("n", "p")),
    "power_regressor": (power_regressor, "nnn", ("p",)),
    "momentum": (lambda m, *x: momentum_regressor(m, *x).momentum, "nn", ("n", "p")),
    "force": (lambda m, *x: momentum_regressor(m, *x).force, "nn", ("n", "p")),
    "energy_regressor": (rm.energy_regressor, "nn", ("e",)),
}


@pytest.fixture(params=FUNCTIONS)
def case(request):
    return FUNCTIONS[request.param]


@pytest.fixture(scope="module", params=["physical", "any"])
def model(request):
    """A tree that Pinocchio orders otherwise; with "any" inertia it cannot hold it at all.

    Such links have a direct model if the rotors are heavy enough.
    """
    model = random_model(
        np.random.default_rng(3), f=7, tree=True, fixed=True, inertia=request.param, drive=True,
        transmission=True,
    )  # fmt: skip
    assert model.n >= 3
    assert not model.twin.in_table_order
    assert model.twin.serves_dynamics == (request.param == "physical")
    if request.param == "any":
        model = model.with_drive(rm.DriveParameters(Ia=np.full(model.n, 300.0), Fc=model.drive.Fc))
        values = model.inertia.values.copy()
        values[:, 9] = np.abs(values[:, 9])  # negative masses are warned of, see below
        model = model.with_inertia(rm.InertialParameters(values))
    return model


def shape_of(core, model):
    sizes = {"n": model.n, "p": len(rm.parameter_names(model))}
    return tuple((sizes | {"e": len(energy_parameter_names(model))})[k] for k in core)


def vectors_of(lengths, model, *batch):
    rng = np.random.default_rng(5)
    q, v, a = random_state(model, rng, *batch)
    return [q, v, a, rng.normal(size=(*batch, 6))][: len(lengths)]


def close(actual, expected, tolerance=1e-12):
    expected = np.asarray(expected)
    assert np.shape(actual) == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


def test_batches_broadcast(case, model):
    """One argument of three rows among single ones, each in turn; others do not fit."""
    function, lengths, _ = case
    vectors = vectors_of(lengths, model, 3)
    for k in range(len(lengths)):
        mixed = [x.tolist() if i == k else x[0] for i, x in enumerate(vectors)]
        full = [x if i == k else np.tile(x[0], (3, 1)) for i, x in enumerate(vectors)]
        close(function(model, *mixed), function(model, *full))
        if len(lengths) > 1:
            with pytest.raises(ShapeError, match="do not broadcast"):
                function(model, *(x[:2] if i == k else x for i, x in enumerate(vectors)))


@pytest.mark.parametrize(
    ("build", "error", "words"),
    [
        (lambda k: np.zeros(k + 1), ShapeError, "expected shape"),
        (lambda k: np.zeros((k, 1)), ShapeError, "ravel"),
        (lambda k: np.full((3, k), np.inf), InvalidValueError, "inf"),
        (lambda k: ["0"] * k, InvalidValueError, "real numbers"),
    ],
)
def test_a_bad_vector_is_named(case, model, build, error, words):
    function, lengths, _ = case
    names = (*("q", "v", "tau" if function is rm.ddm else "a"), "wrench")
    for position, length in enumerate(lengths):
        vectors = vectors_of(lengths, model)
        vectors[position] = build(6 if length == "6" else model.n)
        with pytest.raises(error, match=f"^{names[position]}: .*{words}"):
            function(model, *vectors)


# --- singular mass matrices ------------------------------------------------------------------


def test_joints_that_move_no_inertia_are_named(model):
    massless = model.with_inertia(None).with_drive(None).with_transmission(None)
    vectors = vectors_of("nnn", model, 4)
    with pytest.raises(SingularMassMatrixError, match=f"'{model.name}'.*with_inertia"):
        rm.ddm(massless, *(x[0] for x in vectors))
    assert rm.ddm(massless, *(x[:0] for x in vectors)).shape == (0, model.n)
    rotors = massless.with_drive(rm.DriveParameters(Ia=np.full(model.n, 0.5)))
    close(rm.ddm(rotors, *vectors), 2 * vectors[2])
    wrist = rm.load("rx90").with_drive(None)
    rows = wrist.inertia.values.copy()
    rows[4:] = 0.0
    wrist = wrist.with_inertia(rm.InertialParameters(rows))
    with pytest.raises(SingularMassMatrixError, match=r"rank 4 of 6, .*of joints 5, 6 moves"):
        rm.ddm(wrist, *np.full((3, 6), 0.4))


def rx90_with(link, **values):
    model = rm.load("rx90").with_drive(None)
    rows = model.inertia.values.copy()
    for name, value in values.items():
        rows[link - 1, rm.inertia.PARAMETERS.index(name)] = value
    return model.with_inertia(rm.InertialParameters(rows))


@pytest.mark.parametrize(
    ("model", "error", "words"),
    [
        (rx90_with(3, M=-50.0), InertiaError, "2 of its 6 .*link 3: negative mass -50 kg"),
        (rx90_with(3, ZZ=-2.0, XX=-1.0), InertiaError, "link 3: a principal moment is -2.04 kg"),
        (rm.load("rx90").with_drive(rm.DriveParameters(Ia=[0, 0, 0, 0, 0, -3])),
         InertiaError, r"Ia = \[.* -3.0\]"),
        (rm.load("planar_2r").with_drive(rm.DriveParameters(Ia=[1.0, 1.0])).with_transmission(
            rm.Transmission([[1, 0], [-1, 1]], Iam=[0, 40.0])),
         InertiaError, r"coupled motors, Iam = \[0.0, 40.0\]"),
        (rm.load("planar_2r").with_transmission(rm.Transmission(np.ones((2, 2)))),
         InvalidValueError, "^transmission: .*rank 1 of 2.*None"),
    ],
    ids=["mass", "moments", "rotor", "coupled rotor", "coupling"],
)  # fmt: skip
def test_a_mass_matrix_of_no_robot_names_the_links(model, error, words):
    for batch in ((), (3,)):
        x = np.full((*batch, model.n), 0.3)
        with pytest.raises(error, match=words) as caught:
            rm.ddm(model, x, x, x)
        if error is InertiaError:
            assert ("first in sample 0 of 3" in str(caught.value)) == bool(batch)


def test_negative_masses_are_warned_of_and_masses_too_far_away_are_errors():
    model = rx90_with(6, M=-0.01).with_drive(rm.DriveParameters(Ia=np.ones(6)))
    zero = np.zeros(6)
    for q in (zero, [zero, zero]):
        with pytest.warns(InertiaWarning, match="link 6: negative mass -0.01 kg"):
            rm.ddm(model, q, zero, zero)
    # a mass on a slide whose square of the distance is no float
    table = rm.DHTable(antecedent=[0, 1], sigma=[0, 1], alpha=[0.0, np.pi / 2])
    links = np.zeros((2, 10))
    links[:, 9] = 1.0
    far = rm.RobotModel.from_table(table, inertia=rm.InertialParameters(links))
    with pytest.raises(SingularMassMatrixError, match="overflow"):
        rm.ddm(far, [0.0, 1e160], [0.0, 0.0], [1.0, 1.0])


# --- joints that mimic others ----------------------------------------------------------------


@pytest.mark.parametrize("drive", [True, False])
@pytest.mark.parametrize(
    "matrix",
    [
        [[0.5, 0.2, 0, 0], [0, 2.0, 0, 0], [3, 0.1, 0, 0], [0, 0, 0, 0.01]],
        [[0, 0, 0, 2.0], [0, 0, 0, -1.0], [0, 0, 0, 0.0], [0, 0, 0, 1.0]],
    ],
    ids=["two masters", "chain"],
)
def test_joints_that_mimic_others_follow(matrix, drive):
    """Inverse of direct on the constraint: K^T tau comes back, and the accelerations follow."""
    rng = np.random.default_rng(4)
    model = random_model(rng, f=4, tree=True, drive=True)
    K = rm.Transmission(matrix, rng.normal(size=4))
    model = model.with_transmission(K)
    q_c, v_c, a_c, tau = rng.normal(size=(4, 2, 3, 4))
    w = rng.normal(size=(2, 3, 6))
    q, v = K.to_joint(q_c), v_c @ K.matrix.T
    a = rm.ddm(model, q, v, tau, w, drive)
    back = rm.idm(model, q, v, a, w, drive)
    close(K.to_motor_torque(back), K.to_motor_torque(tau), 1e-10)
    close(a @ (np.eye(4) - K.matrix @ np.linalg.pinv(K.matrix)).T, np.zeros_like(a), 1e-10)
    motion = a_c @ K.matrix.T
    close(rm.ddm(model, q, v, rm.idm(model, q, v, motion, w, drive), w, drive), motion, 1e-9)
    close(a[0, 1], rm.ddm(model, q[0, 1], v[0, 1], tau[0, 1], w[0, 1], drive), 1e-10)


# --- bodies that no body is ------------------------------------------------------------------


@pytest.mark.parametrize("mass", [0.0, 1e-9, -1.0])
def test_first_moments_over_hardly_any_mass_lose_no_digits(mass):
    """One call and a batch agree though the centre of mass may be anywhere."""
    table = rm.DHTable.from_rows([{"sigma": 0}, {"sigma": 0, "d": 0.3, "alpha": 1.0}])
    values = [[1, 0, 0, 1, 0, 1, 0.5, 0, 0, mass], [1, 0.1, 0, 1, 0, 2, 0.1, 0.2, 0.3, mass]]
    arm = rm.RobotModel.from_table(table, rm.InertialParameters(values), gravity=(1, 2, 3))
    q, v, a = [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]
    close(rm.idm(arm, q, v, a), rm.idm(arm, [q], v, a)[0], 1e-13)
    close(rm.mass_matrix(arm, q), rm.mass_matrix(arm, [q])[0], 1e-13)
    close(rm.coriolis_matrix(arm, q, v), rm.coriolis_matrix(arm, [q], v)[0], 1e-13)
    parameters = rm.parameter_vector(arm)
    close(rm.idm(arm, q, v, a), rm.torque_regressor(arm, q, v, a) @ parameters, 1e-13)


# --- few joints ------------------------------------------------------------------------------
