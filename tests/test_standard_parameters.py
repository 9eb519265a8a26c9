"""Standard parameters of physical robots from base parameters; uniform bodies."""

import numpy as np
import pytest
from identities.random_robots import random_bodies, random_drive

import robotmodels as rm
from robotmodels.errors import InertiaError, InvalidValueError, ShapeError
from robotmodels.inertia.consistency import pseudo_inertia
from robotmodels.minimal_parameters import (
    PhysicalStatus,
    base_parameters,
    standard_parameters,
    uniform_bodies,
)


def robot(name, rng):
    model = rm.load(name)
    model = model.with_inertia(random_bodies(rng, model.f))
    return model.with_drive(random_drive(rng, model.n))


def test_nothing_is_nearer_to_the_prior(rng):
    """Small steps in the null space do not come nearer among physical bodies."""
    model = robot("planar_2r", rng)
    base = base_parameters(model, drive=False)
    prior = uniform_bodies(model, 10.0)
    found = standard_parameters(base, base.values(model), prior=prior)
    P0 = pseudo_inertia(prior.values)
    whiten = np.linalg.inv(np.linalg.cholesky(P0))

    def change(values):
        bodies = rm.InertialParameters(values.reshape(2, 10))
        P = whiten @ (pseudo_inertia(bodies.values) - P0) @ np.swapaxes(whiten, 1, 2)
        return np.sqrt((P**2).sum()), np.linalg.eigvalsh(P + np.eye(4)).min()

    distance, least = change(found.values)
    assert distance == pytest.approx(found.distance, rel=1e-9)
    assert least > 0.99e-3
    for _ in range(200):
        step = base.null_space @ (1e-4 * rng.normal(size=base.null_space.shape[1]))
        nearer, least = change(found.values + step)
        assert nearer >= distance - 1e-4 or least < 1e-3


def test_drives_of_the_prior_stay_where_they_are_not_parameters(rng):
    model, drives = robot("planar_2r", rng), random_drive(rng, 2)
    base = base_parameters(model, drive=False)
    assert standard_parameters(base, base.values(model), drive_prior=drives).drive == drives


def test_base_parameters_of_no_robot(rng):
    model = robot("planar_2r", rng)
    base = base_parameters(model, drive=True)
    values = base.values(model)
    values[base.names.index("ZZ2")] = -1.0
    found = standard_parameters(base, values, prior=uniform_bodies(model, 10.0))
    assert found.status is PhysicalStatus.CONSTRAINED
    assert abs(found.deviation).max() > 0.5
    assert np.allclose(base.values(found.of(model)) - values, found.deviation, atol=1e-9)
    assert found.inertia.is_physical.all()
    # with the weights of a regressor it is the torques that are nearest
    W = base.reduce(rm.torque_regressor(model, *rng.normal(size=(3, 40, 2)))).reshape(-1, len(base))
    by_torque = standard_parameters(
        base, values, prior=uniform_bodies(model, 10.0), weights=np.linalg.qr(W, mode="r")
    )
    missed = [np.linalg.norm(W @ one.deviation) for one in (by_torque, found)]
    assert missed[0] <= missed[1] * (1 + 1e-6)


def test_uniform_bodies():
    model = rm.load("rx90")
    bodies = uniform_bodies(model, 80.0)
    assert bodies.mass.sum() == pytest.approx(80.0)
    assert bodies.is_physical.all()
    # a bar of length 2 along x with a ball at its joint; the last link is a ball
    two = rm.RobotModel.from_table(rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0.0, 2.0]))
    r, length = 0.3, 2.0
    bar, ball = np.pi * r**2 * length, 4.0 / 3.0 * np.pi * r**3
    found = uniform_bodies(two, bar + 2.0 * ball, radius=r).values
    along, of_ball = 0.5 * bar * r**2 + 0.4 * ball * r**2, 0.4 * ball * r**2
    across = bar * (r**2 / 4.0 + length**2 / 3.0) + of_ball
    expected = [along, 0, 0, across, 0, across, 0.5 * length * bar, 0, 0, bar + ball]
    assert found[0] == pytest.approx(expected)
    assert found[1] == pytest.approx([of_ball, 0, 0, of_ball, 0, of_ball, 0, 0, 0, ball])
    sphere = np.diag([0.5 * of_ball] * 3 + [ball])
    assert pseudo_inertia(found)[1] == pytest.approx(sphere)


