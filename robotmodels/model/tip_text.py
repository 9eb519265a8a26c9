"""The tip of a model in words: its link, the joints that do not move it, other links."""

from __future__ import annotations

import numpy as np

from ..urdf import RobotParts
from ..urdf.tip import TOOL_LINKS

_SHOWN = 6


def tip_text(parts: RobotParts) -> str:
    """Link and frame of the tool, and links that could be ``tip_link`` instead; one line each."""
    table, tip = parts.table, parts.tip
    at = [f for f in parts.frames if f.parent == tip and np.array_equal(f.pose, parts.tool)]
    links = " = ".join(frame.name for frame in at)
    text = f"Tip: {f'link {links} on ' if at else ''}frame {tip} ({table.names[tip - 1]})"
    still = int(np.sum(~np.isin(table.joint_rows + 1, table.path(tip))))
    if still:
        text += f"; {still} of {table.n} joints do not move it"
    others = _alternatives(parts, {frame.name for frame in at})
    if not others:
        return text
    more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
    return f"{text}\nOther tips (tip_link=): {', '.join(others[:_SHOWN])}{more}"


def _alternatives(parts: RobotParts, given: set[str]) -> list[str]:
    """Links named as tools, links on the tip's own body, and the last link of each branch."""
    ends = set(range(1, parts.table.f + 1)) - set(parts.table.antecedent.tolist())
    near = [f.name for f in parts.frames if f.parent == parts.tip]
    named = [f.name for f in parts.frames if f.name in TOOL_LINKS and f.parent > 0]
    last = {f.parent: f.name for f in parts.frames if f.parent in ends}
    return [n for n in dict.fromkeys((*named, *near, *last.values())) if n not in given]
