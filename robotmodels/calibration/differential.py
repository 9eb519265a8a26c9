"""The generalised differential model: how every parameter moves what is measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_vector
from .extended_table import Frame
from .parameters import GeometricParameters


class DifferentialModel(NamedTuple):
    """Poses of an end with the deviations applied, and their derivatives.

    Attributes
    ----------
    T : ndarray, shape (..., 4, 4)
        World poses, metres.
    psi : ndarray, shape (..., 6, P)
        ``[v; w]`` of the end per unit of each parameter, world axes, at the end's origin
        (m and rad, per m, rad or the unit of the parameter).

    Examples
    --------
    >>> DifferentialModel(np.eye(4), np.zeros((6, 2))).psi.shape
    (6, 2)
    """

    T: Array
    psi: Array


def differential_model(
    parameters: GeometricParameters,
    q: ArrayLike,
    deviation: ArrayLike | None = None,
    frame: Frame = None,
    factors: Array | None = None,
) -> DifferentialModel:
    """Generalised differential model ``dX = Psi(q, xi) d xi`` (identification Jacobian).

    Parameters
    ----------
    parameters : GeometricParameters
        P parameters.
    q : array_like, shape (..., n)
        Readings of the joints, rad or m.
    deviation : array_like, shape (P,), optional
        Values of the parameters, added to the nominal ones; default zero.
    frame : str, int or None
        The end; one of those the parameters were made for.
    factors : ndarray, shape (N, A), optional
        ``parameters.factors(q)`` where it is known already.

    Returns
    -------
    DifferentialModel
        Poses and Psi.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, an end that was not given to `candidate_parameters`.

    References
    ----------
    Seed book section 1.4.3.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> found = differential_model(candidate_parameters(load("rx90")), np.zeros((5, 6)))
    >>> found.T.shape, found.psi.shape
    ((5, 4, 4), (5, 6, 34))
    """
    from ..kernels.erroneous_poses import erroneous_poses

    skeleton = parameters.skeleton
    q = as_vector(q, parameters.model.n, "q")
    P = len(parameters)
    xi = np.zeros(P) if deviation is None else as_exact(deviation, (P,), "deviation")
    rows = np.ascontiguousarray(q.reshape(-1, q.shape[-1]))
    factor = parameters.factors(rows) if factors is None else factors
    T = np.empty((len(rows), 4, 4))
    psi = np.empty((len(rows), 6, P))
    end = skeleton.end_row(frame) - 1 - skeleton.model.f
    erroneous_poses(
        rows, skeleton.nominal, skeleton.sigma, skeleton.joint, skeleton.path(frame),
        np.ascontiguousarray(skeleton.before[:3, :3]),
        np.ascontiguousarray(skeleton.before[:3, 3]),
        np.ascontiguousarray(skeleton.after[end, :3, :3]),
        np.ascontiguousarray(skeleton.after[end, :3, 3]),
        np.ascontiguousarray(xi), *parameters.actions, factor, T, psi,
    )  # fmt: skip
    return DifferentialModel(T.reshape(*q.shape[:-1], 4, 4), psi.reshape(*q.shape[:-1], 6, P))
