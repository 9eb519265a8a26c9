"""Kinds by name, and the configurations that they admit before anything is measured.

Configurations come in groups with equal labels: one posture for measurements from outside, several
postures of the same unknown target for contacts.
"""

from __future__ import annotations

from dataclasses import replace
from inspect import isabstract
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ...geometry import REVOLUTE
from ...kinematics.lengths import spread_configurations
from ..differential import differential_model
from ..extended_table import JOINT_VARIABLE, Frame
from ..parameters import GeometricParameter, GeometricParameters
from .base import Contact, Evaluation, Labelled, Measurement, required

Kind = type[Measurement]
"""A kind of measurement: its class."""
_STARTS = 6  # starts of the search for each posture
_STEPS = 40
_LONGEST = 0.3  # longest step of a joint in one iteration, rad or m


def as_kind(value: Any, name: str = "kind", among: Any = None) -> Kind:
    """A kind given as its class or by its word; by default one that configurations determine."""
    among = is_selectable if among is None else among
    word = value.word if isinstance(value, type) and issubclass(value, Measurement) else value
    if isinstance(word, str):
        word = word.strip().lower().replace("-", "_").replace(" ", "_")
    possible = {k: c for k, c in Measurement.kinds.items() if not isabstract(c) and among(c)}
    if not isinstance(word, str) or word not in possible:
        words = ", ".join(repr(each) for each in sorted(possible))
        raise InvalidValueError(
            f"{name}: expected one of {words}, or the class of one, got {value!r:.80}."
        )
    return possible[word]


def is_selectable(kind: Kind) -> bool:
    """Whether configurations determine its noise-free measurements."""
    shared = issubclass(kind, Labelled) and not issubclass(kind, Contact)
    return not shared and ("drawn" in vars(kind) or required(kind) <= {"pose", "point", "label"})


class Groups(NamedTuple):
    """Configurations with the group number of each. Shapes: q (N, n), label (N,)."""

    q: Array
    label: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of groups."""
        return int(self.label[-1]) + 1 if len(self.label) else 0


def groups_of(q: Array) -> Groups:
    """Groups of the same size. Shapes: q (G, m, n)."""
    G, size, n = q.shape
    return Groups(q.reshape(-1, n), np.repeat(np.arange(G), size))


def measurement_of(
    parameters: GeometricParameters,
    kind: Kind | str,
    groups: Groups,
    frame: Frame = None,
    corrections: Array | None = None,
) -> Measurement:
    """Noise-free measurement of a robot at given configurations."""
    T = differential_model(parameters, groups.q, corrections, frame).T
    return as_kind(kind).drawn(groups.q, T, groups.label, frame=frame)


def drawn_groups(
    parameters: GeometricParameters,
    kind: Kind | str,
    groups: int,
    postures: int,
    rng: np.random.Generator,
    *,
    frame: Frame = None,
    corrections: Array | None = None,
    limits: bool = True,
) -> Groups:
    """Configurations spread over the joint ranges, those of a contact moved until they meet.

    At most so many groups and postures; targets that are not reached in two postures are left out.
    """
    model, kind = parameters.model, as_kind(kind)
    if not issubclass(kind, Contact):
        q = spread_configurations(model, groups * postures, rng)
        return groups_of(q.reshape(groups, postures, -1))
    first = spread_configurations(model, groups, rng)
    starts = spread_configurations(model, groups * postures * _STARTS, rng)
    moving = parameters if corrections is not None else replace(parameters, entries=())
    xi = np.zeros(len(moving)) if corrections is None else corrections
    T = differential_model(moving, first, xi, frame).T
    known = {g: kind.target_at(T[g], rng) for g in range(groups)}
    label = np.repeat(np.arange(groups), postures * _STARTS)
    start = kind.drawn(starts, np.zeros((len(starts), 4, 4)), label, frame=frame, known=known)
    met = satisfied_measurement(moving, start, xi, np.zeros(0))
    found: dict[int, list[Array]] = {g: [first[g]] for g in range(groups)}
    if isinstance(met, Contact):
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        lower, upper = (np.where(bounded, x, 0.0) for x in (model.lower, model.upper))
        middle = 0.5 * (lower + upper)
        turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
        q = met.q - 2.0 * np.pi * np.round((met.q - middle) / (2.0 * np.pi)) * turns
        allowed = np.all((q >= model.lower - 1e-9) & (q <= model.upper + 1e-9), axis=1)
        for row, g, inside in zip(q, met.label, allowed, strict=True):
            members = found[int(g)]
            new = all(np.abs(row - other).max() > 1e-4 for other in members)
            if new and len(members) < postures and (inside or not limits):
                members.append(row)
    kept = [np.array(members) for members in found.values() if len(members) > 1]
    return Groups(
        np.concatenate([np.zeros((0, model.n)), *kept]),
        np.repeat(np.arange(len(kept)), [len(members) for members in kept]).astype(np.int64),
    )


def satisfied_measurement(
    parameters: GeometricParameters, measurement: Measurement, xi: Array, fixtures: Array
) -> Measurement | None:
    """The measurement with readings moved by the least step to zero residuals.

    Blocks that do not reach them are left out; None if no block does.
    """
    if not measurement.views:
        return measurement
    table, P = parameters.table, len(parameters)
    rows = sorted(np.flatnonzero(table.joint >= 0).tolist(), key=lambda r: int(table.joint[r]))
    motions = [GeometricParameter(r, JOINT_VARIABLE[table.sigma[r]], source=r) for r in rows]
    both = replace(parameters, entries=(*parameters.entries, *motions))
    values = np.concatenate([xi, np.zeros(len(motions))])
    scale = np.array([table.size if unit == "m" else 1.0 for unit in measurement.units])
    q, off = measurement.views[0].q, np.full(measurement.blocks, np.inf)
    for _ in range(_STEPS):
        measurement = measurement.with_configurations([q])
        ends = []
        for view in measurement.views:  # of a linked pair, at the same readings
            # bending changes with the readings, so that Newton's step is not exact
            found = differential_model(both, view.q, values, view.frame)
            ends.append(Evaluation(found.T, found.psi[..., P:]))
        part = measurement.linearise(ends, fixtures)
        off = np.abs(part.residual / scale).max(axis=1)
        if (off < 1e-13).all():
            break
        step = -(np.linalg.pinv(part.by_parameters, rcond=1e-6) @ part.residual[..., None])[..., 0]
        longest = np.abs(step).max(axis=1, initial=_LONGEST)
        q = q + step * (_LONGEST / longest)[:, None]
    kept = np.flatnonzero(off < 1e-10)
    return measurement.subset(kept) if len(kept) else None
