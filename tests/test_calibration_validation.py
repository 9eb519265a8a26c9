"""Held-out places are new places; residuals that depend on the posture name the term to try."""

import re
from functools import cache

import numpy as np
import pytest
from calibration_arms import ALONE, NOISE, Arm

import robotmodels as rm
from robotmodels.calibration import KnownDistance, ParameterPrior, Pose, Position, fit
from robotmodels.calibration.validation import partition


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


# --- held-out places ------------------------------------------------------------------------------


@pytest.mark.nightly
def test_the_stated_error_is_that_of_a_new_place():
    ratios = []
    for arm in (Arm(seed, "compliance") for seed in range(10)):
        found = fit(
            arm.nominal, arm.markers(), held_out=arm.positions(arm.readings(200))
        ).validation
        stated = (errors.rms["m"] for errors in (found.folds, found.in_sample))
        ratios.append([rms / found.held_out.rms["m"] for rms in stated])
    folds, in_sample = np.mean(ratios, axis=0)
    assert 1.0 <= folds <= 1.3
    assert in_sample < 0.9 * folds


def parts_of(arm, measured):
    return partition(arm.nominal, measured, 5, np.random.default_rng(0)).splits


def labels(measurements):
    return {label for m in measurements if m.views for label in m.label}


def test_two_sockets_of_one_place_are_kept_aside_together():
    measured = (arm := Arm(0)).sockets(4)
    parts = parts_of(arm, measured)
    aside = sorted(sorted(labels(part.test)) for part in parts)
    assert aside == [[f"{k}:0", f"{k}:1"] for k in range(4)]
    for part in parts:
        assert not labels(part.test) & labels(part.training)
        assert sum(isinstance(m, KnownDistance) for m in part.training) == 3
        assert len(labels(part.training)) == 6


def test_places_without_which_no_length_is_known_stay_in_the_fit():
    arm = Arm(1)
    contacts, p = arm.touches(6, 8)
    far = int(np.argmax(np.linalg.norm(p[1:, 0] - p[0, 0], axis=1))) + 1
    length = float(np.linalg.norm(p[0, 0] - p[far, 0]))
    known = KnownDistance("point:0:0", f"point:{far}:0", length)
    parts = parts_of(arm, [*contacts, known])
    aside = set().union(*(labels(part.test) for part in parts))
    assert not aside & {"0:0", f"{far}:0"}
    assert len(aside) >= 3
    assert all(known in part.training for part in parts)


def test_all_measurements_of_one_posture_are_kept_aside_together():
    measured = (arm := Arm(2)).markers()
    shuffled = measured[1].subset(np.random.default_rng(0).permutation(measured[1].blocks)[3:])
    for part in parts_of(arm, [measured[0], shuffled, measured[2]]):
        kept = {q.tobytes() for m in part.training for q in m.q}
        aside = [{q.tobytes() for q in m.q} for m in part.test]
        assert not kept & set().union(*aside)
        assert aside[0] == aside[2] >= aside[1]


def test_notes_tell_of_measurements_that_cannot_be_held_out():
    arm = Arm(0)
    found = fit(arm.nominal, arm.sockets(1))
    assert any(note.startswith("Measured at 1 place only") for note in found.notes)
    found = fit(arm.nominal, arm.positions(np.tile(arm.readings(1), (60, 1))))
    assert found.validation.folds is found.validation.held_out is None
    assert any(note.startswith("No measurements can be held out") for note in found.notes)
