"""Physically consistent identification: the best torque fit that real robots have."""

import pickle
import sys
from typing import Any

import numpy as np
import pytest
from identities.random_robots import random_bodies, random_drive, random_model, random_state
from scipy.optimize import least_squares
from urdf_parity import urdf_parity

import robotmodels as rm
from robotmodels.errors import InertiaError, InvalidValueError, MissingExtraError, ShapeError
from robotmodels.friction import AsymmetricFriction, StribeckFriction, TorqueOffset, ViscousFriction
from robotmodels.minimal_parameters import (
    CenterOfMassBox,
    CenterOfMassEllipsoid,
    PhysicalStatus,
    base_parameters,
    fit_consistent,
    uniform_bodies,
)
from robotmodels.minimal_parameters.bodies import pseudo_inertias
from robotmodels.regressors import parameter_vector

EXACT, CONSTRAINED = PhysicalStatus.EXACT, PhysicalStatus.CONSTRAINED


def regressor(base, rng, samples=60):
    """Reduced regressor on random motion, (N n, b)."""
    model = base.model
    W = rm.torque_regressor(
        model, *random_state(model, rng, samples), drive=base.drive, friction=base.friction
    )
    return base.reduce(W).reshape(-1, len(base))


def factor(W, tau):
    """R, y and the squares that they do not hold."""
    Q, R = np.linalg.qr(W)
    y = Q.T @ tau
    return R, y, float(np.sum((tau - Q @ y) ** 2))


def noisy(model, rng, noise, samples=60, prior_mass=6.0):
    """Torques of a robot with noise: base, R, y, rest, rows, W, tau."""
    base = base_parameters(model, drive=True)
    W = regressor(base, rng, samples)
    tau = W @ base.values(model)
    tau = tau + noise * np.sqrt(np.mean(tau**2)) * rng.normal(size=len(tau))
    return (base, *factor(W, tau), W, tau)


def arm(rng, name="planar_2r"):
    model = rm.load(name)
    model = model.with_inertia(random_bodies(rng, model.f))
    return model.with_drive(random_drive(rng, model.n))


def robot(kind, rng):
    if kind == "tx40":
        return rm.load("tx40").with_inertia(random_bodies(rng, 6))
    if kind in ("rx90", "gantry", "cobra_s600", "iiwa14"):
        return arm(rng, kind)
    options = {
        "serial": {"prismatic": False},
        "prismatic": {},
        "tree": {"tree": True, "fixed": True},
        "coupled": {"transmission": True},
    }[kind]
    return random_model(rng, f=5, drive=True, **options)


