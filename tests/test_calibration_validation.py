"""Held-out places are new places: stated errors hold where nothing was measured."""

import numpy as np
import pytest
from calibration_arms import Arm

from robotmodels.calibration import KnownDistance, Position, fit
from robotmodels.calibration.validation import partition


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


def test_a_run_of_postures_is_kept_aside_and_what_is_next_to_it_not_fitted():
    arm = Arm(3)
    q = arm.readings(60)
    parts = parts_of(arm, [Position(q, np.zeros((60, 3)))])
    assert sorted(b for part in parts for b in part.blocks) == list(range(60))
    for part in parts:
        first, last = part.blocks.min(), part.blocks.max()
        assert part.blocks.tolist() == list(range(first, last + 1))
        assert np.array_equal(part.training[0].q, np.r_[q[: max(first - 4, 0)], q[last + 5 :]])


def test_notes_tell_of_measurements_that_cannot_be_held_out():
    arm = Arm(0)
    found = fit(arm.nominal, arm.sockets(1))
    assert any(note.startswith("Measured at 1 place only") for note in found.notes)
    found = fit(arm.nominal, arm.positions(np.tile(arm.readings(1), (60, 1))))
    assert found.validation.folds is found.validation.held_out is None
    assert any(note.startswith("No measurements can be held out") for note in found.notes)
