"""URDF text with changed joint origins."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from html import escape
from xml.parsers import expat

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import UrdfError
from ..geometry import constant_factors
from .meshes import MeshFinder
from .parts import TOOL, NamedFrame, RobotParts
from .read import read_urdf
from .tree import UrdfTree, parse_urdf
from .write import fixed_joint, origin_element

_WORLD = "world"
_ROUNDING = 1e-12
_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")


def tool_link(parts: RobotParts) -> str | None:
    """Source link of the tool; None without a link or a source."""
    at_tool = [
        frame.name
        for frame in parts.frames
        if frame.parent == parts.tip and not _differ(frame.pose, parts.tool)
    ]
    if parts.source is None or not at_tool:
        return None
    return parts.source.tool_link if parts.source.tool_link in at_tool else at_tool[-1]


def urdf_in_place(parts: RobotParts, measured: Collection[str] = ()) -> str:
    """URDF text of a robot in its source: only joint origins change."""
    if parts.source is None:
        raise UrdfError("the robot was not read from a URDF: write it with to_urdf.")
    source = parts.source
    before = read_urdf(source.text, source.base_link, source.tip_link)
    for word in ("names", "sigma", "antecedent"):
        if not np.array_equal(getattr(parts.table, word), getattr(before.table, word)):
            raise UrdfError(
                f"the table has other joints ({word}) than the URDF that the robot was read from: "
                "write it with to_urdf."
            )
    tree = parse_urdf(source.text, MeshFinder())
    tool, root = tool_link(parts), source.base_link or tree.root
    old = {frame.name: frame for frame in before.frames}
    now = {frame.name: frame.pose for frame in parts.frames if frame.name in old}
    ends = {
        name for name, pose in now.items()
        if name in measured or name == tool or _differ(pose, old[name].pose)
    }  # fmt: skip
    carrier = _carrier_of_tool(parts, old)
    chain = _joints_to(tree, root, {carrier, *(name for name in ends if old[name].parent)})
    base_moved = _differ(parts.base, before.base)
    mounts = {
        joint.name for joint in tree.children(root)
        if base_moved and joint.name in chain and old[joint.child].parent == 0
    }  # fmt: skip
    text = _Edited(source.text, tree)
    place = {root: old[root].pose}  # of links, in the frames of the table that move them
    if base_moved and not mounts and source.base_link is None:
        text.add_joint(text.add_link(_WORLD), root, parts.base @ place[root])
    elif base_moved:
        place[root] = se3.inverse(parts.base)
    C, C_before = constant_factors(parts.table), constant_factors(before.table)
    joints = tree.children(root)
    for joint in joints:  # grows: parents come before children
        parent, link, j = joint.parent, joint.child, old[joint.child].parent
        was, parent_moved = old[link].pose, _differ(place[parent], old[parent].pose)
        moves = j != old[parent].parent
        if link in ends:
            place[link] = now[link]
        elif moves or joint.name in mounts or not parent_moved:
            place[link] = was
        else:
            place[link] = place[parent] @ joint.origin
        link_moved = _differ(place[link], was)
        if moves:
            row_moved = _differ(C[j - 1], C_before[j - 1])
            if row_moved or (parent_moved and joint.name in chain):
                text.place(joint.name, se3.inverse(place[parent]) @ C[j - 1] @ was)
            if link_moved:
                on_axis = text.add_link(f"{joint.name}_axis")
                text.hang(joint.name, on_axis)
                text.add_joint(on_axis, link, se3.inverse(was) @ place[link])
        elif (link in ends or joint.name in mounts) and (parent_moved or link_moved):
            text.place(joint.name, se3.inverse(place[parent]) @ place[link])
        joints += tree.children(link)
    if tool is None:
        text.add_joint(carrier, text.add_link(TOOL), se3.inverse(place[carrier]) @ parts.tool)
    return text.written()


def _differ(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() > _ROUNDING)


def _carrier_of_tool(parts: RobotParts, links: dict[str, NamedFrame]) -> str:
    """Link to which the tool is fixed."""
    assert parts.source is not None
    was = links[parts.source.tool_link]
    if was.parent == parts.tip:
        return was.name
    return next(name for name, f in links.items() if f.parent == parts.tip and not f.merged)


def _joints_to(tree: UrdfTree, root: str, links: Iterable[str]) -> set[str]:
    """Names of the joints between the root and some links."""
    found: set[str] = set()
    for link in links:
        while link != root and (joint := tree.parent_joint(link)) is not None:
            found.add(joint.name)
            link = joint.parent
    return found


class _Edited:
    """A URDF text with pending edits."""

    def __init__(self, text: str, tree: UrdfTree) -> None:
        self._data = text.lstrip("\ufeff \t\r\n").encode("utf-8")
        self._taken = {*tree.links, *tree.joints}
        self._tags: dict[str, dict[str, tuple[int, int]]] = {}
        self._end = 0
        self._changes: list[tuple[int, int, bytes]] = []
        self._added: list[str] = []
        self._find_tags()

    def _find_tags(self) -> None:
        """Find the positions of the tags of each joint."""
        parser, open_tags = expat.ParserCreate("utf-8"), list[str]()
        joint = ""

        def start(tag: str, attributes: dict[str, str]) -> None:
            nonlocal joint
            open_tags.append(tag)
            if len(open_tags) == 2:
                joint = attributes.get("name", "")
            if open_tags[1:2] == ["joint"] and len(open_tags) <= 3:
                found = _TAG.match(self._data, parser.CurrentByteIndex)
                assert found is not None
                self._tags.setdefault(joint, {}).setdefault(tag, found.span())

        def end(_: str) -> None:
            open_tags.pop()
            self._end = parser.CurrentByteIndex

        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.Parse(self._data, True)

    def place(self, joint: str, pose: Array) -> None:
        """Set the origin of a joint."""
        tags, new = self._tags[joint], origin_element(pose).encode()
        if "origin" in tags:
            first, last = tags["origin"]
            new = new if self._data[first:last].endswith(b"/>") else new[:-2] + b">"
        else:
            first = last = tags["joint"][1]
            new = self._data[last:].partition(b"<")[0] + new
        self._changes.append((first, last, new))

    def hang(self, joint: str, link: str) -> None:
        """Set the child link of a joint."""
        first, last = self._tags[joint]["child"]
        close = "/>" if self._data[first:last].endswith(b"/>") else ">"
        self._changes.append((first, last, f'<child link="{escape(link)}"{close}'.encode()))

    def add_link(self, name: str) -> str:
        """Add a massless link and return its name."""
        name = self._free(name)
        self._added.append(f'  <link name="{escape(name)}"/>')
        return name

    def add_joint(self, parent: str, child: str, pose: Array) -> None:
        """Add a fixed joint."""
        self._added += fixed_joint(parent, child, pose, self._free(f"{child}_fixed"))

    def _free(self, name: str) -> str:
        while name in self._taken:
            name += "_new"
        self._taken.add(name)
        return name

    def written(self) -> str:
        """Edited text."""
        data, end = self._data, self._end
        lines = "".join(f"{line}\n" for line in self._added)
        gap = "\n" if lines and not data[:end].endswith(b"\n") else ""
        for first, last, new in sorted([*self._changes, (end, end, (gap + lines).encode())])[::-1]:
            data = data[:first] + new + data[last:]
        return data.decode("utf-8")
