"""Decorator that compiles kernels, and the types of their arguments.

Inputs are declared read-only: numba then takes frozen and writable arrays alike with one
compilation, where it would otherwise compile a kernel again for every mixture of the two.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.targetconfig import ConfigStack
from numpy.typing import NDArray

from . import Chain
from ._cache import cache_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _input(dtype: types.Type, ndim: int) -> types.Array:
    return types.Array(dtype, ndim, "C", readonly=True)


def _output(ndim: int) -> types.Array:
    return types.Array(types.float64, ndim, "C")


INT = types.int64
NOTHING = types.void
INTS = _input(types.int64, 1)
VECTOR = _input(types.float64, 1)
MATRIX = _input(types.float64, 2)
STACK = _input(types.float64, 3)
CHAIN = types.NamedTuple((INTS, INTS, INTS, STACK, MATRIX, MATRIX, VECTOR), Chain)
OUT1, OUT2, OUT3, OUT4 = (_output(ndim) for ndim in range(1, 5))

KERNELS: list[Any] = []
"""Every kernel of the modules that are imported."""


def compiled(
    *signature: Any, inlined: bool = False, cached: bool = True, counted: bool = True
) -> Any:
    """Decorator: compile a kernel for its declared signature at the first call.

    Without a signature it is an inner function, compiled with the kernels that call it.
    """
    # ``inlined`` puts its code into its callers, ``cached=False`` is for functions made for a
    # function. ``counted=False`` leaves the counting of references to arrays out, a third of the
    # time of small functions: only for inner ones that make and return no arrays and call none
    # that do.

    def decorate(function: Any) -> Any:
        options: dict[str, Any] = {
            "nogil": True,
            "fastmath": False,
            "error_model": "numpy",
            "no_cpython_wrapper": not signature or not counted,
            "no_cfunc_wrapper": True,
            "inline": "always" if inlined else "never",
            "_nrt": counted,
        }
        kernel: Any = njit(**options)(function)
        if kernel is function:  # numba's compilation is switched off
            return function
        cache = cache_of(function) if cached else None
        if cache is not None:
            kernel._cache = cache  # numba has no public way to another folder
        template = kernel.get_call_template

        def template_for(args: Any, kws: Any) -> Any:
            """Compile once for all constants of a type, where numba would for each constant."""
            return template(tuple(map(types.unliteral, args)), kws)

        kernel.get_call_template = template_for
        if signature:
            compile_for = kernel.compile

            def compile_declared(given: Any) -> Any:
                """Compile the declared signature, and refuse other types as later calls do."""
                with global_compiler_lock, _operations_remembered():
                    if not kernel.signatures:
                        compile_for(*signature)
                        kernel.disable_compile()
                declared = kernel.nopython_signatures[0].args
                if given is not None and not _converts(given, declared):
                    raise TypeError(f"{function.__name__}: expected {declared}, got {given}.")
                return kernel.get_overload(*signature)

            kernel.compile = compile_declared
            if counted:
                KERNELS.append(kernel)
        return kernel

    return decorate


@contextmanager
def _operations_remembered() -> Iterator[None]:
    """Within it numba finds the type of each kind of operation once, not at every occurrence.

    That is a fifth of the time of compilation. What it finds depends on the types of the arguments,
    and on the flags of the compilation, of which kernels differ in one only (``counted``).
    """
    known: dict[Any, Any] = {}
    find = types.Function.get_call_type

    def remembered(function: Any, context: Any, args: Any, kws: Any) -> Any:
        counted = getattr(ConfigStack.top_or_none(), "nrt", True)
        key = function, context, tuple(args), tuple(kws.items()), counted
        if key not in known:
            known[key] = find(function, context, args, kws)
        return known[key]

    types.Function.get_call_type = remembered  # type: ignore[method-assign]
    try:
        yield
    finally:
        types.Function.get_call_type = find


def _converts(given: Any, declared: Any) -> bool:
    """Whether numba converts arguments of these types to the declared ones."""
    context: Any = cpu_target.typing_context
    return len(given) == len(declared) and all(
        context.can_convert(*pair) is not None for pair in zip(given, declared, strict=True)
    )


class _Notice(event.Listener):
    """One line on standard error once compilation takes long, in terminals and notebooks."""

    text = (
        "robotmodels: compiling for this machine, once for each kind of computation (5 to 30 s). "
        "`robotmodels compile` compiles everything in advance."
    )
    after = 2.0
    """Seconds of compilation before the line."""

    def __init__(self) -> None:
        self.depth, self.seconds, self.started = 0, 0.0, 0.0

    def on_start(self, event: event.Event) -> None:
        """Print when the time is over: functions within a kernel are events of their own."""
        now = time.monotonic()
        if self.depth == 0:
            self.started = now
        self.depth += 1
        if self.seconds + now - self.started > self.after and self.text:
            if _is_interactive(sys.stderr):
                sys.stderr.write(f"{self.text}\n")
                sys.stderr.flush()
            self.text = ""

    def on_end(self, event: event.Event) -> None:
        """Add the time of a whole kernel."""
        self.depth -= 1
        if self.depth == 0:
            self.seconds += time.monotonic() - self.started


def _is_interactive(stream: Any) -> bool:
    """Whether it is a terminal or in a notebook."""
    return stream is not None and (stream.isatty() or "ipykernel" in sys.modules)


event.register("numba:compile", _Notice())
if hasattr(os, "register_at_fork"):
    # a child must not inherit the lock of a thread that compiles and does not exist there
    os.register_at_fork(
        before=global_compiler_lock.acquire,
        after_in_parent=global_compiler_lock.release,
        after_in_child=global_compiler_lock.release,
    )
