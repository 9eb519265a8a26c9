"""One run over the works that were asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from benchmarks.foreign import Foreign
from benchmarks.kept import keep
from benchmarks.machine import load, machine, too_busy
from benchmarks.side_by_side import report
from benchmarks.side_by_side.works import PACKAGES, Settings, Tool, measured, module


def run(
    wanted: Sequence[tuple[str, str]],
    settings: Settings,
    figaroh: str = "",
    pybotics: str = "",
    out: Path | None = None,
) -> None:
    """Measure, print and keep the results.

    Parameters
    ----------
    wanted
        File and name of each row.
    settings
        How much is measured.
    figaroh, pybotics
        The interpreters that have them, where there are such.
    out
        Folder for ``peers.json`` and ``peers.md``.
    """
    absent = [f"{tool.value} ({name})" for tool, (name, _) in PACKAGES.items() if not module(tool)]
    interpreters = {"figaroh": figaroh, "pybotics": pybotics}
    with ExitStack() as stack:
        for tool, python in ((Tool.FIGAROH, figaroh), (Tool.PYBOTICS, pybotics)):
            word = tool.value.lower()
            why: str | None = f"--{word}-python names no Python"
            if python:
                peer = stack.enter_context(Foreign(tool.value, python, f"{word}_turns.py"))
                why = peer.start()
                if why is None:
                    settings = replace(settings, **{word: peer})
            if why is not None:
                absent.append(f"{tool.value} ({why})")
        if not settings.slow and module(Tool.SSIK) and "general_6r" in [row for _, row in wanted]:
            absent.append("ssik's preparation of a new general arm (minutes: --slow)")
        for line in absent:
            print(f"left out: {line}")
        facts = machine([name for name, _ in PACKAGES.values()], interpreters)
        facts["run"] = "quick: smaller batches, three rounds" if settings.quick else "full"
        warning = too_busy()
        if warning:
            facts["warning"] = warning
            print(f"warning: {warning}", file=sys.stderr)
        rows = []
        for part, name in wanted:
            works = importlib.import_module(f"benchmarks.side_by_side.{part}").WORKS[name]
            for done in measured(works(settings), settings):
                rows.append(done.as_json())
                print(report.line(rows[-1]), flush=True)
        facts["load at the end"] = load()
    text = report.markdown(facts, rows, absent)
    print(f"\n{text}")
    if out is not None:
        keep(out, "peers", text, {"machine": facts, "absent": absent, "rows": rows})
