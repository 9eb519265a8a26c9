"""What makes identification quick and small: filters, kept blocks, parts of long logs."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt, welch

import robotmodels as rm
from robotmodels._arrays import as_floats
from robotmodels.errors import InvalidValueError
from robotmodels.identification import (
    EquationForm,
    check_joints,
    choose_processing,
    equations,
    fit,
)
from robotmodels.identification.equations import Equations
from robotmodels.identification.preparation.filters import settling, zero_phase
from robotmodels.identification.preparation.spectrum import power_density
from robotmodels.identification.scale.kept_equations import kept_equations, plain
from robotmodels.logs import FindingKind, Log, check_log
from robotmodels.logs.long_channels import Runs
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


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize("band", [0.003, 0.012, 0.1, 0.3, 0.49])
def test_zero_phase_is_that_of_scipy(order, band):
    x = np.random.default_rng(0).normal(size=(3000, 2)).cumsum(axis=0)
    wider = np.tan(np.pi * band) / (np.sqrt(2.0) - 1.0) ** (0.5 / order)
    sos = butter(order, 2.0 * np.arctan(wider) / np.pi, output="sos")
    poles = np.abs(np.concatenate([np.roots(row[3:]) for row in np.asarray(sos)]))
    assert settling(band, 1.0, order) == pytest.approx(
        np.log(1e-13) / np.log(poles.max()), abs=1.0, rel=1e-6
    )
    pad = min(settling(band, 1.0, order), len(x) - 1)
    expected = sosfiltfilt(sos, x, axis=0, padtype="odd", padlen=pad)
    # rounding grows with the memory of the filter, of either
    assert np.abs(zero_phase(x, band, 1.0, order) - expected).max() < 1e-10 * np.abs(x).max()


def test_zero_phase_takes_any_layout_and_leaves_its_input():
    x = np.random.default_rng(1).normal(size=(500, 3, 2))
    before = x.copy()
    whole = zero_phase(x, 20.0, DT)
    assert np.array_equal(x, before)
    assert whole.shape == x.shape
    assert np.array_equal(zero_phase(np.asfortranarray(x), 20.0, DT), whole)
    assert np.array_equal(zero_phase(x[:, 1, 1], 20.0, DT), whole[:, 1, 1])
    assert zero_phase(np.ones((4, 0)), 20.0, DT).shape == (4, 0)
    assert np.allclose(zero_phase([3.0, 3.0], 20.0, DT), 3.0)
    zero_phase(x, 20.0, DT, 4)
    with pytest.raises(InvalidValueError, match="order"):
        zero_phase(x, 20.0, DT, 4.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("length", [2, 3, 256, 257, 1000, 1001])
def test_spectrum_is_that_of_scipy(length):
    x = np.random.default_rng(0).normal(size=(1001, 3)).cumsum(axis=0)
    f, P = welch(x, 50.0, nperseg=length, detrend="constant", axis=0)
    own, density = power_density(x, 50.0, length)
    assert np.allclose(own, f, rtol=1e-14, atol=0.0)
    assert np.abs(density - P).max() < 1e-12 * P.max()


def test_a_fit_does_not_import_scipy_signal():
    code = (
        "import sys, numpy as np, robotmodels as rm; from robotmodels.logs import Log\n"
        "from robotmodels.identification import fit\n"
        "m = rm.load('planar_2r'); t = 0.01 * np.arange(3000)[:, None] * [1.0, 2.3]\n"
        "q, v, a = np.sin(t), [1.0, 2.3] * np.cos(t), -np.array([1.0, 5.29]) * np.sin(t)\n"
        "fit(m, Log(0.01, q, rm.idm(m, q, v, a) + v), drive=('Fv',))\n"
        "sys.exit('scipy.signal' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("form", list(EquationForm))
def test_kept_blocks_are_those_that_are_made_again(form):
    log = recorded("planar_2r", 40_000, 0.01)
    base = base_parameters(rm.load("planar_2r"), drive=("Fv", "Fc"))
    system = equations(base, log, choose_processing(log, decimation=20), form)
    made = list(system.blocks())
    assert len(made) > 2
    size = sum(x.nbytes for x in (made[0].t, made[0].W, made[0].y, made[0].use, made[0].v))
    for most in (0, size, 2**25):
        kept = kept_equations(system, most)
        fewer = kept.with_names((system.names[3], system.names[0]))
        for _ in range(2):
            for one, other, few in zip(made, kept.blocks(), fewer.blocks(), strict=True):
                for name in ("t", "W", "y", "use", "v"):
                    assert np.array_equal(getattr(one, name), getattr(other, name))
                assert np.array_equal(few.W, one.W[:, :, [3, 0]])
                assert few.W.flags.c_contiguous
        assert len(kept.store.blocks) == {0: 0, size: 1}.get(most, len(made))
        assert kept.store.size <= most


def test_kept_blocks_are_of_their_log_and_choices_alone():
    log = recorded("planar_2r", 8_000, 0.01)
    base = base_parameters(rm.load("planar_2r"), drive=("Fv", "Fc"))
    kept = kept_equations(equations(base, log, choose_processing(log)))
    (block,) = kept.blocks()
    other = Log(DT, log.q, 2.0 * log.tau)
    (doubled,) = replace(kept, log=other).blocks()
    assert np.allclose(doubled.y, 2.0 * block.y)
    (thinner,) = replace(kept, processing=choose_processing(log, decimation=7)).blocks()
    assert len(thinner) == len(next(plain(replace(kept, processing=choose_processing(
        log, decimation=7))).blocks()))  # fmt: skip
    (powers,) = replace(kept, form=EquationForm.POWER).blocks()
    assert powers.W.shape[1] == 1
    copy = pickle.loads(pickle.dumps(kept))
    assert type(copy) is Equations
    assert np.array_equal(next(copy.blocks()).W, block.W)


def test_a_result_keeps_no_blocks():
    log = recorded("planar_2r", 8_000, 0.01)
    found = fit(rm.load("planar_2r"), log, drive=("Fv", "Fc"))
    assert type(found.system) is Equations
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


def test_runs_are_found_whatever_the_pieces():
    rng = np.random.default_rng(3)
    for _ in range(300):
        same = rng.random(rng.integers(0, 30)) < rng.random()
        runs = Runs(2)
        for part in np.split(same, sorted(rng.integers(0, len(same) + 1, 3))):
            runs.add(part)
        steps = np.diff(np.concatenate([[0], same.astype(int), [0]]))
        pairs = zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True)
        assert runs.ended() == [(a, b) for a, b in pairs if b - a >= 2]


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
