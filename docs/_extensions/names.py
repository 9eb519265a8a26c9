"""Public names: a directive that documents those of a package, and links from the pages to them.

``.. about:: robotmodels.kinematics`` gives what the docstring of a package says of all of its
functions, and ``.. names:: robotmodels.kinematics``, followed by one name a line, a table of them,
then every entry in full. A name is documented under its shortest public path: ``robotmodels.dgm``
where the top package has it. In the Markdown pages code such as ``rm.dgm`` becomes a link to its
entry.
"""

import enum
import importlib
import inspect
import re
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.errors import PycodeError
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective

import robotmodels

DIRECTIVE = re.compile(r"^\.\. names:: (\S+)\n\n((?: {3}\S+\n)+)", re.MULTILINE)
CODE = re.compile(r"rm((?:\.[A-Za-z_]\w*)+)(?:\(.*\))?")


def public_path(room: ModuleType, name: str) -> str:
    """The shortest path under which a user has the object."""
    thing = getattr(room, name)
    if name in robotmodels.__all__ and getattr(robotmodels, name) is thing:
        return f"robotmodels.{name}"
    return f"{room.__name__}.{name}"


@cache
def documented(folder: Path) -> dict[int, str]:
    """Path of every object that the reference pages list, by its identity."""
    paths = {}
    for page in sorted(folder.glob("*.rst")):
        for room_name, names in DIRECTIVE.findall(page.read_text(encoding="utf-8") + "\n"):
            room = importlib.import_module(room_name)
            for name in names.split():
                paths[id(getattr(room, name))] = public_path(room, name)
    return paths


def target(code: str, folder: Path) -> str | None:
    """Path of the entry that code such as ``rm.DHTable.from_rows`` names; None for other code."""
    match = CODE.fullmatch(code)
    if match is None:
        return None
    thing: Any = robotmodels
    path = None
    for name in match[1][1:].split("."):
        thing = getattr(thing, name)
        if id(thing) in documented(folder):
            path = documented(folder)[id(thing)]
        elif path is not None:
            path = f"{path}.{name}"
    return path


def directive_lines(path: str, thing: Any) -> list[str]:
    """The autodoc directive of one object, with its options."""
    if inspect.isclass(thing) and issubclass(thing, BaseException):
        return [f".. autoexception:: {path}"]
    if inspect.isclass(thing):
        lines = [f".. autoclass:: {path}", "   :members:"]
        if issubclass(thing, enum.Enum):
            lines.append("   :undoc-members:")  # their values are sentences
        return lines
    if inspect.isroutine(thing):
        return [f".. autofunction:: {path}"]
    value = repr(thing)
    lines = [f".. py:data:: {path}"]
    if not isinstance(thing, tuple) and len(value) < 100:
        lines.append(f"   :value: {value}")
    return [*lines, "", *(f"   {line}" for line in written_below(path))]


def written_below(path: str) -> list[str]:
    """The text below a constant where its room defines it; autodoc would show its type's."""
    package, _, name = path.rpartition(".")
    for module in sorted(m for m in sys.modules if m == package or m.startswith(package + ".")):
        try:
            found = ModuleAnalyzer.for_module(module).find_attr_docs()
        except PycodeError:
            continue
        if ("", name) in found:
            return found["", name]
    return []


class Names(SphinxDirective):
    """Table of the names, then an entry for each."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Write both as reStructuredText and parse that."""
        room = importlib.import_module(self.arguments[0])
        table = [".. list-table::", "   :widths: 34 66", "   :class: names", ""]
        entries: list[str] = []
        for name in (line.strip() for line in self.content if line.strip()):
            thing = getattr(room, name)
            path = public_path(room, name)
            own = inspect.isclass(thing) or inspect.isroutine(thing)
            first = (inspect.getdoc(thing) or "").strip().partition("\n")[0] if own else ""
            table += [f"   * - `~{path}`", f"     - {first}"]
            entries += [*directive_lines(path, thing), ""]
        source = self.get_source_info()[0]
        return self.parse_text_to_nodes(StringList([*table, "", *entries], source=source))


class About(SphinxDirective):
    """The docstring of a package after its first line: arguments that many functions have."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Titles become paragraphs in bold, because the page has sections of its own."""
        text = inspect.getdoc(importlib.import_module(self.arguments[0])) or ""
        text = re.sub(r"^\*\*(?=\w)", r"\\*\\*", text.partition("\n")[2], flags=re.MULTILINE)
        text = re.sub(r"^(.+)\n-{3,}$", r"**\1**\n", text, flags=re.MULTILINE)
        source = self.get_source_info()[0]
        return self.parse_text_to_nodes(StringList(text.splitlines(), source=source))


def link(app: Sphinx, document: nodes.document) -> None:
    """Make code that is a public name of the package a link to its entry."""
    if app.env.doc2path(app.env.docname).suffix != ".md":
        return
    for literal in list(document.findall(nodes.literal)):
        if isinstance(literal.parent, nodes.reference | pending_xref):
            continue
        path = target(literal.astext(), Path(app.srcdir) / "reference")
        if path is None:
            continue
        reference = pending_xref(
            "", reftype="obj", refdomain="py", reftarget=path, refexplicit=True, refwarn=True,
            refdoc=app.env.docname,
        )  # fmt: skip
        literal.replace_self(reference)
        reference += literal


def setup(app: Sphinx) -> dict[str, bool]:
    """Register both."""
    app.add_directive("about", About)
    app.add_directive("names", Names)
    app.connect("doctree-read", link)
    return {"parallel_read_safe": True}
