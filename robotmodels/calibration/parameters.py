"""Geometric parameters of a calibration: elements of the extended table and error laws."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_vector, read_only
from ..errors import InvalidValueError, nearest_names
from ..model import RobotModel
from .extended_table import JOINT_VARIABLE, Element, ExtendedTable, gravity_loads


class ErrorLaw(Enum):
    """Laws of the error of an element in the configuration: ``error = parameter * factor``.

    The value is the prefix of the names; constant errors are named by their element. A new law is
    a new member.
    """

    unit: str
    """Unit of the parameter; ``{}`` is replaced by that of its element."""
    factor: Callable[[Array], Array] | None
    """By the reading of a joint (rad or m); None for 1 and for the gravity load (N m or N)."""

    CONSTANT = "", "{}", None
    GAIN = "gain", "1", lambda q: q
    SINE = "sine", "{}", np.sin
    COSINE = "cosine", "{}", np.cos
    SINE_2 = "sine_2_", "{}", lambda q: np.sin(2.0 * q)
    COSINE_2 = "cosine_2_", "{}", lambda q: np.cos(2.0 * q)
    COMPLIANCE = "compliance", "{}/N m", None

    def __new__(
        cls, value: str, unit: str, factor: Callable[[Array], Array] | None = None
    ) -> ErrorLaw:
        """Attach unit and factor to the prefix."""
        law = object.__new__(cls)
        law._value_, law.unit, law.factor = value, unit, factor
        return law


class Compliance(Enum):
    """Elements that deflect under gravity, in proportion to their gravity load.

    Parameters
    ----------
    value : str
        The elements.
    """

    NONE = "nothing"
    JOINTS = "joints about their axes"
    LINKS = "joints, links about alpha and beta, and the mount, one each"
    ISOTROPIC = "joints and mount, the same about all axes"
    UNIFORM = "one for all joints and one for the mount, the same about all axes"


@dataclass(frozen=True, slots=True)
class GeometricParameter:
    """One parameter; times the factor of its law it is the error of an element of a row."""

    row: int
    """Row of the extended table: 0 the base, 1 to f the frames, then the ends."""
    element: Element
    law: ErrorLaw = ErrorLaw.CONSTANT
    source: int = -1
    """Row of the joint whose reading or load the law uses; its own row for constant errors."""
    also: tuple[tuple[int, Element, int], ...] = ()
    """Further rows and elements with the same error, each with the row of its source."""

    @property
    def actions(self) -> tuple[tuple[int, Element, int], ...]:
        """All rows and elements that it changes, with the rows of the sources."""
        return ((self.row, self.element, self.source), *self.also)

    @property
    def moves_own_joint(self) -> bool:
        """Whether it adds to the variable of a single joint."""
        variable = self.element in (Element.THETA, Element.R)
        return variable and not self.also and self.law is not ErrorLaw.CONSTANT

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
        """Unit of its value; of a gain and a compliance that of a revolute joint."""
        return self.law.unit.format("m" if self.element.is_length else "rad")


@dataclass(frozen=True, slots=True, eq=False)
class GeometricParameters(Rebuilt):
    """Parameters of a robot, in the order in which they are preferred.

    Of parameters with the same effect the earlier one is kept and the later regrouped into it. The
    usual order is: ends and base, which are known least; the joint variables; the rest of the
    table; last the parameters that depend on the configuration.

    Parameters
    ----------
    table, entries
        The extended table, and the parameters of it (book section 1.4.2).

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> full = candidate_parameters(load("rx90"))
    >>> full.subset(["d3", "theta2"]).names, full.preferring(["d3"]).names[0]
    (('theta2', 'd3'), 'd3')
    """

    table: ExtendedTable
    entries: tuple[GeometricParameter, ...]
    names: tuple[str, ...] = field(init=False)
    actions: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]] = field(init=False)
    """Parameter, row and element of each action, shapes (A,): a parameter has one or more."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(entry.name for entry in self.entries))
        actions = [
            (k, row, int(element))
            for k, entry in enumerate(self.entries)
            for row, element, _ in entry.actions
        ]
        columns = np.array(actions, dtype=np.int64).reshape(-1, 3).T
        object.__setattr__(self, "actions", tuple(read_only(c, np.int64) for c in columns))

    @property
    def model(self) -> RobotModel:
        """The nominal robot."""
        return self.table.model

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
        values = self.table.nominal
        return read_only([
            values[e.row, e.element] if e.law is ErrorLaw.CONSTANT else 0.0 for e in self.entries
        ])  # fmt: skip

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each."""
        return tuple(entry.unit for entry in self.entries)

    def index(self, names: Iterable[str], what: str = "parameters") -> NDArray[np.int64]:
        """Numbers of parameters by name; InvalidValueError with the nearest names if unknown."""
        known = {name: k for k, name in enumerate(self.names)}
        numbers = []
        for name in as_names(names):
            if name not in known:
                near = ", ".join(nearest_names(str(name), known)) or ", ".join(self.names)
                raise InvalidValueError(
                    f"{what}: {name!r} is not a parameter of this calibration; near it: {near}."
                )
            numbers.append(known[name])
        return np.array(numbers, dtype=np.int64)

    def subset(self, names: Iterable[str]) -> Self:
        """Some of the parameters, in this order of preference."""
        return replace(self, entries=tuple(self.entries[k] for k in sorted(self.index(names))))

    def preferring(self, names: Iterable[str]) -> Self:
        """The same parameters, the named ones first and in the order given."""
        first = [self.entries[k] for k in self.index(names)]
        rest = [entry for entry in self.entries if entry not in first]
        return replace(self, entries=(*first, *rest))

    def without(self, names: Iterable[str]) -> Self:
        """All but the named parameters, which keep their nominal values."""
        left_out = set(self.index(names).tolist())
        kept = (e for k, e in enumerate(self.entries) if k not in left_out)
        return replace(self, entries=tuple(kept))

    def factors(self, q: ArrayLike) -> Array:
        """Factor of each action by its law. Shapes: q (N, n) -> (N, A)."""
        q = np.atleast_2d(as_vector(q, self.model.n, "q"))
        actions = [(entry.law, action) for entry in self.entries for action in entry.actions]
        factor = np.ones((len(q), len(actions)))
        loaded = [c for c, (law, _) in enumerate(actions) if law is ErrorLaw.COMPLIANCE]
        if loaded:
            factor[:, loaded] = gravity_loads(self.table, q, [actions[c][1] for c in loaded])
        for c, (law, (_, _, source)) in enumerate(actions):
            if law.factor is not None:
                factor[:, c] = law.factor(q[:, self.table.joint[source]])
        return factor

    def is_of_table(self, entry: GeometricParameter) -> bool:
        """Whether a parameter is a constant error of a frame, not of the base or an end."""
        return entry.law is ErrorLaw.CONSTANT and 0 < entry.row <= self.model.f

    def bends(self, entry: GeometricParameter) -> bool:
        """Whether a parameter is a compliance of a link or of the mount, not of a joint."""
        variable = JOINT_VARIABLE[int(self.table.sigma[entry.row])]
        joint = entry.element is variable and entry.moves_own_joint and entry.source == entry.row
        return entry.law is ErrorLaw.COMPLIANCE and not joint


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Names as a tuple, from a single name or several."""
    return (names,) if isinstance(names, str) else tuple(names)
