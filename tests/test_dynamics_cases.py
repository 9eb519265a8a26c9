"""Options of the inverse model from base parameters, and mass matrices that overflow."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import ShapeError, SingularMassMatrixError
from robotmodels.friction import StribeckFriction


def motion(model, rng, N=5):
    return rng.normal(size=(3, N, model.n))


def test_base_parameters_take_wrench_and_friction_as_the_whole_model_does(rng):
    model = rm.load("rx90")
    base = rm.base_parameters(model)
    q, v, a = motion(model, rng)
    wrench = rng.normal(size=(5, 6))
    n = model.n
    friction = StribeckFriction(np.ones(n), np.full(n, 0.5), np.full(n, 0.9), np.full(n, 0.1))
    options = {"wrench": wrench, "friction": friction}
    from_base = rm.idm_from_base(model, base, base.values(model), q, v, a, **options)
    whole = rm.idm(model, q, v, a, **options)
    np.testing.assert_allclose(from_base, whole, rtol=0, atol=1e-10 * np.abs(whole).max())
    plain = rm.idm_from_base(model, base, base.values(model), q, v, a)
    np.testing.assert_allclose(
        from_base - plain,
        rm.static_torque(model, q, wrench) + friction.torque(v),
        rtol=0,
        atol=1e-10 * np.abs(whole).max(),
    )


def test_friction_of_other_joints_is_named_with_base_parameters(rng):
    model = rm.load("planar_2r")
    base = rm.base_parameters(model)
    friction = StribeckFriction([1.0], [1.0], [2.0], [0.1])
    with pytest.raises(ShapeError, match="friction of 2 joints, got 1"):
        rm.idm_from_base(model, base, base.values(model), *motion(model, rng), friction=friction)


def test_a_mass_matrix_whose_entries_overflow_is_named():
    # a mass on a slide that is run out so far that the square of its distance is no float
    table = rm.DHTable(antecedent=[0, 1], sigma=[0, 1], alpha=[0.0, np.pi / 2])
    links = np.zeros((2, 10))
    links[:, 9] = 1.0
    model = rm.RobotModel.from_table(table, inertia=rm.InertialParameters(links))
    with pytest.raises(SingularMassMatrixError, match="overflow"):
        rm.ddm(model, [0.0, 1e160], [0.0, 0.0], [1.0, 1.0])