KINDS = (
    "rx90", "gantry", "cobra_s600", "iiwa14", "tx40", "serial", "prismatic", "tree", "coupled",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_real_robot_comes_back_at_no_price(kind, rng):
    for _ in range(1 if kind in ("rx90", "iiwa14", "tx40") else 3):
        model = robot(kind, rng)
        base = base_parameters(model, drive=True)
        values = base.values(model)
        W = regressor(base, rng)
        R, y, rest = factor(W, W @ values)
        found = fit_consistent(
            base, R, y, rest=rest, rows=len(W), prior=uniform_bodies(model, 3.0 * model.f)
        )
        assert found.status is EXACT
        assert found.residual_increase == 0.0
        assert found.fit.gap == 0.0
        sizes = np.maximum(abs(values), 1e-3 * abs(values).max())
        assert (abs(found.base_values - values) <= 1e-8 * sizes).all()
        assert found.inertia.is_physical.all()
        for part in (found.drive.Ia, found.drive.Fv, found.drive.Fc):
            assert (part >= 0.0).all()
        again = found.of(model)
        q, v, a = random_state(model, rng, 20)
        torque = rm.idm(model, q, v, a)
        assert abs(rm.idm(again, q, v, a) - torque).max() <= 1e-8 * abs(torque).max()


def cholesky_fit(base, W, tau, P0, margin, start):
    """The same problem by factors: P = margin P0 + L L^T, drives squared; no cones, no solver."""
    f, p = base.model.f, len(base.parameter_names)
    root = np.linalg.cholesky(P0)
    low = np.tril_indices(4)
    offset = np.array([name.startswith("offset") for name in base.parameter_names[10 * f :]])

    def standard(u):
        x = np.zeros(p)
        for j in range(f):
            L = np.zeros((4, 4))
            L[low] = u[10 * j : 10 * j + 10]
            P = root[j] @ (margin * np.eye(4) + L @ L.T) @ root[j].T
            J = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
            x[10 * j : 10 * j + 10] = [*J[np.triu_indices(3)], *P[:3, 3], P[3, 3]]
        x[10 * f :] = np.where(offset, u[10 * f :], u[10 * f :] ** 2)
        return x

    found = least_squares(
        lambda u: W @ (base.matrix @ standard(u)) - tau, start, xtol=1e-14, ftol=1e-14, gtol=1e-14,
        max_nfev=200,
    )  # fmt: skip
    return 2.0 * found.cost


@pytest.mark.parametrize("seed", range(2))
def test_the_optimum_of_an_independent_method(seed):
    """Data of no real robot: the same least as unconstrained least squares of Cholesky factors."""
    rng = np.random.default_rng(seed)
    model = arm(rng)
    base = base_parameters(model, drive=True)
    values = base.values(model)
    values[base.names.index("ZZ2")] *= -0.3
    values[base.names.index("Fc1")] = -0.4
    W = regressor(base, rng, 30)
    tau = W @ values + 0.1 * rng.normal(size=len(W))
    R, y, rest = factor(W, tau)
    prior = uniform_bodies(model, 6.0)
    found = fit_consistent(base, R, y, rest=rest, prior=prior)
    assert found.status is CONSTRAINED
    assert found.residual_increase > 1.0
    assert found.fit.squares == pytest.approx(np.sum((W @ found.base_values - tau) ** 2), rel=1e-9)
    assert found.fit.gap < 2e-4
    starts = [0.7 * rng.normal(size=len(base.parameter_names)) for _ in range(2)]
    P0 = pseudo_inertias(prior)
    best = rest + min(cholesky_fit(base, R, y, P0, 1e-3, u) for u in starts)
    assert best >= found.fit.squares * (1.0 - found.fit.gap) * (1.0 - 1e-9)  # the proof holds
    assert found.fit.squares <= best * (1.0 + 2e-4)
    assert "Fc1 is zero." in found.fit.active
    assert any("pseudo-inertia of link 2" in said for said in found.fit.active)


def test_no_real_robot_on_the_way_to_others_fits_better(rng):
    """Feasible directions: towards real robots, near and far, residuals do not fall."""
    model = arm(rng, "rx90")
    base, R, y, rest, W, tau = noisy(model, rng, 0.5, samples=15)
    found = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 20.0))
    assert found.status is CONSTRAINED
    assert found.residual_increase > 0.0
    for _ in range(100):
        other = model.with_inertia(random_bodies(rng, 6)).with_drive(random_drive(rng, 6))
        way = parameter_vector(other) - found.values
        for step in (1e-6, 1e-4, 1e-2, 1.0):
            squares = np.sum((W @ (base.matrix @ (found.values + step * way)) - tau) ** 2)
            assert squares >= found.fit.squares * (1.0 - found.fit.gap)
    # the nearest base parameters fit worse: the torques are fitted here
    near = rm.standard_parameters(base, found.requested, prior=uniform_bodies(model, 20.0))
    assert np.sum((W @ near.base_values - tau) ** 2) >= found.fit.squares * (1.0 - found.fit.gap)


def test_the_regressor_itself_and_other_units_give_the_same(rng):
    model = arm(rng)
    base, R, y, rest, W, tau = noisy(model, rng, 0.6, samples=12)
    prior = uniform_bodies(model, 6.0)
    found = fit_consistent(base, R, y, rest=rest, rows=len(W), prior=prior)
    whole = fit_consistent(base, W, tau, prior=prior)
    assert found.status is whole.status
    assert whole.fit.squares == pytest.approx(found.fit.squares, rel=1e-7)
    assert whole.base_values == pytest.approx(found.base_values, rel=1e-4, abs=1e-5)
    assert found.rms == pytest.approx(np.sqrt(found.fit.squares / len(W)))
    assert whole.rms is None
    for scale in (1e-4, 1e4):  # weights of other units
        again = fit_consistent(base, scale * R, scale * y, rest=scale**2 * rest, prior=prior)
        assert again.residual_increase == pytest.approx(found.residual_increase, rel=1e-6)
        assert again.base_values == pytest.approx(found.base_values, rel=1e-4, abs=1e-5)