def test_mistakes_are_named(rng):
    model = robot("planar_2r", rng)
    base = base_parameters(model)
    values, wrist = (
        base.values(model),
        rm.load("tx40"),
    )  # the catalogue has no inertia of its link 6
    good, heavy, thin = np.tile(uniform_bodies(model, 10.0).values, (3, 1, 1))
    good[1, 9], heavy[1, 5] = -2.0, 90.0
    thin[:] = [1e-30, 0, 0, 1.0, 0, 1.0, 0, 0, 0, 1.0]
    for call, error, words in (
        (lambda: uniform_bodies(model, 0.0), InvalidValueError, "mass: expected a positive"),
        (lambda: uniform_bodies(model, 1.0, radius=-1.0), InvalidValueError, "radius"),
        (lambda: standard_parameters(base_parameters(wrist), np.ones(55)), InertiaError,
         r"link 6 .*Pass prior=uniform_bodies\(model, mass="),
        (lambda: standard_parameters(base, values[:-1]), ShapeError, "values"),
        *((lambda b=bodies: standard_parameters(base, values, prior=rm.InertialParameters(b)),
           InertiaError, words) for bodies, words in (
            (good, "link 2 .joint_2. is not a body .*its mass is -2 kg"),
            (heavy, "triangle inequality fails"), (thin, r"three directions.*So are 1 more"))),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            call()


def test_it_prints_as_a_table(rng):
    model = robot("planar_2r", rng)
    base = base_parameters(model)
    found = standard_parameters(base, base.values(model), prior=uniform_bodies(model, 10.0))
    rows = [line.strip("│").split("│") for line in str(found).splitlines() if line[:1] == "│"]
    cells = {row[0].strip(): row[1:] for row in rows}
    prior, value, difference = map(float, cells["M2"])
    assert value == pytest.approx(found.inertia.mass[1], rel=1e-5)
    assert difference == pytest.approx(value - prior, rel=1e-2)


def test_values_that_are_rounding_weigh_as_zeros(rng):
    """First moments of 1e-18 to 1e-9 of an arm that cannot have them: the same nearest robot."""
    model = rm.load("ur5e")
    base = base_parameters(model)
    values = base.values(model.with_inertia(uniform_bodies(model, 5.0)))
    first = [k for k, name in enumerate(base.names) if name.startswith("M")]
    nearest = []
    for size in (0.0, 1e-18, 1e-12, 1e-9):
        values[first] = size * rng.normal(size=len(first))
        found = standard_parameters(base, values)
        assert found.is_usable
        nearest.append(np.abs(found.deviation).max())
    np.testing.assert_allclose(nearest, nearest[0], rtol=0.01)
    assert nearest[0] < 0.01


@pytest.mark.parametrize("size", [1e-3, 100.0])
def test_the_size_of_the_robot_does_not_matter(size):
    table = rm.load("rx90").table
    model = rm.RobotModel.from_table(table.replace(d=size * table.d, r=size * table.r))
    drive = rm.DriveParameters(Ia=[0.1 * size**2] * 6, Fv=[size**2] * 6, Fc=[10 * size] * 6)
    model = model.with_inertia(uniform_bodies(model, 60.0)).with_drive(drive)
    base = base_parameters(model)
    found = standard_parameters(base, base.values(model), prior=uniform_bodies(model, 90.0))
    assert found.status is PhysicalStatus.EXACT
    assert found.distance == pytest.approx(1.345171366871, rel=1e-6)
    # a friction below zero is no friction
    values = base.values(model)
    values[base.names.index("Fc3")] = -1e-3 * size
    found = standard_parameters(base, values, prior=uniform_bodies(model, 90.0))
    assert found.status is PhysicalStatus.CONSTRAINED
    for part in (found.drive.Ia, found.drive.Fv, found.drive.Fc):
        assert (part >= 0.0).all()


def coupled_trunk():
    """Three joints, two motors of which are coupled, one after the other."""
    K = rm.Transmission.from_motor([[1.0, 0, 0], [0.5, 1.0, 0], [0, 2.0, 1.0]])
    rows = [{"sigma": 0, "alpha": np.pi / 2 * (j > 0), "d": 0.3 * j} for j in range(3)]
    drive = rm.DriveParameters(*np.random.default_rng(0).uniform(0.5, 1.0, (4, 3)))
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows), transmission=K, drive=drive)


@pytest.mark.parametrize("model", [rm.load("tx40"), coupled_trunk()], ids=["tx40", "three"])
def test_coupled_motors_are_dissipative(model, rng):
    """Rotors and friction of coupled motors that no motors can have are not EXACT."""
    model = model.with_inertia(uniform_bodies(model, 30.0))
    base = base_parameters(model)
    names, own = list(base.names), base.values(model)
    last = model.transmission.coupled_motors[-1]
    for kind in ("Ia", "Fv", "Fc"):
        values = own.copy()
        values[[name in (f"{kind}{last - 1}", f"{kind}{last}") for name in names]] = 0.0
        values[names.index(f"{kind}m{last}")] = 0.01 * (-1.0 if kind == "Fc" else 1.0)
        found = standard_parameters(base, values)
        assert found.status is PhysicalStatus.CONSTRAINED
        drives = found.of(model).drive_matrices
        for matrix in (drives.rotor, drives.viscous):
            assert np.linalg.eigvalsh(matrix)[0] >= -1e-12 * abs(matrix).max()
        v = rng.normal(size=(200, model.n))
        taken = ((drives.torque(v, None) - found.drive.offset) * v).sum(axis=1)
        assert taken.min() >= -1e-12 * abs(taken).max()
        A = rm.mass_matrix(found.of(model), rng.uniform(-2, 2, (20, model.n)))
        assert np.linalg.eigvalsh(A).min() > 0.0
    # and those that motors can have are
    values = own.copy()
    values[names.index(f"Iam{last}")] = 1e-3
    found = standard_parameters(base, values)
    assert found.status is PhysicalStatus.EXACT
    np.testing.assert_allclose(base.values(found.of(model)), values, atol=1e-9)
