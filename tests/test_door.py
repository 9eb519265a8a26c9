"""The door: what `import robotmodels` costs, brings and promises."""

import importlib.metadata
import inspect
import re
import subprocess
import sys

import robotmodels as rm

HEAVY = ("numba", "scipy", "sympy", "meshcat", "yourdfpy", "matplotlib", "example_robot_data")


def python(code):
    """What a fresh interpreter prints."""
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    ).stdout.strip()


def test_import_brings_nothing_heavy():
    code = "import sys, robotmodels; print(*{m.partition('.')[0] for m in sys.modules})"
    assert not set(HEAVY) & set(python(code).split())


def test_version_is_the_installed_one():
    assert rm.__version__ == importlib.metadata.version("robotmodels")


def public_functions():
    """(name, function, its docstring) of every function of the door."""
    for name in rm.__all__:
        function = getattr(rm, name)
        if inspect.isfunction(function):
            yield name, function, inspect.getdoc(function) or ""


def test_every_public_function_states_the_shapes_of_its_arrays():
    """Beyond its first line it says shape, or gives one: ``(..., n)``."""
    problems = []
    for name, function, text in public_functions():
        entries = text.partition("Examples\n")[0].partition("\n")[2]
        has_arrays = any("Array" in str(a) for a in inspect.get_annotations(function).values())
        if has_arrays and not re.search(r"shape|\([^)]*[,.\d][^)]*\)", entries):
            problems.append(name)
    assert problems == []
