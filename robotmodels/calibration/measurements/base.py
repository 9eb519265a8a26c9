"""Base of all kinds of measurement, and the fields that they are declared with.

A kind is a frozen dataclass. Its fields carry metadata of `fields`; checks, subsets, copies, noise,
files and selection of configurations follow from them. A kind adds the rows of a block
(`all_rows`), the coordinates of unknown targets (`unknowns`), first values for them (`guess`), and
residuals with derivatives (`linearise`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from re import sub
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ..differential import DifferentialModel as Evaluation
from ..extended_table import Frame
from .fields import NOISE, FileRow, Given, as_covariance, as_sigma

Row = tuple[str, str]
"""Label and unit, ``"m"`` or ``"rad"``, of a row of residuals or of an unknown coordinate."""
POSITION_ROWS: tuple[Row, ...] = (("x", "m"), ("y", "m"), ("z", "m"))
POSE_ROWS: tuple[Row, ...] = (*POSITION_ROWS, ("rx", "rad"), ("ry", "rad"), ("rz", "rad"))


class View(NamedTuple):
    """Poses that a measurement needs: an end and the configurations. Shapes: q (N, n)."""

    frame: Frame
    q: Array


class Fixture(NamedTuple):
    """Unknown that is not a robot parameter; equal names are the same unknown."""

    name: str
    unit: str


class Linearised(NamedTuple):
    """Residuals of a measurement and their derivatives.

    Shapes: residual (B, k), by_parameters (B, k, P), by_fixtures (B, k, F).
    """

    residual: Array
    by_parameters: Array
    by_fixtures: Array


class _Declared(ABC):
    """Fields that the kinds declare themselves, in the order of their arguments."""

    __slots__ = ()
    q: Array
    sigma: Given
    covariance: Given
    frame: Frame
    name: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Measurement(_Declared):
    """Base of the kinds of measurement; each has B blocks of k rows of residuals.

    Kinds can be mixed freely in one fit. Arguments that several kinds share are explained here.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m; N = B.
    rows : sequence of 0 or 1
        Which of all rows of the kind are measured.
    known : mapping of label to array_like, optional
        Targets (points, planes, lines, poses) whose place in the world is known, m and rad. The
        others are unknown, and are estimated with the robot.
    sigma : array_like, shape (), (k,) or (N, k), optional
        Standard deviations of the rows, m and rad; default: estimated from the data.
    covariance : array_like, shape (k, k) or (N, k, k), optional
        Covariances of the rows, instead of sigma.
    frame : str, int or None
        The end of the robot that is measured; None is the tool.
    name : str
        Name in reports, and before the labels of targets: the same name and label in two
        measurements are the same target.
    origin : tuple of FileRow
        Row of a file that each block was read from; empty if it was not read.

    References
    ----------
    Book sections 1.4.4 and 1.4.5.
    """

    origin: tuple[FileRow, ...] = field(default=(), kw_only=True, repr=False, metadata=NOISE)

    kinds: ClassVar[dict[str, type[Measurement]]] = {}
    word: ClassVar[str]
    """Name of the kind, such as ``point_contact``."""
    all_rows: ClassVar[tuple[Row, ...]]
    in_world: ClassVar[bool] = True
    """Whether the measurement is relative to the world, not to the robot."""
    is_constraint: ClassVar[bool] = False
    """Whether ranks are judged at readings that satisfy the residuals exactly."""
    postures: ClassVar[int] = 1
    """Postures of a target that are drawn for selection."""

    def __init_subclass__(cls) -> None:
        cls.word = sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()
        Measurement.kinds[cls.word] = cls

    def __post_init__(self) -> None:
        for f in fields(self):
            if "check" in f.metadata:
                value = f.metadata["check"](self, f.name, getattr(self, f.name))
                object.__setattr__(self, f.name, value)
        self._check()
        if self.sigma is not None and self.covariance is not None:
            raise InvalidValueError("Give sigma or covariance, not both.")
        for name, check in (("sigma", as_sigma), ("covariance", as_covariance)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, check(value, self.blocks, len(self.axes)))

    def _check(self) -> None:
        """Check fields against each other."""

    def __repr__(self) -> str:
        word = type(self).__name__
        word = word if self.name == self.word else f"{word} {self.name!r}"
        rows, frame = " ".join(self.axes), "" if self.frame is None else f", frame {self.frame!r}"
        return f"<{word}: {self.blocks} of {rows}{frame}>"

    def __reduce__(self) -> tuple[Any, ...]:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        plain = {k: dict(v) if isinstance(v, Mapping) else v for k, v in values.items()}
        return _rebuilt, (type(self), plain)

    @property
    def files(self) -> tuple[tuple[str, int], ...]:
        """Files that it was read from, with their numbers of rows; none if it was not."""
        return tuple(Counter(row.name for row in self.origin).items())

    @property
    def blocks(self) -> int:
        """Number of blocks B; one without readings."""
        return len(getattr(self, "q", (None,)))

    @property
    def row_numbers(self) -> tuple[int, ...]:
        """Numbers among all rows of those that are measured."""
        chosen = getattr(self, "rows", None) or (True,) * len(self.all_rows)
        return tuple(k for k, is_measured in enumerate(chosen) if is_measured)

    @property
    def axes(self) -> tuple[str, ...]:
        """Label of each of the k rows of a block."""
        return tuple(self.all_rows[k][0] for k in self.row_numbers)

    @property
    def units(self) -> tuple[str, ...]:
        """``"m"`` or ``"rad"`` for each of the k rows of a block."""
        return tuple(self.all_rows[k][1] for k in self.row_numbers)

    @property
    def views(self) -> tuple[View, ...]:
        """Poses that are needed; block b uses row b of each view."""
        q = (getattr(self, f.name) for f in fields_of(type(self), "joints"))
        return tuple(View(self.frame, each) for each in q if each is not None)

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Unknowns besides the robot's."""
        return ()

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the target of each block, shape (B,)."""
        return np.zeros(self.blocks, dtype=np.int64)

    @property
    def knows_length(self) -> bool:
        """Whether a length is measured or given, so that the scale of the robot is observable."""
        return "m" in self.units

    @property
    def sees_base(self) -> bool:
        """Whether the base pose matters."""
        return self.in_world

    @property
    def scale_centres(self) -> tuple[Array, Array]:
        """Linear constraints ``A c = b`` on centres c of scaling, shapes (m, 3) and (m,).

        Scaling robot and base about c keeps every contact if all known targets contain c.
        """
        return np.zeros((0, 3)), np.zeros(0)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """First values of the fixtures from the poses of the nominal robot, shape (F,).

        None where other measurements that share the fixtures determine them.
        """
        return np.zeros(0)

    @abstractmethod
    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Residuals, predicted minus measured, and derivatives at given poses and fixtures."""

    def split(self, residual: Array, J: Array, parameters: int) -> Linearised:
        """Measured rows of all rows. Shapes: residual (B, rows), J (B, rows, P + F)."""
        at = list(self.row_numbers)
        return Linearised(residual[:, at], J[:, at, :parameters], J[:, at, parameters:])

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same measurement with other readings, one array for each view."""
        names = [f.name for f in fields_of(type(self), "joints")]
        return replace(self, **dict(zip(names, configurations, strict=False)))

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Only some of the blocks."""
        changed: dict[str, Any] = {}
        for f in fields(self):
            value = getattr(self, f.name)
            if "block" in f.metadata and isinstance(value, tuple):
                changed[f.name] = tuple(value[b] for b in blocks) if value else ()
            elif "block" in f.metadata and value is not None:
                changed[f.name] = value[blocks]
        if isinstance(self, Labelled):
            kept = {self.label[b] for b in blocks}
            changed["known"] = {k: v for k, v in self.known.items() if k in kept}
        return replace(self, **changed)

    @classmethod
    def drawn(cls, q: Array, T: Array, label: Any, **more: Any) -> Self:
        """Noise-free measurement of a robot with poses T of its end; equal labels, one target."""
        values: dict[str, Any] = {"pose": T, "point": T[:, :3, 3], "label": label}
        contents = {f.name: f.metadata.get("content") for f in fields(cls)}
        kind: Any = cls
        return kind(q, **{name: values[c] for name, c in contents.items() if c in values}, **more)


