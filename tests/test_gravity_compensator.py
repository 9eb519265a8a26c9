"""Gravity compensators: torque by energy, in all models, identified, regrouped with gravity."""

import numpy as np
import pytest
from identities.random_robots import random_bodies, random_drive, random_table

import robotmodels as rm
from robotmodels.dynamics import idm_from_base
from robotmodels.friction import AsymmetricFriction, GravityCompensator
from robotmodels.regressors import (
    energy_difference_regressor,
    parameter_vector,
    torque_regressor,
)
from robotmodels.simulation import torque_parts

GEOMETRY = {"a": 0.3, "b": 0.5, "phi": 0.4}
SPRING = {**GEOMETRY, "values": [4000.0, -600.0]}
SERIES = {"values": [30.0, -20.0, 8.0, -5.0]}


def random_arm(rng, f=4):
    """Revolute joints, axes that are aligned or clearly are not, any gravity."""
    table = random_table(rng, f, prismatic=False, limits=False)
    table = table.replace(beta=np.where(abs(table.beta) < 1e-2, 0.0, table.beta))
    model = rm.RobotModel.from_table(table, gravity=rng.normal(size=3) * 6)
    return model.with_inertia(random_bodies(rng, f)).with_drive(random_drive(rng, f))


def test_the_torque_is_the_slope_of_the_energy():
    rng = np.random.default_rng(0)
    for _ in range(10):
        a, b, phi = *rng.uniform(0.05, 1.0, 2), rng.uniform(-np.pi, np.pi)
        K, P = rng.normal(size=2) * [3000.0, 500.0]
        one = GravityCompensator(2, 2, a, b, phi, [K, P])
        q = rng.uniform(-np.pi, np.pi, (20, 2))

        def energy(angle, a=a, b=b, phi=phi, K=K, P=P):
            away = a * np.exp(1j * phi) - b * np.exp(1j * angle)
            length = np.abs(away)
            return 0.5 * K * length**2 + P * length

        h = 1e-5
        slope = (energy(q[:, 1] + h) - energy(q[:, 1] - h)) / (2 * h)
        torque = one.torque(np.zeros(2), q)
        assert abs(torque[:, 1] - slope).max() < 1e-6 * (abs(K) + abs(P))
        assert not torque[:, 0].any()


