"""Numbers as tables show them."""

from typing import Any


def figure(x: float) -> str:
    """Two or three digits, no exponents."""
    if x >= 100.0:
        return f"{x:.0f}"
    digits = 1 if x >= 10.0 else 2 if x >= 0.1 else 3 if x >= 0.01 else 4
    return f"{x:.{digits}f}"


def way_of(entry: dict[str, Any]) -> str:
    """Mode of an entry of a work, and what tells it from others of that mode."""
    return ", ".join(word for word in (entry["mode"], entry["how"]) if word)


def told_ratios(row: dict[str, Any], form: str) -> str:
    """The others to ours, by mode; a work of a single mode does not name it."""
    told = [
        form.format(ratio=figure(ratio), mode=mode) if mode else figure(ratio)
        for mode, ratio in row["ratios"].items()
    ]
    return "; ".join(told)


def told_goals(row: dict[str, Any]) -> str:
    """What is asked of ours, each with whether it is met."""
    return "; ".join(f"{g['text']}, {'met' if g['met'] else 'not met'}" for g in row["goals"])
