"""What is kept aside is what a new place is: stated errors hold where nothing was measured."""

import numpy as np
import pytest
from calibration_places import PRIOR, PROTOCOLS, Arm, markers, sockets, stated_over_true

import robotmodels as rm
from robotmodels.calibration import KnownDistance, PointContact, Position, fit
from robotmodels.calibration.measurements import Distance
from robotmodels.calibration.report import report
from robotmodels.calibration.validation import partition


@pytest.mark.parametrize(
    ("name", "prior"), [("markers", PRIOR), ("motion", PRIOR), ("markers", None)]
)
@pytest.mark.nightly
def test_the_stated_error_is_that_of_a_new_place(name, prior):
    ratios = [stated_over_true(PROTOCOLS[name], seed, prior) for seed in range(10)]
    folds, in_sample = np.mean(ratios, axis=0)
    assert 1.0 <= folds <= 1.3
    assert in_sample < 0.9 * folds


# --- what belongs together ------------------------------------------------------------------------


def parts_of(arm, measured, folds=5, seed=0):
    return partition(arm.nominal, measured, folds, np.random.default_rng(seed)).splits


def labels(measurements):
    return {label for m in measurements if m.views for label in m.label}


def test_two_sockets_of_one_place_are_kept_aside_together():
    arm = Arm(0)
    measured, _ = sockets(arm, 4)
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
    # without a known distance there is nothing to keep
    assert len(set().union(*(labels(part.test) for part in parts_of(arm, contacts)))) == 6


def test_all_measurements_of_one_posture_are_kept_aside_together():
    arm = Arm(2)
    measured, _ = markers(arm)
    shuffled = measured[1].subset(np.random.default_rng(0).permutation(measured[1].blocks)[3:])
    for part in parts_of(arm, [measured[0], shuffled, measured[2]]):
        kept = {q.tobytes() for m in part.training for q in m.q}
        aside = [{q.tobytes() for q in m.q} for m in part.test]
        assert not kept & set().union(*aside)
        assert aside[0] == aside[2] >= aside[1]


def test_a_run_of_postures_is_kept_aside_and_what_is_next_to_it_not_fitted():
    arm = Arm(3)
    q = arm.postures(60)
    parts = parts_of(arm, [Position(q, np.zeros((60, 3)))])
    assert sorted(b for part in parts for b in part.blocks) == list(range(60))
    for part in parts:
        first, last = part.blocks.min(), part.blocks.max()
        assert part.blocks.tolist() == list(range(first, last + 1))
        fitted = np.r_[q[: max(first - 4, 0)], q[last + 5 :]]
        assert np.array_equal(part.training[0].q, fitted)


def test_a_thing_round_which_the_arm_moves_is_no_place():
    arm = Arm(4)
    q = arm.postures(60)
    measured = Distance(q, np.full(60, 0.5), pivot=np.repeat([0, 1, 2], 20))
    for part in parts_of(arm, [measured]):
        assert labels(part.test) == labels(part.training) == {"0", "1", "2"}


def test_known_points_are_places_too():
    arm = Arm(5)
    contacts, p = arm.touches(4, 8)
    known = [
        PointContact(m.q, m.point, known={m.point[0]: there[0]})
        for m, there in zip(contacts, p, strict=True)
    ]
    parts = parts_of(arm, known)
    assert len(set().union(*(labels(part.test) for part in parts))) == 4
    assert not any(labels(part.test) & labels(part.training) for part in parts)


# --- words ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def places():
    arm = Arm(0)
    return fit(arm.nominal, sockets(arm, 4)[0], prior=PRIOR)


def test_the_report_says_what_was_kept_aside(places):
    text = " ".join(report(places).split())
    assert places.validation.folds.fits == 4
    assert "4 folds: whole places (4) held out." in text
    assert "Held out: whole places (4) held out." in text
    assert not any("place" in note and "only" in note for note in places.notes)
    arm = Arm(2)
    found = fit(arm.nominal, markers(arm)[0], prior=PRIOR)
    text = " ".join(report(found).split())
    assert "5 folds: runs of successive postures, those next to a run left out" in text


@pytest.mark.parametrize("count", [1, 2])
def test_too_few_places_are_named(count):
    arm = Arm(2)
    measured, _ = sockets(arm, count)
    found = fit(arm.nominal, measured, prior=PRIOR)
    [note] = [note for note in found.notes if note.startswith("Measured at")]
    assert note.startswith(f"Measured at {count} place{'s' * (count > 1)} only")
    assert "may be larger at another place" in note
    assert found.validation.folds.fits == 5
    # positions elsewhere are other places
    both = fit(arm.nominal, [*measured, arm.seen(arm.postures(30))], prior=PRIOR, held_out=0)
    assert not any(note.startswith("Measured at") for note in both.notes)


@pytest.mark.nightly
def test_the_note_is_right_about_one_place():
    """Folds at one place state less than another place errs: that is why they are named."""
    assert np.mean([stated_over_true(lambda arm: sockets(arm, 1), s)[0] for s in range(6)]) < 0.7


def test_nothing_to_keep_aside_is_said():
    arm = Arm(0)
    q = np.tile(arm.postures(1), (60, 1))
    measured = Position(q, rm.dgm(arm.real, q)[:, :3, 3] + 1e-4 * arm.rng.normal(size=(60, 3)))
    found = fit(arm.nominal, measured, prior=PRIOR)
    assert found.validation.folds is None
    assert found.validation.held_out is None
    assert any(note.startswith("No measurements can be held out") for note in found.notes)


def test_a_point_that_is_touched_once_is_no_place():
    arm = Arm(0)
    contacts, _ = arm.touches(4, 8)
    once = PointContact(arm.postures(3), ["a", "b", "c"])
    for part in parts_of(arm, [*contacts, once]):
        assert once in part.training
        assert len(labels(part.test)) == 1
