"""Residuals that depend on the posture: when a calibration says so, and which term it names."""

import re
from functools import cache

import numpy as np
import pytest
from identities.random_robots import random_bodies
from test_calibration_fit import erroneous, touching

import robotmodels as rm
from robotmodels.calibration import ParameterPrior, PointContact, Pose, Position, fit

NOISE = 1e-4
"""Standard deviation of positions, m."""
OPTIONS = {
    "joint compliance": {"compliance": "joints"},
    "gear eccentricity": {"eccentricity": True},
    "gains of the readings": {"gains": True},
}


class Scene:
    """A random arm of six joints, its real brother, and errors of its joints of a given size.

    Kinds: none, compliance, eccentricity, and backlash (each joint lags behind its last move).
    The errors move the tool by three standard deviations of the noise (rms of a coordinate).
    """

    def __init__(self, seed, kind="none", size=3.0, masses=True):
        self.rng = rng = np.random.default_rng([seed, 17])
        a, b = rng.uniform(0.2, 0.7, size=2)
        turn = np.pi / 2
        alpha, d, r = [
            ([0, turn, 0, -turn, turn, -turn], [0, 0.1, a, 0.05, 0, 0], [0, 0, 0, b, 0, 0]),
            ([0, turn, 0, 0, -turn, turn], [0, 0, -a, -b, 0, 0], [0.1, 0, 0, 0.15, 0.1, 0.1]),
            (rng.uniform(-1.8, 1.8, 6), rng.uniform(0, 0.4, 6), rng.uniform(-0.3, 0.3, 6)),
        ][seed % 3]
        table = rm.DHTable(
            antecedent=np.arange(6), sigma=np.zeros(6, int), theta=np.zeros(6),
            alpha=alpha, d=d, r=r,
        )  # fmt: skip
        heavy = rm.RobotModel.from_table(table, inertia=random_bodies(rng, 6))
        self.heavy = heavy.with_tool(rm.se3.translation(0.06, -0.04, 0.12))
        self.arm = self.heavy
        if not masses:
            self.arm = self.heavy.with_inertia(rm.InertialParameters(np.zeros((6, 10))))
        self.real = erroneous(self.heavy, rng)
        self.kind, self.each, self.waves = kind, np.abs(rng.normal(size=6)), rng.normal(size=(4, 6))
        self.scale = 1e-5
        q = self.readings(300)
        moved = rm.dgm(self.real, self.actual(q)) - rm.dgm(self.real, q)
        rms = np.sqrt(np.mean(moved[:, :3, 3] ** 2))
        self.scale *= size * NOISE / rms if rms else 0.0

    def readings(self, count):
        return self.rng.uniform(-2.2, 2.2, (count, 6))

    def actual(self, q):
        """Where the joints are."""
        if self.kind == "compliance":
            return q - self.scale * self.each * rm.gravity_torque(self.heavy, q)
        if self.kind == "eccentricity":
            waves = np.stack([np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)], axis=1)
            return q + self.scale * np.einsum("nki,ki->ni", waves, self.waves)
        if self.kind == "backlash":
            return q + self.scale * self.each * np.sign(np.diff(q, axis=0, prepend=0.0))
        return q

    def positions(self, q):
        p = rm.dgm(self.real, self.actual(q))[:, :3, 3]
        return Position(q, p + NOISE * self.rng.normal(size=p.shape))

    def measured(self, count):
        return self.positions(self.readings(count))


def note(result):
    """What is said of residuals that depend on the posture; empty if nothing is."""
    return " ".join(
        text for text in result.notes if "residuals depend on the posture" in text.lower()
    )


def named(text):
    """The term to try next and the errors without and with it, m; None if there is none."""
    found = re.search(r"Try ([a-z ]+) next\. .*?: \1 \(.*?\) from ([\d.]+) to ([\d.]+) mm", text)
    return found and (found[1], 1e-3 * float(found[2]), 1e-3 * float(found[3]))


@cache
def fitted(seed, kind, masses=True):
    scene = Scene(seed, kind, masses=masses)
    measured = scene.measured(80)
    return scene, measured, fit(scene.arm, measured, prior=ParameterPrior(), folds=3, held_out=0)


@pytest.mark.parametrize("prior", [None, ParameterPrior()])
def test_noise_has_no_structure(prior):
    found = []
    for seed in range(20):
        scene = Scene(seed)
        result = fit(scene.arm, scene.measured(50), prior=prior, folds=0, held_out=0)
        found.append(bool(note(result)))
    assert np.mean(found) <= 0.05


@pytest.mark.parametrize(
    ("kind", "term"), [("compliance", "joint compliance"), ("eccentricity", "gear eccentricity")]
)
@pytest.mark.nightly
def test_the_cause_is_named_first(kind, term):
    found = [named(note(fitted(seed, kind)[2])) for seed in range(9)]
    assert sum(f is not None and f[0] == term for f in found) >= 8


