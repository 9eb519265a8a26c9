"""What joint sliders move: the independent joints of a robot, and the joints that follow them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..model import RobotModel

# A joint without a limit: half a turn to either side, or this many metres.
_HALF_TURN, _HALF_STROKE = np.pi, 1.0

# How far a joint may be from what its coupling says, rad or m.
_COUPLED = 1e-6


@dataclass(frozen=True, slots=True)
class Slider:
    """A joint in the panel.

    Parameters
    ----------
    name : str
        Of the joint.
    path : str
        The node that moves.
    prismatic : bool
        Whether it slides along its z axis, in metres; otherwise it turns about it, in radians.
    passive : bool
        Whether no motor moves it (mu = 0 in the table).
    lower, upper : float
        Its limits; infinite where it has none.
    ends : (float, float)
        Of the slider: the limits, or -pi to pi, -1 m to 1 m where there are none.
    follows : tuple of str
        The joints that a joint without a slider of its own moves with; empty for all others.

    Examples
    --------
    >>> Slider("joint_1", "robots/arm/joint_1/q", False, False, -1.0, 1.0, (-1.0, 1.0), ()).ends
    (-1.0, 1.0)
    """

    name: str
    path: str
    prismatic: bool
    passive: bool
    lower: float
    upper: float
    ends: tuple[float, float]
    follows: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A frame whose pose the panel can show.

    Parameters
    ----------
    name : str
        Of the frame.
    path : str
        The node it is fixed to.
    pose : ndarray, shape (4, 4)
        In that node.

    Examples
    --------
    >>> Target("tool", "robots/arm/joint_1/q", np.eye(4)).name
    'tool'
    """

    name: str
    path: str
    pose: Array


@dataclass(frozen=True, slots=True, eq=False)
class SliderPanel:
    """Sliders of a robot: n joints move as ``q = C x + q_0``, x are the r independent ones.

    Parameters
    ----------
    joints : tuple of Slider
        All n joints, in the order of the table.
    independent : ndarray of int, shape (r,)
        Which of them have a slider.
    matrix, offset : ndarray, shape (n, r) and (n,)
        ``C`` and ``q_0``.
    start : ndarray, shape (r,)
        Where the sliders are at first, rad or m.
    postures : tuple of (str, ndarray)
        Named configurations and their x.
    targets : tuple of Target
        Frames whose pose can be shown; the first one is shown at first.

    Examples
    --------
    >>> none = np.zeros(0)
    >>> SliderPanel((), none.astype(int), np.zeros((0, 0)), none, none, (), ()).independent.size
    0
    """

    joints: tuple[Slider, ...]
    independent: NDArray[np.int64]
    matrix: Array
    offset: Array
    start: Array
    postures: tuple[tuple[str, Array], ...]
    targets: tuple[Target, ...]

    @property
    def q(self) -> Array:
        """All n joint variables at first, rad or m."""
        return self.matrix @ self.start + self.offset


def slider_panel(
    model: RobotModel, q: Array, moving: Sequence[str], frames: Sequence[str]
) -> SliderPanel:
    """The sliders of a robot.

    Parameters
    ----------
    model : RobotModel
        The robot.
    q : ndarray, shape (n,)
        Where it is at first, of `coupled_posture`.
    moving : sequence of n str
        The node of each joint's motion.
    frames : sequence of f + 1 str
        The node that moves with each frame of the table; the first one is the base.

    Returns
    -------
    SliderPanel
        Sliders, named configurations and frames.
    """
    independent, matrix, offset = coupling(model)
    postures = []
    for name, posture in model.configurations.items():
        x = posture[independent]
        kept = np.allclose(matrix @ x + offset, posture, rtol=0.0, atol=_COUPLED)
        postures.append((name if kept else f"{name} (coupled joints follow)", x))
    joints = tuple(_slider(model, i, path, matrix, independent) for i, path in enumerate(moving))
    tool = Target(model.frame_names[-1], frames[model.tip], model.tool)
    targets = {tool.name: tool}
    for j, name in enumerate(model.table.names, start=1):
        targets.setdefault(name, Target(name, frames[j], np.eye(4)))
    # a link of the source URDF goes before a joint of the same name, as in dgm
    targets |= {f.name: Target(f.name, frames[f.parent], f.pose) for f in model.frames}
    targets[tool.name] = tool
    return SliderPanel(
        joints, independent, matrix, offset, q[independent], tuple(postures),
        tuple(targets.values()),
    )  # fmt: skip


