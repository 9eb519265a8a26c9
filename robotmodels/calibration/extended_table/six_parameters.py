"""The six parameters of a pose: how a robot stands in the world, and a tool on its flange."""

from __future__ import annotations

from math import atan2, hypot
from typing import Any, NamedTuple

import numpy as np

from ... import se3
from ..._arrays import Array, read_only
from ...geometry import DHTable, link_transforms

_CLEAR = 0.5
"""Sine of alpha from which the six parameters of a pose are well determined (30 degrees)."""


class SixParameters(NamedTuple):
    """Six parameters of a pose, and the constant turn that keeps them well determined.

    Attributes
    ----------
    elements : ndarray, shape (7,)
        gamma, b, beta (0), alpha, d, theta, r in rad and m.
    turn : ndarray, shape (4, 4)
        A constant quarter turn, or the identity: in front of a base, behind a tool.

    Examples
    --------
    >>> base_parameters_of(np.eye(4)).elements.round(3) + 0.0
    array([0.   , 0.   , 0.   , 1.571, 0.   , 0.   , 0.   ])
    """

    elements: Array
    turn: Array


def pose_of_elements(elements: Array) -> Array:
    """Pose of one row of the table.

    Parameters
    ----------
    elements : ndarray, shape (7,)
        gamma, b, beta, alpha, d, theta, r in rad and m.

    Returns
    -------
    ndarray, shape (4, 4)
        ``Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta)
        Trans(z, r)``.

    References
    ----------
    Seed book eq. [1.3].

    Examples
    --------
    >>> pose_of_elements(np.array([0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0]))[:3, 3]
    array([2., 0., 1.])
    """
    gamma, b, beta, alpha, d, theta, r = elements[:, None]
    row = DHTable([0], [2], gamma=gamma, b=b, beta=beta, alpha=alpha, d=d, theta=theta, r=r)
    return link_transforms(row, [])[0]


def base_parameters_of(base: Any) -> SixParameters:
    """Six parameters of the place Z of a robot in the world, ``Z = turn row(elements)``.

    Where z_0 is nearly parallel to the axis z of the world the six parameters would not describe
    small displacements along y: the world is then turned by a constant quarter about x.

    Parameters
    ----------
    base : pose, shape (4, 4)
        Z, metres.

    Returns
    -------
    SixParameters
        Elements and turn.

    References
    ----------
    Seed book section 1.4.2 (frame 0), eq. [1.10].

    Examples
    --------
    >>> found = base_parameters_of(np.eye(4))
    >>> np.allclose(found.turn @ pose_of_elements(found.elements), np.eye(4))
    True
    """
    base = se3.as_single_pose(base, "base")
    turn = _turn(base[2, 2])
    return SixParameters(read_only(_six_elements(se3.inverse(turn) @ base)), read_only(turn))


def tool_parameters_of(tool: Any) -> SixParameters:
    """Six parameters of the place E of a tool in the frame that carries it, ``E = row turn``.

    Parameters
    ----------
    tool : pose, shape (4, 4)
        E, metres.

    Returns
    -------
    SixParameters
        Elements and turn. The turn does not move the tool's origin.

    References
    ----------
    Seed book section 1.4.2 (frame n + 1), eq. [1.10].

    Examples
    --------
    >>> found = tool_parameters_of(np.eye(4))
    >>> np.allclose(pose_of_elements(found.elements) @ found.turn, np.eye(4))
    True
    """
    tool = se3.as_single_pose(tool, "tool")
    turn = _turn(tool[2, 2])
    return SixParameters(read_only(_six_elements(tool @ se3.inverse(turn))), read_only(turn))


def _turn(cosine: float) -> Array:
    return np.eye(4) if 1.0 - cosine**2 >= _CLEAR**2 else se3.rotation("x", -np.pi / 2)


def _six_elements(T: Array) -> Array:
    R, p = T[:3, :3], T[:3, 3]
    alpha = atan2(hypot(R[0, 2], R[1, 2]), R[2, 2])
    gamma = atan2(R[0, 2], -R[1, 2])
    theta = atan2(R[2, 0], R[2, 1])
    x = np.array([np.cos(gamma), np.sin(gamma), 0.0])
    b, d, r = np.linalg.solve(np.column_stack([[0.0, 0.0, 1.0], x, R[:, 2]]), p)
    return np.array([gamma, b, 0.0, alpha, d, theta, r])
