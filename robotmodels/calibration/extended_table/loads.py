"""Gravity load on each element of the table.

Source: Seed book section 1.5.1.1 (potential energy).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._arrays import Array
from ...kinematics import link_poses
from .elements import Element
from .six_parameters import pose_of_elements
from .skeleton import Skeleton


def gravity_loads(
    skeleton: Skeleton, q: Array, elements: Sequence[tuple[int, Element, int]]
) -> Array:
    """Forces of gravity along elements: moments about rotations, forces along translations.

    Shapes: q (N, n) -> (N, K).
    """
    model = skeleton.model
    T = link_poses(model, q)
    mass = model.inertia.values[:, 9]
    moment = T[..., :3, :3] @ model.inertia.values[:, 6:9, None]
    moment = moment[..., 0] + mass[:, None] * T[..., :3, 3]
    carried = _carried(skeleton)
    loads = np.empty((len(q), len(elements)))
    for k, (row, element, carrier) in enumerate(elements):
        axis, origin = _axis(skeleton, T, row, element)
        bodies = carried[carrier]
        total = mass[bodies].sum()
        if element.is_length:
            moved = total * axis
        else:
            moved = np.cross(axis, moment[:, bodies].sum(axis=1) - total * origin)
        loads[:, k] = moved @ model.gravity
    return loads


def _axis(skeleton: Skeleton, T: Array, row: int, element: Element) -> tuple[Array, Array]:
    """World direction and origin of an element at every configuration, shapes (N, 3)."""
    if element in (Element.THETA, Element.R) and 1 <= row <= skeleton.model.f:
        # theta and r are along z_j, with the joint's own motion done or not
        return T[:, row - 1, :3, 2], T[:, row - 1, :3, 3]
    before = np.where(np.arange(len(Element)) < element, skeleton.nominal[row], 0.0)
    antecedent = int(skeleton.antecedent[row])
    if row == 0:
        start = np.broadcast_to(skeleton.before, (len(T), 4, 4))
    elif antecedent == 0:
        start = np.broadcast_to(skeleton.model.base, (len(T), 4, 4))
    else:
        start = T[:, antecedent - 1]
    there = start @ pose_of_elements(before)
    return there[:, :3, _DIRECTIONS[element]], there[:, :3, 3]


_DIRECTIONS = {
    Element.GAMMA: 2,
    Element.B: 2,
    Element.BETA: 1,
    Element.ALPHA: 0,
    Element.D: 0,
    Element.THETA: 2,
    Element.R: 2,
}


def _carried(skeleton: Skeleton) -> dict[int, list[int]]:
    """Bodies (from 0) that each row moves, the base's row all of them."""
    f = skeleton.model.f
    carried: dict[int, list[int]] = {row: [] for row in range(skeleton.rows)}
    for body in range(f):
        row = body + 1
        while row >= 0:
            carried[row].append(body)
            row = int(skeleton.antecedent[row])
    return carried
