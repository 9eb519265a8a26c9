"""One fit of real bodies: squares of torques on cones, solved, settled and proved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from ...estimation.conic import (
    Cone,
    ConeOutcome,
    ConeSolution,
    Constraint,
    lower_bound,
    solve_cones,
)
from ...minimal_parameters.cone import ConeProblem
from .result import ConsistentStatus, largest_violation
from .system import TorqueSquares

_FIRST = 1e-8
"""Weight of the squared distance from the prior beside the sum of squares, at first, where the
user gives none: it only decides what the torques do not."""
SOUGHT = 1e-5
"""Part of the squares that the weight may cost in the end, where the least is looked for."""
_ROUNDS = 8
"""How often the fit is scaled again at most."""
_SIZES = 4.0
"""How much the size of the numbers may be off without scaling again."""
_TIGHT = 1e-5
"""Room, in natural units, that is none."""
_KEPT = 1e-9
"""Deviation from the least squares, relative to the largest, that is none."""
_PROVED = 2e-4
"""Part of the squares within which the fit is known to be the best; else its status says so."""
_REAL = 5e-9
"""Violation that is rounding, in natural units as many as the robot is away from the prior."""


@dataclass(frozen=True, slots=True)
class FoundRobot:
    """Standard parameters that a fit ended at, with what is known of them."""

    x: Array
    status: ConsistentStatus
    gap: float
    violation: float
    clipped: float
    active: tuple[str, ...]
    stopped: str = ""


@dataclass(frozen=True, slots=True)
class ConstrainedFit:
    """One fit: real bodies near a prior, squares of torques, bounds and the weight of the prior."""

    problem: ConeProblem
    system: TorqueSquares
    bounds: tuple[Constraint, ...]
    gamma: float
    tolerance: float

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Of drives, bodies and bounds."""
        return (*self.problem.drives, *self.problem.bodies(self.problem.margin), *self.bounds)

    def free(self) -> FoundRobot | None:
        """The nearest robot with the least squares, if real ones have them."""
        if self.gamma > 0.0:
            return None
        problem, system = self.problem, self.system
        known = [one for one in self.bounds if one.cone is Cone.ZERO]
        others = tuple(one for one in self.bounds if one.cone is not Cone.ZERO)
        E = np.concatenate([system.same, *(one.rows for one in known)])
        e = np.concatenate([system.level, *(one.right for one in known)])
        found = problem.nearest(E, e, others, problem.size(system.best))
        if found.outcome is not ConeOutcome.SOLVED:
            return None
        missed = np.abs(system.same @ found.x - system.level).max()
        if missed > _KEPT * max(1e-300, float(np.abs(system.level).max())):
            return None
        if not self.is_met(found.x):
            return None
        return self.finished(found.x, 0.0, 0.0, ConsistentStatus.FREE)

    def constrained(self) -> FoundRobot:
        """The best fit, and of equal ones the nearest."""
        problem, system = self.problem, self.system
        smallest = max(system.least, 1e-8 * float(system.target @ system.target), 1e-300)
        # from above: beside squares taken too small, robots that are far away look impossible
        total = max(smallest, system.sum(problem.prior))
        weight = self.gamma / total if self.gamma > 0.0 else _FIRST
        size = problem.size(system.best)
        found = self.fitted(total, weight, size)
        for _ in range(_ROUNDS):
            # how great squares, distance and numbers are is known only now
            if not np.isfinite(found.x).all():
                break
            reached, wide = max(smallest, system.sum(found.x)), self.size_of(found.x)
            far = problem.distance(found.x)
            even = max(reached, total) <= _SIZES * min(reached, total)
            light = self.gamma > 0.0 or weight * far**2 <= 2.0 * SOUGHT
            if even and light and max(size, wide) <= _SIZES * min(size, wide):
                break
            now = total if even else reached
            trial = self.gamma / now if self.gamma > 0.0 else min(_FIRST, SOUGHT / (1.0 + far**2))
            again = self.fitted(now, trial, wide)
            if again.outcome is not ConeOutcome.SOLVED and found.outcome is ConeOutcome.SOLVED:
                break
            found, total, weight, size = again, now, trial, wide
        if not np.isfinite(found.x).all():
            failed = ConsistentStatus.FAILED
            stopped = f"The cone solver stopped: {found.ended}."
            return FoundRobot(problem.prior, failed, np.inf, np.inf, 0.0, (), stopped)
        x = found.x if self.gamma > 0.0 else self.nearest(found.x)
        signed = self.settled(x)
        clipped = float(np.abs((signed - x) / problem.unit).max())
        gap = self.gap(signed, found, total, weight)
        status = ConsistentStatus.WEIGHTED if self.gamma > 0.0 else ConsistentStatus.CONSTRAINED
        if gap > _PROVED + self.tolerance:
            status = ConsistentStatus.LOOSE
        if not self.is_met(signed):
            status = ConsistentStatus.FAILED
        stopped = self.stopped(signed, found, status)
        return self.finished(signed, gap, clipped, status, stopped)

    def stopped(self, x: Array, found: ConeSolution, status: ConsistentStatus) -> str:
        """Where the solver stopped early: its status, iterations and the worst constraint."""
        if status is ConsistentStatus.LOOSE:
            heading = "Constraint with the largest share of the duality gap:"
            parts = [
                one.share(found.x, one.dual(z))
                for one, z in zip(self.constraints, found.multipliers, strict=True)
            ]
        elif status is ConsistentStatus.FAILED:
            heading = "Most violated constraint:"
            parts = [-one.slack(x) for one in self.constraints]
        else:
            return ""
        sentences = [sentence for one in self.constraints for sentence in one.sentences]
        worst = sentences[int(np.argmax(np.concatenate(parts)))]
        return f"The cone solver stopped: {found.ended}. {heading} {worst}"

    def settled(self, x: Array) -> Array:
        """Known values exact, bounds missed by rounding met, signs turned back."""
        unit, moved = self.problem.unit, x
        held = [one for one in self.bounds if one.cone is Cone.ZERO]
        for _ in self.bounds:  # what meets one bound may miss another
            if held:
                E = np.concatenate([one.rows for one in held])
                e = np.concatenate([one.right for one in held])
                moved = x + unit * (np.linalg.pinv(E * unit) @ (e - E @ x))
            sides = (one for one in self.bounds if one.cone is Cone.NONNEGATIVE)
            missed = [one for one in sides if one not in held and one.slack(moved)[0] < 0.0]
            if not missed:
                break
            held += missed
        x = moved
        return self.problem.with_signs(x)

    def size_of(self, x: Array) -> float:
        """How many natural units a solution has, as a unit for the solver's numbers."""
        if not np.isfinite(x).all():
            return self.problem.size(self.system.best)
        return max(1.0, self.problem.distance(x) / np.sqrt(len(x)))

    def nearest(self, x: Array) -> Array:
        """The nearest to the prior of all that fit as well as the best, x."""
        problem, system = self.problem, self.system
        squares = system.sum(x)
        radius = np.sqrt(squares * (1.0 + self.tolerance) - system.least)
        same = Constraint(
            Cone.SECOND_ORDER,
            np.vstack((np.zeros(len(x)), system.fit)) / radius,
            np.concatenate(([radius], system.target)) / radius,
            ("",),
        )
        found = solve_cones(
            problem.metric, -problem.metric @ problem.prior, (*self.constraints, same),
            problem.unit, self.size_of(x), (system.fit / radius, system.target / radius), 0.0,
        )  # fmt: skip
        if found.outcome is ConeOutcome.SOLVED and self.is_met(self.settled(found.x)):
            return found.x
        return x

    def fitted(self, total: float, weight: float, size: float) -> ConeSolution:
        """The least of squares over ``total``, with the distance weighted beside them."""
        problem, system = self.problem, self.system
        root = np.sqrt(total)
        return solve_cones(
            weight * problem.metric, -weight * problem.metric @ problem.prior, self.constraints,
            problem.unit, size, (system.fit / root, system.target / root),
        )  # fmt: skip

    def gap(self, x: Array, found: ConeSolution, total: float, weight: float) -> float:
        """Part of the squares by which a robot within twice the reach could be better."""
        problem, system = self.problem, self.system
        sought = found.x
        change, miss = sought - problem.prior, system.fit @ sought - system.target
        value = 0.5 * (
            float(miss @ miss) / total + weight * float(change @ problem.metric @ change)
        )
        gradient = system.fit.T @ miss / total + weight * problem.metric @ change
        # squares and distance are both curved: the one where the torques see, the other elsewhere
        root = np.linalg.cholesky(weight * problem.metric).T
        root = np.vstack((system.fit / np.sqrt(total), root), dtype=np.float64)
        bound = 2.0 * lower_bound(
            value, gradient, sought, self.constraints, found.multipliers, root
        )
        here = (system.sum(x) - system.least) / total
        if self.gamma > 0.0:  # of the sum that was asked for
            here += weight * problem.distance(x) ** 2
        else:  # of the squares alone, for robots at most twice as far as this one
            bound -= 4.0 * weight * problem.distance(x) ** 2
        # squares without any constraint are a bound as well
        return max(0.0, here - max(bound, 0.0)) / (here + system.least / total)

    def violation(self, x: Array) -> float:
        """By how much the worst constraint is missed, in natural units."""
        return largest_violation([one.slack(x) for one in self.constraints])

    def is_met(self, x: Array) -> bool:
        """Whether the bodies are real and constraints are missed by rounding only."""
        real = all((one.slack(x) > 0.0).all() for one in self.problem.bodies(0.0))
        return real and self.violation(x) <= _REAL * (1.0 + self.problem.distance(x))

    def finished(
        self, x: Array, gap: float, clipped: float, status: ConsistentStatus, stopped: str = ""
    ) -> FoundRobot:
        """The robot, with the constraints that it leaves no room."""
        active = []
        for one in self.constraints:
            if one.cone is not Cone.ZERO:
                slack = one.slack(x)
                pairs = zip(slack, one.sentences, strict=True)
                active += [sentence for s, sentence in pairs if s < _TIGHT]
        return FoundRobot(x, status, gap, self.violation(x), clipped, tuple(active), stopped)

    def contradiction(self) -> str:
        """Which bounds no real bodies meet together: as few as still contradict."""
        bounds = list(self.bounds)
        for one in self.bounds:
            fewer = [other for other in bounds if other is not one]
            if not self.is_possible(tuple(fewer)):
                bounds = fewer
        names = " ".join(sentence for one in bounds for sentence in one.sentences)
        return (
            "bounds: no real bodies meet them together. What contradicts, each as it would be at "
            f"its bound: {names} Widen one of them, or ask for a smaller margin."
        )

    def is_possible(self, bounds: tuple[Constraint, ...]) -> bool:
        """Whether some real bodies meet bounds."""
        problem = self.problem
        constraints = (*problem.drives, *problem.bodies(problem.margin), *bounds)
        start = -problem.metric @ problem.prior
        found = solve_cones(problem.metric, start, constraints, problem.unit)
        return found.outcome is not ConeOutcome.INFEASIBLE
