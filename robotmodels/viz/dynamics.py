"""Figures of dynamics: the parts of torques, the energy balance of a simulation, inertia maps.

Parameters
----------
model, degrees, columns, **look
    See `robotmodels.viz`; the model of a simulation is its own.
motion : Trajectory, Samples or Simulation
    One motion of n joints. A simulation brings its own friction, wrench and drives.
wrench, drive, friction
    Constant wrench that the tool exerts (6,), whether the model's drives count, and a friction
    model besides them, as of `idm`.
joints : sequence of int, optional
    Which joints, columns of q from 0; default all.
simulation, events : Simulation, and bool
    As `simulate` gives it; whether thin lines mark where joints stick and break away.
grid : DynamicsMap
    As `dynamics_map` gives it.
of, pair : int and array_like of int, shape (2,), optional
    Of two joints that vary: whose gravity torque and inertia, and whose coupling, from 0; default
    the first, and these two.

Returns
-------
matplotlib.figure.Figure

References
----------
Book sections 1.5.1.1 to 1.5.1.5.

Examples
--------
>>> from robotmodels.robots import load
>>> from robotmodels.trajectories import quintic
>>> move = quintic(np.zeros(6), np.ones(6), duration=1.0)
>>> figure = plot_torque_parts(load("rx90"), move, joints=[0, 1])
>>> [axes.get_title(loc="left") for axes in figure.axes]
['joint_1 (N m)', 'joint_2 (N m)']
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction
from ..model import RobotModel, check_model
from ..simulation.dynamics_map import DynamicsMap
from ..simulation.result import Simulation, SimulationEventKind
from ..simulation.torque_parts import simulated_torque_parts, torque_parts
from ..trajectories.trajectory import Samples, Trajectory
from . import over_time, style
from .over_time import Unit
from .style import COLUMN, DASHED, INK, PAGE, PALE, ZERO, Figure, Look

_PARTS = (
    ("inertia", "inertia"),
    ("coriolis", "Coriolis and centrifugal"),
    ("gravity", "gravity"),
    ("friction", "friction"),
    ("wrench", "wrench of the tool"),
)
_MARKED = (SimulationEventKind.STUCK, SimulationEventKind.BROKE_AWAY)
_MOST_MARKS = 40  # more would hide the lines
_PAIRS, _LEAST = 5, 0.005  # most lines of coupling, and the least coupling that is drawn
_SPREAD = 50.0  # ratio of inertias from which on their axis is logarithmic
_ROUNDING = 1e-12


@style.plot
def plot_torque_parts(
    model: RobotModel,
    motion: Trajectory | Samples | Simulation,
    *,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
    joints: Sequence[int] | None = None,
    columns: int | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Torques of a motion split into inertia, Coriolis, gravity, friction and wrench, by joint.

    A panel for each joint; parts that are zero for all of them have no line.
    """
    check_model(model)
    if isinstance(motion, Simulation):
        if motion.model != model or wrench is not None or friction is not None or not drive:
            raise InvalidValueError(
                "motion: a simulation has its own model, wrench, drives and friction; pass "
                "simulation.model and leave the others out."
            )
        times, parts = motion.t, simulated_torque_parts(motion)
    else:
        samples = over_time.sampled(motion, "motion")
        if samples.n != model.n:
            raise ShapeError(f"motion: expected one of {model.n} joints, got {samples.n}.")
        times, (q, v, a) = samples.t, samples.values[:3]
        parts = torque_parts(model, q, v, a, wrench, drive, friction)
    every = range(model.n) if joints is None else joints
    shown = style.as_choice(every, model.n, "joints", "joints")
    names, efforts = over_time.joint_names(None, model.n, model), over_time.effort_units(model)
    least = _ROUNDING * np.abs(parts.total[:, shown]).max(axis=0, initial=0.0)
    values = [getattr(parts, field)[:, shown] for field, _ in _PARTS]
    present = [k for k, part in enumerate(values) if (np.abs(part) > least).any()]
    labels = [_PARTS[part][1] for part in present]
    wide = style.as_columns(columns, len(shown), 1 if len(shown) < 5 else 2)
    figure, order = style.panel_list(len(shown), wide, 1.1, look)
    for k, (axes, j) in enumerate(zip(order, shown, strict=True)):
        lines = np.array([values[part][:, k] for part in present]).reshape(-1, len(times)).T
        over_time.lines_over_time(axes, times, lines, labels, present, zero=True)
        total = {"marker": "" if len(times) > 1 else "o", "color": INK, "linewidth": 1.8}
        total |= {"alpha": 0.85, "zorder": 1.9, "label": "total"}
        axes.plot(times, parts.total[:, j], **total)
        axes.set_title(f"{names[j]} ({efforts[j]})", loc="left")
    return style.finished(figure, look)


