"""Identification at scale: the same bits for any workers, few pieces at a time, many logs."""

from __future__ import annotations

import multiprocessing
import threading
import time
import tracemalloc
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import cache
from importlib import import_module

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.estimation.covariance import correlated_covariance
from robotmodels.estimation.factor import merged
from robotmodels.estimation.linear import weighted
from robotmodels.identification import choose_processing, equations, reduce_equations
from robotmodels.identification.forms import EquationForm
from robotmodels.identification.signals import piece_signals, slice_with_margin
from robotmodels.logs import Log
from robotmodels.logs.log import RefusedRows
from robotmodels.minimal_parameters import base_parameters

DT = 0.002


def recorded(name: str, N: int, seed: int, noise: float = 0.0) -> Log:
    """A log of a robot that moves with a few frequencies, all joints."""
    model = rm.load(name)
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)[:, None]
    q, v, a = (np.zeros((N, model.n)) for _ in range(3))
    for f in (0.11, 0.23, 0.37, 0.59):
        w = 2.0 * np.pi * f
        s, c = rng.normal(size=(2, model.n)) * 0.5
        q += s * np.sin(w * t) + c * np.cos(w * t)
        v += w * (s * np.cos(w * t) - c * np.sin(w * t))
        a -= w**2 * (s * np.sin(w * t) + c * np.cos(w * t))
    tau = rm.idm(model, q, v, a) + 0.1 * v + noise * rng.normal(size=q.shape)
    return Log(DT, q, tau)


@cache
def system(form: EquationForm = EquationForm.TORQUE, decimation: int = 5, name: str = "planar_2r"):
    """Equations in more pieces than a window holds; two recordings."""
    log = recorded(name, 90_000, 0, 0.01)
    log = replace_starts(log, (0, 40_123))
    base = base_parameters(rm.load(name), drive=("Fv", "Fc"))
    chosen = choose_processing(log, decimation=decimation)
    return equations(base, log, chosen, form)


def replace_starts(log: Log, starts: tuple[int, ...]) -> Log:
    return Log(log.dt, log.q, log.tau, starts=starts)


def bits(factors) -> bytes:
    counts = factors.counts.tobytes() + factors.left_out.tobytes()
    return b"".join(R.tobytes() for R in factors.factors) + counts


@pytest.mark.parametrize("workers", [1, 2, 3, 4])
def test_the_number_of_workers_and_their_order_change_no_bit(workers):
    whole = system()
    here = bits(reduce_equations(whole))
    with ThreadPoolExecutor(workers) as pool:
        assert bits(reduce_equations(whole, Shuffled(pool), window=workers + 3)) == here


class Shuffled(Executor):
    """Begins some tasks late, so that others are done before them."""

    def __init__(self, pool):
        self.pool, self.number, self.lock = pool, 0, threading.Lock()

    def submit(self, fn, /, *args, **kwargs):
        with self.lock:
            self.number += 1
            wait = 0.01 * (self.number * 7 % 3)
        return self.pool.submit(lambda: (time.sleep(wait), fn(*args, **kwargs))[1])


@pytest.mark.parametrize(
    "way", ["fork", pytest.param("spawn", marks=pytest.mark.slow)]
)  # a spawned process imports the package
def test_processes_give_the_same_bits(way):
    whole = system()
    here = bits(reduce_equations(whole))
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(way)) as pool:
        assert bits(reduce_equations(whole, pool)) == here


@pytest.mark.slow
@pytest.mark.parametrize("processes", [False, True])
def test_a_dask_cluster_gives_the_same_bits(processes):
    import distributed

    whole = system()
    here = bits(reduce_equations(whole))
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=processes, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
        client.get_executor() as pool,
    ):  # fmt: skip
        assert bits(reduce_equations(whole, pool)) == here


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


