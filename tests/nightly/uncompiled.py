"""pytest plugin for the leg that runs kernels as plain Python, so that their lines are counted.

Plain Python takes some hundred times longer: a test that is not done after ``LONGEST`` seconds of
the processor is given up, and what it has run by then counts. Of a test with many sets of
parameters ``SETS`` are run, evenly chosen from first to last (default: all). Whether results are
right is told by the ordinary runs; a test that fails here fails as anywhere.
"""

import os
import signal
from collections.abc import Iterator
from types import FrameType

import pytest
from hypothesis import settings

LONGEST = float(os.environ.get("LONGEST", "20"))
SETS = int(os.environ.get("SETS", "0"))

settings.register_profile(
    "few", max_examples=3, deadline=None, derandomize=True, database=None, print_blob=True
)
os.environ["HYPOTHESIS_PROFILE"] = "few"


def _give_up(number: int, frame: FrameType | None) -> None:
    # coverage holds a lock where it takes note of a file, which no exception may break off
    inner = frame
    while inner is not None and f"{os.sep}_pytest{os.sep}" not in inner.f_code.co_filename:
        if f"{os.sep}coverage{os.sep}" in inner.f_code.co_filename:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.01)
            return
        inner = inner.f_back
    pytest.skip(f"not done after {LONGEST:.0f} s without compilation")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep so many sets of parameters of each test."""
    if not SETS:
        return
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    kept = {
        id(sets[round(k * (len(sets) - 1) / max(min(SETS, len(sets)) - 1, 1))])
        for sets in tests.values()
        for k in range(min(SETS, len(sets)))
    }
    config.hook.pytest_deselected(items=[item for item in items if id(item) not in kept])
    items[:] = [item for item in items if id(item) in kept]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Call the test, for as long as it may take."""
    before = signal.signal(signal.SIGVTALRM, _give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
    try:
        return (yield)
    except ZeroDivisionError:
        # infinity in a kernel, where the test goes on; only counting may stop at it
        if not SETS:
            raise
        pytest.skip("divides by zero, which is an error in plain Python alone")
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
