"""The linear equations of an identification: blocks of regressor and measured torque."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel
from .preparation.processing import Processing
from .preparation.signals import Piece, pieces


class EquationForm(Enum):
    """What the equations balance.

    Examples
    --------
    >>> EquationForm.TORQUE.name
    'TORQUE'
    """

    TORQUE = "torques of the joints"
    """The inverse dynamic model: one equation for each joint; needs accelerations."""
    FILTERED = "rates of the momenta of the joints"
    """The momentum form through a low-pass: one for each joint, without accelerations."""
    POWER = "power of all joints together"
    """One equation at each time; needs accelerations."""
    ENERGY = "energy of the robot between instants"
    """One equation for each stretch of time, without accelerations."""

    @property
    def by_joint(self) -> bool:
        """Whether each joint has equations of its own."""
        return self in (EquationForm.TORQUE, EquationForm.FILTERED)


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Some equations: ``W @ parameters = y``, of m kinds (the joints) at k times.

    Parameters
    ----------
    t : ndarray, shape (k,)
        Times in the log, seconds; of a stretch its middle.
    W : ndarray, shape (k, m, b)
        Regressor.
    y : ndarray, shape (k, m)
        Measured side: N m or N; W of a power, J of an energy.
    use : ndarray of bool, shape (k, m)
        Which equations take part: not those in a dead band.
    v : ndarray, shape (k, n)
        Velocities, rad/s or m/s, filtered alike; of a stretch their mean.
    """

    t: Array
    W: Array
    y: Array
    use: NDArray[np.bool_]
    v: Array

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """One data object for every method: a robot, its parameters, a log, and how it is processed.

    Blocks are made when they are asked for, piece by piece, so that memory does not grow with the
    log.

    Parameters
    ----------
    base : BaseParameters
        Of the robot, with its drive kinds and friction model.
    names : tuple of str
        Those of its parameters that have columns, b of them.
    log : Log
        The log.
    processing : Processing
        The choices.
    form : EquationForm
        What is balanced.
    """

    base: BaseParameters
    names: tuple[str, ...]
    log: Log
    processing: Processing
    form: EquationForm = EquationForm.TORQUE

    @property
    def model(self) -> RobotModel:
        """The robot."""
        return self.base.model

    @property
    def kinds(self) -> int:
        """Equations at one time: the joints, or one for the whole robot."""
        return self.model.n if self.form.by_joint else 1

    def with_names(self, names: tuple[str, ...]) -> Self:
        """The same equations in fewer parameters."""
        return replace(self, names=names)

    def pieces(self) -> list[Piece]:
        """Pieces of the log, always the same ones."""
        return list(pieces(self.log, self.processing))

    def block(self, piece: Piece) -> Block:
        """Equations of one piece.

        Parameters
        ----------
        piece : Piece
            One of `pieces`.

        Returns
        -------
        Block
            With k = (rows of the piece) / decimation, rounded up; forms that need samples on
            either side have a few less at the ends of a recording.
        """
        from .forms.energy import energy_block
        from .forms.filtered import filtered_block
        from .forms.power import power_block
        from .forms.torque import torque_block

        if self.form is EquationForm.FILTERED:
            return filtered_block(self, piece)
        if self.form is EquationForm.POWER:
            return power_block(self, piece)
        if self.form is EquationForm.ENERGY:
            return energy_block(self, piece)
        return torque_block(self, piece)

    def blocks(self) -> Iterator[Block]:
        """Equations of the whole log, piece by piece."""
        for piece in self.pieces():
            yield self.block(piece)


def equations(
    base: BaseParameters, log: Log, processing: Processing,
    form: EquationForm = EquationForm.TORQUE,
) -> Equations:  # fmt: skip
    """Equations of a log for a robot.

    Parameters
    ----------
    base : BaseParameters
        Of the robot.
    log : Log
        Of as many joints.
    processing : Processing
        The choices, of `choose_processing`.
    form : EquationForm
        What is balanced.

    Returns
    -------
    Equations
        In all base parameters.

    Raises
    ------
    InvalidValueError
        A log of another number of joints.

    Examples
    --------
    >>> from robotmodels.identification import choose_processing
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> block = next(system.blocks())
    >>> block.W.shape[1:], block.y.shape[1:] == (2,)
    ((2, 8), True)
    """
    if log.n != base.model.n:
        raise InvalidValueError(
            f"log: it has {log.n} joints and {base.model.name!r} has {base.model.n}; give read_log "
            "the columns of the robot's joints, in its order."
        )
    return Equations(base, base.names, log, processing, form)
