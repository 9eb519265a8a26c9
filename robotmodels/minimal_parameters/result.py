"""Base parameters: kept parameters and the standard parameters regrouped into them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats, read_only
from ..drive import Drives, drive_kinds
from ..errors import InvalidValueError, ShapeError
from ..estimation.columns import NEGLIGIBLE
from ..friction import Friction
from ..geometry import PRISMATIC, REVOLUTE
from ..latex_text import markdown
from ..model import RobotModel, check_model
from ..regressors import parameter_names, parameter_vector
from .alignment import aligned_robot
from .formulas import Formula, formulas, symbolic_texts
from .rules import reach
from .tables import BaseValues, KeptNames, base_latex, base_text, base_values

_SAME = 1e-9
"""Tolerance of the same constants, relative to 1 (directions) or to the robot's size."""


class BaseMethod(Enum):
    """Method that determined base parameters."""

    SYMBOLIC = "symbolic"
    NUMERIC = "numeric"


@dataclass(frozen=True, eq=False, repr=False)
class BaseParameters:
    """Minimal set of inertial (and drive) parameters of a robot. Read-only, picklable.

    Compare two results in the torque, ``reduce(W) @ matrix``: where a kept column has little
    effect, its row of the matrix may change much.

    Parameters
    ----------
    kept : ndarray of int, shape (b,)
        Numbers of the kept standard parameters.
    matrix : ndarray, shape (b, p)
        ``beta = matrix @ pi``: base parameters from standard parameters.
    method : BaseMethod
        Method that determined them.
    gap : (float, float), optional
        Rank gap of the numeric method: smallest residual norm of a kept column and largest of a
        dropped one, relative to the longest column (parameters in natural units).
    tolerance, angle : float
        Part of the largest torque that counts as zero; angle in rad up to which axes were aligned.
    notes : tuple of str
        Nearly aligned axes, constrained joints, an uncertain rank, a motion with little excitation.
    neglected : tuple of str
        Parameters whose effect on the torques is below the tolerance, or only due to the angles of
        axes treated as aligned.
    torque_error : float, optional
        Largest torque error on an independent motion, relative to the largest torque; for logged
        motion on the same samples. None for symbolic rules alone.
    """

    model: RobotModel
    drive: Drives
    kept: NDArray[np.int64]
    matrix: Array
    method: BaseMethod
    gap: tuple[float, float] | None = None
    friction: Friction | None = None
    tolerance: float = NEGLIGIBLE
    notes: tuple[str, ...] = ()
    neglected: tuple[str, ...] = ()
    torque_error: float | None = None
    angle: float = NEGLIGIBLE

    def __post_init__(self) -> None:
        object.__setattr__(self, "drive", drive_kinds(self.drive))
        object.__setattr__(self, "kept", read_only(self.kept, np.int64))
        object.__setattr__(self, "matrix", read_only(self.matrix))
        shape = (len(self.kept), len(self.parameter_names))
        if self.matrix.shape != shape:
            raise ShapeError(f"matrix: expected shape {shape}, got {self.matrix.shape}.")

    def __len__(self) -> int:
        return len(self.kept)

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """The p standard parameters."""
        return parameter_names(self.model, self.drive, self.friction)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The kept parameters by their standard names, in the order of the columns."""
        return tuple(self.parameter_names[k] for k in self.kept)

    @cached_property
    def no_effect(self) -> tuple[str, ...]:
        """Standard parameters without effect on the torques."""
        shown = {*self.neglected}
        names = np.array(self.parameter_names)[~self.matrix.any(axis=0)].tolist()
        return tuple(name for name in names if name not in shown)

    @cached_property
    def alone(self) -> tuple[str, ...]:
        """Standard parameters that are identifiable one by one."""
        single = (self.matrix != 0).sum(axis=1) == 1
        return tuple(self.parameter_names[k] for k in self.kept[single])

    @cached_property
    def in_combination(self) -> tuple[str, ...]:
        """Standard parameters that are identifiable only together with others."""
        apart = {*self.no_effect, *self.neglected, *self.alone}
        return tuple(name for name in self.parameter_names if name not in apart)

    @cached_property
    def regrouping(self) -> Mapping[str, Mapping[str, float]]:
        """Coefficients of standard parameters in each kept one, by name (``ZZ1`` or ``ZZ1R``)."""
        names = self.parameter_names
        coefficients = KeptNames(
            (name, MappingProxyType({names[k]: float(row[k]) for k in np.flatnonzero(row)}))
            for name, row in zip(self.names, self.matrix, strict=True)
        )
        return MappingProxyType(coefficients)

    @cached_property
    def null_space(self) -> Array:
        """Changes of the standard parameters without an effect on torques, shape (p, p - b).

        A column for each parameter that is not kept: it changes by 1, the kept ones compensate.
        """
        p = len(self.parameter_names)
        others = np.setdiff1d(np.arange(p), self.kept)
        changes = np.zeros((p, len(others)))
        changes[others, np.arange(len(others))] = 1.0
        changes[self.kept] = -self.matrix[:, others]
        return read_only(changes)

    def reduce(self, W: ArrayLike) -> Array:
        """Columns (..., b) of a regressor (..., p) that belong to the base parameters."""
        W = as_floats(W, "W")
        p = len(self.parameter_names)
        if W.ndim < 1 or W.shape[-1] != p:
            raise ShapeError(
                f"W: expected shape (..., {p}), a column for each standard parameter (with the "
                "same friction as these base parameters, and the same drives: "
                f"drive={tuple(kind.value for kind in drive_kinds(self.drive))}), got {W.shape}; "
                "for an energy, drive=('Ia',) or less."
            )
        return np.ascontiguousarray(W[..., self.kept])

    def values(self, model: RobotModel) -> Array:
        """Base parameters (b,) of a model's standard parameters; raises for other structures."""
        self.check(model)
        return self.matrix @ parameter_vector(model, self.drive, self.friction)

    def value_table(self, values: RobotModel | ArrayLike) -> BaseValues:
        """Names, values and units side by side, of a robot or of values (b,)."""
        if isinstance(values, RobotModel):
            numbers = self.values(values)
        else:
            numbers = as_exact(values, (len(self),), "values")
        return base_values(self.names, self.matrix, self.model.table.sigma, numbers)

    def belongs_to(self, model: RobotModel) -> bool:
        """Whether a robot has the same geometry, gravity in the base and coupled motors.

        Inertial and drive parameters, zeros of the joints, tool and names do not matter.
        """
        check_model(model)
        return not structure_differences(self.model, model, self.drive)

    def check(self, model: RobotModel) -> None:
        """Raise for a robot with other base parameters, see `belongs_to`."""
        check_model(model)
        if differences := structure_differences(self.model, model, self.drive):
            raise InvalidValueError(
                f"model: these are base parameters of {self.model.name!r}, and {model.name!r} has "
                f"others: {'; '.join(differences)}. Compute those of the model itself."
            )

    @cached_property
    def formulas(self) -> tuple[Formula, ...]:
        """The terms of each kept parameter; coefficients in symbols of the table, or in numbers."""
        if self.method is BaseMethod.NUMERIC:
            return self.numbers
        model = aligned_robot(self.model, self.angle)[0]
        texts = symbolic_texts(model, self.drive, self.kept, self.matrix, self.tolerance)
        return formulas(self.parameter_names, self.kept, self.matrix, texts)

    @cached_property
    def numbers(self) -> tuple[Formula, ...]:
        """The formulas with numbers as coefficients."""
        return formulas(self.parameter_names, self.kept, self.matrix, {})

    @property
    def text(self) -> str:
        """The table of the book, as text."""
        return base_text(self)

    @property
    def latex(self) -> str:
        """The table of the book, in LaTeX."""
        return base_latex(self)

    def _repr_markdown_(self) -> str:
        return markdown(self.latex)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return (
            f"<BaseParameters of {self.model.name!r}: {len(self)} of {len(self.parameter_names)}, "
            f"{len(self.no_effect)} without effect, {self.method.name.lower()}>"
        )

    def __reduce__(self) -> tuple[object, ...]:  # rebuilt, so that its arrays are read-only again
        return type(self), tuple(getattr(self, field.name) for field in fields(self))


