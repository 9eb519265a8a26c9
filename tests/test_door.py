"""The door: what `import robotmodels` costs, brings and promises."""

import importlib.metadata
import inspect
import re
import subprocess
import sys
from pathlib import Path

import robotmodels as rm

HEAVY = ("numba", "scipy", "sympy", "meshcat", "yourdfpy", "matplotlib", "example_robot_data")


def python(code):
    """What a fresh interpreter prints."""
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    ).stdout.strip()


def test_import_takes_less_than_0_6_s():
    # the clock counts what runs beside the test, the processor's time the threads of libraries
    code = (
        "from time import perf_counter as t, process_time as p; a, b = t(), p(); "
        "import robotmodels; print(min(t() - a, p() - b))"
    )
    python(code)  # warm-up: byte code is written and files are read into memory
    assert min(float(python(code)) for _ in range(5)) < 0.6


def test_import_brings_nothing_heavy():
    code = "import sys, robotmodels; print(*{m.partition('.')[0] for m in sys.modules})"
    assert not set(HEAVY) & set(python(code).split())


def test_every_name_of_the_door_exists():
    assert len(set(rm.__all__)) == len(rm.__all__)
    assert [name for name in rm.__all__ if not hasattr(rm, name)] == []


def test_version_is_the_installed_one():
    assert rm.__version__ == importlib.metadata.version("robotmodels")


def test_types_are_shipped():
    assert Path(rm.__file__).with_name("py.typed").is_file()


def public_functions():
    """(name, function, its docstring) of every function of the door."""
    for name in rm.__all__:
        function = getattr(rm, name)
        if inspect.isfunction(function):
            yield name, function, inspect.getdoc(function) or ""


def test_every_public_function_is_documented():
    problems = []
    for name, function, text in public_functions():
        expected = {"Examples"}
        if inspect.signature(function).parameters:
            expected.add("Parameters")
        if inspect.signature(function).return_annotation not in (None, "None"):
            expected.add("Returns")
        sections = set(re.findall(r"^(\w[\w ]*)\n-{3,}$", text, flags=re.MULTILINE))
        if "Yields" in sections:
            sections.add("Returns")
        missing = expected - sections
        if missing:
            problems.append(f"{name} lacks {', '.join(sorted(missing))}")
        if ">>>" not in text.partition("Examples\n")[2]:
            problems.append(f"{name} has no example that runs")
    assert problems == []


def test_every_public_function_states_the_shapes_of_its_arrays():
    """Beyond its first line it says shape, or gives one: ``(..., n)``."""
    problems = []
    for name, function, text in public_functions():
        entries = text.partition("Examples\n")[0].partition("\n")[2]
        has_arrays = any("Array" in str(a) for a in inspect.get_annotations(function).values())
        if has_arrays and not re.search(r"shape|\([^)]*[,.\d][^)]*\)", entries):
            problems.append(name)
    assert problems == []