def test_small_and_large_robots_are_the_same_problem(rng):
    """A robot of the same shape with masses and torques times s; its prior knows no drives."""
    model = rm.load("rx90")
    true = model.with_inertia(uniform_bodies(model, 60.0))
    true = true.with_drive(rm.DriveParameters(Ia=[0] * 6, Fv=[10] * 6, Fc=[5] * 6, offset=[0] * 6))
    base, R, y, rest, *_ = noisy(true, rng, 0.3, samples=15)
    base = base_parameters(model, drive=True)
    fits = {
        s: fit_consistent(base, R, s * y, rest=s**2 * rest, prior=uniform_bodies(model, 60.0 * s))
        for s in (1e-6, 1e-3, 1.0, 1e3, 1e6)
    }
    expected = fits[1.0]
    assert expected.status is CONSTRAINED
    assert expected.residual_increase > 0.1
    for s, found in fits.items():
        assert found.status is CONSTRAINED
        assert found.fit.gap < 2e-4
        assert found.fit.squares == pytest.approx(s**2 * expected.fit.squares, rel=1e-6)
        assert found.fit.active == expected.fit.active
        far = np.abs(found.base_values / s - expected.base_values).max()
        assert far < 1e-4 * np.abs(expected.base_values).max()


@pytest.mark.parametrize("drives", [1e-12, 1e-6, 1e-3, 1e3, 1e6])
def test_a_prior_of_other_sizes_is_no_proof_of_a_bad_fit(drives, rng):
    """Drives of the prior are far from those of the torques: the best is found, or it is said."""
    model = rm.load("rx90").with_inertia(uniform_bodies(rm.load("rx90"), 60.0))
    model = model.with_drive(rm.DriveParameters(Ia=[0] * 6, Fv=[9] * 6, Fc=[5] * 6, offset=[0] * 6))
    base, R, y, rest, *_ = noisy(model, rng, 0.3, samples=150)
    best = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 60.0))
    assert best.status is CONSTRAINED
    size = drives * np.ones(6)
    prior = rm.DriveParameters(Ia=size, Fv=size, Fc=size, offset=size)
    found = fit_consistent(
        base, R, y, rest=rest, prior=uniform_bodies(model, 60.0), drive_prior=prior
    )
    if drives < 1.0:
        assert found.status is CONSTRAINED
        assert found.fit.squares == pytest.approx(best.fit.squares, rel=1e-3)
    assert found.status in (CONSTRAINED, PhysicalStatus.INACCURATE)
    if found.status is CONSTRAINED:
        assert found.fit.squares <= best.fit.squares * 1.0005
    assert best.fit.squares >= found.fit.squares * (1.0 - found.fit.gap) * (1.0 - 1e-4)


def test_what_the_data_does_not_determine_is_the_priors(rng):
    """A log that never moves joint 2: its columns are empty, the prior stands in."""
    model = arm(rng)
    base = base_parameters(model, drive=True)
    q, v, a = rng.normal(size=(3, 40, 2))
    v[:, 1] = a[:, 1] = 0.0
    W = base.reduce(rm.torque_regressor(model, q, v, a)).reshape(-1, len(base))
    tau = W @ base.values(model)
    R, y, rest = factor(W, tau)
    prior = uniform_bodies(model, 6.0)
    found = fit_consistent(base, R, y, rest=rest, prior=prior, drive_prior=model.drive)
    assert found.status is EXACT
    assert abs(W @ found.base_values - tau).max() < 1e-8 * abs(tau).max()
    assert found.drive.Fv[1] == pytest.approx(model.drive.Fv[1], rel=1e-6)
    assert found.inertia.mass[0] == pytest.approx(prior.mass[0], rel=0.9)
    # M1 acts nowhere by itself: of a prior that is the robot it is kept, also where all is noisy
    base, R, y, rest, *_ = noisy(model, rng, 0.02)
    assert fit_consistent(base, R, y, rest=rest).distance < 2.0


