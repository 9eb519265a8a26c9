"""Scale of the robot: whether measurements determine it (contacts alone do not)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..kinematics.lengths import spread_configurations
from .differential import differential_model
from .measurements import scale_is_observable
from .parameters import ErrorLaw, GeometricParameters
from .problem import Problem

_RANK_TOLERANCE = 1e-9  # of the null space, relative
_SCALE_TOLERANCE = 1e-6  # difference of a motion from a scaling; lengths that are zero, relative


def needs_a_length(problem: Problem, known: Iterable[str]) -> bool:
    """Whether the scale has to come from a parameter that is known."""
    if all(unit == "rad" for m in problem.measurements for unit in m.units):
        return False  # orientations do not depend on lengths at all
    p, known = problem.parameters, set(known)
    constant = [e for e in p.entries if e.law is ErrorLaw.CONSTANT]
    base_is_known = all(e.name in known for e in constant if e.row == 0)
    if scale_is_observable(problem.measurements, p.model.base[:3, 3] if base_is_known else None):
        return False
    return any(e.element.is_length and 0 < e.row <= p.model.f for e in constant)


def check_scale(problem: Problem, W: Array, fixed: Sequence[str], named: Sequence[str]) -> None:
    """Refuse measurements that do not determine the scale of the robot. Shapes: W (M, F + P)."""
    p = problem.parameters
    R = np.asarray(np.linalg.qr(W, mode="r"))
    # readings of prismatic joints are lengths, and may be enough
    slides = bool((p.table.sigma == PRISMATIC).any())
    distances = _distances(p)
    if (named or slides) and _scale_is_kept(problem, R, fixed, distances):
        return
    least = _SCALE_TOLERANCE * p.table.size
    rest = [name for name in fixed if name not in named]
    lengths = [
        entry.name
        for entry, value in zip(p.entries, p.nominal, strict=True)
        if entry.law is ErrorLaw.CONSTANT
        and entry.element.is_length
        and abs(value) > least
        and 0 < entry.row <= p.model.f
        and _scale_is_kept(problem, R, [*rest, entry.name], distances)
    ]
    known = "These measurements contain no length"
    problem_text = f"{known}: a robot scaled to zero size would satisfy them."
    if named:
        problem_text = (
            f"{known}, and fixing {', '.join(named)} does not determine the scale: other "
            "parameters have the same effect."
        )
    raise InvalidValueError(
        f"{problem_text} Measure a distance (KnownDistance, Distance), or name a parameter whose "
        f"length is known: known_lengths=({lengths[0] if lengths else 'd3'!r},). Lengths that "
        f"would do here: {', '.join(lengths) or 'none'}."
    )


def _scale_is_kept(
    problem: Problem, R: Array, fixed: Iterable[str], distances: tuple[Array, Array]
) -> bool:
    """Whether no unidentifiable direction scales all distances of the end. Shapes: R (k, F + P)."""
    F, fixed = problem.F, set(fixed)
    free = [k for k, name in enumerate(problem.parameters.names) if name not in fixed]
    columns = np.concatenate([np.arange(F), F + np.array(free)]).astype(int)
    size = np.linalg.norm(R[:, columns], axis=0)
    active = size > _RANK_TOLERANCE * size.max(initial=0.0)
    columns, size = columns[active], size[active]
    _, values, directions = (np.asarray(part) for part in np.linalg.svd(R[:, columns] / size))
    rank = int((values > _RANK_TOLERANCE * values[0]).sum())
    null_space = directions[rank:] / size
    of_robot = columns >= F
    length, slope = distances
    shapes = slope[:, columns[of_robot] - F] @ null_space[:, of_robot].T
    if not shapes.shape[1]:
        return bool(length.any())
    shapes = shapes / np.maximum(np.linalg.norm(shapes, axis=0), np.finfo(float).tiny)
    scaled = shapes @ np.linalg.lstsq(shapes, length, rcond=_RANK_TOLERANCE)[0]
    return bool(np.linalg.norm(scaled - length) > _SCALE_TOLERANCE * np.linalg.norm(length))


def _distances(p: GeometricParameters) -> tuple[Array, Array]:
    """Distances of the end between random postures, and their derivatives, shape (rows, P)."""
    q = spread_configurations(p.model, 40, np.random.default_rng(0))
    T, psi = differential_model(p, q, frame=p.table.frames[0])
    apart = np.diff(T[:, :3, 3], axis=0)
    length = np.linalg.norm(apart, axis=1)
    along = apart / np.where(length > 0.0, length, 1.0)[:, None]
    return length, np.einsum("ni,nip->np", along, np.diff(psi[:, :3], axis=0))
