"""Columns of the drives and of friction, for every regressor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np

from .._arrays import Array, read_only
from ..drive import Transmission
from ..friction import LinearFriction
from ..friction.protocols import basis_at
from ..model import RobotModel
from .columns import ChosenColumns

Terms = Iterable[tuple[str, "Array | list[Array]"]]
"""Torques (N, n) per unit of each kind of parameter; of coupled motors, a list with one for each.
Parameters of joints act on one joint, those of coupled motors on several."""


def couplings(model: RobotModel) -> list[tuple[Array, Array]]:
    """Turns ``w`` (n,) of each coupled motor per joint, and ``w w^T`` without its diagonal."""
    return [] if model.transmission is None else _couplings(model.transmission)


@lru_cache(maxsize=16)  # cached: used for each piece of a log
def _couplings(transmission: Transmission) -> list[tuple[Array, Array]]:
    weights = transmission.weights
    rows = [weights[m - 1] for m in transmission.coupled_motors]
    return [(read_only(w), read_only(np.outer(w, w) - np.diag(w**2))) for w in rows]


def rotor_terms(model: RobotModel, a: Array) -> Terms:
    """Torques of unit rotors at accelerations (N, n); at velocities, their momenta."""
    yield "Ia", a
    yield "Iam", [a @ cross for _, cross in couplings(model)]


def friction_terms(
    model: RobotModel, q: Array, v: Array, friction: LinearFriction | None
) -> Iterator[tuple[str, Array | list[Array]]]:
    """Torques of unit friction parameters and offsets at states (N, n)."""
    yield "Fv", v
    yield "Fc", np.sign(v)
    yield "offset", np.ones_like(v)
    motors = couplings(model)
    yield "Fvm", [v @ cross for _, cross in motors]
    yield "Fcm", [np.sign(v @ row)[:, None] * row for row, _ in motors]
    if friction is not None:
        yield from zip(friction.kinds, np.moveaxis(basis_at(friction, v, q), -2, 0), strict=True)


def add_torques(chosen: ChosenColumns, terms: Terms, W: Array, sign: float = 1.0) -> None:
    """Write the torques of unit parameters, times a sign, into ``W (N, n, c)``."""
    for kind, values in terms:
        if isinstance(values, list):
            for motor, torque in enumerate(values):
                if (column := chosen.column(kind, motor)) >= 0:
                    W[:, :, column] = sign * torque
        else:
            joints, columns = chosen.parameters(kind)
            if joints.size:
                W[:, joints, columns] = sign * values[:, joints]


def add_powers(
    chosen: ChosenColumns, terms: Terms, v: Array, rows: Array, factor: float = 1.0
) -> None:
    """Write the powers of unit parameters at velocities, times a factor, into ``rows (N, c)``."""
    for kind, values in terms:
        if isinstance(values, list):
            for motor, torque in enumerate(values):
                if (column := chosen.column(kind, motor)) >= 0:
                    rows[:, column] = factor * (torque * v).sum(axis=1)
        else:
            joints, columns = chosen.parameters(kind)
            if joints.size:
                rows[:, columns] = factor * values[:, joints] * v[:, joints]
