"""Errors of predicted torques on a log."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from ..dynamics import idm
from ..errors import InvalidValueError
from ..model import RobotModel
from ..table_text import percent_text
from .equations import Equations
from .forms import EquationForm
from .signals import Processing, decimation_window, piece_signals
from .torques import parameter_torque

POOR = 0.3
"""Unexplained share of the torque (root mean square) above which a prediction is poor."""
_NOISE = 2.0
"""Allowance for coloured noise: factor on the white-noise power."""


@dataclass(frozen=True, slots=True, eq=False)
class Errors(Rebuilt):
    """Errors of predicted torques, by joint. Read-only.

    Parameters
    ----------
    rmse : ndarray, shape (n,)
        Root mean square of measured less predicted torque at the rate of the log, N m or N.
    relative : ndarray, shape (n,)
        The same relative to the measured torque.
    bias : ndarray, shape (n,)
        Mean of measured less predicted torque, N m or N.
    filtered_rmse : ndarray, shape (n,)
        Root mean square of the residuals of the equations, in which both sides are filtered and
        dead bands left out; NaN for a joint without equations.
    filtered_relative : ndarray, shape (n,)
        The same relative to the filtered torque.
    correlation : ndarray, shape (n,)
        Correlation of successive residuals of the equations.
    noise : ndarray, shape (n,)
        Root mean square of the white part of the errors, from their second differences.
    samples : int
        Number of samples, without the edges of recordings.
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


@dataclass(frozen=True, slots=True)
class Validation:
    """Errors of the predicted torques of an identification.

    Parameters
    ----------
    in_sample : Errors
        On the log that was fitted.
    held_out : Errors or None
        On the log given as ``test``.
    nominal : Errors or None
        Errors of the given robot on the fitted log, without equations (NaN in these
        fields); None for a robot without masses.
    folds : None
        None: neighbouring samples of a log are correlated, so that its parts are not independent;
        give ``test``.
    """

    in_sample: Errors
    held_out: Errors | None = None
    nominal: Errors | None = None
    folds: None = None


class _Sums:
    """Running sums of torque errors e (N, n)."""

    def __init__(self, n: int) -> None:
        self.squares, self.sums, self.torque, self.rough = np.zeros((4, n))
        self.samples = self.steps = 0

    def add(self, e: Array, tau: Array) -> None:
        """Add successive samples."""
        self.squares += (e * e).sum(axis=0)
        self.sums += e.sum(axis=0)
        self.torque += (tau**2).sum(axis=0)
        self.rough += (np.diff(e, 2, axis=0) ** 2).sum(axis=0)
        self.samples += len(e)
        self.steps += max(len(e) - 2, 0)

    def errors(self, filtered: tuple[Array, Array, Array] | None = None) -> Errors:
        """Errors, including those of the equations if given."""
        none = np.full(len(self.sums), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            return Errors(
                np.sqrt(self.squares / self.samples),
                np.sqrt(self.squares / self.torque),
                self.sums / self.samples,
                *((none, none, none) if filtered is None else filtered),
                np.sqrt(self.rough / (6.0 * max(self.steps, 1))),
                self.samples,
            )


def prediction_errors(
    system: Equations, values: Array, ramp: Array, nominal: bool = False
) -> tuple[Errors, Errors | None]:
    """Errors of values (b,) on the log of equations, and of the given robot.

    Dry friction is linear within the velocities ``ramp`` (n,).
    """
    if system.form is not EquationForm.TORQUE:
        system = Equations(system.base, system.names, system.log, system.processing)
    log, n = system.log, system.log.n
    known = nominal and bool(system.model.inertia.values.any())
    own, given = _Sums(n), _Sums(n)
    kept, torque, taken, products = np.zeros((4, n))
    last = np.zeros((0, n))
    for piece in system.pieces():
        x = piece_signals(log, system.processing, piece, 0)
        predicted = parameter_torque(system.base, system.names, values, x.q, x.v, x.a, ramp)
        own.add(x.tau - predicted, x.tau)
        if known:
            given.add(x.tau - idm(system.model, x.q, x.v, x.a), x.tau)
        block = system.block(piece)
        r = np.where(block.use, block.y - block.W @ values, 0.0)
        kept += (r * r).sum(axis=0)
        torque += np.where(block.use, block.y**2, 0.0).sum(axis=0)
        taken += block.use.sum(axis=0)
        chain = np.vstack((last, r))
        products += (chain[1:] * chain[:-1]).sum(axis=0)
        last = r[-1:]
    if not own.samples:
        raise InvalidValueError(
            f"log: none of its recordings is longer than the {2 * system.processing.edges} samples "
            "that are cut at both ends; give a longer one, or shorter edges (processing=)."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        filtered = np.sqrt(kept / taken), np.sqrt(kept / torque), products / kept
    return own.errors(filtered), given.errors() if known else None


def no_errors(n: int) -> Errors:
    """Errors of an estimate without values: NaN."""
    return Errors(*np.full((7, n), np.nan), samples=0)


def poor_prediction(
    model: RobotModel, processing: Processing, in_sample: Errors, held_out: Errors | None
) -> str:
    """Sentence about poorly predicted torques, empty if there are none."""
    names = np.array(model.table.joint_names)
    sides = {"the log": in_sample}
    if held_out is not None:
        sides["the held-out log"] = held_out
    gain = float((decimation_window(processing.decimation) ** 2).sum())
    slides = model.table.sigma[model.table.joint_rows] == 1
    usual = None
    sentences: list[str] = []
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
        named = [f"{names[j]} ({percent_text(part[j])})" for j in np.flatnonzero(poor)]
        total = np.where(rests, left, error)
        units = [unit for unit in (known & slides, known & ~slides) if unit.any()]  # N and N m
        whole = max((total[unit].sum() / torque[unit].sum() for unit in units), default=0.0)
        if whole > POOR**2:
            named.append(f"all joints together ({percent_text(np.sqrt(whole))})")
        if named:
            sentences.append(f"on {log}: {', '.join(named)}")
    if not sentences:
        return ""
    text = f"Poor prediction. Unexplained part of the torque {'; '.join(sentences)}"
    if beyond.any():
        text += f"; worse than predicting zero torque: {', '.join(names[beyond])}"
    why = (
        "The parameters do not generalise to that motion: use a log that excites these joints "
        "more, or fewer parameters (essential=True in the method)."
        if sentences[0].startswith("on the held-out log")
        else "The order of the joints, signs, zeros, units, the sampling period, the model or the "
        "direction of its gravity may be wrong, the log too short or too noisy, or the method or "
        "form unsuitable (compare method 'wls' and form 'torque')."
    )
    return f"{text}. {why} Do not use the parameters until the cause is known."
