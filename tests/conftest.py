"""What every test shares: the hypothesis profiles and a seeded generator."""

import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

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
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


def pytest_configure(config):
    """Let the workers of a run compile the kernels together, each beginning at another one.

    They compile when their modules are imported, minutes in a fresh clone, and what one worker has
    compiled the others find on the disk. Without this all import everything in the same order.
    """
    worker = getattr(config, "workerinput", None)
    if worker is None:
        return
    package = Path(find_spec("robotmodels").origin).parent
    names = [
        ".".join(path.relative_to(package.parent).with_suffix("").parts)
        for path in sorted(package.rglob("*.py"))
        if "_compile import" in path.read_text(encoding="utf-8")
    ]
    first = int(worker["workerid"].removeprefix("gw")) * len(names) // worker["workercount"]
    for name in names[first:] + names[:first]:
        import_module(name)


@pytest.fixture
def rng():
    return np.random.default_rng(0)
