"""Laws."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_vector, read_only
from ..errors import InvalidValueError, nearest_names
from ..model import RobotModel
from .extended_table import Element, Skeleton, gravity_loads


class ErrorLaw(Enum):
    """How the error of an element depends on the configuration.

    A member's value is what the names of its parameters begin with; a constant error is called by
    its element. Every law is linear in its parameter, whose factor is

    ============  =============================================================
    CONSTANT      1
    GAIN          the reading of a joint (rad or m); of another joint: coupling
    COMPLIANCE    minus the gravity torque of a joint (N m or N)
    SINE, COSINE  of the reading: an encoder that is mounted off its axis
    SINE_2, ...   of twice the reading: a graduated disc that is not flat
    ============  =============================================================

    Examples
    --------
    >>> ErrorLaw.GAIN.value
    'gain'
    """

    CONSTANT = ""
    GAIN = "gain"
    COMPLIANCE = "compliance"
    SINE = "sine"
    COSINE = "cosine"
    SINE_2 = "sine_2_"
    COSINE_2 = "cosine_2_"


class Compliance(Enum):
    """What gives way under gravity, in proportion to its moment there.

    Examples
    --------
    >>> Compliance.ISOTROPIC.value
    'joints and mount, the same about all axes'
    """

    NONE = "nothing"
    JOINTS = "joints about their axes"
    LINKS = "joints, links about alpha and beta, and the mount, each for itself"
    ISOTROPIC = "joints and mount, the same about all axes"
    UNIFORM = "one for all joints and one for the mount, the same about all axes"


@dataclass(frozen=True, slots=True)
class GeometricParameter:
    """One parameter: the deviation of an element of a row, times its law.

    A compliance that is the same about several axes acts on further elements as well.

    Parameters
    ----------
    row : int
        Row of the extended table: 0 the base, 1 to f the frames, then the ends.
    element : Element
        Which of the seven elementary motions.
    law : ErrorLaw
        How it depends on the configuration.
    source : int
        Row of the joint that the law reads, or whose load bends; the row's own for constant errors.
    also : tuple of (int, Element, int)
        Further rows and elements that it acts on alike, each with the row of its source.

    Examples
    --------
    >>> GeometricParameter(3, Element.THETA, ErrorLaw.GAIN, 3).name
    'gain3'
    >>> GeometricParameter(6, Element.THETA, ErrorLaw.GAIN, 5).name
    'gain6_5'
    """

    row: int
    element: Element
    law: ErrorLaw = ErrorLaw.CONSTANT
    source: int = -1
    also: tuple[tuple[int, Element, int], ...] = ()

    @property
    def actions(self) -> tuple[tuple[int, Element, int], ...]:
        """All rows and elements that it acts on, and rows of the sources."""
        return ((self.row, self.element, self.source), *self.also)

    @property
    def moves_own_joint(self) -> bool:
        """Whether it adds to the variable of a joint alone."""
        own = self.element in (Element.THETA, Element.R)
        return own and not self.also and self.law is not ErrorLaw.CONSTANT

    @property
    def name(self) -> str:
        """``alpha3``, ``gain5``, ``gain6_5``: element or law, row, and the row of the source."""
        if self.law is ErrorLaw.CONSTANT:
            return f"{self.element.word}{self.row}"
        sources = {source for _, _, source in self.actions}
        if self.also:
            return f"{self.law.value}{self.source if len(sources) == 1 else '_joints'}"
        if self.law is ErrorLaw.COMPLIANCE and not self.moves_own_joint:
            return f"{self.law.value}_{self.element.word}{self.row}"
        other = "" if self.source == self.row else f"_{self.source}"
        return f"{self.law.value}{self.row}{other}"

    @property
    def unit(self) -> str:
        """Unit of the deviation, for a law that reads a revolute joint unless it is constant."""
        own = "m" if self.element.is_length else "rad"
        return {ErrorLaw.GAIN: "1", ErrorLaw.COMPLIANCE: f"{own}/N m"}.get(self.law, own)


@dataclass(frozen=True, slots=True, eq=False)
class GeometricParameters(Rebuilt):
    """Parameters of a robot, in the order in which they are preferred.

    Where two of them act alike the earlier is kept and the later regrouped into it: first the
    ends and the base, which are the least known and may be far off, then the variables of the
    joints, the rest of the table, and last what depends on the configuration.

    Parameters
    ----------
    skeleton : Skeleton
        The extended table.
    entries : tuple of GeometricParameter
        The parameters.

    References
    ----------
    Seed book section 1.4.2.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> candidate_parameters(load("rx90")).names[11:15]
    ('theta0', 'theta1', 'theta2', 'theta3')
    """

    skeleton: Skeleton
    entries: tuple[GeometricParameter, ...]
    names: tuple[str, ...] = field(init=False)
    """Names, shape (P,)."""
    actions: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]] = field(init=False)
    """Parameter, row and element of each action, shapes (A,): a parameter has one or more."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(entry.name for entry in self.entries))
        found = [
            (k, row, int(element))
            for k, entry in enumerate(self.entries)
            for row, element, _ in entry.actions
        ]
        columns = np.array(found, dtype=np.int64).reshape(-1, 3).T
        object.__setattr__(self, "actions", tuple(read_only(c, np.int64) for c in columns))

    @property
    def model(self) -> RobotModel:
        """The nominal robot."""
        return self.skeleton.model

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        """Names alone: the extended table holds the whole robot."""
        return f"<GeometricParameters of {self.model.name}: {', '.join(self.names)}>"

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row of each parameter, shape (P,)."""
        return np.array([entry.row for entry in self.entries], dtype=np.int64)

    @property
    def nominal(self) -> Array:
        """Nominal value of each, rad or m; 0 for those that depend on the configuration."""
        values = self.skeleton.nominal
        return read_only([
            values[e.row, e.element] if e.law is ErrorLaw.CONSTANT else 0.0 for e in self.entries
        ])  # fmt: skip

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each deviation."""
        return tuple(entry.unit for entry in self.entries)

    def index(self, names: Iterable[str], what: str = "parameters") -> NDArray[np.int64]:
        """Positions of parameters by name.

        Parameters
        ----------
        names : iterable of str
            Names among `names`.
        what : str
            Used in the error message.

        Returns
        -------
        ndarray of int
            Positions.

        Raises
        ------
        InvalidValueError
            An unknown name; the message gives the nearest ones.
        """
        known = {name: k for k, name in enumerate(self.names)}
        found = []
        for name in as_names(names):
            if name not in known:
                near = ", ".join(nearest_names(str(name), known)) or ", ".join(self.names)
                raise InvalidValueError(
                    f"{what}: {name!r} is not a parameter of this calibration; near it: {near}."
                )
            found.append(known[name])
        return np.array(found, dtype=np.int64)

    def subset(self, names: Iterable[str]) -> Self:
        """Only some of the parameters, in this order of preference.

        Parameters
        ----------
        names : iterable of str
            Which.

        Returns
        -------
        GeometricParameters
            The subset.

        Raises
        ------
        InvalidValueError
            An unknown name.

        Examples
        --------
        >>> from robotmodels.calibration import candidate_parameters
        >>> from robotmodels.robots import load
        >>> candidate_parameters(load("rx90")).subset(["d3", "theta2"]).names
        ('theta2', 'd3')
        """
        return replace(self, entries=tuple(self.entries[k] for k in sorted(self.index(names))))

    def preferring(self, names: Iterable[str]) -> Self:
        """The same parameters, some of them before the others.

        Parameters
        ----------
        names : iterable of str
            Which are preferred, in this order.

        Returns
        -------
        GeometricParameters
            In another order.

        Raises
        ------
        InvalidValueError
            An unknown name.

        Examples
        --------
        >>> from robotmodels.calibration import candidate_parameters
        >>> from robotmodels.robots import load
        >>> candidate_parameters(load("rx90")).preferring(["d3"]).names[0]
        'd3'
        """
        first = [self.entries[k] for k in self.index(names)]
        rest = [entry for entry in self.entries if entry not in first]
        return replace(self, entries=(*first, *rest))

    def without(self, names: Iterable[str]) -> Self:
        """All but some of the parameters.

        Parameters
        ----------
        names : iterable of str
            Which to leave out: they stay at their nominal values.

        Returns
        -------
        GeometricParameters
            The others.

        Raises
        ------
        InvalidValueError
            An unknown name.

        Examples
        --------
        >>> from robotmodels.calibration import candidate_parameters
        >>> from robotmodels.robots import load
        >>> full = candidate_parameters(load("rx90"))
        >>> len(full) - len(full.without(["r4"]))
        1
        """
        left_out = set(self.index(names).tolist())
        kept = tuple(e for k, e in enumerate(self.entries) if k not in left_out)
        return replace(self, entries=kept)

    def factors(self, q: ArrayLike) -> Array:
        """What each deviation is multiplied by at each configuration.

        Parameters
        ----------
        q : array_like, shape (N, n)
            Readings of the joints, rad or m.

        Returns
        -------
        ndarray, shape (N, A)
            For each of `actions`: 1 for constant errors; else by `ErrorLaw`.
        """
        q = np.atleast_2d(as_vector(q, self.model.n, "q"))
        owner, rows, elements = self.actions
        factor = np.ones((len(q), len(owner)))
        laws = [self.entries[k].law for k in owner]
        sources = [source for entry in self.entries for _, _, source in entry.actions]
        loaded = [c for c, law in enumerate(laws) if law is ErrorLaw.COMPLIANCE]
        if loaded:
            bent = [(int(rows[c]), Element(int(elements[c])), sources[c]) for c in loaded]
            factor[:, loaded] = gravity_loads(self.skeleton, q, bent)
        for c, law in enumerate(laws):
            if law in _LAWS:
                factor[:, c] = _LAWS[law](q[:, self.skeleton.joint[sources[c]]])
        return factor


_LAWS = {
    ErrorLaw.GAIN: lambda x: x,
    ErrorLaw.SINE: np.sin,
    ErrorLaw.COSINE: np.cos,
    ErrorLaw.SINE_2: lambda x: np.sin(2.0 * x),
    ErrorLaw.COSINE_2: lambda x: np.cos(2.0 * x),
}


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Names as a tuple, from a single name or several."""
    return (names,) if isinstance(names, str) else tuple(names)
