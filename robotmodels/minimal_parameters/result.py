"""What `base_parameters` returns: the parameters that are kept and what each stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats, read_only
from ..drive import Drives, drive_kinds
from ..errors import InvalidValueError, ShapeError
from ..estimation.columns import NOTHING
from ..friction import Friction
from ..latex_text import markdown
from ..model import RobotModel, check_model
from ..regressors import energy_parameter_names, parameter_names, parameter_vector
from .alignment import aligned_robot
from .belonging import differences
from .formulas import Formula, numeric_formulas, symbolic_formulas
from .printing import table_latex, table_text
from .values_table import BaseValues, KeptNames, base_values


class BaseMethod(Enum):
    """How base parameters were found.

    Examples
    --------
    >>> BaseMethod("numeric")
    <BaseMethod.NUMERIC: 'numeric'>
    """

    SYMBOLIC = "symbolic"
    NUMERIC = "numeric"


@dataclass(frozen=True, eq=False, repr=False)
class BaseParameters:
    """The fewest inertial (and drive) parameters that give the same torques. Read-only, picklable.

    Also called minimal, identifiable or barycentric parameters.

    Parameters
    ----------
    model : RobotModel
        The robot.
    drive : bool or collection of DriveKind or str
        Which kinds of its drive parameters are among the p standard parameters; kept as a tuple of
        `DriveKind`, empty where there are none.
    kept : ndarray of int, shape (b,)
        Which of them are kept, by number.
    matrix : ndarray, shape (b, p)
        ``beta = matrix @ pi``: base parameters from standard parameters.
    method : BaseMethod
        How they were found.
    gap : (float, float), optional
        Of the numeric method: the least that a kept column has beyond those kept before it, and the
        most that one has which is not kept, as parts of the longest column of all (parameters in
        natural units, those of a robot of this size and unit mass). It is what decides: what is
        below the tolerance is not kept. Far apart, the rank is beyond doubt; where they are not,
        `notes` says which parameters are in doubt.
    friction : Friction, optional
        A linear friction model whose parameters come after those of the drives.
    tolerance : float
        Part of the largest torque that counts as nothing.
    notes : tuple of str
        What is to be known of the result, in sentences: axes that are aligned only nearly, joints
        that are constrained, a rank that is in doubt, a motion that shows little.
    neglected : tuple of str
        Parameters that torques show, but with less than the tolerance, or only by the angles of
        axes that were taken as aligned.
    missed : float, optional
        Largest torque that they miss on a motion that was not used to find them, as part of the
        largest; of logged motion on its own samples. None where rules alone gave them.
    angle : float
        Angle in rad up to which axes were taken as parallel or perpendicular.

    Raises
    ------
    ShapeError
        Fields that do not fit each other.

    Notes
    -----
    Two results are compared in the torque, ``reduce(W) @ matrix``, and not by their matrices: where
    a kept column hardly acts, its row of the matrix may be moved by much and no torque shows it.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(load("planar_2r"), drive=False)
    >>> base.names
    ('ZZ1', 'ZZ2', 'MX2', 'MY2')
    >>> dict(base.regrouping["ZZ1"])
    {'ZZ1': 1.0, 'M2': 1.0}
    """

    model: RobotModel
    drive: Drives
    kept: NDArray[np.int64]
    matrix: Array
    method: BaseMethod
    gap: tuple[float, float] | None = None
    friction: Friction | None = None
    tolerance: float = NOTHING
    notes: tuple[str, ...] = ()
    neglected: tuple[str, ...] = ()
    missed: float | None = None
    angle: float = NOTHING

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
        """Standard parameters that no torque shows."""
        shown = {*self.neglected}
        names = np.array(self.parameter_names)[~self.matrix.any(axis=0)].tolist()
        return tuple(name for name in names if name not in shown)

    @cached_property
    def alone(self) -> tuple[str, ...]:
        """Standard parameters that are determined one by one."""
        single = (self.matrix != 0).sum(axis=1) == 1
        return tuple(self.parameter_names[k] for k in self.kept[single])

    @cached_property
    def in_combination(self) -> tuple[str, ...]:
        """Standard parameters that are determined only together with others."""
        apart = {*self.no_effect, *self.neglected, *self.alone}
        return tuple(name for name in self.parameter_names if name not in apart)

    @cached_property
    def regrouping(self) -> Mapping[str, Mapping[str, float]]:
        """Of each kept parameter, the coefficients of all that it stands for, itself included.

        By its standard name, ``ZZ1``, or as it is printed, ``ZZ1R``.
        """
        names = self.parameter_names
        found = KeptNames(
            (name, MappingProxyType({names[k]: float(row[k]) for k in np.flatnonzero(row)}))
            for name, row in zip(self.names, self.matrix, strict=True)
        )
        return MappingProxyType(found)

    @cached_property
    def null_space(self) -> Array:
        """Changes of the standard parameters that no torque shows, shape (p, p - b).

        One column for each parameter that is not kept: it changes by 1, and the kept ones make up
        for it.
        """
        p = len(self.parameter_names)
        others = np.setdiff1d(np.arange(p), self.kept)
        changes = np.zeros((p, len(others)))
        changes[others, np.arange(len(others))] = 1.0
        changes[self.kept] = -self.matrix[:, others]
        return read_only(changes)

    def reduce(self, W: ArrayLike) -> Array:
        """The columns of a regressor that belong to the base parameters.

        Parameters
        ----------
        W : array_like, shape (..., p)
            Regressor with a column for each standard parameter, such as `torque_regressor` of
            the same ``drive``.

        Returns
        -------
        ndarray, shape (..., b)
            ``reduce(W) @ values(model)`` equals ``W @ parameter_vector(model)``.

        Raises
        ------
        ShapeError
            Another number of columns.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters
        >>> base_parameters(load("planar_2r"), drive=False).reduce(np.ones((5, 2, 20))).shape
        (5, 2, 4)
        """
        W = as_floats(W, "W")
        p = len(self.parameter_names)
        if W.ndim < 1 or W.shape[-1] != p:
            raise ShapeError(
                f"W: expected shape (..., {p}), a column for each standard parameter (with the "
                "same friction as these base parameters, and the same drives: "
                f"drive={tuple(kind.value for kind in drive_kinds(self.drive))}), got {W.shape}."
                + self._energy_hint(W.shape[-1] if W.ndim else 0)
            )
        return np.ascontiguousarray(W[..., self.kept])

    def _energy_hint(self, columns: int) -> str:
        """What is missing where a regressor has the columns of an energy."""
        energy = energy_parameter_names(self.model, self.drive)
        if columns not in (len(energy), len(energy_parameter_names(self.model))):
            return ""
        kinds = dict.fromkeys(
            name.rstrip("0123456789") for name in self.parameter_names if name not in energy
        )
        if not kinds:
            return ""
        return (
            f" An energy has no columns of {', '.join(kinds)}: reduce it by base parameters without"
            " them, base_parameters(model, drive=('Ia',))."
        )

    def values(self, model: RobotModel) -> Array:
        """Base parameters of a model's own standard parameters.

        Parameters
        ----------
        model : RobotModel
            A robot of the same structure.

        Returns
        -------
        ndarray, shape (b,)
            ``matrix @ parameter_vector(model)``.

        Raises
        ------
        InvalidValueError
            A robot with other base parameters: another structure, geometry, gravity or coupling.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters
        >>> arm = load("planar_2r")
        >>> base_parameters(arm).values(arm).shape
        (9,)
        """
        self.check(model)
        return self.matrix @ parameter_vector(model, self.drive, self.friction)

    def value_table(self, values: RobotModel | ArrayLike) -> BaseValues:
        """Names, values and units side by side.

        Parameters
        ----------
        values : RobotModel or array_like, shape (b,)
            A robot of the same structure, or values such as identified ones.

        Returns
        -------
        BaseValues
            A mapping of names to values that prints as a table.

        Raises
        ------
        InvalidValueError, ShapeError
            A robot with other base parameters; another number of values; NaN.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters
        >>> arm = load("planar_2r")
        >>> table = base_parameters(arm, drive=False).value_table([4.0, 1.0, 0.5, 0.0])
        >>> table["ZZ1"], table["ZZ1R"]
        (4.0, 4.0)
        """
        if isinstance(values, RobotModel):
            numbers = self.values(values)
        else:
            numbers = as_exact(values, (len(self),), "values")
        return base_values(self.names, self.matrix, self.model.table.sigma, numbers)

    def belongs_to(self, model: RobotModel) -> bool:
        """Whether a robot has these base parameters, with values of its own.

        Parameters
        ----------
        model : RobotModel
            A robot; its inertial and drive parameters, zeros of the joints, tool and names do not
            matter.

        Returns
        -------
        bool
            Same frames and constants of the table, same gravity in the base, same coupled motors.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters
        >>> base_parameters(load("rx90")).belongs_to(load("puma560"))
        False
        """
        check_model(model)
        return not differences(self.model, model, self.drive)

    def check(self, model: RobotModel) -> None:
        """Refuse a robot that has other base parameters.

        Parameters
        ----------
        model : RobotModel
            A robot.

        Raises
        ------
        InvalidValueError
            It does not have these base parameters, see `belongs_to`.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters
        >>> base_parameters(load("rx90")).check(load("rx90"))
        """
        check_model(model)
        if found := differences(self.model, model, self.drive):
            raise InvalidValueError(
                f"model: these are base parameters of {self.model.name!r}, and {model.name!r} has "
                f"others: {'; '.join(found)}. Ask for those of the model itself."
            )

    @cached_property
    def formulas(self) -> tuple[Formula, ...]:
        """What each kept parameter stands for, term by term.

        Of the symbolic method with the coefficients in symbols of the table, else in numbers.
        """
        if self.method is BaseMethod.SYMBOLIC:
            model = aligned_robot(self.model, self.angle).model
            return symbolic_formulas(
                model, self.drive, self.kept, self.matrix, self.parameter_names, self.tolerance
            )
        return self.numbers

    @cached_property
    def numbers(self) -> tuple[Formula, ...]:
        """The formulas with numbers as coefficients."""
        return numeric_formulas(self.parameter_names, self.kept, self.matrix)

    @cached_property
    def text(self) -> str:
        """The table of the book, as text."""
        return table_text(self)

    @cached_property
    def latex(self) -> str:
        """The same in LaTeX."""
        return table_latex(self)

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
        return type(self), (
            self.model, self.drive, self.kept, self.matrix, self.method, self.gap, self.friction,
            self.tolerance, self.notes, self.neglected, self.missed, self.angle,
        )  # fmt: skip
