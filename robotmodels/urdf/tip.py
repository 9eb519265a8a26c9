"""The tip of a robot when nobody names one: the end of its arm, before the fingers of a hand."""

from __future__ import annotations

from typing import NamedTuple

from .parts import TOOL, NamedFrame
from .tree import UrdfTree

TOOL_LINKS = ("tool0", "tcp", TOOL, "ee_link", "flange", "hand")
"""Names of links that mark the end of an arm, in order of preference."""
_WHOLE_ARM = 6  # joints that place a body anywhere: what moves beyond it is no part of the arm


class Tip(NamedTuple):
    """The link whose frame is the tool, and how many moving joints lie beyond it."""

    frame: NamedFrame
    beyond: int


def default_tip(
    tree: UrdfTree, joints: tuple[str, ...], antecedent: list[int], frames: tuple[NamedFrame, ...]
) -> Tip:
    """The tip of a URDF that is read without ``tip_link``."""
    following: list[list[int]] = [[] for _ in range(len(joints) + 1)]
    longest, count = [0] * (len(joints) + 1), [0] * (len(joints) + 1)
    for j in range(len(joints), 0, -1):
        before = antecedent[j - 1]
        following[before].append(j)
        longest[before] = max(longest[before], longest[j] + 1)
        count[before] += count[j] + 1
    links = {frame.name: frame for frame in frames}
    tool = links.get(TOOL)
    if tool is not None and tool.parent > 0:
        joint = tree.parent_joint(TOOL)
        # as `urdf_text` writes the tool of a model, whatever else is fixed beside it
        if count[tool.parent] and joint is not None and joint.name != f"{TOOL}_fixed":
            return Tip(_tool_link(frames, tool.parent) or tool, count[tool.parent])
        return Tip(tool, count[tool.parent])
    path = [len(joints)]
    while antecedent[path[-1] - 1]:
        path.append(antecedent[path[-1] - 1])
    for length, j in enumerate(reversed(path), start=1):
        branches = sorted((longest[k] + 1 for k in following[j]), reverse=True)
        if not branches or branches[0] >= length:
            continue
        marked = _tool_link(frames, j)
        if marked is not None:
            return Tip(marked, count[j])
        if len(branches) > 1 and (branches[0] == branches[1] or length >= _WHOLE_ARM):
            parents = [tree.joints[joints[k - 1]].parent for k in following[j]]
            return Tip(links[_common_link(tree, joints[j - 1], parents)], count[j])
    return Tip(links[_last_link(tree, joints[-1])], 0)


def _tool_link(frames: tuple[NamedFrame, ...], j: int) -> NamedFrame | None:
    """The link with the preferred name among those that joint j moves."""
    named = [frame for frame in frames if frame.parent == j and frame.name in TOOL_LINKS]
    return min(named, key=lambda frame: TOOL_LINKS.index(frame.name), default=None)


def _last_link(tree: UrdfTree, joint: str) -> str:
    """The link that a joint carries, or what is fixed to it as long as that is a single link."""
    name = tree.joints[joint].child
    following = tree.children(name)
    while len(following) == 1 and following[0].kind == "fixed":
        name = following[0].child
        following = tree.children(name)
    return name


def _common_link(tree: UrdfTree, joint: str, links: list[str]) -> str:
    """The last link on the way from what a joint carries to all of some links fixed to it."""
    first, common = tree.joints[joint].child, None
    for link in links:
        way = [link]
        while way[-1] != first:
            above = tree.parent_joint(way[-1])
            assert above is not None
            way.append(above.parent)
        common = way if common is None else [name for name in common if name in way]
    assert common is not None
    return common[0]
