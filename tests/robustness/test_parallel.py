"""Threads and processes give the numbers of one thread, bit for bit, first calls among them."""

import json
import multiprocessing
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from robustness.parallel_work import WORK, everything, models_of_motion, robots

pytestmark = pytest.mark.nightly

THREADS = 8
TESTS = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def models():
    return robots()


@pytest.fixture(scope="module")
def jobs(models):
    return [(work.__name__, model, 1) for work in WORK for model in models]


@pytest.fixture(scope="module")
def alone(jobs):
    return [everything(*job) for job in jobs]


def test_the_work_tells_robots_and_states_apart(alone, models):
    # a digest that is always the same would prove nothing
    assert len(set(alone)) == len(alone)
    assert models_of_motion(models[0], 1) != models_of_motion(models[0], 2)


def test_threads_with_mixed_robots_give_the_numbers_of_one(jobs, alone):
    # every job several times, neighbours of different kind and robot
    order = np.random.default_rng(0).permutation(np.repeat(np.arange(len(jobs)), 3))
    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(lambda k: everything(*jobs[k]), order))
    assert found == [alone[k] for k in order]


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_processes_give_the_numbers_of_one(jobs, alone, method, monkeypatch):
    # a spawned process imports this folder anew
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(TESTS), str(TESTS.parent)]))
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        found = list(pool.map(everything, *zip(*jobs, strict=True), timeout=120.0))
    assert found == alone


FIRST = """
import json, sys, threading
from concurrent.futures import ThreadPoolExecutor
from robustness.parallel_work import WORK, everything
import robotmodels as rm
barrier = threading.Barrier(8)
model = rm.load("rx90")
model = model.with_inertia(rm.uniform_bodies(model, 4.0))
def first(k):
    barrier.wait()  # all at once: lazy imports, caches and compiled kernels are raced for
    return everything(WORK[k % len(WORK)].__name__, model, 1)
with ThreadPoolExecutor(8) as pool:
    print(json.dumps(list(pool.map(first, range(8)))))
"""


def test_a_first_call_from_many_threads_at_once(models):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    done = subprocess.run(
        [sys.executable, "-c", FIRST], env=environment, capture_output=True, text=True,
        timeout=300.0, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    wanted = [everything(WORK[k % len(WORK)].__name__, models[0], 1) for k in range(THREADS)]
    assert json.loads(done.stdout) == wanted
