"""What figures were measured on: processor, system, versions, load."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import robotmodels as rm

OWN = ("pin", "numpy", "numba", "scipy")
BUSY = 1.0
"""A load above this when a run begins is warned of."""


def machine(
    packages: Iterable[str] = (), interpreters: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Facts by name; versions of distributions, also of other Pythons (distribution: its path)."""
    facts = {
        "cpu": processor(),
        "system": platform.system(),
        "python": platform.python_version(),
        "robotmodels": rm.__version__,
    }
    facts |= {name: version(sys.executable, name) or "not installed" for name in (*OWN, *packages)}
    for name, python in (interpreters or {}).items():
        facts[name] = (version(python, name) if python else None) or "left out"
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "not set")
    return facts | {"OPENBLAS_NUM_THREADS": threads, "load": f"{load()} when the run began"}


def processor() -> str:
    """The name of the processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def too_busy() -> str:
    """A warning where others are at work on the machine, else empty."""
    if hasattr(os, "getloadavg") and os.getloadavg()[0] > BUSY:
        return f"others were at work when the run began (load {load()}): times are too long"
    return ""


def load() -> str:
    """How busy the machine is."""
    if not hasattr(os, "getloadavg"):
        return "load is not told here"
    return f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def version(python: str, package: str) -> str | None:
    """Version of a distribution that a Python has, None where it has none."""
    code = f"from importlib.metadata import version; print(version({package!r}))"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def head(title: str, facts: Mapping[str, str]) -> list[str]:
    """The first lines of a table of results."""
    return [f"# {title}", "", *(f"- {name}: {value}" for name, value in facts.items()), ""]