@style.plot
def plot_energy(
    simulation: Simulation,
    *,
    events: bool = True,
    **look: Unpack[Look],
) -> Figure:
    """Energies and works of a simulated motion, and the drift of their balance.

    The sum of kinetic energy, change of potential energy, work of friction and work of the tool on
    the environment, less the work of the control, is constant; the lower panel has its drift, which
    is the error of the integration. Terms that are zero all the time have no line.
    """
    sim = as_instance(simulation, Simulation, "simulation", " of simulate")
    figure, grid = style.panels(COLUMN, 3.4, look, 2, sharex=True, height_ratios=[2.6, 1.0])
    upper, lower = grid[:, 0]
    unit, factor = _unit(sim.energy_turnover)
    terms = {
        "kinetic energy": sim.kinetic,
        "potential energy": sim.potential - sim.potential[0],
        "friction work": sim.friction_work,
        "work of the tool": sim.wrench_work,
        "\N{MINUS SIGN} control work": -sim.control_work,
    }
    present = [name for name, values in terms.items() if values.any()] or ["kinetic energy"]
    lines = factor * np.stack([terms[name] for name in present], axis=1)
    over_time.lines_over_time(upper, sim.t, lines, present)
    marker = "" if len(sim.t) > 1 else "o"
    total = factor * (sim.kinetic[0] + sim.drift)
    upper.plot(sim.t, total, marker=marker, color=INK, zorder=2.5, label="sum", **DASHED)
    upper.set_ylabel(f"energy ({unit})")
    unit, factor = _unit(float(np.abs(sim.drift).max()))
    lower.plot(sim.t, factor * sim.drift, marker=marker, color=INK, label="_drift")
    lower.set(xlabel="time (s)", ylabel=f"drift ({unit})")
    marked = [event.t for event in sim.events if event.kind in _MARKED] if events else []
    for t in marked[-_MOST_MARKS:]:
        for axes in (upper, lower):
            axes.axvline(t, color=PALE, linewidth=0.8, zorder=1.2, label="_event")
    return style.finished(figure, look)


def _unit(most: float) -> tuple[str, float]:
    """A unit in which an energy is easy to read, and its factor."""
    from matplotlib.ticker import EngFormatter

    prefixes = EngFormatter.ENG_PREFIXES
    power = 3 * int(np.clip(np.floor(np.log10(most) / 3.0), -4, 2)) if most > 0.0 else 0
    return f"{prefixes[power]}J", 10.0**-power


@style.plot
def plot_inertia_map(
    grid: DynamicsMap,
    *,
    of: int | None = None,
    pair: ArrayLike | None = None,
    degrees: bool = True,
    **look: Unpack[Look],
) -> Figure:
    """Gravity torques, diagonal inertia and coupling over one or two joints.

    Over one joint: lines of all joints, and of the pairs of joints that are coupled most. Over two
    joints: three maps, of one joint and one pair. Coupling is ``M_ij / sqrt(M_ii M_jj)``, without
    unit: 0 where neither joint feels the other's acceleration, 1 where they move one body.
    """
    as_instance(grid, DynamicsMap, "grid", " of dynamics_map")
    n, joints = grid.model.n, grid.joints
    every = over_time.joint_units(None, n, grid.model, degrees)
    names = [over_time.joint_names(None, n, grid.model)[j] for j in joints]
    kinds = [every[j] for j in joints]
    if len(joints) > 1:
        (joint,) = style.as_choice([joints[0] if of is None else of], n, "of", "a joint")
        two = np.atleast_1d(list(joints) if pair is None else pair)
        two = style.as_choice(two, n, "pair", "two different joints")
        if len(two) != 2:
            raise InvalidValueError(f"pair: expected two different joints, got {pair!r:.60}.")
        return _maps(grid, names, kinds, joint, two, look)
    if of is not None or pair is not None:
        raise InvalidValueError("of, pair: all elements are drawn over one joint; leave them out.")
    return _lines(grid, f"{names[0]} ({kinds[0].value})", kinds[0].factor, look)


