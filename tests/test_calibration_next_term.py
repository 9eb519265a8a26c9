"""Residuals that depend on the posture: when a calibration says so, and which term it names."""

import re
from functools import cache

import numpy as np
import pytest
from calibration_arms import ALONE, NOISE, Arm

import robotmodels as rm
from robotmodels.calibration import ParameterPrior, Pose, Position, fit


def note(result):
    """What is said of residuals that depend on the posture; empty if nothing is."""
    return " ".join(x for x in result.notes if "residuals depend on the posture" in x.lower())


def named(text):
    """The term to try next; None if there is none."""
    found = re.search(r"Try ([a-z ]+) next\. .*?: \1 \(.*?\) from [\d.]+ to [\d.]+ mm", text)
    return found and found[1]


@cache
def fitted(seed, kind):
    arm = Arm(seed, kind)
    measured = arm.positions(arm.readings(80))
    return arm, measured, fit(arm.nominal, measured, folds=3, held_out=0)


@pytest.mark.parametrize("prior", [None, ParameterPrior()])
def test_noise_and_exact_data_have_no_structure(prior):
    arms = [Arm(seed) for seed in range(10)]
    found = [fit(s.nominal, s.positions(s.readings(50)), prior=prior, **ALONE) for s in arms]
    assert sum(bool(note(result)) for result in found) <= 1
    q = arms[0].readings(40)
    assert not note(fit(arms[0].nominal, Pose(q, rm.dgm(arms[0].real, q)), prior=prior, **ALONE))


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
    arm = Arm(2)
    tight = ParameterPrior(length=1e-5, angle=1e-5)
    result = fit(arm.nominal, arm.positions(arm.readings(80)), prior=tight, **ALONE)
    assert result.validation.in_sample.rms["m"] > 3 * NOISE
    assert not note(result)


def test_an_error_that_all_measurements_of_a_posture_share_is_noise():
    found = []
    for seed in range(5):
        arm = Arm(seed)
        q = np.repeat(arm.readings(40), 3, axis=0)
        shared = np.repeat(3e-4 * arm.rng.normal(size=(40, 3)), 3, axis=0)
        p = arm.positions(q).p + shared
        found.append(bool(note(fit(arm.nominal, Position(q, p), **ALONE))))
    assert sum(found) <= 1


def test_a_term_of_the_fit_is_not_named_again():
    arm, measured, _ = fitted(0, "compliance")
    assert not note(fit(arm.nominal, measured, compliance="joints", folds=0))
    arm, measured, _ = fitted(0, "eccentricity")
    text = note(fit(arm.nominal, measured, compliance="joints", folds=2, held_out=0))
    assert named(text) == "gear eccentricity"
    assert "joint compliance" not in text
