"""The door: what `import robotmodels` costs, brings and promises."""

import importlib.metadata
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import robotmodels as rm

HEAVY = ("numba", "scipy", "sympy", "meshcat", "yourdfpy", "matplotlib", "example_robot_data")
FUNCTIONS = [name for name in rm.__all__ if inspect.isfunction(getattr(rm, name, None))]


def python(code):
    """What a fresh interpreter, started outside the checkout's warnings filter, prints."""
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    ).stdout.strip()


def test_import_takes_less_than_0_6_s():
    code = "from time import perf_counter as t; a = t(); import robotmodels; print(t() - a)"
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


@pytest.mark.parametrize("name", FUNCTIONS)
def test_public_function_is_documented(name):
    function = getattr(rm, name)
    text = inspect.getdoc(function) or ""
    sections = set(re.findall(r"^(\w[\w ]*)\n-{3,}$", text, flags=re.MULTILINE))
    expected = {"Examples"}
    if inspect.signature(function).parameters:
        expected.add("Parameters")
    if inspect.signature(function).return_annotation not in (None, "None"):
        expected.add("Returns")
    assert expected <= sections, f"rm.{name} lacks the sections {sorted(expected - sections)}"
    assert ">>>" in text.partition("Examples\n")[2], f"the example of rm.{name} does not run"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_public_function_states_the_shapes_of_its_arrays(name):
    """An array's entry gives its shape, ``(..., n)``, or says shape in words."""
    function = getattr(rm, name)
    text = inspect.getdoc(function) or ""
    described = "\n".join(text.split("Examples\n")[0].splitlines()[1:])
    arrays = [a for a in inspect.get_annotations(function).values() if "Array" in str(a)]
    assert not arrays or "shape" in described or re.search(r"\([^)]*[,.\d][^)]*\)", described), (
        f"rm.{name} takes or returns arrays and gives no shape"
    )