def test_bounds_on_masses_are_kept_and_named(rng):
    model = arm(rng, "rx90")
    base, R, y, rest, *_ = noisy(model, rng, 0.01)
    prior = uniform_bodies(model, 20.0)
    loose = fit_consistent(base, R, y, rest=rest, prior=prior)
    bounds = np.tile([-np.inf, np.inf], (6, 1))
    bounds[1] = 0.5, 0.5
    bounds[2] = loose.inertia.mass[2] * 1.2, np.inf
    bounds[3] = 0.0, 0.3
    found = fit_consistent(base, R, y, rest=rest, prior=prior, mass_bounds=bounds, total_mass=9.0)
    assert found.status in (EXACT, CONSTRAINED)
    assert found.inertia.mass[1] == pytest.approx(0.5, rel=1e-7)
    assert found.inertia.mass[2] >= bounds[2, 0] * (1 - 1e-7)
    assert found.inertia.mass[3] <= 0.3 * (1 + 1e-7)
    assert found.inertia.mass.sum() == pytest.approx(9.0, rel=1e-7)
    assert found.inertia.is_physical.all()
    assert "The mass of link 4 is at its upper bound, 0.3 kg." in found.fit.active
    assert found.fit.squares >= loose.fit.squares * (1 - 1e-5)
    between = fit_consistent(base, R, y, rest=rest, prior=prior, total_mass=[30.0, 40.0])
    assert between.inertia.mass.sum() >= 30.0 * (1 - 1e-7)


def test_bounds_on_centres_are_kept_and_named(rng):
    model = arm(rng)
    base, R, y, rest, *_ = noisy(model, rng, 0.01)
    prior = uniform_bodies(model, 6.0)
    centre = model.inertia.first_moments[1] / model.inertia.mass[1]
    low = centre + np.array([0.05, -0.1, -np.inf])
    high = centre + np.array([0.1, 0.1, np.inf])
    found = fit_consistent(
        base, R, y, rest=rest, prior=prior, mass_bounds=[[1.0, 9.0], [2.0, 2.5]],
        centre_bounds=[CenterOfMassBox(2, low, high)],
    )  # fmt: skip
    own = found.inertia.first_moments[1] / found.inertia.mass[1]
    assert (own >= low - 1e-7).all()
    assert (own <= high + 1e-7).all()
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    ball = CenterOfMassEllipsoid(2, centre + np.array([0.3, 0.0, 0.0]), [0.1, 0.05, 0.2], turned)
    found = fit_consistent(
        base,
        R,
        y,
        rest=rest,
        prior=prior,
        centre_bounds=[ball],
        total_mass=model.inertia.mass.sum(),
    )
    own = found.inertia.first_moments[1] / found.inertia.mass[1]
    inside = np.linalg.norm((turned.T @ (own - ball.center)) / ball.semi_axes)
    assert inside == pytest.approx(1.0, abs=1e-4)
    assert "The centre of mass of link 2 is on the surface of its ellipsoid." in found.fit.active
    known = CenterOfMassBox(1, [0.1, 0.02, -0.03], [0.1, 0.02, -0.03])
    found = fit_consistent(base, R, y, rest=rest, prior=prior, centre_bounds=[known])
    own = found.inertia.first_moments[0] / found.inertia.mass[0]
    assert own == pytest.approx([0.1, 0.02, -0.03], abs=1e-8)


def test_bounds_that_contradict_are_a_status(rng):
    model = arm(rng, "rx90")
    base, R, y, rest, *_ = noisy(model, rng, 0.01)
    prior = uniform_bodies(model, 20.0)
    bounds = np.tile([-np.inf, np.inf], (6, 1))
    bounds[1, 0], bounds[4, 0], bounds[5, 1] = 6.0, 7.0, 50.0
    boxes = [CenterOfMassBox(3, [0.1, -1, -1], [0.2, 1, 1])]
    boxes.append(CenterOfMassEllipsoid(3, [0.9, 0, 0], [0.1, 0.1, 0.1]))
    for more in ({"mass_bounds": bounds, "total_mass": 10.0}, {"centre_bounds": boxes}):
        found = fit_consistent(base, R, y, rest=rest, prior=prior, **more)
        assert found.status is PhysicalStatus.INFEASIBLE
        assert found.reason().startswith("No physical robot satisfies the bounds; widen one")
        with pytest.raises(InvalidValueError, match="No physical robot"):
            found.of(model)


