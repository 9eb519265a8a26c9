"""Whether the size of the robot is told: contacts are satisfied by one shrunk to nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..._arrays import Array
from ...errors import InvalidValueError
from ...geometry import PRISMATIC
from ...kinematics.lengths import spread_configurations
from ..extended_table.differential import differential_model
from ..extended_table.elements import ErrorLaw
from ..measurements import scale_is_observable
from ..problem import Problem

_POSTURES = 40
_NULL = 1e-9
_MOVES = 1e-6
_ZERO = 1e-6
_TINY = 1e-300


def needs_a_length(problem: Problem, known: Iterable[str]) -> bool:
    """Whether the scale has to come from a parameter that is known."""
    if all(unit == "rad" for m in problem.measurements for unit in m.units):
        return False  # orientations do not see lengths at all
    p, known = problem.parameters, set(known)
    base_is_known = not any(
        e.row == 0 and e.law is ErrorLaw.CONSTANT and e.name not in known for e in p.entries
    )
    if scale_is_observable(problem.measurements, p.model.base[:3, 3] if base_is_known else None):
        return False
    return any(
        e.law is ErrorLaw.CONSTANT and e.element.is_length and 0 < e.row <= p.model.f
        for e in p.entries
    )


def check_scale(problem: Problem, W: Array, fixed: Sequence[str], named: Sequence[str]) -> None:
    """Refuse measurements that do not determine the scale of the robot. Shapes: W (M, F + P)."""
    p, F = problem.parameters, problem.F
    least = _ZERO * problem.parameters.skeleton.size
    lengths = [
        entry.name
        for entry, value in zip(p.entries, p.nominal, strict=True)
        if entry.law is ErrorLaw.CONSTANT and entry.element.is_length and abs(value) > least
        and 0 < entry.row <= p.model.f
    ]  # fmt: skip
    R = np.asarray(np.linalg.qr(W, mode="r"))
    distances, G = _distances(problem)

    def is_open(names: Iterable[str]) -> bool:
        left_out = set(names)
        free = np.array([k for k, name in enumerate(p.names) if name not in left_out], dtype=int)
        columns = np.concatenate([np.arange(F), F + free]).astype(int)
        size = np.linalg.norm(R[:, columns], axis=0)
        told = size > _NULL * size.max(initial=0.0)
        columns, size = columns[told], size[told]
        _, values, directions = (np.asarray(part) for part in np.linalg.svd(R[:, columns] / size))
        rank = int((values > _NULL * values[0]).sum())
        unseen = directions[rank:] / size
        of_robot = columns >= F
        shapes = G[:, columns[of_robot] - F] @ unseen[:, of_robot].T
        if not shapes.shape[1]:
            return not distances.any()
        shapes = shapes / np.maximum(np.linalg.norm(shapes, axis=0), _TINY)
        shrunk = shapes @ np.linalg.lstsq(shapes, distances, rcond=_NULL)[0]
        return bool(np.linalg.norm(shrunk - distances) <= _MOVES * np.linalg.norm(distances))

    # readings of prismatic joints are lengths, and may be enough
    slides = bool((p.skeleton.sigma == PRISMATIC).any())
    if (named or slides) and not is_open(fixed):
        return
    rest = [name for name in fixed if name not in named]
    serve = [name for name in lengths if not is_open([*rest, name])]
    example = serve[0] if serve else "d3"
    advice = (
        f"Measure a distance (KnownDistance, Distance), or name a parameter whose length is known: "
        f"known_lengths=({example!r},). Lengths that would do here: {', '.join(serve) or 'none'}."
    )
    if not named:
        raise InvalidValueError(
            "These measurements know no length: a robot shrunk to nothing would satisfy them. "
            f"{advice}"
        )
    raise InvalidValueError(
        f"These measurements know no length, and {', '.join(named)} cannot give it here: other "
        f"parameters act alike, and the robot would shrink with them. {advice}"
    )


def _distances(problem: Problem) -> tuple[Array, Array]:
    """Distances of the end between random postures, and their derivatives, shape (rows, P)."""
    p = problem.parameters
    q = spread_configurations(p.model, _POSTURES, np.random.default_rng(0))
    T, psi = differential_model(p, q, frame=p.skeleton.frames[0])
    apart = np.diff(T[:, :3, 3], axis=0)
    length = np.linalg.norm(apart, axis=1)
    along = apart / np.where(length > 0.0, length, 1.0)[:, None]
    return length, np.einsum("ni,nip->np", along, np.diff(psi[:, :3], axis=0))