def test_fewer_equations_than_parameters_and_columns_of_zeros():
    model = rm.load("rx90")
    log = recorded("rx90", 400, 1)
    whole = equations(base_parameters(model), log, choose_processing(log, decimation=50, edges=0))
    block = whole.block(whole.pieces()[0])
    factors = reduce_equations(whole)
    for j, R in enumerate(factors.factors):
        rows = np.column_stack((block.W[:, j], block.y[:, j]))[block.use[:, j]]
        scale = max(float(abs(rows.T @ rows).max()), 1e-300)
        np.testing.assert_allclose(R.T @ R / scale, rows.T @ rows / scale, atol=1e-13)


def test_a_task_has_the_rows_of_its_slice_with_margin():
    whole = system()
    told = RefusedRows("a.csv", tuple(range(1000)), "NaN")
    log = Log(DT, whole.log.q, whole.log.tau, v=whole.log.q, refused=[told], notes=["long"])
    chosen = whole.processing
    for piece in whole.pieces():
        alone, moved = slice_with_margin(log, chosen, piece)
        assert np.shares_memory(alone.q, log.q)
        assert (alone.refused, alone.notes) == ((), ())
        assert len(alone) < (piece.stop - piece.start) + 2 * 16384
        one = piece_signals(log, chosen, piece, chosen.reach)
        other = piece_signals(alone, chosen, moved, chosen.reach)
        for name in ("q", "v", "a", "tau"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


class Counting(Executor):
    """Does tasks when they are asked for, and counts those that wait."""

    def __init__(self, fails_at=None):
        self.waiting, self.most, self.done, self.cancelled = 0, 0, 0, 0
        self.fails_at = fails_at

    def submit(self, fn, /, *args, **kwargs):
        self.waiting += 1
        self.most = max(self.most, self.waiting)
        return Later(self, lambda: fn(*args, **kwargs))


class Later(Future):
    def __init__(self, owner, work):
        super().__init__()
        self.owner, self.work = owner, work

    def result(self, timeout=None):
        self.owner.waiting -= 1
        self.owner.done += 1
        if self.owner.done == self.owner.fails_at:
            raise RuntimeError("a worker died")
        return self.work()

    def cancel(self):
        self.owner.cancelled += 1
        return super().cancel()


def test_no_more_pieces_wait_than_the_window():
    whole = system(decimation=1)
    pieces = len(whole.pieces())
    pool = Counting()
    assert bits(reduce_equations(whole, pool, window=4)) == bits(reduce_equations(whole))
    assert (pool.most, pool.done, pool.cancelled) == (4, pieces, 0)
    assert pieces > 20


def test_after_an_error_what_waits_is_cancelled():
    pool = Counting(fails_at=3)
    with pytest.raises(RuntimeError, match="a worker died"):
        reduce_equations(system(decimation=1), pool, window=5)
    assert pool.cancelled == 4
    with pytest.raises(InvalidValueError, match="window"):
        reduce_equations(system(), pool, window=0)


def test_progress_never_falls_and_ends_at_one():
    whole = system()
    logs = [whole, whole.with_log(whole.log.rows(0, 50_000)), whole]
    with ThreadPoolExecutor(2) as pool:
        for executor in (None, pool):
            told: list[float] = []
            reduce_equations(logs, executor, told.append)
            assert len(told) == sum(len(part.pieces()) for part in logs)
            assert (np.diff(told) > 0.0).all()
            assert told[-1] == 1.0
            told.clear()
            reduce_equations(iter(logs), executor, told.append)
            assert told == [1.0]


def test_files_opened_one_at_a_time_give_what_merging_gives():
    whole = system()
    base, chosen = whole.base, whole.processing
    opened: list[int] = []

    def files():
        for seed in range(4):
            opened.append(seed)
            yield equations(base, recorded("planar_2r", 30_000, seed, 0.01), chosen)

    one = reduce_equations(files())
    assert opened == [0, 1, 2, 3]
    parts = [reduce_equations(part) for part in files()]
    other = merged(merged(parts[3], parts[1]), merged(parts[0], parts[2]))
    a, b = weighted(one), weighted(other)
    np.testing.assert_allclose(a.values, b.values, rtol=1e-9, atol=1e-9 * abs(b.values).max())
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9, atol=1e-18)
    assert (one.counts == other.counts).all()
    with ThreadPoolExecutor(2) as pool:
        assert bits(reduce_equations(files(), pool)) == bits(one)