@pytest.mark.parametrize("kind", ["tx40", "coupled"])
def test_coupled_motors_stay_real(kind, rng):
    model = robot(kind, rng)
    base = base_parameters(model, drive=True)
    values = base.values(model)
    assert model.transmission is not None
    motor = model.transmission.coupled_motors[-1]
    for name, value in ((f"Fvm{motor}", 9.0), (f"Fcm{motor}", -9.0), (f"Iam{motor}", 5.0)):
        values[base.names.index(name)] = value
    W = regressor(base, rng)
    R, y, rest = factor(W, W @ values)
    found = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 3.0 * model.f))
    assert found.status is CONSTRAINED
    drives = found.of(model).drive_matrices
    assert drives is not None
    for matrix in (drives.rotor, drives.viscous):
        assert np.linalg.eigvalsh(matrix)[0] >= -1e-9 * abs(matrix).max()
    assert any("coupled motors" in said for said in found.fit.active)


@pytest.mark.parametrize(
    ("friction", "bad"),
    [
        (StribeckFriction([1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [0.1, 0.1]), "Fc1"),
        (AsymmetricFriction(*np.ones((4, 2))), "Fcn2"),
        (ViscousFriction([1.0, 1.0]) + TorqueOffset([-1.0, 2.0]), "Fv2"),
    ],
)
def test_frictions_of_models_take_energy(friction, bad, rng):
    model = arm(rng)
    base = base_parameters(model, drive=("Ia",), friction=friction)
    values = base.values(model)
    values[base.names.index(bad)] = -2.0
    W = regressor(base, rng)
    R, y, rest = factor(W, W @ values)
    found = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 6.0))
    assert found.status is CONSTRAINED
    assert found.values[list(base.parameter_names).index(bad)] == pytest.approx(0.0, abs=1e-4)
    assert f"{bad} is zero." in found.fit.active
    assert found.friction is not None
    if isinstance(friction, StribeckFriction):  # Fs below Fc is no Stribeck curve
        values[base.names.index("Fs2")], values[base.names.index("Fc1")] = 1.0, 3.0
        found = fit_consistent(base, R, R @ values, rest=rest, prior=uniform_bodies(model, 6.0))
        assert "Fs2 of Stribeck's curve is its Fc2." in found.fit.active
        StribeckFriction(*found.friction, vs=[0.1, 0.1])  # Fs >= Fc >= 0, or it is refused
    elif bad == "Fv2":  # an offset has either sign
        assert found.friction[-1, 0] == pytest.approx(-1.0, abs=0.1)
    else:
        assert (found.friction >= 0.0).all()


def test_the_weight_trades_residuals_for_nearness(rng):
    model = arm(rng, "rx90")
    base, R, y, rest, *_ = noisy(model, rng, 0.3, samples=20)
    prior = uniform_bodies(model, 20.0)
    fits = [fit_consistent(base, R, y, rest=rest, prior=prior, gamma=g) for g in (1e-2, 1.0, 100.0)]
    assert all(fit.status is PhysicalStatus.WEIGHTED for fit in fits)
    assert all(fit.fit.gap < 1e-7 for fit in fits)
    squares, distances = [f.fit.squares for f in fits], [f.distance for f in fits]
    assert squares == sorted(squares)
    assert distances == sorted(distances, reverse=True)
    assert squares[0] < squares[2]
    # where no constraint is active it is a linear ridge
    last = fit_consistent(base, R, y, rest=rest, prior=prior, gamma=1e9)
    assert last.distance < 1e-2
    assert not last.fit.active


@pytest.mark.parametrize("kind", ["rx90", "serial", "tree", "coupled", "tx40"])
def test_torques_survive_the_urdf(kind, rng):
    model = robot(kind, rng)
    base, R, y, rest, *_ = noisy(model, rng, 0.05)
    found = fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 3.0 * model.f))
    links, drives, friction, lost = urdf_parity(found.of(model), rng)
    assert max(links, drives) < 1e-9
    assert friction < 1e-12
    assert any("rotor inertia" in said for said in lost)