def test_forces_by_hand():
    # at a right angle of a 3-4-5 triangle: the arm of a force along the long side is 0.24 m
    cylinder = GravityCompensator(1, 1, a=0.3, b=0.4, phi=0.0, values=[0.0, 100.0])
    np.testing.assert_allclose(cylinder.torque([0.0], [np.pi / 2]), [24.0])
    np.testing.assert_allclose(cylinder.torque([0.0], [-np.pi / 2]), [-24.0])
    series = GravityCompensator(1, 1, values=[1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(series.torque([0.0], [np.pi / 2]), [1.0 - 4.0], atol=1e-14)
    np.testing.assert_allclose(series.torque([0.0], [np.pi / 4]), [1.5 * np.sqrt(2.0) + 3.0])
    equal = GravityCompensator(1, 1, a=0.3, b=0.3, phi=0.0, values=[0.0, 100.0])
    assert equal.torque([0.0], [0.0]) == 0.0  # length zero: no direction, no torque
    two = GravityCompensator(3, [3, 1], a=[0.3, 0.2], b=0.4, phi=0.0, values=[0.0, 100.0])
    np.testing.assert_allclose(
        two.torque(np.zeros(3), np.full(3, np.pi / 2)), [8.0 / np.sqrt(0.2), 0.0, 24.0]
    )


@pytest.mark.parametrize("options", [SPRING, SERIES])
def test_every_model_has_it(options):
    rng = np.random.default_rng(2)
    model = random_arm(rng, 3)
    other = AsymmetricFriction(*rng.uniform(0.5, 2.0, (4, model.n)))
    one = GravityCompensator(model.n, 2, **options) + other
    q, v, a = rng.normal(size=(3, 30, model.n))
    extra = one.torque(v, q)
    tau = rm.idm(model, q, v, a) + extra
    back = rm.ddm(model, q, v, tau, friction=one)
    np.testing.assert_allclose(back, rm.ddm(model, q, v, tau - extra), rtol=1e-9, atol=1e-9)
    W = torque_regressor(model, q, v, a, drive=True, friction=one)
    found = [
        rm.idm(model, q, v, a, friction=one),
        [rm.idm(model, *x, friction=one) for x in zip(q, v, a, strict=True)],
        torque_parts(model, q, v, a, friction=one).total,
        W @ parameter_vector(model, True, one),
    ]
    for method in ("symbolic", "numeric"):
        base = rm.base_parameters(model, method, drive=True, friction=one)
        found += [base.reduce(W) @ base.values(model)]
        found += [idm_from_base(model, base, base.values(model), q, v, a)]
    for torques in found:
        np.testing.assert_allclose(torques, tau, rtol=0, atol=1e-11 * np.abs(tau).max())


def test_its_work_between_samples_is_the_change_of_its_energy():
    """With velocities that are linear between samples, also through zero; and none around."""
    arm = rm.RobotModel.from_table(rm.DHTable(antecedent=[0, 1], sigma=[0, 0]))
    one = GravityCompensator(2, 2, **GEOMETRY)
    t = np.array([0.0, 0.01, 0.03, 0.06])
    v = np.array([[0.0, 1.0], [0.0, 2.0], [0.0, -3.0], [0.0, 1.0]])
    steps = 0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None]
    q = np.array([0.3, 0.2]) + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    rows = energy_difference_regressor(arm, t, q, v, columns=["Kc2", "Pc2"], friction=one)
    length = np.abs(0.3 * np.exp(0.4j) - 0.5 * np.exp(1j * q[:, 1]))
    energies = np.stack([0.5 * length**2, length], axis=1)
    np.testing.assert_allclose(rows, np.diff(energies, axis=0), rtol=0, atol=1e-12)
    # rounded velocities: the work still ends where the samples do
    rows = energy_difference_regressor(arm, t, q, v + 1e-6, columns=["Kc2", "Pc2"], friction=one)
    np.testing.assert_allclose(rows, np.diff(energies, axis=0), rtol=0, atol=2e-8)


def test_what_gravity_does_alike_is_regrouped():
    """About a horizontal axis first moments turn with sin q and cos q, as a spring does."""
    pendulum = [{"sigma": 0}, {"sigma": 0, "d": 0.4}]
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(pendulum), gravity=[0.0, -9.81, 0.0])
    rng = np.random.default_rng(6)
    model = model.with_inertia(random_bodies(rng, 2)).with_drive(random_drive(rng, 2))
    for method in ("symbolic", "numeric"):
        series = GravityCompensator(2, [1, 2], **SERIES)
        base = rm.base_parameters(model, method, drive=True, friction=series)
        assert "Gs1" not in base.names
        assert "Gc1" not in base.names
        # -m g x cos q: 9.81 MX1 and Gc1 are one parameter
        assert base.regrouping["MX1"]["Gc1"] == pytest.approx(1 / 9.81)
        assert base.regrouping["MY1"]["Gs1"] == pytest.approx(-1 / 9.81)
        assert {"Gss1", "Gcc1", "Gs2", "Gc2"} <= {*base.names}  # MX2 is known by its inertia
        spring = GravityCompensator(2, 1, **SPRING)
        base = rm.base_parameters(model, method, drive=True, friction=spring)
        assert "Kc1" not in base.names
        assert "Pc1" in base.names
        assert base.regrouping["MX1"]["Kc1"] == pytest.approx(-0.15 * np.sin(0.4) / 9.81)
        assert {"Kc2", "Pc2"} <= {*base.no_effect}