def coupled_posture(model: RobotModel, q: Array | None) -> Array:
    """Where the robot is at first.

    Parameters
    ----------
    model : RobotModel
        The robot.
    q : ndarray, shape (n,), optional
        What the caller asked for; by default the independent joints are at zero.

    Returns
    -------
    ndarray, shape (n,)
        Radians or metres.

    Raises
    ------
    InvalidValueError
        Coupled joints of ``q`` are not where their coupling has them.

    Examples
    --------
    >>> from robotmodels.drive import Transmission
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(
    ...     DHTable(antecedent=[0, 1], sigma=[0, 0]),
    ...     transmission=Transmission([[1, 0], [-2, 0]], [0, 0.1]),
    ... )
    >>> coupled_posture(arm, None)
    array([0. , 0.1])
    """
    independent, matrix, offset = coupling(model)
    asked = model.configurations["zero"] if q is None else q
    coupled = matrix @ asked[independent] + offset
    off = np.abs(asked - coupled)
    if q is not None and (off > _COUPLED).any():
        j = int(off.argmax())
        raise InvalidValueError(
            f"q: {model.table.joint_names[j]} moves with other joints, whose values put it at "
            f"{coupled[j]:.9g}, got {q[j]:.9g}; give it that value, or drop the transmission with "
            "with_transmission(None)."
        )
    return coupled


def coupling(model: RobotModel) -> tuple[NDArray[np.int64], Array, Array]:
    """Which joints are independent, and how the others follow them.

    A transmission that can be inverted leaves all joints independent, however their motors are
    coupled. Where it cannot (a joint mimics others), ``q - q_0`` is in the range of K, which a
    choice of as many joints as its rank describes: ``q - q_0 = K K_i^+ (q_i - q_0i)``.

    Parameters
    ----------
    model : RobotModel
        The robot.

    Returns
    -------
    independent : ndarray of int, shape (r,)
        Joints, in the order of the table.
    matrix : ndarray, shape (n, r)
        ``C`` of ``q = C q_i + offset``.
    offset : ndarray, shape (n,)
        Radians or metres.

    Examples
    --------
    >>> from robotmodels.drive import Transmission
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(
    ...     DHTable(antecedent=[0, 1], sigma=[0, 0]), transmission=Transmission([[1, 0], [-2, 0]])
    ... )
    >>> independent, matrix, offset = coupling(arm)
    >>> independent, matrix.ravel()
    (array([0]), array([ 1., -2.]))
    """
    n = model.n
    if model.transmission is None:
        return np.arange(n), np.eye(n), np.zeros(n)
    K, q_0 = model.transmission.matrix, model.transmission.offset
    # joints that an encoder of their own moves come first: they lead, the others mimic
    order = sorted(range(n), key=lambda j: (K[j, j] == 0.0, j))
    chosen: list[int] = []
    basis = np.zeros((0, n))
    for j in order:
        row = K[j] / (np.linalg.norm(K[j]) or 1.0)
        rest = row - basis.T @ (basis @ row)
        if np.linalg.norm(rest) > 1e-9:
            chosen.append(j)
            basis = np.vstack((basis, rest / np.linalg.norm(rest)))
    independent = np.array(sorted(chosen), dtype=np.int64)
    if independent.size == n:
        return independent, np.eye(n), np.zeros(n)
    C = K @ np.linalg.pinv(K[independent])
    C[np.abs(C) < 1e-14] = 0.0
    C[independent] = np.eye(independent.size)
    offset = q_0 - C @ q_0[independent]
    offset[independent] = 0.0
    return independent, C, offset


def _slider(
    model: RobotModel, i: int, path: str, matrix: Array, independent: NDArray[np.int64]
) -> Slider:
    table = model.table
    names = table.joint_names
    row = int(table.joint_rows[i])
    prismatic = bool(table.sigma[row] == PRISMATIC)
    leaders = () if i in independent else tuple(
        names[k] for k, c in zip(independent, matrix[i], strict=True) if c
    )  # fmt: skip
    lower, upper = float(table.lower[i]), float(table.upper[i])
    return Slider(
        names[i], path, prismatic, not table.mu[row], lower, upper,
        _ends(lower, upper, _HALF_STROKE if prismatic else _HALF_TURN), leaders,
    )  # fmt: skip


def _ends(lower: float, upper: float, half: float) -> tuple[float, float]:
    """The limits; where one is missing, as much as a joint without any has, beyond the other."""
    low = lower if np.isfinite(lower) else min(-half, upper - 2.0 * half)
    high = upper if np.isfinite(upper) else max(half, lower + 2.0 * half)
    return low, high
