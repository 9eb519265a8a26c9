"""How well parameters predict the torques of a log."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from ..errors import InvalidValueError
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel
from .equations import EquationForm, Equations
from .prediction import predicted_torque
from .preparation.filters import decimation_window
from .preparation.processing import Processing
from .preparation.signals import piece_signals, pieces
from .reporting.parameters import percent

POOR = 0.3
"""Part of the torque that is left over, above which a prediction is bad."""
_NOISE = 2.0
"""Noise is not always white: how much more of its square may be at low frequencies."""


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
    noise : ndarray, shape (n,)
        Root mean square of the part of the errors that is white, from their second differences.
    samples : int
        Of the log, edges left out.
    """

    rmse: Array
    relative: Array
    bias: Array
    filtered_rmse: Array
    filtered_relative: Array
    correlation: Array
    noise: Array
    samples: int

    def __post_init__(self) -> None:
        for field in fields(self)[:-1]:
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))


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
    products, rough, steps = np.zeros(n), np.zeros(n), 0
    last = np.zeros((0, n))
    for piece in pieces(log, processing):
        found = piece_signals(log, processing, piece, 0)
        e = found.tau - predicted_torque(base, names, values, found.q, found.v, found.a, widths)
        squares += (e * e).sum(axis=0)
        sums += e.sum(axis=0)
        whole += (found.tau**2).sum(axis=0)
        samples += len(e)
        rough += (np.diff(e, 2, axis=0) ** 2).sum(axis=0)
        steps += max(len(e) - 2, 0)
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
            np.sqrt(kept / taken), np.sqrt(kept / filtered), products / kept,
            np.sqrt(rough / (6.0 * max(steps, 1))), samples,
        )  # fmt: skip


def no_validation(n: int) -> Validation:
    """The errors of an estimate without values."""
    return Validation(*np.full((7, n), np.nan), samples=0)


def poor_prediction(
    model: RobotModel, processing: Processing, fitted: Validation, held_out: Validation | None
) -> str:
    """Sentences about torques that are predicted badly."""
    names = np.array(model.table.joint_names)
    sides = {"the log": fitted}
    if held_out is not None:
        sides["the log kept aside"] = held_out
    gain = float((decimation_window(processing.decimation) ** 2).sum())
    slides = model.table.sigma[model.table.joint_rows] == 1
    usual = None
    found: list[str] = []
    beyond = np.zeros(model.n, dtype=bool)
    for log, side in sides.items():
        rests = np.isnan(side.filtered_relative)
        error = np.where(rests, side.rmse, side.filtered_rmse) ** 2
        part = np.where(rests, side.relative, side.filtered_relative)
        known = (part > 0.0) & np.isfinite(part)
        torque = np.where(known, error, np.inf) / np.where(known, part, 1.0) ** 2
        left = error - _NOISE * np.where(rests, 1.0, gain) * side.noise**2
        usual = np.where(known, torque, 0.0) if usual is None else usual
        worse = ~rests & (left > torque)
        poor = worse | ~rests & (left > POOR**2 * np.sqrt(torque * np.maximum(torque, usual)))
        beyond |= worse
        named = [f"{names[j]} ({percent(part[j])})" for j in np.flatnonzero(poor)]
        total = np.where(rests, left, error)
        kinds = [kind for kind in (known & slides, known & ~slides) if kind.any()]  # N and N m
        whole = max((total[kind].sum() / torque[kind].sum() for kind in kinds), default=0.0)
        if whole > POOR**2:
            named.append(f"all joints together ({percent(np.sqrt(whole))})")
        if named:
            found.append(f"on {log}: {', '.join(named)}")
    if not found:
        return ""
    text = f"Poor prediction. Unexplained part of the torque {'; '.join(found)}"
    if beyond.any():
        text += f"; worse than predicting zero torque: {', '.join(names[beyond])}"
    why = (
        "The parameters do not carry over to that motion: use a log that excites these joints "
        "more, or fewer parameters (essential=True)."
        if found[0].startswith("on the log kept aside")
        else "The order of the joints, signs, zeros, units, the sampling period or the model may "
        "be wrong, the log too short or too noisy, or the method or form unsuitable (compare "
        "method 'wls' and form 'torque')."
    )
    return f"{text}. {why} Do not use the parameters until the cause is known."
