"""Base parameters of a robot, by rules or by numbers."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_vector, batch_rows
from .._choices import chosen
from ..drive import Transmission
from ..errors import InvalidValueError, ShapeError
from ..estimation.columns import DEPENDENT
from ..model import RobotModel, check_model
from .numeric import base_by_numbers
from .result import BaseMethod, BaseParameters
from .symbolic import base_by_rules


def base_parameters(
    model: RobotModel,
    method: Literal["symbolic", "numeric"] | BaseMethod = "symbolic",
    drive: bool = True,
    motion: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    constraint: ArrayLike | Transmission | None = None,
    tolerance: float = DEPENDENT,
) -> BaseParameters:
    """Base inertial parameters: the fewest that give the same torques.

    Also called minimal, barycentric or identifiable parameters. Both methods keep Khalil's choice:
    the parameters of the frames nearest to the base before those behind them, link parameters
    before ``Ia`` before ``Fv``, ``Fc`` and ``offset``; what depends on others is regrouped into
    those that come before it.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints; serial or tree, any base and gravity.
    method : {"symbolic", "numeric"}
        By Khalil's rules, with formulas, or from the columns of the torque regressor.
    drive : bool
        Whether the drive parameters are among the standard ones.
    motion : tuple of array_like, shapes (N, n), optional
        Joint variables (rad or m), velocities and accelerations that the regressor is taken on, of
        the numeric method; default random ones. What logged motion does not show is not kept.
    constraint : array_like, shape (n, u), or Transmission, optional
        Joints that are bound to each other, ``v = constraint u`` (mimic joints, a transmission):
        the torques are those of the u free variables. Of the numeric method.
    tolerance : float
        Sine of the angle to the columns kept before, below which a column depends on them. Of the
        numeric method; `BaseParameters.gap` says how far from it the columns are.

    Returns
    -------
    BaseParameters
        ``.names``, ``.regrouping``, ``.matrix``, ``.no_effect``; prints as the book's table.

    Raises
    ------
    InvalidValueError
        Another method; motion, a constraint or a tolerance for the symbolic one; NaN; an empty log.
    ShapeError
        Arrays of the wrong shape.

    References
    ----------
    Seed book section 1.5.3; M. Gautier and W. Khalil, "Direct calculation of minimum set of
    inertial parameters of serial robots", IEEE T-RA 6(3), 1990; W. Khalil and F. Bennis, "Comments
    on ...", IEEE T-RA 10(1), 1994.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> base = base_parameters(load("rx90"), drive=False)
    >>> len(base), dict(base.regrouping["ZZ4"])
    (36, {'ZZ4': 1.0, 'YY5': 1.0})
    """
    check_model(model)
    if chosen(BaseMethod, method, "method") is BaseMethod.SYMBOLIC:
        given = {"motion": motion, "constraint": constraint}
        if any(value is not None for value in given.values()) or tolerance != DEPENDENT:
            names = [name for name, value in given.items() if value is not None] or ["tolerance"]
            raise InvalidValueError(
                f"{names[0]}: the symbolic method knows the table alone; use method='numeric'."
            )
        return base_by_rules(model, bool(drive))
    if not 0.0 < tolerance < 1.0:
        raise InvalidValueError(f"tolerance: expected a sine between 0 and 1, got {tolerance}.")
    samples = None if motion is None else _samples(model, motion)
    bound = None if constraint is None else _bound(model, constraint)
    return base_by_numbers(model, bool(drive), samples, bound, tolerance)


def _samples(
    model: RobotModel, motion: tuple[ArrayLike, ArrayLike, ArrayLike]
) -> tuple[Array, Array, Array]:
    if not isinstance(motion, (tuple, list)) or len(motion) != 3:
        raise InvalidValueError("motion: expected three arrays (q, v, a), each of shape (N, n).")
    names = ("q", "v", "a")
    arrays = tuple(as_vector(x, model.n, s) for x, s in zip(motion, names, strict=True))
    _, rows = batch_rows(arrays, names)
    if rows[0].shape[0] == 0:
        raise InvalidValueError(
            "motion: the log is empty; give at least one sample, or none for random motion."
        )
    return rows[0], rows[1], rows[2]


def _bound(model: RobotModel, constraint: ArrayLike | Transmission) -> Array:
    matrix = constraint.matrix if isinstance(constraint, Transmission) else constraint
    G = as_core(matrix, (), "constraint")
    if G.ndim != 2 or G.shape[0] != model.n or G.shape[1] == 0:
        raise ShapeError(
            f"constraint: expected shape ({model.n}, u), a row for each joint, got {G.shape}."
        )
    if not np.any(G):
        raise InvalidValueError("constraint: all zero, so nothing moves.")
    return G
