"""Identification of robots with kinematic loops, from logs of their actuated joints.

The loops are closed at each sample; the equations are those of the actuated joints, ``G^T W``, in
the rows of all joints of the tree, of which the others have no equations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._arrays import Array
from ..drive import Drives
from ..errors import InvalidValueError
from ..logs import Log
from ..loops import ClosingStatus, LoopedParameters, LoopedRobot, base_parameters, close
from ..minimal_parameters import BaseParameters
from .checks import accepted_log, accepted_test
from .equations import Equations
from .forms import Block, FormedRows, Mask, torque_block
from .methods.base import Method
from .methods.linear import Irls, Ols, Wls
from .processing import checked_processing, choose_processing
from .signals import Piece, Processing

_SIZE = 1024  # samples at a time


@dataclass(frozen=True, slots=True, eq=False)
class LoopedEquations(Equations):
    """Torque equations of the actuated joints of a looped robot, on a log of all its joints."""

    base: LoopedParameters  # type: ignore[assignment]

    def block(self, piece: Piece) -> Block:
        """Equations of a piece; read-only."""
        return torque_block(self, piece, self._formed)

    def chunks(
        self, regressor: Callable[..., Any], *samples: Array, size: int = _SIZE
    ) -> Iterator[Array]:
        """Regressor of samples (N, n), chunk by chunk; zero in the rows of passive joints."""
        for k in range(0, len(samples[0]), size):
            yield self.base.torque_rows(*(x[k : k + size] for x in samples), columns=self.names)

    def _formed(self, W: Array, y: Array, v: Array, use: Mask) -> FormedRows:
        """Rows of actuated joints, at samples at which dry friction of all joints is known."""
        actuated = np.isin(np.arange(self.log.n), self.base.robot.actuated)
        return W, y, use.all(axis=1, keepdims=True) & actuated


def looped_method(robot: LoopedRobot, method: Method, others: dict[str, bool]) -> Method:
    """The method without shrinkage; options that loops do not support are refused."""
    refused = [name for name, given in others.items() if given]
    if type(method) not in (Ols, Wls, Irls):
        refused.append(f"method={method.name!r}")
    if isinstance(method, Wls) and method.shrinkage:
        refused.append("shrinkage")
    if robot.tree.transmission is not None:
        refused.append("transmission")
    if refused:
        raise InvalidValueError(
            f"model: {robot.name!r} has kinematic loops, for which fit has no "
            f"{', '.join(refused)}; "
            "it has torque equations with method='ols', 'wls' or 'irls', drive= and base=."
        )
    return replace(method, shrinkage=False) if isinstance(method, Wls) else method


def looped_equations(
    robot: LoopedRobot,
    log: Log,
    test: Log | None,
    drive: Drives,
    base: BaseParameters | None,
    processing: Processing | Mapping[str, Any] | None,
    checked: bool,
) -> tuple[LoopedEquations, Log | None, tuple[str, ...]]:
    """Equations of a log of the actuated joints, the test log, and findings on both."""
    findings: tuple[str, ...] = ()
    given = log
    if checked:
        log, findings = accepted_log(log, None, "log", joints=False)
    if test is not None:
        test, more = accepted_test(given, test, len(robot.actuated), None, checked)
        findings += more
    if log.n != len(robot.actuated):
        raise InvalidValueError(
            f"log: it has {log.n} joints, and {len(robot.actuated)} of {robot.name!r} are "
            "actuated; give read_log the columns of these joints."
        )
    if base is None:
        first = close(robot, log.q[0])
        found = first.status == ClosingStatus.CLOSED
        base = base_parameters(robot, first.q if found else None, drive)
    if not isinstance(base, LoopedParameters) or base.robot != robot:
        raise InvalidValueError(
            "base: expected loops.base_parameters(robot, q_ref) of the same looped robot."
        )
    log = with_all_joints(base, log)
    held_out = None if test is None else with_all_joints(base, test)
    chosen = checked_processing(processing, log)
    if not isinstance(chosen, Processing):
        chosen = choose_processing(log, **chosen)
    return LoopedEquations(base, base.names, log, chosen), held_out, findings


def with_all_joints(base: LoopedParameters, log: Log) -> Log:
    """The log with positions of all joints, and no torque of the passive ones."""
    robot = base.robot
    q, v, a, _ = base.motion(base.q_ref, log.q, log.v, log.a)
    tau = np.zeros(q.shape)
    tau[:, robot.actuated] = log.tau
    measured = {"v": None if log.v is None else v, "a": None if log.a is None else a}
    names = ("starts", "delay", "sources", "refused", "notes")
    kept = {name: getattr(log, name) for name in names}
    return Log(log.dt, q, tau, names=robot.tree.table.joint_names, **measured, **kept)
