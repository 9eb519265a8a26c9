"""Residuals that depend on the posture: when a calibration says so, and which term it names."""

import re
from functools import cache

import numpy as np
import pytest
from identities.random_robots import random_bodies
from test_calibration_fit import ALONE, erroneous

import robotmodels as rm
from robotmodels.calibration import ParameterPrior, Pose, Position, fit

NOISE = 1e-4
"""Standard deviation of positions, m."""


class Scene:
    """A random arm of six joints, its real brother, and errors of its joints.

    Kinds: none, compliance, eccentricity, and backlash (each joint lags behind its last move).
    The errors move the tool by three standard deviations of the noise (rms of a coordinate).
    """

    def __init__(self, seed, kind="none"):
        self.rng = rng = np.random.default_rng([seed, 17])
        a, b = rng.uniform(0.2, 0.7, size=2)
        turn = np.pi / 2
        alpha, d, r = [
            ([0, turn, 0, -turn, turn, -turn], [0, 0.1, a, 0.05, 0, 0], [0, 0, 0, b, 0, 0]),
            ([0, turn, 0, 0, -turn, turn], [0, 0, -a, -b, 0, 0], [0.1, 0, 0, 0.15, 0.1, 0.1]),
            (rng.uniform(-1.8, 1.8, 6), rng.uniform(0, 0.4, 6), rng.uniform(-0.3, 0.3, 6)),
        ][seed % 3]
        table = rm.DHTable(np.arange(6), np.zeros(6, int), theta=np.zeros(6), alpha=alpha, d=d, r=r)
        heavy = rm.RobotModel.from_table(table, inertia=random_bodies(rng, 6))
        self.arm = heavy.with_tool(rm.se3.translation(0.06, -0.04, 0.12))
        self.real = erroneous(self.arm, rng)
        self.kind, self.each, self.waves = kind, np.abs(rng.normal(size=6)), rng.normal(size=(4, 6))
        self.scale = 1e-5
        q = self.readings(300)
        moved = rm.dgm(self.real, self.actual(q)) - rm.dgm(self.real, q)
        rms = np.sqrt(np.mean(moved[:, :3, 3] ** 2))
        self.scale *= 3.0 * NOISE / rms if rms else 0.0

    def readings(self, count):
        return self.rng.uniform(-2.2, 2.2, (count, 6))

    def actual(self, q):
        """Where the joints are."""
        if self.kind == "compliance":
            return q - self.scale * self.each * rm.gravity_torque(self.arm, q)
        if self.kind == "eccentricity":
            waves = np.stack([np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)], axis=1)
            return q + self.scale * np.einsum("nki,ki->ni", waves, self.waves)
        if self.kind == "backlash":
            return q + self.scale * self.each * np.sign(np.diff(q, axis=0, prepend=0.0))
        return q

    def positions(self, q):
        p = rm.dgm(self.real, self.actual(q))[:, :3, 3]
        return Position(q, p + NOISE * self.rng.normal(size=p.shape))


def note(result):
    """What is said of residuals that depend on the posture; empty if nothing is."""
    return " ".join(x for x in result.notes if "residuals depend on the posture" in x.lower())


def named(text):
    """The term to try next; None if there is none."""
    found = re.search(r"Try ([a-z ]+) next\. .*?: \1 \(.*?\) from [\d.]+ to [\d.]+ mm", text)
    return found and found[1]


@cache
def fitted(seed, kind):
    scene = Scene(seed, kind)
    measured = scene.positions(scene.readings(80))
    return scene, measured, fit(scene.arm, measured, folds=3, held_out=0)


@pytest.mark.parametrize("prior", [None, ParameterPrior()])
def test_noise_and_exact_data_have_no_structure(prior):
    scenes = [Scene(seed) for seed in range(10)]
    found = [fit(s.arm, s.positions(s.readings(50)), prior=prior, **ALONE) for s in scenes]
    assert sum(bool(note(result)) for result in found) <= 1
    q = scenes[0].readings(40)
    assert not note(fit(scenes[0].arm, Pose(q, rm.dgm(scenes[0].real, q)), prior=prior, **ALONE))


@pytest.mark.parametrize(
    ("kind", "term"), [("compliance", "joint compliance"), ("eccentricity", "gear eccentricity")]
)
@pytest.mark.nightly
def test_the_cause_is_named_first(kind, term):
    assert sum(named(note(fitted(seed, kind)[2])) == term for seed in range(9)) >= 8


def test_backlash_is_not_geometry():
    found = [note(fitted(seed, "backlash")[2]) for seed in range(3)]
    assert sum("no geometric parameter" in text for text in found) >= 2


def test_what_a_prior_holds_back_is_geometry():
    scene = Scene(2)
    tight = ParameterPrior(length=1e-5, angle=1e-5)
    result = fit(scene.arm, scene.positions(scene.readings(80)), prior=tight, **ALONE)
    assert result.validation.in_sample.rms["m"] > 3 * NOISE
    assert not note(result)


def test_an_error_that_all_measurements_of_a_posture_share_is_noise():
    found = []
    for seed in range(5):
        scene = Scene(seed)
        q = np.repeat(scene.readings(40), 3, axis=0)
        shared = np.repeat(3e-4 * scene.rng.normal(size=(40, 3)), 3, axis=0)
        p = scene.positions(q).p + shared
        found.append(bool(note(fit(scene.arm, Position(q, p), **ALONE))))
    assert sum(found) <= 1


def test_a_term_of_the_fit_is_not_named_again():
    scene, measured, _ = fitted(0, "compliance")
    assert not note(fit(scene.arm, measured, compliance="joints", folds=0))
    scene, measured, _ = fitted(0, "eccentricity")
    text = note(fit(scene.arm, measured, compliance="joints", folds=2, held_out=0))
    assert named(text) == "gear eccentricity"
    assert "joint compliance" not in text
