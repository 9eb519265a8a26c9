"""Logs of several robots reduced together, so that all workers stay busy until the end."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sized
from concurrent.futures import Executor
from itertools import groupby
from typing import TypeVar

from ...errors import InvalidValueError
from ...estimation.merging import merged_tree
from ..equations import Equations
from .piece_tasks import piece_reductions
from .reduction import Reduction, merge

K = TypeVar("K", bound=Hashable)


def reduce_many(
    systems: Mapping[K, Equations | Iterable[Equations]],
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
    window: int | None = None,
) -> dict[K, Reduction]:
    """Reduce the equations of several robots, or of several choices for one.

    Parameters
    ----------
    systems : mapping to Equations or iterables of Equations
        Of each robot its logs, as for `reduce_equations`.
    executor, progress, window
        As for `reduce_equations`; the fraction is that of all logs together.

    Returns
    -------
    dict
        Of each robot what `reduce_equations` gives, to the last bit.

    Raises
    ------
    InvalidValueError
        A robot without equations; logs of one robot with different parameters or kinds of
        equations; a window below 1.

    References
    ----------
    Seed book section 1.6.2.1.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.identification import Log, choose_processing, equations
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = reduce_many({"left": system, "right": system})
    >>> sorted(found), found["left"].rows == found["right"].rows
    (['left', 'right'], True)
    """
    owners: deque[K] = deque()  # of the pieces that are under way

    def logs() -> Iterator[Equations]:
        for key, value in systems.items():
            for system in (value,) if isinstance(value, Equations) else value:
                owners.extend([key] * len(system.pieces()))
                yield system

    count = 0
    for value in systems.values():
        if not isinstance(value, (Equations, Sized)):
            count = None
            break
        count += 1 if isinstance(value, Equations) else len(value)
    leaves = piece_reductions(logs(), executor, progress, window, count)
    found: dict[K, Reduction] = {}
    # pieces come robot by robot
    for key, own in groupby(((owners.popleft(), leaf) for leaf in leaves), lambda pair: pair[0]):
        whole = merged_tree((leaf for _, leaf in own), merge)
        assert whole is not None  # a group has a leaf
        found[key] = whole
    for key in systems:
        if key not in found:
            raise InvalidValueError(
                f"systems: expected the equations of at least one log of {key!r}, got none."
            )
    return found
