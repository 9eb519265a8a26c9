"""The balance of energy of a simulation over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from ..simulation.result import Simulation, SimulationEventKind
from .figures import (
    COLUMN,
    LIMIT_DASHES,
    LINE_WIDTH,
    THIN_WIDTH,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import INK, PALE
from .plot_trajectory import draw_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKED = (SimulationEventKind.STUCK, SimulationEventKind.BROKE_AWAY)
_MOST_MARKS = 40  # more would hide the lines


def plot_energy(
    simulation: Simulation,
    *,
    events: bool = True,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Energies and works of a simulated motion, and the drift of their balance.

    Kinetic energy, change of potential energy, what friction has taken, what the tool has done on
    the environment, less the work of the control: their sum stays what it was at the start. The
    lower panel has its drift, which is the error of the integration. What is zero all the time has
    no line.

    Parameters
    ----------
    simulation : Simulation
        As `simulate` gives it. Many samples make smooth lines: give it times.
    events : bool
        Whether thin lines mark where joints stick and break away.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels.

    Raises
    ------
    InvalidValueError
        No simulation.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.simulation import simulate
    >>> fall = simulate(load("rx90"), np.zeros(6), np.zeros(6), t=np.linspace(0.0, 0.2, 51))
    >>> figure = plot_energy(fall)
    >>> [text.get_text() for text in figure.legends[0].get_texts()]
    ['kinetic energy', 'potential energy', 'sum']
    """
    if not isinstance(simulation, Simulation):
        raise InvalidValueError(
            "simulation: expected a Simulation, as simulate(...) gives it, got "
            f"{type(simulation).__name__}."
        )
    sim = simulation
    figure = new_figure(COLUMN, 3.4, size)
    grid = panels(figure, 2, sharex=True, gridspec_kw={"height_ratios": [2.6, 1.0]})
    upper, lower = grid[:, 0]
    unit, factor = _unit(sim.energy_turnover)
    for k, (label, values) in enumerate(_terms(sim)):
        draw_line(upper, sim.t, factor * values, line_style(k), label)
    total = factor * (sim.kinetic[0] + sim.drift)
    upper.plot(sim.t, total, color=INK, linewidth=LINE_WIDTH, linestyle=LIMIT_DASHES, label="sum",
               marker="" if len(sim.t) > 1 else "o", markersize=3.0, zorder=2.5)  # fmt: skip
    upper.set_ylabel(f"energy ({unit})")
    small, more = _unit(float(np.abs(sim.drift).max()))
    lower.plot(sim.t, more * sim.drift, color=INK, linewidth=LINE_WIDTH, label="drift",
               marker="" if len(sim.t) > 1 else "o", markersize=3.0)  # fmt: skip
    lower.set_ylabel(f"drift ({small})")
    lower.set_xlabel("time (s)")
    if events:
        for axes in (upper, lower):
            _marks(axes, sim)
    figure.align_ylabels()
    handles: list[Any] = [
        line for line in upper.get_lines() if not str(line.get_label()).startswith("_")
    ]
    legend_above(figure, handles, title)
    return figure


def _terms(sim: Simulation) -> list[tuple[str, Array]]:
    """Lines of the balance, those that are not zero."""
    terms = [
        ("kinetic energy", sim.kinetic),
        ("potential energy", sim.potential - sim.potential[0]),
        ("friction work", sim.friction_work),
        ("work of the tool", sim.wrench_work),
        ("\N{MINUS SIGN} control work", -sim.control_work),
    ]
    return [(label, values) for label, values in terms if values.any()] or terms[:1]


def _unit(most: float) -> tuple[str, float]:
    """A unit in which a value is easy to read, and its factor."""
    for symbol, factor in (("MJ", 1e-6), ("kJ", 1e-3), ("J", 1.0), ("mJ", 1e3), ("µJ", 1e6),
                           ("nJ", 1e9), ("pJ", 1e12)):  # fmt: skip
        if most * factor >= 1.0:
            return symbol, factor
    return ("J", 1.0) if most == 0.0 else ("fJ", 1e15)


def _marks(axes: Axes, sim: Simulation) -> None:
    """Thin lines where joints stick and break away: the last ones, if there are many."""
    marked = [event for event in sim.events if event.kind in _MARKED]
    for event in marked[-_MOST_MARKS:]:
        axes.axvline(
            event.t, color=PALE, linewidth=THIN_WIDTH, linestyle="-", zorder=1.2, label="_event"
        )
