"""Identification at scale: the same bits for any workers, few pieces at a time, many logs."""

from __future__ import annotations

import multiprocessing
import pickle
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
from identification_logs import recorded

import robotmodels as rm
from robotmodels.estimation.linear import weighted
from robotmodels.identification import choose_processing, equations, reduce_equations
from robotmodels.identification.forms import EquationForm
from robotmodels.logs import Log
from robotmodels.minimal_parameters import base_parameters

pytestmark = pytest.mark.nightly


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


@pytest.mark.parametrize(
    "pool",
    [
        lambda stack: Shuffled(stack.enter_context(ThreadPoolExecutor(1))),
        lambda stack: Shuffled(stack.enter_context(ThreadPoolExecutor(3))),
        processes("fork"),
        pytest.param(processes("spawn"), marks=pytest.mark.nightly),  # it imports the package
        pytest.param(dask, marks=pytest.mark.nightly),
    ],
)
def test_the_number_of_workers_and_their_order_change_no_bit(pool):
    whole = system()
    with ExitStack() as stack:
        executor = pool(stack)
        found = reduce_equations(whole, executor, window=6)
        executor.shutdown()
    assert bits(found) == bits(reduce_equations(whole))


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


@pytest.mark.parametrize("cutoff", [None, 20.0])
def test_pieces_give_what_one_pass_gives(cutoff, monkeypatch):
    """The whole recording in one piece: filter, differences, decimation, factor."""
    whole = system(4, starts=(0,))
    log = whole.log.rows(0, 60_000)
    cut = equations(whole.base, log, choose_processing(log, decimation=4, cutoff=cutoff))
    in_pieces, blocks = reduce_equations(cut), list(cut.blocks())
    assert len(blocks) > 3
    signals = sys.modules["robotmodels.identification.signals"]
    for name in ("PIECE", "_INSTANTS"):
        monkeypatch.setattr(signals, name, 10**9)
    (block,) = cut.blocks()
    for name in ("W", "y", "v"):
        one = getattr(block, name)
        found = np.concatenate([getattr(part, name) for part in blocks])
        np.testing.assert_allclose(found, one, rtol=0, atol=1e-9 * abs(one).max())
    a, b = weighted(in_pieces), weighted(reduce_equations(cut))
    np.testing.assert_allclose(a.values, b.values, rtol=1e-9, atol=1e-9 * abs(b.values).max())


def test_memory_is_that_of_a_piece_whatever_the_length():
    whole = system()
    peaks = []
    for repeats in (2, 12):
        logs = (whole.with_log(whole.log.rows(0, 40_000)) for _ in range(repeats))
        tracemalloc.start()
        reduce_equations(logs)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.02 * peaks[0]


def test_blocks_are_kept_as_far_as_memory_allows_of_their_log_and_choices_alone(monkeypatch):
    whole = system(4).cached()
    first = bits(reduce_equations(whole))
    assert len(whole.cache.blocks) == len(whole.pieces())
    assert next(whole.blocks()) is next(whole.blocks())
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
    assert pickle.loads(pickle.dumps(whole)).cache is None
    monkeypatch.setattr(sys.modules["robotmodels.identification.equations"], "_KEPT_BYTES", 10**6)
    some = system(4).cached()
    assert bits(reduce_equations(some)) == first
    assert 0 < some.cache.size <= 10**6
    assert some.with_log(some.log.rows(0, 20_000)).cache is None