@pytest.mark.parametrize("cutoff", [None, 20.0])
def test_pieces_give_what_one_pass_gives(cutoff, monkeypatch):
    """The whole recording in one piece: filter, differences, decimation, factor."""
    whole = system(decimation=4)
    log = replace_starts(whole.log.rows(0, 60_000), (0,))
    chosen = choose_processing(log, decimation=4, cutoff=cutoff)
    cut = equations(whole.base, log, chosen)
    in_pieces, blocks = reduce_equations(cut), list(cut.blocks())
    assert len(blocks) > 3
    module = import_module("robotmodels.identification.signals")
    monkeypatch.setattr(module, "PIECE", 10**9)
    monkeypatch.setattr(module, "_INSTANTS", 10**9)
    (block,) = cut.blocks()
    for name in ("W", "y", "v"):
        one = getattr(block, name)
        found = np.concatenate([getattr(part, name) for part in blocks])
        np.testing.assert_allclose(found, one, rtol=0, atol=1e-9 * abs(one).max())
    a, b = weighted(in_pieces), weighted(reduce_equations(cut))
    np.testing.assert_allclose(a.values, b.values, rtol=1e-9, atol=1e-9 * abs(b.values).max())


def test_logs_that_do_not_belong_together_are_refused():
    first = system()
    with pytest.raises(InvalidValueError, match="same parameters"):
        reduce_equations([first, system(name="rx90", decimation=25)])
    with pytest.raises(InvalidValueError, match="got none"):
        reduce_equations([])


def test_memory_is_that_of_a_piece_whatever_the_length():
    base = base_parameters(rm.load("planar_2r"), drive=("Fv", "Fc"))
    whole = system()
    peaks = []
    for repeats in (2, 12):
        logs = (
            equations(base, whole.log.rows(0, 40_000), whole.processing) for _ in range(repeats)
        )
        tracemalloc.start()
        reduce_equations(logs)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.02 * peaks[0]


def test_covariance_does_not_depend_on_pieces(monkeypatch):
    whole = system(decimation=4)
    part = whole.with_log(replace_starts(whole.log.rows(0, 30_000), (0,)))
    rng = np.random.default_rng(8)
    b = len(part.names)
    given = rng.normal(size=b), np.array([1.0, 2.0]), np.eye(b)
    once = correlated_covariance(part, *given)
    monkeypatch.setattr(import_module("robotmodels.identification.signals"), "PIECE", 900)
    assert len(part.pieces()) > 20
    again = correlated_covariance(part, *given)
    assert again.lags == once.lags
    np.testing.assert_allclose(again.covariance, once.covariance, rtol=1e-9)
    np.testing.assert_allclose(again.correlation, once.correlation, rtol=1e-9)


def test_blocks_are_kept_as_far_as_memory_allows(monkeypatch):
    whole = system(decimation=4).cached()
    first = bits(reduce_equations(whole))
    assert len(whole.cache.blocks) == len(whole.pieces())
    assert bits(reduce_equations(whole)) == first
    fewer = whole.with_names(whole.names[1:])
    assert bits(reduce_equations(fewer)) == bits(reduce_equations(fewer.uncached()))
    monkeypatch.setattr(import_module("robotmodels.identification.equations"), "_KEPT_BYTES", 10**6)
    some = system(decimation=4).cached()
    assert bits(reduce_equations(some)) == first
    assert 0 < some.cache.size <= 10**6
    assert some.with_log(some.log.rows(0, 20_000)).cache is None
