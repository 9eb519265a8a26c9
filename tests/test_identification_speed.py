"""Long logs: parts that represent them, and findings of checks that look at them."""

import numpy as np
from identification_logs import recorded

import robotmodels as rm
from robotmodels.identification.checks import check_joints
from robotmodels.logs import FindingKind, Log, check_log
from robotmodels.logs.stretches import stretches


def test_stretches_cover_a_log_and_keep_its_recordings():
    q = np.arange(1000.0)[:, None]
    log = Log(0.01, q, -q, q + 1.0, q + 2.0, starts=(0, 430, 435))
    part = stretches(log, 50, 300)
    assert np.array_equal(part.v, part.q + 1.0)
    assert np.array_equal(part.a, part.q + 2.0)
    assert len(part) <= 300
    assert part.q[0, 0] == 0.0
    assert part.q[-1, 0] == 984.0  # the 15 samples after it are no stretch
    assert np.array_equal(part.tau, -part.q)
    for rows in part.recordings():
        inside = part.q[rows, 0]
        assert (np.diff(inside) == 1.0).all()
        assert inside[-1] < 430.0 or inside[0] >= 435.0
    short = Log(0.01, q, q, starts=tuple(range(0, 1000, 4)))
    assert 0 < len(stretches(short, 50, 300)) <= 300


def test_what_a_long_log_hides_is_found_in_stretches_and_said():
    model, whole = rm.load("planar_2r"), recorded("planar_2r", 120_000, noise=0.01)
    assert check_joints(whole, model) == ()
    wrong = Log(whole.dt, whole.q, whole.tau * [-1.0, 1.0])
    (found,) = [f for f in check_joints(wrong, model) if f.joints == ("1",)]
    assert "of 120000 samples" in found.sentence


def test_what_happens_once_in_a_long_log_is_found():
    q = np.sin(1e-3 * np.arange(250_000))[:, None] * [1.0, 0.7]
    q[99_950:100_060, 1] = q[99_950, 1]  # a sensor that stops, over the end of a piece
    q[230_000:, 0] += 0.5
    tau = np.cos(q) + 1e-3 * np.random.default_rng(0).normal(size=q.shape)
    q[150_000, 0] += 2.0
    log = Log(1e-3, q, tau)
    found = {(f.kind, f.joints): f.sentence for f in check_log(log)}
    assert "repeat, from row 99950" in found[FindingKind.STUCK, ("2",)]
    assert "the first at row 150000" in found[FindingKind.SPIKES, ("1",)]
    assert "at row 230000" in found[FindingKind.JUMP, ("1",)]
    assert (FindingKind.JUMP, ("2",)) not in found
