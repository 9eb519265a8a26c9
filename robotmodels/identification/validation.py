"""How well parameters predict the torques of a log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from ..errors import InvalidValueError
from ..logs import Log
from ..minimal_parameters import BaseParameters
from .equations import EquationForm, Equations
from .prediction import predicted_torque
from .preparation.processing import Processing
from .preparation.signals import piece_signals, pieces


@dataclass(frozen=True, slots=True, eq=False)
class Validation(Rebuilt):
    """Errors of predicted torques, by joint. Read-only.

    Parameters
    ----------
    rmse : ndarray, shape (n,)
        Root mean square of measured less predicted torque at the rate of the log, N m or N.
    relative : ndarray, shape (n,)
        Its part of the root mean square of the measured torque.
    bias : ndarray, shape (n,)
        Mean of measured less predicted torque, N m or N.
    filtered_rmse : ndarray, shape (n,)
        Root mean square of the residuals of the equations, in which both sides are filtered and
        dead bands left out; NaN for a joint without equations.
    filtered_relative : ndarray, shape (n,)
        Its part of the filtered torque.
    correlation : ndarray, shape (n,)
        Of successive residuals of the equations.
    samples : int
        Of the log, edges left out.
    """

    rmse: Array
    relative: Array
    bias: Array
    filtered_rmse: Array
    filtered_relative: Array
    correlation: Array
    samples: int

    def __post_init__(self) -> None:
        names = ("rmse", "relative", "bias", "filtered_rmse", "filtered_relative", "correlation")
        for name in names:
            object.__setattr__(self, name, read_only(getattr(self, name)))


def validate(
    base: BaseParameters,
    names: tuple[str, ...],
    values: Array,
    log: Log,
    processing: Processing,
    system: Equations | None = None,
    ramp: Array | None = None,
) -> Validation:
    """Compare predicted torques with those of a log, which may be another one.

    Parameters
    ----------
    base : BaseParameters
        Of the robot.
    names : tuple of str
        The b parameters that were identified.
    values : ndarray, shape (b,)
        Their values.
    log : Log
        The log.
    processing : Processing
        How positions become velocities and accelerations.
    system : Equations, optional
        The equations of these torques, where they have been made; others are not used.
    ramp : ndarray, shape (n,), optional
        Velocities over which dry friction rises, rad/s or m/s; default the dead bands.

    Returns
    -------
    Validation
        Errors by joint.

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> from robotmodels.identification import choose_processing, fit
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> found = fit(arm, log, drive=("Fv",))
    >>> errors = validate(found.base, found.names, found.values, log, choose_processing(log))
    >>> bool((errors.relative < 1e-3).all()), errors.samples > 3000
    (True, True)
    """
    if system is None or system.form is not EquationForm.TORQUE or system.names != names:
        system = Equations(base, names, log, processing)
    n = log.n
    widths = processing.dead_band if ramp is None else ramp
    squares, sums, whole = np.zeros(n), np.zeros(n), np.zeros(n)
    samples = 0
    kept, filtered, taken = np.zeros(n), np.zeros(n), np.zeros(n)
    products = np.zeros(n)
    last = np.zeros((0, n))
    for piece in pieces(log, processing):
        found = piece_signals(log, processing, piece, 0)
        e = found.tau - predicted_torque(base, names, values, found.q, found.v, found.a, widths)
        squares += (e * e).sum(axis=0)
        sums += e.sum(axis=0)
        whole += (found.tau**2).sum(axis=0)
        samples += len(e)
        block = system.block(piece)
        r = np.where(block.use, block.y - block.W @ values, 0.0)
        kept += (r * r).sum(axis=0)
        filtered += np.where(block.use, block.y**2, 0.0).sum(axis=0)
        taken += block.use.sum(axis=0)
        chain = np.vstack((last, r))
        products += (chain[1:] * chain[:-1]).sum(axis=0)
        last = r[-1:]
    if not samples:
        raise InvalidValueError(
            f"log: none of its recordings is longer than the {2 * processing.edges} samples that "
            "are cut at both ends; give a longer one, or shorter edges=."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        return Validation(
            np.sqrt(squares / samples), np.sqrt(squares / whole), sums / samples,
            np.sqrt(kept / taken), np.sqrt(kept / filtered), products / kept, samples,
        )  # fmt: skip
