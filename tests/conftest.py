"""What every test shares: the hypothesis profiles and a seeded generator."""

import os

# tests run beside each other: threads of the linear algebra would wait for one another, which
# takes longer than the small matrices here. Read when NumPy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import settings

# Ordinary runs are short and always draw the same examples; HYPOTHESIS_PROFILE=thorough searches
# further, with new examples each time.
settings.register_profile(
    "quick", max_examples=25, deadline=None, derandomize=True, database=None, print_blob=True
)
settings.register_profile("thorough", max_examples=1000, deadline=None, print_blob=True)
# programs of their own: planted faults, an oracle made with a peer
collect_ignore = ["nightly", "oracles/make_kinodynamic.py"]
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


def pytest_configure(config):
    """Let the workers of a run compile the kernels together, each beginning at another one.

    What one worker has compiled the others find on the disk.
    """
    worker = getattr(config, "workerinput", None)
    if worker is None or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return
    from robotmodels.kernels.prepare import compile_module, kernel_modules

    names = kernel_modules()
    first = int(worker["workerid"].removeprefix("gw")) * len(names) // worker["workercount"]
    for name in names[first:] + names[:first]:
        compile_module(name)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Leave all but some of the parameters of tests marked ``sampled`` to the nightly run."""
    tests = {}
    for item in items:
        if item.get_closest_marker("sampled"):
            tests.setdefault(item.nodeid.split("[")[0], []).append(item)
    for cases in tests.values():
        count = cases[0].get_closest_marker("sampled").args[0]
        kept = {(2 * k + 1) * len(cases) // (2 * count) for k in range(count)}
        for k, item in enumerate(cases):
            if k not in kept:
                item.add_marker(pytest.mark.nightly)


@pytest.fixture
def rng():
    return np.random.default_rng(0)
