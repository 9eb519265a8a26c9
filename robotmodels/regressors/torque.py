"""Torque regressor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from numpy.typing import ArrayLike

from .._arrays import Array
from ..drive import Drives
from ..friction import Friction, LinearFriction
from ..model import RobotModel
from .chunks import FORMS, Form, chunked, evaluate
from .columns import LINKS, ChosenColumns, Columns
from .drives import add_torques, friction_terms, rotor_terms


def torque_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Array:
    """Matrix W of the inverse dynamic model: ``idm(model, q, v, a) = W @ parameters``.

    Also called the identification (observation) matrix; ``computeJointTorqueRegressor``.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints; its own inertia is not used.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations; the leading axes broadcast.
    drive : bool or collection of DriveKind or str
        Drive parameters with columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        couplings of motors belong to their kinds.
    columns : indices, names, mask or BaseParameters, optional
        A choice of the columns, which alone are computed; default all.
    friction : Friction, optional
        A friction model that is linear in its parameters; its columns come last.

    Returns
    -------
    ndarray, shape (..., n, p)
        p = 10 f + 4 n (10 f without drives), three more for each coupled motor; columns as
        `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; columns that do not exist;
        friction that is not linear.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> torque_regressor(one, [0.0], [3.0], [2.0], columns=["ZZ1", "Fv1"])
    array([[2., 3.]])
    """
    return evaluate(FORMS[torque_regressor], model, (q, v, a), drive, columns, friction)


def torque_regressor_chunks(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    size: int = 256,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Iterator[tuple[slice, Array]]:
    """The torque regressor of a long log, piece by piece: `chunked` of `torque_regressor`.

    Parameters
    ----------
    model, q, v, a, drive, columns, friction
        As for `torque_regressor`; q, v, a of shape (N, n), in rad or m, per s and per s^2.
    size : int
        Samples in a piece.

    Yields
    ------
    rows : slice
        Samples of the piece.
    W : ndarray, shape (k, n, p)
        Their regressor. The next piece overwrites it: use or copy it before going on.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> samples = np.zeros((1000, 1))
    >>> [W.shape[0] for _, W in torque_regressor_chunks(one, samples, samples, samples, size=400)]
    [400, 400, 200]
    """
    return chunked(
        torque_regressor, model, q, v, a, size=size, drive=drive, columns=columns, friction=friction
    )


def fill_torques(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    W: Array,
) -> None:
    """Write the chosen columns of the samples ``(q, v, a)`` into ``W (N, n, c)``."""
    from ..kernels.regressors import torque_regressors

    q, v, a = rows
    torque_regressors(q, v, a, model.chain, model.gravity, chosen.places[LINKS], W)
    add_torques(chosen, rotor_terms(model, a), W)
    add_torques(chosen, friction_terms(model, q, v, friction), W)


FORMS[torque_regressor] = Form(fill_torques, "qva")
