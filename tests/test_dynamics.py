"""The border of dynamic models and regressors: shapes, batches, singular matrices, errors."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.dynamics import base_model, idm_from_base, with_payload, without_payload
from robotmodels.errors import (
    InertiaError,
    InvalidValueError,
    ShapeError,
    SingularMassMatrixError,
)
from robotmodels.friction import AsymmetricFriction
from robotmodels.inertia import InertiaWarning
from robotmodels.minimal_parameters import base_parameters
from robotmodels.regressors import (
    momentum_regressor,
    power_regressor,
)

# function of the model and its vectors, lengths of these
FUNCTIONS = {
    "idm": (rm.idm, "nnn6"),
    "ddm": (rm.ddm, "nnn6"),
    "mass_matrix": (rm.mass_matrix, "n"),
    "coriolis_matrix": (rm.coriolis_matrix, "nn"),
    "gravity_torque": (rm.gravity_torque, "n"),
    "kinetic_energy": (rm.kinetic_energy, "nn"),
    "potential_energy": (rm.potential_energy, "n"),
    "torque_regressor": (rm.torque_regressor, "nnn"),
    "power_regressor": (power_regressor, "nnn"),
    "momentum_regressor": (lambda m, *x: momentum_regressor(m, *x).force, "nn"),
    "energy_regressor": (rm.energy_regressor, "nn"),
}


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


def vectors_of(lengths, model, *batch):
    rng = np.random.default_rng(5)
    q, v, a = random_state(model, rng, *batch)
    return [q, v, a, rng.normal(size=(*batch, 6))][: len(lengths)]


def close(actual, expected, tolerance=1e-12):
    expected = np.asarray(expected)
    assert np.shape(actual) == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


@pytest.mark.parametrize(("function", "lengths"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_batches_broadcast(function, lengths, model):
    """One argument of three rows among single ones, each in turn; others are named."""
    vectors = vectors_of(lengths, model, 3)
    names = (*("q", "v", "tau" if function is rm.ddm else "a"), "wrench")
    for k, name in zip(range(len(lengths)), names, strict=False):
        mixed = [x.tolist() if i == k else x[0] for i, x in enumerate(vectors)]
        full = [x if i == k else np.tile(x[0], (3, 1)) for i, x in enumerate(vectors)]
        close(function(model, *mixed), function(model, *full))
        if len(lengths) > 1:
            with pytest.raises(ShapeError, match="do not broadcast"):
                function(model, *(x[:2] if i == k else x for i, x in enumerate(vectors)))
        for bad, error in ((mixed[k][0][1:], ShapeError), (np.inf * full[k], InvalidValueError)):
            mixed[k] = bad
            with pytest.raises(error, match=f"^{name}: "):
                function(model, *mixed)


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
    state = np.array([[0.3, 0.4], [0.5, 0.6], [0.7, 0.8]])
    for model, count in ((rm.idm, 3), (rm.mass_matrix, 1), (rm.coriolis_matrix, 2)):
        close(model(arm, *state[:count]), model(arm, *state[:count, None])[0], 1e-13)
    W = rm.torque_regressor(arm, *state)
    close(rm.idm(arm, *state), W @ rm.parameter_vector(arm), 1e-13)


# --- payloads and base parameters ---------------------------------------------------------------


def planar():
    links = rm.InertialParameters.from_com([1, 2], [[0.2, 0, 0], [0.1, 0, 0]], np.zeros((2, 3, 3)))
    return rm.RobotModel.from_table(rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]), links)


def test_what_is_taken_off_leaves_nothing_behind():
    bare = planar().with_inertia(None)
    payload = 0.7, [0.1, 0.3, -0.2], np.diag([0.3, 0.2, 0.11])
    loaded = with_payload(bare, *payload)
    np.testing.assert_array_equal(without_payload(loaded, *payload).inertia.values, 0.0)
    assert with_payload(bare, 0.0, [1.0, 0.0, 0.0]).inertia == bare.inertia
    with pytest.raises(InertiaError, match=r"a payload's mass cannot be negative.*without_payload"):
        with_payload(bare, -1.0, [0.0, 0.0, 0.0])
    # point masses are on the border of what bodies have: rounding gives no warning
    for mass in (1e-9, 1e6):
        for com in np.random.default_rng(0).normal(size=(10, 3)):
            left = without_payload(with_payload(planar(), mass, com), mass, com).inertia.values
            atol = 1e-14 * max(1.0, mass)
            np.testing.assert_allclose(left, planar().inertia.values, atol=atol)


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        ((5.0, [0, 0, 0]), "link 2 .*'robot'.*negative mass -3 kg"),
        ((2.0, [0.3, 0, 0]), "first moments without mass"),
        ((1.0, [0.1, 0.0, 0], 0.2 * np.eye(3), 1), "link 1 "),
    ],
)
def test_a_body_that_was_not_there_is_reported(payload, words):
    """The link is warned of by name; the numbers are those of the subtraction."""
    with pytest.warns(InertiaWarning, match=words) as caught:
        left = without_payload(planar(), *payload)
    assert caught[0].filename == __file__
    assert not left.inertia.is_physical.all()
    # a link that was no body before is not the payload's fault
    identified = planar().with_inertia(rm.InertialParameters(-np.ones((2, 10))))
    without_payload(identified, *payload)


@pytest.mark.parametrize("drive", [True, False])
def test_base_parameters_with_a_friction_model(drive):
    model = random_model(np.random.default_rng(8), f=4, drive=True)
    n = model.n
    rng = np.random.default_rng(1)
    friction = AsymmetricFriction(*rng.uniform(0.5, 2.0, (4, n)))
    if drive:
        model = model.with_drive(rm.DriveParameters(Ia=model.drive.Ia))
    q, v, a = random_state(model, rng, 20)
    base = base_parameters(model, "numeric", drive=drive, friction=friction)
    values = base.values(model)
    tau = rm.idm(model, q, v, a, friction=friction)
    found = idm_from_base(model, base, values, q, v, a)
    np.testing.assert_allclose(found, tau, rtol=0, atol=1e-10 * np.abs(tau).max())
    with pytest.raises(InvalidValueError, match="AsymmetricFriction"):
        base_model(model, base, values)
