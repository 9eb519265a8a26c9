"""The table multiplied out into the plain arrays that compiled kernels take."""

from __future__ import annotations

import numpy as np

from .._arrays import Array, read_only
from ..geometry import DHTable, constant_factors
from ..kernels import Chain


def multiplied_out(table: DHTable, base: Array) -> Chain:
    """Arrays of a table for the kernels: structure and constant transforms."""
    C = constant_factors(table)
    joint = np.full(table.f, -1, dtype=np.int64)
    joint[table.joint_rows] = np.arange(table.n)
    return Chain(
        antecedent=table.antecedent,
        sigma=table.sigma,
        joint=read_only(joint, np.int64),
        rotation=read_only(C[:, :3, :3]),
        position=read_only(C[:, :3, 3]),
        base_rotation=read_only(base[:3, :3]),
        base_position=read_only(base[:3, 3]),
    )