def fields_of(kind: type[Measurement], content: str) -> list[Field[Any]]:
    """Fields of a kind with some content."""
    return [f for f in fields(kind) if f.metadata.get("content") == content]


def required(kind: type[Measurement]) -> set[str]:
    """Contents of the fields, besides q, that have no default."""
    given = [f for f in fields(kind) if f.default is MISSING and f.name != "q"]
    return {f.metadata.get("content", "") for f in given}


def _rebuilt(kind: type[Measurement], values: dict[str, Any]) -> Measurement:
    return kind(**values)


def have_solution(A: Array, b: Array) -> bool:
    """Whether ``A c = b`` has a solution. Shapes: A (m, 3), b (m,)."""
    c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
    return bool(np.abs(A @ c - b).max(initial=0.0) <= 1e-9 * max(np.abs(b).max(initial=0.0), 1e-3))


class Labelled(Measurement):
    """Base of kinds whose blocks have targets: blocks with the same label share one."""

    __slots__ = ()

    known: Mapping[str, Array]
    unknowns: ClassVar[tuple[Row, ...]]
    """Coordinates of an unknown target."""

    @property
    def coordinates(self) -> tuple[Row, ...]:
        """Coordinates of an unknown target that the rows depend on."""
        return self.unknowns

    @property
    def label_field(self) -> str:
        """Name of the field of the labels."""
        return fields_of(type(self), "label")[0].name

    @property
    def label(self) -> tuple[str, ...]:
        """Label of each block."""
        return getattr(self, self.label_field) or ("0",) * self.blocks

    @property
    def labels(self) -> tuple[str, ...]:
        """Each label once, in the order in which they come."""
        return tuple(dict.fromkeys(self.label))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Labels of the targets that are estimated; none without labels."""
        given = self.labels if getattr(self, self.label_field) else ()
        return tuple(label for label in given if label not in self.known)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the label of each block."""
        return self._numbers(self.labels)

    @property
    def unknown_groups(self) -> NDArray[np.int64]:
        """Number of the label of each block among the unknown ones; -1 where it is known."""
        return self._numbers(self.unknown)

    def _numbers(self, labels: tuple[str, ...]) -> NDArray[np.int64]:
        number = {label: k for k, label in enumerate(labels)}
        return np.array([number.get(label, -1) for label in self.label], dtype=np.int64)

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the unknown targets."""
        return tuple(
            Fixture(f"{self.name}:{label}.{coordinate}", unit)
            for label in self.unknown
            for coordinate, unit in self.coordinates
        )

    @property
    def sees_base(self) -> bool:
        """Whether a target is known in the world."""
        return self.in_world and bool(self.known)

    def guess_each(self, guess: Callable[[NDArray[np.bool_]], Any]) -> Array:
        """First values of all unknown targets from a function of the blocks of one."""
        group = self.unknown_groups
        each = [guess(group == g) for g in range(len(self.unknown))]
        return np.concatenate([np.zeros(0), *each])

    def targets(
        self, unknown: Array, slope: Array, known: Mapping[str, Any]
    ) -> tuple[Array, Array]:
        """Target of each block and its derivative by the fixtures of all U unknown targets.

        Shapes: unknown (U, ...), slope (U, r, c) by own coordinates -> (B, ...), (B, r, U c).
        """
        U, r, c = slope.shape
        values = {**dict(zip(self.unknown, unknown, strict=True)), **known}
        derivative, group = np.zeros((self.blocks, r, U * c)), self.unknown_groups
        for g in range(U):
            derivative[group == g, :, c * g : c * g + c] = slope[g]
        return np.array([values[label] for label in self.label]), derivative


class Contact(Labelled):
    """Base of kinds whose end meets a target in each configuration."""

    __slots__ = ()

    is_constraint: ClassVar[bool] = True

    @property
    def knows_length(self) -> bool:
        """Whether known targets have no common point; else the robot can shrink towards it."""
        return not have_solution(*self.scale_centres)

    @property
    def scale_centres(self) -> tuple[Array, Array]:
        """Points at which the rows in metres of known targets vanish: they are linear in them."""
        T, psi = np.tile(np.eye(4), (self.blocks, 1, 1)), np.tile(np.eye(6, 3), (self.blocks, 1, 1))
        part = self.linearise([Evaluation(T, psi)], np.zeros(len(self.fixtures)))
        rows = np.outer(self.unknown_groups < 0, [unit == "m" for unit in self.units])
        return part.by_parameters[rows], -part.residual[rows]

    @staticmethod
    @abstractmethod
    def target_at(T: Array, rng: np.random.Generator) -> Array:
        """A known target that an end at pose T meets, its free coordinates random."""


# --- several measurements -------------------------------------------------------------------------


def whitened(measurement: Measurement, rows: Array, scale: Array) -> Array:
    """Rows divided by their standard deviations, or by the root of their covariance.

    Shapes: rows (B, k) or (B, k, m), scale (k,).
    """
    columns = rows if rows.ndim == 3 else rows[..., None]
    if measurement.covariance is not None:
        columns = np.linalg.solve(np.linalg.cholesky(measurement.covariance), columns)
    else:
        sigma = scale if measurement.sigma is None else measurement.sigma
        columns = columns / sigma[..., None]
    return columns.reshape(rows.shape)


def scale_is_observable(measurements: Iterable[Measurement], base_origin: Any = None) -> bool:
    """Whether measurements determine the scale of a robot, all of them together."""
    measurements = tuple(measurements)
    if any(m.knows_length for m in measurements):
        return True
    parts = [m.scale_centres for m in measurements]
    if base_origin is not None:
        parts.append((np.eye(3), np.asarray(base_origin)))
    return not have_solution(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def single_observations(measurements: Iterable[Measurement]) -> dict[str, str]:
    """Targets with no more rows than unknown coordinates of their own, and a sentence on each."""
    unknowns: dict[str, set[str]] = {}
    rows = Counter[str]()
    for m in measurements:
        for target in dict.fromkeys(f.name.rpartition(".")[0] for f in m.fixtures):
            names = (f.name for f in m.fixtures if f.name.rpartition(".")[0] == target)
            unknowns.setdefault(target, set()).update(names)
            # fixtures of kinds without labels are common to all blocks
            label = target.removeprefix(f"{m.name}:")
            count = m.label.count(label) if isinstance(m, Labelled) else m.blocks
            rows[target] += count * len(m.axes)
    return {
        target: f"{target} has {rows[target]} measured rows: they determine its {len(names)} "
        "unknown coordinates at most, and no parameter of the robot. Measure it in more postures, "
        "or leave it out."
        for target, names in unknowns.items()
        if rows[target] <= len(names)
    }
