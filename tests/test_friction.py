"""Friction models: values by hand, columns, breakaway, mistakes."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.dynamics import idm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.friction import (
    AsymmetricFriction,
    CoulombFriction,
    FrictionSum,
    LinearFriction,
    StribeckFriction,
    TorqueOffset,
    ViscousFriction,
)
from robotmodels.regressors import parameter_names, parameter_vector, torque_regressor

TWO = [1.0, 2.0]
MODELS = {
    "viscous": ViscousFriction(TWO),
    "Coulomb": CoulombFriction(TWO),
    "offset": TorqueOffset(TWO),
    "asymmetric": AsymmetricFriction(TWO, [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]),
    "Stribeck": StribeckFriction(TWO, [3.0, 4.0], [5.0, 6.0], [0.1, 0.2]),
    "sum": FrictionSum((ViscousFriction(TWO), CoulombFriction([3.0, 4.0]))),
}


def arm(**options):
    table = rm.DHTable.from_rows([{"sigma": 0}, {"sigma": 2, "d": 0.1}, {"sigma": 1, "d": 0.2}])
    return rm.RobotModel.from_table(table, **options)


@pytest.mark.parametrize(
    ("name", "v", "torque"),
    [
        ("viscous", [0.5, -0.5], [0.5, -1.0]),
        ("Coulomb", [0.5, -0.5], [1.0, -2.0]),
        ("Coulomb", [0.0, -0.0], [0.0, 0.0]),
        ("offset", [0.5, -0.5], [1.0, 2.0]),
        ("asymmetric", [0.5, -0.5], [3.5, -11.0]),
        ("asymmetric", [0.0, 0.0], [0.0, 0.0]),
        ("Stribeck", [0.1, -0.2], [0.1 + 3 + 2 / np.e, -(0.4 + 4 + 2 / np.e)]),
        ("Stribeck", [0.0, 1e300], [0.0, 2e300]),
        ("sum", [0.5, -0.5], [3.5, -5.0]),
    ],
)
def test_torques_by_hand(name, v, torque):
    np.testing.assert_allclose(MODELS[name].torque(v), torque, rtol=1e-14)


def test_models_add_up_and_their_columns_come_last():
    robot, v = arm(), np.array([[0.3, -0.2], [0.0, 4.0]])
    a, b = MODELS["asymmetric"], MODELS["Stribeck"]
    both = a + b + MODELS["offset"]
    assert not any(isinstance(part, FrictionSum) for part in both.parts)
    assert isinstance(both, LinearFriction)
    np.testing.assert_allclose(both.torque(v), a.torque(v) + b.torque(v) + TWO, rtol=1e-14)
    W = torque_regressor(robot, v, v, v, drive=False, friction=both)
    extra = W[..., -2 * len(both.kinds) :] @ both.parameters.ravel()
    np.testing.assert_allclose(extra, both.torque(v), rtol=1e-13)
    names = parameter_names(robot, True, a)
    assert names[:-8] == parameter_names(robot)
    assert names[-8:] == ("Fvp1", "Fvp3", "Fcp1", "Fcp3", "Fvn1", "Fvn3", "Fcn1", "Fcn3")
    np.testing.assert_array_equal(parameter_vector(robot, True, a)[-8:], a.parameters.ravel())
    for drive, twice in ((False, both + a), (True, b), (True, ViscousFriction(TWO))):
        with pytest.raises(InvalidValueError, match="already"):
            torque_regressor(robot, v, v, v, drive=drive, friction=twice)


def test_a_model_of_your_own_is_taken():
    class Quadratic:
        n = 2

        def torque(self, v):
            return 3.0 * np.asarray(v) * np.abs(v)

    robot, viscous = arm(drive=rm.DriveParameters(Ia=[0.5, 0.5])), ViscousFriction(TWO)
    v = np.array([2.0, -1.0])
    found = idm(robot, 0 * v, v, v, friction=Quadratic()) - idm(robot, 0 * v, v, v)
    np.testing.assert_allclose(found, [12.0, -3.0], rtol=1e-14)
    for both in (viscous + Quadratic(), Quadratic() + viscous):
        np.testing.assert_allclose(both.torque(v), [14.0, -5.0])
        with pytest.raises(InvalidValueError, match="Quadratic is not linear"):
            torque_regressor(robot, v, v, v, friction=both)
    for other in (3.0, None, CoulombFriction):
        with pytest.raises(TypeError, match="unsupported operand"):
            other + (viscous + viscous)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: ViscousFriction(1.0), ShapeError, "Fv"),
        (lambda: CoulombFriction([np.nan]), InvalidValueError, "Fc"),
        (lambda: AsymmetricFriction([1], [1, 2], [1], [1]), ShapeError, "Fcp"),
        (lambda: StribeckFriction([1], [1], [1], [0.0]), InvalidValueError, "vs"),
        (lambda: StribeckFriction([1], [1], [1], [1.0], [-1]), InvalidValueError, "exponent"),
        (lambda: StribeckFriction([1], [-1], [1], [1.0]), InvalidValueError, "^Fc: .*joint 1"),
        (lambda: StribeckFriction([1, 1], [1, 3], [2, 2.5], [1, 1]), InvalidValueError,
         r"^Fs: .*joint 2 \(2.5\) is less than .*\(3\)"),
        (lambda: FrictionSum(()), InvalidValueError, "at least one"),
        (lambda: idm(arm(), *np.zeros((3, 2)), friction="viscous"), InvalidValueError, "friction"),
        (lambda: ViscousFriction([1]) + ViscousFriction([1, 2]), ShapeError, "1 joints, got 2"),
        (lambda: ViscousFriction([1.0]).torque([1.0, 2.0]), ShapeError, "^v:"),
    ],
)  # fmt: skip
def test_mistakes_are_named(make, error, words):
    with pytest.raises(error, match=words):
        make()