def test_the_result_is_a_value(rng):
    model = arm(rng)
    base, R, y, rest, W, _ = noisy(model, rng, 0.5, samples=12)
    found = fit_consistent(base, R, y, rest=rest, rows=len(W), prior=uniform_bodies(model, 6.0))
    again = pickle.loads(pickle.dumps(found))
    assert again.residual_increase == found.residual_increase
    assert not again.base_values.flags.writeable
    assert not again.values.flags.writeable
    assert found.standard_errors is None
    assert set(found.notes) >= {*found.fit.active}
    text = str(found)
    assert found.status.sentence in text
    assert f"{found.residual_increase:.3g} %" in text
    for said in found.fit.active:
        assert said in text
    assert f"residuals +{found.residual_increase:.3g} %" in repr(found)
    assert found.base_values == pytest.approx(base.values(found.of(model)), rel=1e-12, abs=1e-12)


def test_mistakes_are_named(rng):
    model = arm(rng)
    base, R, y, rest, *_ = noisy(model, rng, 0.1)
    b = len(base)
    prior = uniform_bodies(model, 6.0)
    for error, said, changes in (
        (ShapeError, "R: expected shape", {"R": R[:, :-1]}),
        (ShapeError, "y: expected shape", {"y": y[:-1]}),
        (InvalidValueError, "R: every entry is zero", {"R": np.zeros((b, b))}),
        (InvalidValueError, "rest: expected a sum of squares", {"rest": -1.0}),
        (InvalidValueError, "rows", {"rows": 0}),
        (InvalidValueError, "gamma", {"gamma": -1.0}),
        (InvalidValueError, "margin", {"margin": 1.0}),
        (InvalidValueError, "tolerance", {"tolerance": 0.0}),
        (InvalidValueError, "prior: expected 2 links", {"prior": rm.InertialParameters.zeros(3)}),
        (InertiaError, "prior: link 1", {"prior": rm.InertialParameters.zeros(2)}),
        (InvalidValueError, "drive_prior", {"drive_prior": rm.DriveParameters.zeros(3)}),
        (ShapeError, r"mass_bounds: expected shape \(2, 2\)", {"mass_bounds": [1.0, 2.0]}),
        (InvalidValueError, "mass of link 2", {"mass_bounds": [[0, 1], [2, 1]]}),
        (InvalidValueError, "mass of link 1", {"mass_bounds": [[-5, -1], [2, 3]]}),
        (InvalidValueError, "mass of link 1", {"mass_bounds": [[np.nan, 1], [2, 3]]}),
        (InvalidValueError, "total mass of all", {"total_mass": -1.0}),
        (ShapeError, "total_mass", {"total_mass": [1.0, 2.0, 3.0]}),
        (InvalidValueError, "no link 3", {"centre_bounds": [CenterOfMassBox(3, [0] * 3, [1] * 3)]}),
        (InvalidValueError, "expected CenterOfMassBox", {"centre_bounds": [3]}),
    ):
        given: dict[str, Any] = {"R": R, "y": y, "rest": rest, "prior": prior} | changes
        with pytest.raises(error, match=said):
            fit_consistent(base, given.pop("R"), given.pop("y"), **given)
    with pytest.raises(InvalidValueError, match="low must not be above"):
        CenterOfMassBox(1, [1, 0, 0], [0, 1, 1])
    with pytest.raises(InvalidValueError, match="low must not be above"):
        CenterOfMassBox(1, [np.inf, 0, 0], [np.inf, 1, 1])
    with pytest.raises(ShapeError, match="high"):
        CenterOfMassBox(1, [1, 0, 0], [0, 1])
    with pytest.raises(InvalidValueError, match="semi_axes"):
        CenterOfMassEllipsoid(1, [0, 0, 0], [1, 0, 1])
    with pytest.raises(InvalidValueError, match="rotation"):
        CenterOfMassEllipsoid(1, [0, 0, 0], [1, 1, 1], 2 * np.eye(3))


def test_without_the_solver(monkeypatch, rng):
    model = arm(rng)
    base, R, y, rest, *_ = noisy(model, rng, 0.1)
    monkeypatch.setitem(sys.modules, "cvxpy", None)
    with pytest.raises(MissingExtraError, match=r"robotmodels\[cones\]"):
        fit_consistent(base, R, y, rest=rest, prior=uniform_bodies(model, 6.0))