def _lines(grid: DynamicsMap, label: str, factor: float, look: Look) -> Figure:
    """Lines over one joint."""
    n, x = grid.model.n, factor * grid.ranges[0]
    names, efforts = over_time.joint_names(None, n, grid.model), over_time.effort_units(grid.model)
    figure, places = style.panels(COLUMN, 4.6, look, 3, sharex=True)
    gravity, inertia, coupling = places[:, 0]
    diagonal = np.einsum("kii->ki", grid.mass)
    labels, units = (names if n > 1 else ["_only"]), [u for u in ("N m", "N") if u in efforts]
    for axes, what, values, symbols in (
        (gravity, "gravity torque", grid.gravity, {"N m": "N m", "N": "N"}),
        (inertia, "inertia", diagonal, {"N m": "kg m²", "N": "kg"}),
    ):
        over_time.lines_over_time(axes, x, values, labels)
        axes.set_ylabel(f"{what}\n({' or '.join(symbols[unit] for unit in units)})")
    if (diagonal > 0.0).all() and diagonal.max() > _SPREAD * diagonal.min():
        inertia.set_yscale("log")
    coupling.set(xlabel=label, ylabel="coupling\n(no unit)", ylim=(-1.08, 1.08))
    coupling.axhline(0.0, **ZERO)
    pairs = {
        (i, j): float(np.nan_to_num(np.abs(grid.coupling[:, i, j])).max())
        for i, j in combinations(range(n), 2)
    }
    strongest = sorted(sorted(pairs, key=lambda p: -pairs[p])[:_PAIRS])
    drawn = [p for p in strongest if pairs[p] > _LEAST]
    both = [f"{names[i]} and {names[j]}" for i, j in drawn]
    for k, (i, j) in enumerate(drawn):
        coupling.plot(x, grid.coupling[:, i, j], label=f"_{both[k]}", **style.line(k))
    if drawn:
        figure.legend(coupling.get_lines()[1:], both, loc="outside lower center", ncols=2)
    else:
        style.note(coupling, "no coupling" if pairs else "one joint: no coupling")
    return style.finished(figure, look)


def _maps(
    grid: DynamicsMap,
    varied: Sequence[str],
    kinds: Sequence[Unit],
    joint: int,
    pair: Sequence[int],
    look: Look,
) -> Figure:
    """Maps over two joints."""
    i, j = pair
    names = over_time.joint_names(None, grid.model.n, grid.model)
    long = over_time.is_prismatic(grid.model)[joint]
    height = 2.8 if look.get("title") else 2.55
    figure, places = style.panels(PAGE, height, look, 1, 3, sharey=True)
    torque, tiny = grid.gravity[..., joint], _ROUNDING * float(np.abs(grid.gravity).max(initial=0))
    coupling, inertia = grid.coupling[..., i, j], grid.mass[..., joint, joint]
    maps = (
        (f"gravity torque\nof {names[joint]}", "(N)" if long else "(N m)", torque, tiny, True),
        (f"inertia\nof {names[joint]}", "(kg)" if long else "(kg m²)", inertia, 0.0, False),
        (f"coupling\n{names[i]}, {names[j]}", "no unit", coupling, _ROUNDING, True),
    )
    x, y = (unit.factor * values for unit, values in zip(kinds, grid.ranges, strict=True))
    for axes, (label, unit, values, rounding, signed) in zip(places[0], maps, strict=True):
        # rounding errors would be stretched to all colours of a map
        values = np.where(np.abs(values) <= rounding, 0.0, values)
        most = style.color_map(figure, axes, x, y, values, signed, unit)
        finite = values[np.isfinite(values)]
        if finite.size and np.ptp(finite) > 1e-9 * most:
            z = np.ma.masked_invalid(values.T)
            axes.contour(x, y, z, levels=8, colors=[INK], linewidths=0.8, linestyles="-", alpha=0.6)
        elif not most:
            style.note(axes, "zero everywhere" if finite.size else "a joint moves\nno inertia")
        axes.set_title(style.wrapped(label, PAGE / 3.0 - 0.6))
        style.joint_axes(axes, varied, kinds)
        axes.label_outer()
    return style.finished(figure, look)
