"""Compile kernels before they are called."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from ..errors import InvalidValueError
from ._cache import cache_folder, kernel_files
from ._compile import KERNELS


def kernel_modules() -> list[str]:
    """Names of the modules with compiled functions."""
    root = Path(__file__).resolve().parents[2]
    return [".".join(path.relative_to(root).with_suffix("").parts) for path in kernel_files()]


def compile_module(name: str) -> int:
    """Compile all kernels of a module, or load them, and return their number."""
    importlib.import_module(name)
    kernels = [kernel for kernel in KERNELS if kernel.py_func.__module__ == name]
    for kernel in kernels:
        kernel.compile(None)
    return len(kernels)


def compile_all(
    processes: int | None = None, progress: Callable[[int, int, str], None] | None = None
) -> tuple[int, Path | None]:
    """Compile everything in several processes; return the number of kernels and their folder."""
    if processes is not None and processes < 1:
        raise InvalidValueError(f"processes: expected 1 or more, got {processes}.")
    names = kernel_modules()
    count, done = 0, 0
    workers = min(processes or os.cpu_count() or 1, len(names))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(compile_module, name): name for name in names}
        for future in as_completed(futures):
            count, done = count + future.result(), done + 1
            if progress is not None:
                progress(done, len(names), futures[future])
    return count, cache_folder()
