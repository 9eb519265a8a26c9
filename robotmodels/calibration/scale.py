"""Scale of the robot: whether measurements determine it (contacts alone do not)."""

from __future__ import annotations

from collections.abc import Collection

from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from .measurements import scale_is_observable
from .parameters import ErrorLaw
from .problem import Problem

_LEAST = 1e-6  # length that counts as zero, relative to the robot's size


def needs_a_length(problem: Problem, known: Collection[str] = ()) -> bool:
    """Whether the scale has to come from a parameter that is known."""
    if all(unit == "rad" for m in problem.measurements for unit in m.units):
        return False  # orientations do not depend on lengths at all
    p = problem.parameters
    constant = [e for e in p.entries if e.law is ErrorLaw.CONSTANT]
    base_is_known = all(e.name in known for e in constant if e.row == 0)
    if scale_is_observable(problem.measurements, p.model.base[:3, 3] if base_is_known else None):
        return False
    return any(e.element.is_length and 0 < e.row <= p.model.f for e in constant)


def check_scale(problem: Problem, known: Collection[str], named: Collection[str]) -> None:
    """Refuse measurements without a length if no length of the table is known.

    The readings of prismatic joints are lengths as well.
    """
    p = problem.parameters
    if not needs_a_length(problem, known) or (p.table.sigma == PRISMATIC).any():
        return
    lengths = [
        entry.name
        for entry, value in zip(p.entries, p.nominal, strict=True)
        if entry.law is ErrorLaw.CONSTANT
        and entry.element.is_length
        and abs(value) > _LEAST * p.table.size
        and 0 < entry.row <= p.model.f
    ]
    if not set(lengths).isdisjoint(named):
        return
    fixed = f", and fixing {', '.join(named)} gives none" if named else ""
    raise InvalidValueError(
        f"These measurements contain no length{fixed}: a robot scaled to zero size would satisfy "
        "them. Measure a distance (KnownDistance, Distance), or name a parameter whose length is "
        f"known: known_lengths=({lengths[0] if lengths else 'd3'!r},). Lengths that would do here: "
        f"{', '.join(lengths) or 'none'}."
    )
