"""Signals of logs: filter, differences, edges, dead bands; equations at scale, in any pools."""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
import tracemalloc
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from identification_fleet import recorded

import robotmodels as rm
from robotmodels.identification import choose_processing, equations, reduce_equations
from robotmodels.identification.forms import EquationForm
from robotmodels.identification.signals import (
    central_differences,
    piece_signals,
    pieces,
    settling,
    signals,
    zero_phase,
)
from robotmodels.logs import Log
from robotmodels.minimal_parameters import base_parameters

DT = 0.001


def gain(frequency: float, cutoff: float, order: int) -> complex:
    """Amplitude and phase of a sine after the filter, by least squares on its middle."""
    t = DT * np.arange(max(int(40.0 / (min(frequency, cutoff) * DT)), 8000))
    inner = slice(len(t) // 4, 3 * len(t) // 4)
    wave = np.exp(2j * np.pi * frequency * t)
    sines = np.column_stack((wave.real, wave.imag))[inner]
    return complex(*np.linalg.lstsq(sines, zero_phase(wave.real, cutoff, DT, order)[inner])[0])


@pytest.mark.parametrize("order", [1, 2, 4, 6])
@pytest.mark.parametrize("cutoff", [2.0, 300.0])
def test_the_filter_is_at_minus_three_decibels_at_its_cutoff(order, cutoff):
    assert abs(gain(cutoff, cutoff, order) - np.sqrt(0.5)) < 1e-6  # real: no delay


def test_the_filter_passes_below_and_stops_above_and_keeps_lines_up_to_its_ends():
    assert abs(gain(5.0, 50.0, 4) - 1.0) < 1e-6
    # two passes of the fourth order: 48 dB an octave, and more by the bilinear transform
    assert abs(gain(100.0, 50.0, 4)) < 10.0 ** (-40.0 / 20.0)
    t = DT * np.arange(3000)
    line = np.column_stack((2.0 + 0.3 * t, -t))
    np.testing.assert_allclose(zero_phase(line, 10.0, DT), line, atol=1e-9)


@pytest.mark.parametrize("order", [1, 4])
def test_the_filter_forgets_samples_beyond_its_settling_time(order):
    x = np.random.default_rng(0).normal(size=8000)
    margin = settling(20.0, DT, order)
    whole, part = (zero_phase(y, 20.0, DT, order) for y in (x, x[2000:6000]))
    inner = slice(margin, 4000 - margin)
    assert np.abs(whole[2000:6000][inner] - part[inner]).max() < 1e-12
    assert np.abs(whole[2000:6000] - part).max() > 1e-3  # at the ends they count


@pytest.mark.parametrize("accuracy", [2, 4, 6])
def test_central_differences_have_their_order(accuracy):
    error = []
    for dt in (0.02, 0.01):
        t = dt * np.arange(int(4.0 / dt))
        off = np.abs(central_differences(np.sin(3.0 * t), dt, accuracy) - 3.0 * np.cos(3.0 * t))
        error.append(off[10:-10].max())
    assert abs(np.log2(error[0] / error[1]) - accuracy) < 0.05
    assert central_differences(np.array([1.0, 3.0]), 0.5, accuracy).tolist() == [4.0, 4.0]


def test_edges_are_cut_on_every_channel_of_every_recording():
    log = recorded("rx90", 12_000, dt=DT)
    log = Log(DT, log.q, log.tau, starts=(0, 1_000, 5_000))
    chosen = choose_processing(log, edges=0.75)
    found = signals(log, chosen)
    rows = np.concatenate((np.arange(1_750, 4_250), np.arange(5_750, 11_250)))
    np.testing.assert_allclose(found.t, DT * rows, rtol=1e-12)
    np.testing.assert_array_equal(found.tau, log.tau[rows])
    assert len(found.q) == len(found.v) == len(found.a) == len(rows)
    assert any("1 of 3 recordings (1000 samples) are not longer" in note for note in chosen.notes)


def test_dead_bands_are_four_standard_deviations_of_the_velocity_noise(rng):
    t = np.arange(0.0, 20.0, DT)[:, None]
    q, level = np.sin(2.0 * np.pi * 0.5 * t), 2e-3
    clean, noisy = (
        choose_processing(Log(DT, x, np.zeros_like(q)), cutoff=20.0)
        for x in (q, q + level * rng.normal(size=q.shape))
    )
    assert clean.dead_band[0] == pytest.approx(0.003 * np.pi, rel=0.05)
    density = level**2 * 2.0 * DT  # one-sided, of white noise
    spread = np.sqrt(density * (2.0 * np.pi) ** 2 * 20.0**3 / 3.0)
    assert noisy.dead_band[0] == pytest.approx(4.0 * spread, rel=0.1)


def test_samples_in_the_dead_band_take_no_part():
    log = recorded("rx90", 20_000, dt=DT)
    base = base_parameters(rm.load("rx90"), drive=("Fv", "Fc"))
    band = np.linspace(0.05, 0.3, log.n)
    chosen = choose_processing(log, decimation=1, dead_band=band)
    # and 0.3 periods of the cutoff on either side, over which the filter smears a reversal
    assert abs(chosen.guard * log.dt * chosen.cutoff - 0.3) <= log.dt * chosen.cutoff
    inside, blocks = 0, equations(base, log, chosen).blocks()
    for piece, block in zip(pieces(log, chosen), blocks, strict=True):
        found = piece_signals(log, chosen, piece, 0)
        slow = np.abs(np.concatenate((found.before, found.v, found.after))) < band
        near = [slow[max(k - chosen.guard, 0) : k + chosen.guard + 1] for k in range(len(slow))]
        near = np.array([rows.any(axis=0) for rows in near])
        first = len(found.before)
        np.testing.assert_array_equal(block.use, ~near[first : first + len(block)])
        inside += int((~block.use).sum())
    assert 0.02 * log.n * len(log) < inside < 0.9 * log.n * len(log)


def test_measured_velocities_are_taken_and_filtered_alike():
    log = recorded("rx90", 20_000, dt=DT)
    v = np.cos(np.arange(20_000.0))[:, None] * np.ones(log.n)
    chosen = choose_processing(log, cutoff=20.0)
    found = signals(Log(DT, log.q, log.tau, v=v), chosen)
    rows = slice(chosen.edges, len(log) - chosen.edges)
    np.testing.assert_allclose(found.v, zero_phase(v, 20.0, DT)[rows], atol=1e-12)
    raw = choose_processing(log, filtered=False, edges=0.1)
    np.testing.assert_array_equal(signals(Log(DT, log.q, log.tau, v=v), raw).v, v[100:-100])


# --- at scale -----------------------------------------------------------------------------------


@cache
def system(decimation: int = 5, name: str = "planar_2r", starts: tuple[int, ...] = (0, 40_123)):
    """Equations in more pieces than a window holds; two recordings."""
    log = recorded(name, 90_000, noise=0.01)
    log = Log(log.dt, log.q, log.tau, starts=starts)
    base = base_parameters(rm.load(name), drive=("Fv", "Fc"))
    return equations(base, log, choose_processing(log, decimation=decimation))


def bits(factors) -> bytes:
    counts = factors.counts.tobytes() + factors.left_out.tobytes()
    return b"".join(R.tobytes() for R in factors.factors) + counts


class Shuffled(Executor):
    """Begins some tasks late, so that others are done before them."""

    def __init__(self, pool):
        self.pool, self.number, self.lock = pool, 0, threading.Lock()

    def submit(self, fn, /, *args, **kwargs):
        with self.lock:
            self.number += 1
            wait = 0.01 * (self.number * 7 % 3)
        return self.pool.submit(lambda: (time.sleep(wait), fn(*args, **kwargs))[1])


def dask(stack):
    import distributed

    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    cluster = stack.enter_context(distributed.LocalCluster(processes=False, **options))
    return stack.enter_context(distributed.Client(cluster)).get_executor()


def processes(way):
    return lambda stack: ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(way))


