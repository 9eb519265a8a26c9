"""Measured and predicted torques of an identification, in sample and held out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from ..identification.report_tables import effort_units
from ..identification.result import IdentificationResult, check_result, predicted_torque, validate
from ..identification.signals import piece_signals, pieces
from ..logs import Log
from .figures import PAGE, SMALL_SIZE, THIN_WIDTH, legend_above, line_style, new_figure, panels
from .palette import BAND, INK, PALE
from .plot_envelope import envelope

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS = 700
"""Largest number of sample groups over a log."""
_MEASURED, _PREDICTED, _LEFT = line_style(3).color, line_style(0).color, line_style(1).color


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTorques:
    """Envelopes of a log's torques, NaN between recordings.

    Shapes: measured, predicted, left (k, n); slow_t (g,); slow (g, n).
    """

    measured: tuple[Array, Array]
    predicted: tuple[Array, Array]
    left: tuple[Array, Array]
    slow_t: Array
    slow: Array


def as_identification(result: Any) -> IdentificationResult:
    """Check that the argument is an identification result."""
    check_result(result)
    return result


def check_test(result: IdentificationResult, test: Any) -> None:
    """Raise unless the test is a log of the robot."""
    if test is None:
        return
    if not isinstance(test, Log):
        raise InvalidValueError(f"test: expected a Log, got {type(test).__name__}.")
    if test.n != result.model.n:
        raise ShapeError(f"test: expected a log of {result.model.n} joints, got {test.n}.")


def plot_identification_torques(
    result: IdentificationResult,
    test: Log | None = None,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Measured and predicted torques over time and their difference, a row for each joint.

    Samples are drawn as envelopes, so that peaks of long logs remain visible. Grey stretches are in
    the dead band, whose equations are excluded.

    Parameters
    ----------
    result : IdentificationResult
        Result of `identification.fit`.
    test : Log, optional
        Held-out log: drawn in a second column, in the same scale.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        The title of each panel gives the error relative to the measured torque.

    Raises
    ------
    InvalidValueError, ShapeError
        Not a result; not a log of its joints.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> result = fit(*example_log())
    >>> [axes.get_ylabel() for axes in plot_identification_torques(result).axes]
    ['torque (N m)', 'torque (N m)']
    """
    identification = as_identification(result)
    check_test(identification, test)
    sides = [("fitted", identification.equations.log, identification.validation.in_sample)]
    if test is not None:
        sides.append(("held out", test, validate(identification, test)))
    n, units = identification.model.n, effort_units(identification.model)
    figure = new_figure(PAGE, 0.9 + 1.15 * n, size)
    grid = panels(
        figure, n, len(sides), sharex="col", sharey="row",
        width_ratios=[max(log.duration, 0.25 * sides[0][1].duration) for _, log, _ in sides],
    )  # fmt: skip
    for column, (word, log, errors) in enumerate(sides):
        drawn = drawn_torques(identification, log)
        for j, name in enumerate(identification.model.table.joint_names):
            axes = grid[j, column]
            axes.fill_between(
                drawn.slow_t, 0.0, 1.0, where=drawn.slow[:, j].astype(bool).tolist(), step="mid",
                transform=axes.get_xaxis_transform(), color=BAND, linewidth=0.0, zorder=0.5,
                label="dead band",
            )  # fmt: skip
            axes.axhline(0.0, color=PALE, linewidth=THIN_WIDTH, zorder=1.2, label="_zero")
            for (t, y), color, width, label in (
                (drawn.measured, _MEASURED, THIN_WIDTH, "measured"),
                (drawn.left, _LEFT, THIN_WIDTH, "measured less predicted"),
                (drawn.predicted, _PREDICTED, 1.1, "predicted"),
            ):
                axes.plot(t[:, j], y[:, j], color=color, linewidth=width, label=label)
            relative = 100.0 * errors.relative[j]
            axes.set_title(f"{name}, {word}: {relative:.3g} %", loc="left", size=SMALL_SIZE,
                           color=INK, pad=2.0)  # fmt: skip
            if column == 0:
                kind = "force" if units[j] == "N" else "torque"
                axes.set_ylabel(f"{kind} ({units[j]})")
        grid[-1, column].set_xlabel("time (s)")
    handles = [*grid[0, 0].get_lines(), *grid[0, 0].collections]
    legend_above(figure, [h for h in handles if not str(h.get_label()).startswith("_")], title)
    return figure


def drawn_torques(result: IdentificationResult, log: Log) -> DrawnTorques:
    """Envelopes of the torques of a log, piece by piece."""
    chosen = result.equations.processing
    step = max(1, len(log) // _POINTS)
    parts: list[list[tuple[Array, Array]]] = [[], [], []]
    slow_t, slow = [], []
    gap = np.full((1, log.n), np.nan)
    begin = None
    for piece in pieces(log, chosen):
        signals = piece_signals(log, chosen, piece, 0)
        tau = predicted_torque(result, signals.q, signals.v, signals.a)
        for part, y in zip(parts, (signals.tau, tau, signals.tau - tau), strict=True):
            if begin is not None and piece.begin != begin:
                part.append((gap, gap))
            part.append(envelope(signals.t, y, step))
        begin = piece.begin
        starts = np.arange(0, len(signals), step)
        inside = np.add.reduceat(
            (np.abs(signals.v) < chosen.dead_band).astype(float), starts, axis=0
        )
        counts = np.diff(np.append(starts, len(signals)))
        slow_t.append(signals.t[starts] + 0.5 * (counts - 1) * log.dt)
        slow.append(inside > 0.5 * counts[:, None])
    measured, predicted, left = (
        (np.concatenate([t for t, _ in part]), np.concatenate([y for _, y in part]))
        for part in parts
    )
    return DrawnTorques(measured, predicted, left, np.concatenate(slow_t), np.concatenate(slow))