def structure_differences(model: RobotModel, other: RobotModel, drive: Drives) -> list[str]:
    """Differences of two robots that change their base parameters."""
    a, b = model.chain, other.chain
    if model is other:
        return []
    if not (np.array_equal(a.antecedent, b.antecedent) and np.array_equal(a.sigma, b.sigma)):
        return ["its frames or kinds of joints differ"]
    z, revolute, slides = a.rotation[:, :, 2], a.sigma == REVOLUTE, a.sigma == PRISMATIC
    turned = np.abs(a.rotation - b.rotation)
    turned[revolute, :, :2] = 0.0  # the zero of a revolute joint is free
    moved = a.position - b.position
    moved -= slides[:, None] * np.sum(moved * z, axis=1, keepdims=True) * z
    moved[a.antecedent == 0] = 0.0  # the place of the base has no effect
    off = (turned.max(axis=(1, 2)) > _SAME) | (np.abs(moved).max(axis=1) > _SAME * reach(model))
    differences = [f"axis {k + 1} has another place" for k in np.flatnonzero(off)]
    down, below = (np.asarray(m.gravity) @ m.chain.base_rotation for m in (model, other))
    if np.abs(down - below).max() > _SAME * max(1.0, float(np.abs(down).max())):
        differences.append(f"gravity in the base is {below.round(4)} instead of {down.round(4)}")
    if any(kind.coupling is not None for kind in drive_kinds(drive)):
        mine, theirs = (_coupled(m) for m in (model, other))
        if mine.keys() != theirs.keys() or any(
            np.abs(mine[m] - theirs[m]).max() > _SAME for m in mine
        ):
            differences.append("other motors are coupled, or in another way")
    return differences


def _coupled(model: RobotModel) -> dict[int, Array]:
    """Weights of the joints (n,) of each coupled motor."""
    K = model.transmission
    return {} if K is None else {m: K.weights[m - 1] for m in K.coupled_motors}