@pytest.mark.parametrize("kind", ["compliance", "eccentricity", "backlash"])
@pytest.mark.nightly
def test_the_term_brings_on_fresh_data_what_it_promises(kind):
    ratios = []
    for seed in range(6):
        scene, measured, result = fitted(seed, kind)
        text = note(result)
        if kind != "backlash":
            assert text.startswith("The residuals depend on the posture")
        promise = named(text)
        if promise is None:
            continue
        fresh = scene.measured(200)
        without, with_it = (
            fit(scene.arm, measured, prior=ParameterPrior(), folds=0, held_out=fresh, **options)
            .validation.held_out.rms["m"]
            for options in ({}, OPTIONS[promise[0]])
        )  # fmt: skip
        ratios.append((without - with_it) / (promise[1] - promise[2]))
    if kind == "backlash":  # which no term is: a promise is rare, and small
        assert len(ratios) <= 3
        assert all(ratio > 0.0 for ratio in ratios)
    else:
        assert len(ratios) >= 5
        assert 0.7 < np.median(ratios) < 1.3


def test_backlash_is_not_geometry():
    assert (
        sum("no geometric parameter" in note(fitted(seed, "backlash")[2]) for seed in range(6)) >= 5
    )


def test_without_masses_they_are_asked_for():
    for seed in range(3):
        text = note(fitted(seed, "compliance", False)[2])
        assert "no geometric parameter" in text
        assert "Give the model masses (with_inertia) to try joint compliance." in text
        assert "compliance='joints'" not in text


def test_poses():
    scene = Scene(1, "compliance")
    q = scene.readings(60)
    T = rm.dgm(scene.real, scene.actual(q))
    T[:, :3, 3] += NOISE * scene.rng.normal(size=(60, 3))
    text = note(fit(scene.arm, Pose(q, T), prior=ParameterPrior(), folds=3, held_out=0))
    assert named(text)[0] == "joint compliance"
    assert re.search(r"mm and [\d.]+ to [\d.]+ deg", text)


def contacts(kind, **options):
    """A fit to contacts with four points: the real arm is at them, less its joints' errors."""
    scene = Scene(0, kind)
    points = rm.dgm(scene.real, scene.readings(4))[:, :3, 3]
    q, labels = touching(scene.real, points, 30, scene.rng)
    sol = q + 1e-4 * scene.rng.normal(size=q.shape)
    q = sol.copy()
    for _ in range(10):
        q += sol - scene.actual(q)
    return fit(scene.arm, PointContact(q, labels), known_lengths="r4", held_out=0, **options)


def test_contacts():
    prior = ParameterPrior()
    assert not note(contacts("none", folds=0, prior=prior))
    assert named(note(contacts("compliance", folds=3, prior=prior)))[0] == "joint compliance"


def test_parameters_left_out_may_be_the_cause():
    few = [f"theta{k}" for k in range(2, 6)]
    text = note(contacts("none", folds=0, parameters=[*few, "r4"]))
    assert text.startswith("The residuals depend on the posture")
    assert "left out may be the cause" in text
    scene = Scene(0)  # lengths are measured: the test allows for all of the table
    assert not note(fit(scene.arm, scene.measured(60), parameters=few, folds=0, held_out=0))


def test_what_a_prior_holds_back_is_geometry():
    scene = Scene(2)
    tight = ParameterPrior(length=1e-5, angle=1e-5)
    result = fit(scene.arm, scene.measured(80), prior=tight, folds=0, held_out=0)
    assert result.validation.in_sample.rms["m"] > 3 * NOISE
    assert not note(result)


def test_an_error_that_all_measurements_of_a_posture_share_is_noise():
    found = []
    for seed in range(10):
        scene = Scene(seed)
        q = np.repeat(scene.readings(40), 3, axis=0)
        shared = np.repeat(3e-4 * scene.rng.normal(size=(40, 3)), 3, axis=0)
        p = scene.positions(q).p + shared
        found.append(bool(note(fit(scene.arm, Position(q, p), folds=0, held_out=0))))
    assert sum(found) <= 1


def test_exact_data_and_few_postures_have_no_structure():
    scene = Scene(0)
    q = scene.readings(40)
    exact = Pose(q, rm.dgm(scene.real, q))
    assert not note(fit(scene.arm, exact, folds=0, held_out=0))
    bent = Pose(q[:15], rm.dgm(Scene(0, "compliance", size=30.0).real, q[:15]))
    assert not note(fit(scene.arm, bent, folds=0, held_out=0))


def test_a_term_of_the_fit_is_not_named_again():
    scene, measured, _ = fitted(0, "compliance")
    result = fit(scene.arm, measured, compliance="joints", prior=ParameterPrior(), folds=0)
    assert not note(result)
    scene, measured, _ = fitted(0, "eccentricity")
    result = fit(scene.arm, measured, compliance="joints", folds=2, held_out=0)
    assert named(note(result))[0] == "gear eccentricity"
    assert "joint compliance" not in note(result)
