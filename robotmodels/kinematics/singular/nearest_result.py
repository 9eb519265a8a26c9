"""What a search of singular configurations near a given one has found."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt
from ..._outcomes import Outcome
from ...table_text import boxed
from ..singularity_kind import SingularityKind
from .task import counting_lines

_WIDTH = 100


class NearestStatus(Outcome):
    """What one found configuration is; fits int8.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> NearestStatus.NEAREST.sentence
    'Singular, and none of the same kind in its neighbourhood is nearer.'
    """

    NEAREST = 0, "Singular, and none of the same kind in its neighbourhood is nearer."
    AT_LIMIT = 1, "Singular, and none that respects the joint limits is nearer there."
    NOT_STATIONARY = 2, "Singular, but a nearer one in its neighbourhood is not excluded."
    CROSSING = (
        3, "Singular in another way than the given configuration, and the nearest to within 1e-4.",
    )  # fmt: skip


class SearchOutcome(Outcome):
    """What a search came to.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> SearchOutcome.NONE_FOUND.name
    'NONE_FOUND'
    """

    FOUND = 0, "Singular configurations were found."
    ALREADY_SINGULAR = 1, "The given configuration is singular itself."
    NONE_FOUND = 2, "No singular configuration was found from any start."


@dataclass(frozen=True, slots=True, eq=False)
class NearestSingularities(Rebuilt):
    """Singular configurations by their distance from a given one. Read-only; `print` it.

    S rows, the nearest first; none twice, also not by whole turns of a joint unless limits were
    asked for.

    Parameters
    ----------
    home : ndarray, shape (n,)
        The given configuration, rad or m.
    q : ndarray, shape (S, n)
        Singular configurations, rad or m.
    distance : ndarray, shape (S,)
        From ``home``, weighted: ``sqrt(sum of w (dq)^2)``, strokes in units of ``length``.
    direction : ndarray, shape (S, n)
        ``(q - home) / distance``, rad or m per unit of distance; zero where the distance is.
    escape : ndarray, shape (S, n)
        Joint direction, rad or m per unit of distance, normal to the singular set there: the
        weakest singular value rises along it. Towards ``home``.
    slope : ndarray, shape (S,)
        Of the weakest singular value along ``escape``, per unit of distance: nearly 0 where the
        singular set is touched twice, or where two sets cross.
    codimension : ndarray of int, shape (S,)
        Number of conditions on the joints that the set makes there: 1 is a surface.
    kind : tuple of tuple of SingularityKind
        Names of each.
    words : tuple of tuple of str
        Sentences of each.
    residual : ndarray, shape (S,)
        Weakest singular value over the largest: 0 is exactly singular.
    stationarity : ndarray, shape (S,)
        Part of the way home that lies along the set, in units of distance: 0 is nearest;
        infinite where sets cross.
    status : ndarray of int8, shape (S,)
        Codes of `NearestStatus`.
    outcome : SearchOutcome
        Of the whole search.
    length : float
        Characteristic length, metres.
    mask : ndarray of bool, shape (6,)
        Components that count.
    frame : str
        What the frame is called, such as ``"the tool"``.

    Examples
    --------
    >>> from robotmodels import load, nearest_singularity
    >>> found = nearest_singularity(load("rx90"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    >>> found.distance[:2], [kinds[0].name for kinds in found.kind[:2]]
    (array([0.3894, 0.5   ]), ['SHOULDER', 'WRIST'])
    """

    home: Array
    q: Array
    distance: Array
    direction: Array
    escape: Array
    slope: Array
    codimension: NDArray[np.int64]
    kind: tuple[tuple[SingularityKind, ...], ...]
    words: tuple[tuple[str, ...], ...]
    residual: Array
    stationarity: Array
    status: NDArray[np.int8]
    outcome: SearchOutcome
    length: float
    mask: NDArray[np.bool_]
    frame: str

    @property
    def count(self) -> int:
        """Number of configurations found."""
        return len(self.q)

    def of(self, kind: SingularityKind) -> int | None:
        """Row of the nearest configuration of a kind.

        Parameters
        ----------
        kind : SingularityKind
            Shoulder, elbow, wrist or other.

        Returns
        -------
        int or None
            Its row; None if there is none.

        Examples
        --------
        >>> from robotmodels import load, nearest_singularity
        >>> found = nearest_singularity(load("rx90"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
        >>> found.of(SingularityKind.WRIST), found.of(SingularityKind.OTHER)
        (1, None)
        """
        return next((i for i, kinds in enumerate(self.kind) if kind in kinds), None)

    def reason(self, i: int = 0) -> str:
        """What one of them is, in a sentence.

        Parameters
        ----------
        i : int
            Row.

        Returns
        -------
        str
            The sentence of its status.

        Examples
        --------
        >>> from robotmodels import load, nearest_singularity
        >>> nearest_singularity(load("rx90"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]).reason()
        'Singular, and none of the same kind in its neighbourhood is nearer.'
        """
        return NearestStatus(int(self.status[i])).sentence

    def __str__(self) -> str:
        """Table of what was found, and what the kinds mean below it."""
        lines = [self.outcome.sentence, *counting_lines(self.mask, self.frame)]
        if not self.count:
            return "\n".join(lines)
        kinds = [", ".join(kind.value for kind in row) for row in self.kind]
        joints = [(f"q{j + 1}", [_short(x) for x in self.q[:, j]]) for j in range(self.q.shape[1])]
        fixed = [("distance", [f"{d:.4g}" for d in self.distance]), ("kind", kinds)]
        words = list(dict.fromkeys(text for row in self.words for text in row))
        said = [part for text in words for part in wrap(text, _WIDTH, subsequent_indent="  ")]
        return "\n".join([*lines, *_tables(fixed, joints), *said])

    def __repr__(self) -> str:
        nearest = "".join(
            f"; {kind.value} at {self.distance[i]:.4g}"
            for kind in SingularityKind
            if (i := self.of(kind)) is not None
        )
        return f"<NearestSingularities {self.outcome.name}: {self.count} found{nearest}>"


def _short(x: float) -> str:
    return f"{round(float(x), 5) + 0.0:.5g}"


def _tables(fixed: list[tuple[str, list[str]]], joints: list[tuple[str, list[str]]]) -> list[str]:
    """One table, or several one below the other where the joints do not fit abreast."""
    count = len(joints)
    while count > 1:
        tables = [boxed([*fixed, *joints[k : k + count]]) for k in range(0, len(joints), count)]
        if max(len(line) for table in tables for line in table.splitlines()) <= _WIDTH:
            return tables
        count -= 1
    return [boxed([*fixed, *joints[k : k + 1]]) for k in range(len(joints))] or [boxed(fixed)]