@pytest.mark.nightly
@pytest.mark.parametrize(
    "pool",
    [
        lambda stack: Shuffled(stack.enter_context(ThreadPoolExecutor(1))),
        lambda stack: Shuffled(stack.enter_context(ThreadPoolExecutor(3))),
        processes("fork"),
        processes("spawn"),  # it imports the package
        dask,
    ],
)
def test_the_number_of_workers_and_their_order_change_no_bit(pool):
    whole = system()
    with ExitStack() as stack:
        executor = pool(stack)
        found = reduce_equations(whole, executor, window=6)
        executor.shutdown()
    assert bits(found) == bits(reduce_equations(whole))


@pytest.mark.nightly
def test_the_factor_is_that_of_all_equations():
    whole = system(decimation=7)
    factors = reduce_equations(whole)
    blocks = list(whole.blocks())
    weights = np.array([1.0, 3.0])
    R, y, rest = factors.stacked(weights)
    rows = np.vstack([
        w * np.column_stack((b.W[:, j], b.y[:, j]))[b.use[:, j]]
        for j, w in enumerate(weights)
        for b in blocks
    ])  # fmt: skip
    N = rows.T @ rows
    found = np.zeros_like(N)
    found[:-1, :-1], found[:-1, -1], found[-1, :-1] = R.T @ R, R.T @ y, R.T @ y
    found[-1, -1] = y @ y + rest
    size = np.sqrt(np.diag(N))
    np.testing.assert_allclose(found / np.outer(size, size), N / np.outer(size, size), atol=1e-12)
    assert factors.rows == len(rows)


@pytest.mark.nightly
def test_memory_is_that_of_a_piece_whatever_the_length():
    whole = system()
    peaks = []
    for repeats in (8, 24):  # the tree of merged pieces has its height
        logs = (whole.with_log(whole.log.rows(0, 40_000)) for _ in range(repeats))
        tracemalloc.start()
        reduce_equations(logs)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.02 * peaks[0]


@pytest.mark.nightly
def test_blocks_are_kept_as_far_as_memory_allows_of_their_log_and_choices_alone(monkeypatch):
    whole = system(4).cached()
    first = bits(reduce_equations(whole))
    assert bits(reduce_equations(whole)) == first
    fewer = whole.with_names(whole.names[1:])
    assert bits(reduce_equations(fewer)) == bits(reduce_equations(fewer.uncached()))
    log = whole.log
    table = replace(whole.model.table, d=2.0 * whole.model.table.d)
    base = base_parameters(whole.model.with_table(table), drive=whole.base.drive)
    assert base.names == whole.names
    others = {
        "base": base,
        "log": Log(log.dt, log.q, 2.0 * log.tau),
        "form": EquationForm.POWER,
        "processing": choose_processing(log, decimation=7),
    }
    for name, value in others.items():
        other = replace(whole, **{name: value})
        for kept, made in zip(other.blocks(), other.uncached().blocks(), strict=True):
            assert np.array_equal(kept.W, made.W)
            assert np.array_equal(kept.y, made.y)
    monkeypatch.setattr(sys.modules["robotmodels.identification.equations"], "_KEPT_BYTES", 10**6)
    some = system(4).cached()
    assert bits(reduce_equations(some)) == first
    assert 0 < some.cache.size <= 10**6
    assert some.with_log(some.log.rows(0, 20_000)).cache is None
