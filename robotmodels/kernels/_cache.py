"""Compiled functions on the disk, so that a machine compiles each of them once.

They lie in one folder for each state of the kernels' sources and each version of Python, numba and
NumPy: an edited function, or one that calls it, is never run from an older compilation. Every file
carries a checksum. A cache that cannot be used costs time and one warning, no result.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import sys
import uuid
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from ..errors import RobotModelsWarning

_PACKAGE = Path(__file__).resolve().parents[1]
_DIGEST = hashlib.sha256().digest_size


def kernel_files() -> list[Path]:
    """Source files with compiled functions, sorted."""
    return [path for path in sorted(_PACKAGE.rglob("*.py")) if b"_compile import" in _read(path)]


def _read(path: Path) -> bytes:
    return path.read_bytes()


@cache
def cache_folder() -> Path | None:
    """Folder of the compiled functions; None, with a warning, where there cannot be one."""
    try:
        root = os.environ.get("NUMBA_CACHE_DIR")
        base = Path(root).expanduser().absolute() if root else _user_caches()
        folder = base / f"robotmodels-{_fingerprint()}"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        _check_owner(folder)
    except (OSError, RuntimeError) as error:
        _warn(f"the cache folder cannot be used ({error})")
        return None
    return folder


def _user_caches() -> Path:
    """Where the operating system keeps caches of a user."""
    home = Path.home()
    if len(home.parts) < 2:
        raise OSError("the user has no home folder")
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = home / "Library" / "Caches"
    else:
        given = Path(os.environ.get("XDG_CACHE_HOME", ""))
        caches = given if given.is_absolute() else home / ".cache"
    return caches / "robotmodels"


def _fingerprint() -> str:
    versions = f"{sys.version} {numba.__version__} {np.__version__}"
    digest = hashlib.sha256(versions.encode())
    for path in [Path(__file__), *kernel_files()]:
        digest.update(f"{path.relative_to(_PACKAGE).as_posix()} ".encode() + _read(path))
    return digest.hexdigest()[:16]


def _check_owner(folder: Path) -> None:
    """Refuse a folder into which others may put code."""
    if sys.platform == "win32":
        return
    status = folder.stat()
    if status.st_uid not in (os.getuid(), 0) or status.st_mode & 0o022:
        raise PermissionError(f"other users can write to {folder}")


@cache
def _warn(reason: str) -> None:
    warnings.warn(
        f"Compiled functions are not cached: {reason}. Each process compiles its own, which takes "
        "some seconds; results are the same. Set NUMBA_CACHE_DIR to a folder of your own.",
        RobotModelsWarning,
        stacklevel=2,
    )


def cache_of(function: Any) -> FunctionCache | None:
    """Cache of the compilations of a function; None where there is no folder."""
    folder = cache_folder()
    return None if folder is None else _Cache(function, folder)


class _Implementation(CompileResultCacheImpl):
    """Serialisation of a compilation by numba, without its choice of a folder."""

    def __init__(self) -> None:
        pass


class _Cache(FunctionCache):
    """Cache of one function: a file for each signature and processor."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._name = repr(function)
        self._py_func = function
        self._impl = _Implementation()
        self._cache_path = str(folder)
        self._cache_file = _Files(folder, f"{function.__module__}.{function.__qualname__}")
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load a compilation; None where there is none that can be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001  # whatever a damaged or foreign file leads to
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compilation."""
        if self._impl.check_cachable(data):
            self._cache_file.save(self._index_key(sig, data.codegen), self._impl.reduce(data))


class _Files:
    """The files of one function in the folder, in the place of numba's index and data files."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder, name

    def _path(self, key: Any) -> Path:
        return self.folder / f"{self.name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}"

    def load(self, key: Any) -> Any:
        """Read a compilation whose checksum is right."""
        try:
            data = _read(self._path(key))
        except OSError:
            return None
        digest, data = data[:_DIGEST], data[_DIGEST:]
        return pickle.loads(data) if hashlib.sha256(data).digest() == digest else None

    def save(self, key: Any, value: Any) -> None:
        """Write a compilation in one step: other processes read all of it or nothing."""
        data = dumps(value)
        path = self._path(key)
        unfinished = path.with_name(f"{path.name}.{uuid.uuid4().hex[:8]}")
        try:
            try:
                unfinished.write_bytes(hashlib.sha256(data).digest() + data)
                unfinished.replace(path)
            except BaseException:  # an interrupt too
                with contextlib.suppress(OSError):
                    unfinished.unlink()
                raise
        except OSError as error:
            _warn(f"the folder cannot be written ({error})")
