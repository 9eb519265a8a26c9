"""A program in an interpreter of its own that takes its turns on request.

The script of a peer is started as ``PYTHON script JOB``, says one line of JSON, either
``{"ready": VERSION}`` or ``{"skipped": REASON}``, and then answers every line that names a task by
one line: ``{"processor": s, "clock": s, "note": text}``.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.measure import Spent


class Foreign:
    """A peer's process, from `start` until the end of the ``with`` block.

    Parameters
    ----------
    name
        The peer's, for messages.
    python
        The interpreter that has the peer.
    script
        File of this folder.
    """

    def __init__(self, name: str, python: str, script: str) -> None:
        self.name, self.python = name, python
        self.script = Path(__file__).parent / script
        self._process: subprocess.Popen[str] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._jobs = 0

    def start(self) -> str | None:
        """Start the peer; why it cannot be had, None where it can."""
        try:
            self._process = subprocess.Popen(
                [self.python, "-P", "-W", "ignore", str(self.script)], stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            return self._answer().get("skipped")
        except OSError as error:
            return f"{self.python} does not start ({error})"

    def job(self, **content: Any) -> str:
        """Write arrays and texts where the peer's process finds them."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory()
        self._jobs += 1
        path = Path(self._folder.name) / f"job{self._jobs}.npz"
        np.savez(path, **content)
        return str(path)

    def robot_job(self, model: rm.RobotModel, **content: Any) -> str:
        """The same for a robot without drives, with columns of rotors and friction."""
        zero = np.zeros(model.n)
        return self.job(urdf=rm.to_urdf(model), Ia=zero, Fv=zero, Fc=zero, **content)

    def task(self, name: str, *words: str) -> Callable[[], Spent]:
        """Work for a contestant: the peer does it and says how long it took."""
        line = json.dumps([name, *words])

        def run() -> Spent:
            said = self._ask(line)
            return Spent(said["processor"], said["clock"], said.get("note", ""))

        return run

    def _ask(self, line: str) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):
                return json.loads(line)
        raise RuntimeError(f"{self.name} ended without an answer: see what it wrote above.")

    def __enter__(self) -> Foreign:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process is not None:
            if self._process.stdin is not None:
                self._process.stdin.close()
            self._process.wait(60)
        if self._folder is not None:
            self._folder.cleanup()
