"""Standard parameters beside their prior, as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..table_text import boxed

if TYPE_CHECKING:
    from .standard import StandardParameters

_KINDS: dict[str, str] = {
    "XX": "J", "XY": "J", "XZ": "J", "YY": "J", "YZ": "J", "ZZ": "J",
    "MX": "MS", "MY": "MS", "MZ": "MS",
}  # fmt: skip
_NOTHING = 1e-9
"""Change relative to the values of a link, or of a kind, that shows as none."""


def standard_text(found: StandardParameters) -> str:
    """A row for each parameter: prior, value and difference; each link a real body or not."""
    f = found.inertia.f
    worst = float(abs(found.deviation).max(initial=0.0))
    lines = [
        found.status.value,
        f"Largest deviation of a base parameter {worst:.2e}, distance from the prior "
        f"{found.distance:.3g}.",
    ]
    rows = [
        (name, "", before, now)
        for name, before, now in zip(
            found.names, found.prior.tolist(), found.values.tolist(), strict=True
        )
    ]
    physical = found.inertia.is_physical
    for j in range(f):
        said = "real body" if physical[j] else "no real body"
        rows[10 * j] = (rows[10 * j][0], f"link {j + 1}: {said}", *rows[10 * j][2:])
    if len(rows) > 10 * f:
        rows[10 * f] = (rows[10 * f][0], "drives", *rows[10 * f][2:])
    sizes = _sizes(found)
    lines.append(
        boxed([
            ("", [part for _, part, _, _ in rows]),
            ("parameter", [name for name, *_ in rows]),
            ("prior", [_shown(x, size, "") for (*_, x, _), size in zip(rows, sizes, strict=True)]),
            ("value", [_shown(x, size, "") for (*_, x), size in zip(rows, sizes, strict=True)]),
            ("difference", [
                _shown(now - before, size, "+")
                for (*_, before, now), size in zip(rows, sizes, strict=True)
            ]),
        ])
    )  # fmt: skip
    lines.append("SI units: XX to ZZ kg m^2, MX to MZ kg m, M kg; drives as in their tables.")
    return "\n".join(lines)


def _shown(value: float, size: float, sign: str) -> str:
    """Digits that are more than rounding of a parameter of its kind."""
    return "0" if abs(value) <= _NOTHING * size else f"{value:{sign}.{3 if sign else 6}g}"


def _sizes(found: StandardParameters) -> list[float]:
    """Largest parameter of the kind of each: inertias, moments, masses, rotors, ..."""
    letters = [name.rstrip("0123456789") for name in found.names]
    kinds = [_KINDS.get(name, name) for name in letters]
    most: dict[str, float] = {}
    for kind, a, b in zip(kinds, found.prior.tolist(), found.values.tolist(), strict=True):
        most[kind] = max(most.get(kind, 0.0), abs(a), abs(b))
    # rotors are inertias, which the least digits of the solver are relative to
    return [max(most[kind], most["J"] if kind == "Ia" else 0.0) for kind in kinds]
