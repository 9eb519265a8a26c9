"""Direct and inverse dynamic identification models: measured torque, simulated motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

from ..._arrays import Array
from ...estimation.factor import TriangularFactors, reduced
from ..equations import Block, Equations
from .loop import ClosedLoop, closed_loop
from .method import Advance, Scores, SimulatingMethod, Step, weighted_step
from .simulation import ClosedLoopSimulator, SimulationDivergedError

_PARTS = 8
"""Holding periods of an assumed controller's torques per sample."""
_SINGULAR = 1e10
"""Condition number above which the simulated motion does not determine the parameters."""


@dataclass(frozen=True, slots=True, eq=False)
class Didim(SimulatingMethod):
    """Direct and inverse dynamic identification models (DIDIM): torques alone are measured.

    The controlled robot is simulated with the last parameters; weighted least squares then explain
    the measured torque by the regressor of the simulated motion. Where the log has references, the
    measured positions serve only for the initial parameters.

    Parameters
    ----------
    controller, start, iterations, lags, width, substeps
        See `Instrumental`.

    References
    ----------
    M. Gautier, A. Janot and P.-O. Vandanjon, "A new closed-loop output error method for parameter
    identification of robot dynamics", IEEE T-CST 21(2), 2013, section III.

    Examples
    --------
    >>> Didim().iterations
    50
    """

    iterations: int = 50
    name: ClassVar[str] = "didim"
    title: ClassVar[str] = "direct and inverse dynamic identification models"
    _memory: ClassVar[int] = 6
    _advice: ClassVar[tuple[str, ...]] = (
        "DIDIM does not converge where the simulated motion depends on the parameters more than "
        "the torques determine them (a joint of little inertia under friction, for instance): use "
        "instrumental variables, which use the measured motion too.",
    )

    def _prepare(
        self, simulator: ClosedLoopSimulator, factors: TriangularFactors, size: Array
    ) -> tuple[Advance, Scores]:
        """One step of weighted least squares, and its equations."""

        def scores(values: Array) -> Callable[[], Iterable[Block]]:
            signals = simulator.signals(values)
            return lambda: (block for _, block in simulator.blocks(signals))

        def advance(values: Array, weights: Array | None) -> Step:
            step = weighted_step(reduced(factors.names, scores(values)()), values, weights)
            if not step.condition < _SINGULAR:
                raise SimulationDivergedError
            return step

        return advance, scores

    def _loop(self, system: Equations, values: Array) -> ClosedLoop | None:
        """Closed loop; torques of an assumed controller are held for a part of a sample.

        A held torque lags by half of its period, an error of inertia and friction.
        """
        loop = SimulatingMethod._loop(self, system, values)
        if loop is None or self.controller is not None:
            return loop
        quick = replace(loop.controller, period=system.log.dt / _PARTS)
        quicker = closed_loop(system, values, quick, self.width, self.substeps)
        note = (
            f"Its torques are held for one of {_PARTS} parts of a sample. DIDIM explains torques "
            "by a motion that it simulates: without the robot's controller and references (q_ref "
            "of the log) its standard errors do not include the difference of the controllers."
        )
        return quicker and replace(quicker, notes=(*loop.notes, note))
