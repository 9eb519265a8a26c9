"""The budget of a search for an exciting trajectory, and what more of it would bring."""

import re
import subprocess
import sys
import time

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.identification.excitation import (
    ExcitationStatus,
    exciting_trajectory,
    problem,
    search,
)


def counted(monkeypatch):
    """Counts evaluations, and keeps the last problem."""
    seen = {"evaluations": 0, "work": 0.0}
    value = problem.ExcitationProblem.value

    def counting(self, x, stage):
        seen["evaluations"] += 1
        seen["work"] = self.work
        return value(self, x, stage)

    monkeypatch.setattr(problem.ExcitationProblem, "value", counting)
    return seen


@pytest.mark.parametrize("name", ["rx90", "panda"])
def test_the_budget_bounds_the_multiplications_of_any_robot(name, monkeypatch):
    budget = 7e8
    monkeypatch.setattr(search, "BUDGET", budget)
    seen = counted(monkeypatch)
    one = exciting_trajectory(rm.load(name), rng=0)
    assert 0.5 * budget < seen["evaluations"] * seen["work"] < 1.2 * budget
    assert len(one.starts) == 1
    assert one.status is ExcitationStatus.LIMIT_OF_ITERATIONS
    assert one.status.sentence.startswith("The limit on iterations or evaluations was")
    assert any("more iterations (iterations=" in note for note in one.notes)
    assert one.limits.kept
    assert one.condition < one.baseline_conditions[0]
    evaluations = seen["evaluations"]
    twice = exciting_trajectory(rm.load(name), rng=0, starts=2)
    assert seen["evaluations"] - evaluations == pytest.approx(2 * evaluations, rel=0.25)
    assert twice.condition <= one.condition


def test_long_evaluations_leave_fewer_starts_and_random_motions(monkeypatch):
    monkeypatch.setattr(search, "BUDGET", 2e8)
    found = exciting_trajectory(rm.load("ur10e"), rng=0)
    assert len(found.starts) == 1
    assert len(found.baseline) <= 8
    assert any("benefit of more starts cannot be estimated" in note for note in found.notes)
    assert found.limits.kept
    monkeypatch.setattr(search, "BUDGET", 3e10)
    again = exciting_trajectory(rm.load("planar_2r"), harmonics=2, rng=0)
    assert len(again.starts) == 8  # never more than these by default
    assert again.status is ExcitationStatus.CONVERGED


def test_iterations_that_are_asked_for_are_made(monkeypatch):
    monkeypatch.setattr(search, "BUDGET", 1e8)
    found = exciting_trajectory(rm.load("planar_2r"), starts=1, baseline=2, iterations=20, rng=0)
    assert found.starts[0].stages.tolist() == [20, 20, 20, 20]
    assert found.status is ExcitationStatus.LIMIT_OF_ITERATIONS


SCRIPT = """
import hashlib, sys
import robotmodels as rm
from robotmodels.identification.excitation import exciting_trajectory
found = exciting_trajectory(rm.load("rx90"), starts=1, baseline=3, iterations=10, rng=5)
print(hashlib.sha256(found.coefficients.tobytes()).hexdigest())
"""


def test_the_same_bits_with_any_number_of_threads(monkeypatch):
    seen = set()
    for threads in ("1", "2"):
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", threads)
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
        )
        seen.add(done.stdout)
    assert len(seen) == 1


def test_gain_of_twice_is_that_of_normal_values():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(4000, 16))
    promised = np.mean([search.gain_of_twice(row[:8]) for row in values])
    brought = np.mean(values[:, :8].min(axis=1) - values.min(axis=1))
    assert promised == pytest.approx(brought, rel=0.1)
    assert search.gain_of_twice(values[0, :1]) == 0.0


def told(found):
    """Percent that the notes promise of twice the budget."""
    (number,) = re.findall(r"lower the condition number by about (\S+) %", " ".join(found.notes))
    return float(number)


def test_twice_the_budget_brings_about_what_was_told():
    """On three robots, five searches each: what 8 starts found beyond their first 4."""
    promised, brought = [], []
    for name in ("planar_2r", "lab_trr", "cobra_s600"):
        for seed in range(5):
            options = {"harmonics": 3, "baseline": 8, "iterations": 60, "rng": seed}
            twice = exciting_trajectory(rm.load(name), starts=8, **options)
            ends = np.log([start.after.condition for start in twice.starts])
            assert told(twice) == pytest.approx(100.0 * search.gain_of_twice(ends), rel=0.06)
            promised.append(search.gain_of_twice(ends[:4]))
            brought.append(ends[:4].min() - ends.min())
    assert 0.25 * np.mean(promised) < np.mean(brought) < 4.0 * np.mean(promised)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "reached"), [("ur10e", 29.2), ("panda", 28.8), ("iiwa14", 37.8)])
def test_the_default_is_good_within_twenty_seconds(name, reached):
    start = time.process_time()
    found = exciting_trajectory(rm.load(name), rng=0)
    assert time.process_time() - start < 20.0
    assert found.limits.kept
    assert found.condition < 1.3 * reached
    assert found.condition < found.baseline_conditions[0]
    assert len(found.baseline) == 100
    assert 0.0 < told(found) < 20.0
