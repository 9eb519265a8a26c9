"""What makes identification quick and small: kept blocks, parts of long logs."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import robotmodels as rm
from robotmodels._arrays import as_floats
from robotmodels.errors import InvalidValueError
from robotmodels.identification import choose_processing, equations, fit
from robotmodels.identification.checks import check_joints
from robotmodels.identification.forms import EquationForm
from robotmodels.logs import FindingKind, Log, check_log
from robotmodels.logs.stretches import stretches
from robotmodels.minimal_parameters import base_parameters

DT = 0.002


def recorded(name: str, N: int, noise: float = 0.0) -> Log:
    """A log of a robot that moves with a few frequencies, all joints."""
    model = rm.load(name)
    rng = np.random.default_rng(7)
    t = DT * np.arange(N)[:, None]
    q, v, a = (np.zeros((N, model.n)) for _ in range(3))
    for f in (0.11, 0.23, 0.37, 0.59):
        w = 2.0 * np.pi * f
        s, c = rng.normal(size=(2, model.n)) * 0.5
        q += s * np.sin(w * t) + c * np.cos(w * t)
        v += w * (s * np.cos(w * t) - c * np.sin(w * t))
        a -= w**2 * (s * np.sin(w * t) + c * np.cos(w * t))
    tau = rm.idm(model, q, v, a) + 2.0 * v + np.sign(v) + noise * rng.normal(size=q.shape)
    return Log(DT, q, tau)


def test_kept_blocks_are_of_their_log_and_choices_alone():
    log = recorded("planar_2r", 8_000, 0.01)
    base = base_parameters(rm.load("planar_2r"), drive=("Fv", "Fc"))
    kept = equations(base, log, choose_processing(log)).cached()
    (block,) = kept.blocks()
    assert next(kept.blocks()) is block
    (doubled,) = replace(kept, log=Log(DT, log.q, 2.0 * log.tau)).blocks()
    assert np.allclose(doubled.y, 2.0 * block.y)
    fewer = replace(kept, processing=choose_processing(log, decimation=7))
    assert np.array_equal(next(fewer.blocks()).W, next(fewer.uncached().blocks()).W)
    (powers,) = replace(kept, form=EquationForm.POWER).blocks()
    assert powers.W.shape[1] == 1
    copy = pickle.loads(pickle.dumps(kept))
    assert copy.cache is None
    assert np.array_equal(next(copy.blocks()).W, block.W)


def test_a_result_keeps_no_blocks():
    log = recorded("planar_2r", 8_000, 0.01)
    found = fit(rm.load("planar_2r"), log, drive=("Fv", "Fc"))
    assert found.equations.cache is None
    assert len(pickle.dumps(found)) < 2 * 8 * log.q.size * 3


def test_finite_numbers_are_told_in_long_arrays():
    x = np.zeros((300_000, 3))
    assert as_floats(x, "x") is x
    for place in ((0, 0), (150_001, 2), (299_999, 1)):
        y = x.copy()
        y[place] = np.inf
        with pytest.raises(InvalidValueError, match=rf"\[{place[0]}, {place[1]}\]"):
            as_floats(y, "x")
    assert as_floats(np.zeros((1, 600_000)), "x").shape == (1, 600_000)


def test_stretches_cover_a_log_and_keep_its_recordings():
    q = np.arange(1000.0)[:, None]
    log = Log(0.01, q, -q, starts=(0, 430, 435))
    part = stretches(log, 50, 300)
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
    model, whole = rm.load("planar_2r"), recorded("planar_2r", 120_000, 0.01)
    assert check_joints(whole, model) == ()
    wrong = Log(DT, whole.q, whole.tau * [-1.0, 1.0])
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
    assert "110 samples from row 99950" in found[FindingKind.STUCK, ("2",)]
    assert (
        "1 sample of its position is an outlier (at row 150000)"
        in (found[FindingKind.SPIKES, ("1",)])
    )
    assert "at row 230000" in found[FindingKind.JUMP, ("1",)]
    assert (FindingKind.JUMP, ("2",)) not in found
