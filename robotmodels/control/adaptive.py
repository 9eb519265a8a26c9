"""Adaptive control: estimates of inertial parameters that make tracking errors vanish.

References
----------
Seed book section 5.2.8; J.-J. Slotine and W. Li, "On the adaptive control of robot manipulators",
Int. J. Robotics Research 6(3), 1987.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_vector, batch_rows
from ..drive import Drives
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel, check_model
from ..regressors import parameter_names, parameter_vector
from ..regressors.columns import LINKS, ChosenColumns, chosen_columns, standard_blocks
from ..regressors.drives import add_torques, friction_terms, rotor_terms
from .joint_laws import SurfaceLaw
from .law import as_gains, as_word, started

_REMAINS = 0.2
"""Part of an error of a parameter that remains where the motion excites it too little."""


def slotine_li_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    v_r: ArrayLike,
    a_r: ArrayLike,
    drive: Drives = True,
) -> Array:
    """Regressor of ``A a_r + C(q, v) v_r + Q``, with the friction of the drives at v.

    C(q, v) v_r with Christoffel symbols is symmetric in both velocities: a difference of squares of
    half sums, each a torque regressor.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints; its own inertia is not used.
    q, v, v_r, a_r : array_like, shape (..., n)
        Joint variables (rad or m), their velocities, reference velocities and accelerations; the
        leading axes broadcast.
    drive : bool or collection of DriveKind or str
        Drive parameters with columns, as in `torque_regressor`.

    Returns
    -------
    ndarray, shape (..., n, p)
        Columns as `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> Y = slotine_li_regressor(one, [0.0], [3.0], [1.0], [2.0])
    >>> dict(zip(parameter_names(one), Y[0].tolist(), strict=True))["ZZ1"]
    2.0
    """
    check_model(model)
    names = "q", "v", "v_r", "a_r"
    given = zip((q, v, v_r, a_r), names, strict=True)
    batch, rows = batch_rows(tuple(as_vector(x, model.n, name) for x, name in given), names)
    chosen = chosen_columns(standard_blocks(model, drive, None), None, model)
    return _regressors(model, chosen, *rows).reshape(*batch, model.n, chosen.count)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AdaptiveSlotineLi(SurfaceLaw):
    """Adaptive control of Slotine and Li.

    ``tau = Y theta + gain s`` and ``theta' = adaptation Y^T s``, with the regressor Y of
    `slotine_li_regressor` at ``q_r' = q_d' + slope e``, and ``s = q_r' - q'``. The state is theta.
    Errors of tracking vanish whatever theta; theta itself converges where the motion excites it.

    Parameters
    ----------
    reference, slope, gain
        As for `Passivity`: positions; rate at which the error vanishes, 1/s; torque by s.
    adaptation : float or array_like, shape (p,)
        Gains of the estimates.
    parameters : {"base", "standard"}
        Estimated parameters. Standard ones drift along combinations that have no effect.
    start : array_like, shape (p,), optional
        Estimates at the start; default zero.
    model : RobotModel
        The robot; its inertia is not used.
    drive : bool or collection of DriveKind or str
        Drive parameters that are estimated, too.

    Raises
    ------
    ShapeError, InvalidValueError
        As `Passivity`, and a start of the wrong length.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> AdaptiveSlotineLi([0, 0], 5.0, 10.0, 1.0, model=load("planar_2r"), drive=False).names
    ('ZZ1', 'ZZ2', 'MX2', 'MY2')
    """

    reference: Any
    slope: Any
    gain: Any
    adaptation: Any
    parameters: str = "base"
    start: Any = None
    model: RobotModel = None  # type: ignore[assignment]
    drive: Drives = True
    names: tuple[str, ...] = field(init=False)
    state0: Array = field(init=False)
    base: BaseParameters | None = field(init=False)
    _chosen: ChosenColumns = field(init=False)

    def __post_init__(self) -> None:
        check_model(self.model)
        self._prepare(("slope", "gain"), self.model)
        as_word(self.parameters, ("base", "standard"), "parameters")
        base = base_parameters(self.model, drive=self.drive) if self.parameters == "base" else None
        names = tuple(base.names if base else parameter_names(self.model, self.drive))
        blocks, p = standard_blocks(self.model, self.drive, None), len(names)
        start = np.zeros(p) if self.start is None else as_exact(self.start, (p,), "start")
        self._set(adaptation=as_gains(self.adaptation, "adaptation", p), start=start, state0=start)
        self._set(base=base, names=names, _chosen=chosen_columns(blocks, names, self.model))

    def true_values(self, plant: RobotModel) -> Array:
        """Parameters (p,) of a robot of the same structure, to which the estimates converge."""
        return self.base.values(plant) if self.base else parameter_vector(plant, self.drive)

    def regressor(self, t: float, q: Any, v: Any) -> tuple[Array, Array]:
        """Y, shape (n, p), and s, shape (n,)."""
        q, v, *_ = self._measured(q, v, self.state0, None)
        v_r, a_r = self._rates(t, q, v)
        rows = (x.reshape(1, -1) for x in (q, started(v, v_r), v_r, a_r))
        return _regressors(self.model, self._chosen, *rows)[0], v_r - v

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        Y, s = self.regressor(t, q, v)
        return Y @ x + self.gain * s

    def _rate(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        Y, s = self.regressor(t, q, v)
        return self.adaptation * (s @ Y)

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float:
        """``(s^T A s + sum of squared errors of the estimates / adaptation) / 2``."""
        missing = self.true_values(plant) - x
        kinetic = SurfaceLaw.lyapunov(self, plant, t, q, v, x)
        return kinetic + 0.5 * float(missing @ (missing / self.adaptation))

    def notes(self, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence that names the parameters that a motion (N, n) excites too little.

        Errors of the estimates decrease as ``theta' = -adaptation Y^T Y / gain theta``, on average.
        """
        if len(t) < 2:
            return ()
        root = np.sqrt(np.broadcast_to(self.adaptation, (len(self.names),)))
        Y = np.array([self.regressor(*row)[0] for row in zip(t, q, v, strict=True)])
        Y = Y * root / np.sqrt(np.broadcast_to(self.gain, (self.n,)))[:, None]
        # persistent excitation: the second half, as if all of the run were like it
        weights = 2.0 * np.convolve(np.diff(t), [0.5, 0.5]) * (t > 0.5 * (t[0] + t[-1]))
        size, axes = np.linalg.eigh(np.einsum("k,kij,kil->jl", weights, Y, Y))
        remains = (axes * axes) @ np.exp(-np.maximum(size, 0.0))
        few = [name for name, part in zip(self.names, remains, strict=True) if part > _REMAINS]
        if not few:
            return ()
        return (f"The motion excites these parameters too little to estimate: {', '.join(few)}.",)


def _regressors(
    model: RobotModel, chosen: ChosenColumns, q: Array, v: Array, v_r: Array, a_r: Array
) -> Array:
    """The regressor of rows (N, n), shape (N, n, c)."""
    from ..kernels.regressors import torque_regressors

    W, squares = np.empty((2, len(q), model.n, chosen.count))
    links, zero = chosen.places[LINKS], np.zeros(3)
    torque_regressors(q, 0.5 * (v + v_r), a_r, model.chain, model.gravity, links, W)
    torque_regressors(q, 0.5 * (v - v_r), 0.0 * a_r, model.chain, zero, links, squares)
    W -= squares
    add_torques(chosen, rotor_terms(model, a_r), W)
    add_torques(chosen, friction_terms(model, q, v, None), W)
    return W
