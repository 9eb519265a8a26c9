"""Each method with the options that it takes, for equations that are made and reduced."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from .._choices import chosen
from ..errors import InvalidValueError
from ..model import RobotModel
from .equations import Equations
from .methods.estimate import Estimate, Method
from .methods.least_squares import ordinary, reweighted, weighted
from .methods.recursive import recursive
from .methods.ridge import ridge, segments
from .methods.robust import robust
from .methods.sequential import sequential
from .methods.total import total
from .scale.reduction import Reduction

if TYPE_CHECKING:
    from ..estimation import Loss
    from .closed_loop import ClosedLoop, Controller, Output

_SIMULATED = (Method.IV, Method.DIDIM, Method.CLOE)


@dataclass(frozen=True, slots=True, eq=False)
class MethodOptions:
    """Options of the methods; None is the method's default."""

    loss: Loss | str | None = None
    prior: RobotModel | ArrayLike | None = None
    prior_deviations: ArrayLike | None = None
    strength: float | None = None
    noise: ArrayLike | None = None
    forgetting: float | None = None
    controller: Controller | None = None
    loop: ClosedLoop | None = None
    start: ArrayLike | None = None
    output: Output | str | None = None
    shrinkage: bool | None = None

    def check(self, method: Method) -> None:
        """Refuse options that a method does not take: none is ignored."""
        for field in fields(self):
            takers = _TAKERS[field.name]
            if getattr(self, field.name) is not None and method not in takers:
                words = " or ".join(repr(taker.name.lower()) for taker in takers)
                raise InvalidValueError(
                    f"{field.name}: the method {method.name.lower()!r} does not take it; it is "
                    f"for {words}."
                )


_TAKERS = {
    "loss": (Method.ROBUST,),
    "prior": (Method.RIDGE,),
    "prior_deviations": (Method.RIDGE,),
    "strength": (Method.RIDGE,),
    "noise": (Method.TLS,),
    "forgetting": (Method.RECURSIVE,),
    "controller": _SIMULATED,
    "loop": _SIMULATED,
    "start": _SIMULATED,
    "output": (Method.CLOE,),
    "shrinkage": (Method.WLS, Method.IRLS),
}


def solve(
    system: Equations, reduction: Reduction, method: Method, options: MethodOptions
) -> Estimate:
    """Parameters by one of the methods."""
    options.check(method)
    if method is Method.OLS:
        return ordinary(reduction)
    if method is Method.WLS:
        return weighted(reduction)
    if method is Method.IRLS:
        return reweighted(reduction)
    if method is Method.ROBUST:
        return robust(system, reduction, "huber" if options.loss is None else options.loss)
    if method is Method.TLS:
        return total(reduction, 0.001 if options.noise is None else options.noise)
    if method is Method.SEQUENTIAL:
        return sequential(system, reduction)
    if method is Method.RECURSIVE:
        return recursive(system, reduction, _or(options.forgetting, 1.0))
    if method is Method.RIDGE:
        told = options.strength is not None or options.prior_deviations is not None
        parts = None if told else segments(system)
        return ridge(
            reduction, _prior(system, options.prior), options.prior_deviations, options.strength,
            parts,
        )  # fmt: skip
    return _simulated(system, reduction, method, options)


def _simulated(
    system: Equations, reduction: Reduction, method: Method, options: MethodOptions
) -> Estimate:
    from .closed_loop import Output, didim, instrumental, output_error

    controller, start, loop = options.controller, options.start, options.loop
    if method is Method.IV:
        return instrumental(system, reduction, controller, start, loop=loop)
    if method is Method.DIDIM:
        return didim(system, reduction, controller, start, loop=loop)
    output = Output.TORQUE if options.output is None else chosen(Output, options.output, "output")
    return output_error(system, reduction, controller, start, output=output, loop=loop)


def _prior(system: Equations, prior: RobotModel | ArrayLike | None) -> ArrayLike | None:
    """Values of the parameters that are identified, of a robot that is expected."""
    if not isinstance(prior, RobotModel):
        return prior
    values = dict(zip(system.base.names, system.base.values(prior).tolist(), strict=True))
    return [values[name] for name in system.names]


def _or(value: float | None, default: float) -> float:
    return default if value is None else value
