"""Columns of the drives and of friction, for every regressor."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from .._arrays import Array, read_only
from ..drive import Transmission
from ..friction import LinearFriction
from ..friction.protocols import basis_at
from ..model import RobotModel
from .columns import ChosenColumns


def couplings(model: RobotModel) -> list[tuple[Array, Array]]:
    """Of each coupled motor, its turns ``w`` per joint (n,) and ``w w^T`` without diagonal."""
    if model.transmission is None:
        return []
    return _couplings(model.transmission)


@lru_cache(maxsize=16)  # asked for each chunk of a log
def _couplings(transmission: Transmission) -> list[tuple[Array, Array]]:
    weights = transmission.weights
    rows = [weights[m - 1] for m in transmission.coupled_motors]
    return [(read_only(w), read_only(np.outer(w, w) - np.diag(w**2))) for w in rows]


def joint_terms(
    q: Array, v: Array, rotor: Array | None, friction: LinearFriction | None
) -> Iterator[tuple[str, Array]]:
    """Torque per unit of each kind of parameter that acts on its own joint.

    Shapes: q, v, rotor (N, n) -> values (N, n).
    """
    if rotor is not None:
        yield "Ia", rotor
    yield "Fv", v
    yield "Fc", np.sign(v)
    yield "offset", np.ones_like(v)
    if friction is not None:
        basis = basis_at(friction, v, q)
        for k, kind in enumerate(friction.kinds):
            yield kind, basis[:, k]


def coupled_terms(
    model: RobotModel, v: Array, rotor: Array | None
) -> Iterator[tuple[str, int, Array]]:
    """Torques per unit of each parameter of the coupled motors.

    Shapes: v, rotor (N, n) -> torques (N, n).
    """
    for i, (row, cross) in enumerate(couplings(model)):
        if rotor is not None:
            yield "Iam", i, rotor @ cross
        yield "Fvm", i, v @ cross
        yield "Fcm", i, np.sign(v @ row)[:, None] * row


def add_torques(
    model: RobotModel,
    chosen: ChosenColumns,
    q: Array,
    v: Array,
    rotor: Array | None,
    friction: LinearFriction | None,
    sign: float,
    W: Array,
) -> None:
    """Write drive and friction columns of a torque, times a sign, into ``W (N, n, c)``."""
    for kind, values in joint_terms(q, v, rotor, friction):
        joints, columns = _wanted(chosen, kind)
        if joints.size:
            W[:, joints, columns] = sign * values[:, joints]
    if chosen.has("Iam", "Fvm", "Fcm"):
        for kind, motor, torques in coupled_terms(model, v, rotor):
            if (column := chosen.column(kind, motor)) >= 0:
                W[:, :, column] = sign * torques


def add_powers(
    model: RobotModel,
    chosen: ChosenColumns,
    q: Array,
    v: Array,
    rotor: Array,
    friction: LinearFriction | None,
    rows: Array,
) -> None:
    """Write the power of drive and friction columns into ``rows (N, c)``."""
    for kind, values in joint_terms(q, v, rotor, friction):
        joints, columns = _wanted(chosen, kind)
        if joints.size:
            rows[:, columns] = values[:, joints] * v[:, joints]
    if chosen.has("Iam", "Fvm", "Fcm"):
        for kind, motor, torques in coupled_terms(model, v, rotor):
            if (column := chosen.column(kind, motor)) >= 0:
                rows[:, column] = (torques * v).sum(axis=1)


def add_rotor_momenta(model: RobotModel, chosen: ChosenColumns, v: Array, W: Array) -> None:
    """Write the momenta of unit rotors into ``W (N, n, c)``."""
    joints, columns = _wanted(chosen, "Ia")
    if joints.size:
        W[:, joints, columns] = v[:, joints]
    if chosen.has("Iam"):
        for i, (_, cross) in enumerate(couplings(model)):
            if (column := chosen.places["Iam"][i]) >= 0:
                W[:, :, column] = v @ cross


def add_rotor_energies(model: RobotModel, chosen: ChosenColumns, v: Array, rows: Array) -> None:
    """Write the energies of unit rotors into ``rows (N, c)``."""
    joints, columns = _wanted(chosen, "Ia")
    if joints.size:
        rows[:, columns] = 0.5 * v[:, joints] ** 2
    if chosen.has("Iam"):
        for i, (_, cross) in enumerate(couplings(model)):
            if (column := chosen.places["Iam"][i]) >= 0:
                rows[:, column] = 0.5 * ((v @ cross) * v).sum(axis=1)


def _wanted(chosen: ChosenColumns, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Joints whose parameter of this kind has a column, and these columns."""
    place = chosen.places.get(kind)
    if place is None:
        place = np.empty(0, dtype=np.int64)
    joints = np.flatnonzero(place >= 0)
    return joints, place[joints]
