"""What figures were measured on: processor, system, versions, load."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import robotmodels as rm

OWN = ("pin", "numpy", "numba", "scipy")


def machine(
    packages: Iterable[str] = (), interpreters: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Facts by name, for the head of a table.

    Parameters
    ----------
    packages
        Distributions to tell the versions of, besides those that robotmodels stands on.
    interpreters
        Distribution and the Python that has it, where that is another one; an empty path says that
        none was named.
    """
    facts = {
        "cpu": processor(),
        "system": platform.system(),
        "python": platform.python_version(),
        "robotmodels": rm.__version__,
    }
    facts |= {name: installed(name) or "not installed" for name in (*OWN, *packages)}
    for name, python in (interpreters or {}).items():
        facts[name] = (installed_for(python, name) if python else None) or "left out"
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "not set")
    return facts | {"OPENBLAS_NUM_THREADS": threads, "load": f"{load()} when the run began"}


def processor() -> str:
    """The name of the processor."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        if names:
            return names[0].partition(":")[2].strip()
    return platform.processor() or platform.machine()


BUSY = 1.0
"""A load above this when a run begins is warned of."""


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


def installed(package: str) -> str | None:
    """Version of a distribution, None where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def installed_for(python: str, package: str) -> str | None:
    """Version of a distribution that another Python has, None where it has none."""
    code = f"from importlib.metadata import version; print(version({package!r}))"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def head(title: str, facts: Mapping[str, str]) -> list[str]:
    """The first lines of a table of results."""
    return [f"# {title}", "", *(f"- {name}: {value}" for name, value in facts.items()), ""]
