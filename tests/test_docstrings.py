"""Docstrings: the full NumPy form for names that a room exports, at most three lines for others."""

import ast
import enum
import functools
import importlib
import inspect
import re
from pathlib import Path

from test_api import public_names, rooms

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / "robotmodels").rglob("*.py"))
SECTION = re.compile(r"^([A-Z]\w+(?: \w+)?)\n-{3,}$", re.MULTILINE)
LONGEST = 3
"""Lines of text of a docstring that no room exports: the summary, and the shapes of arrays."""


def function_of(member):
    """The function behind a property, a class method, a decorator or a compiler."""
    if isinstance(member, functools.cached_property):
        member = member.func
    member = getattr(member, "fget", None) or getattr(member, "__func__", member)
    member = getattr(member, "py_func", member)
    return inspect.unwrap(member) if callable(member) else member


def place(thing):
    """(module, qualified name), or None where the package does not define it."""
    module = getattr(thing, "__module__", None) or ""
    return (module, thing.__qualname__) if module.startswith("robotmodels") else None


@functools.cache
def exported():
    """Places of what rooms export, and of the public members of exported classes."""
    names, members = set(), set()
    for room in rooms().values():
        for thing in (getattr(room, name) for name in public_names(room)):
            if inspect.isclass(thing):
                owners = [c for c in thing.__mro__ if c.__module__.startswith("robotmodels")]
                public = [
                    function_of(member)
                    for owner in owners
                    for name, member in vars(owner).items()
                    if not name.startswith("_") or name.endswith("__")
                ]
                members |= {place(m) for m in public if inspect.isroutine(m) or inspect.isclass(m)}
                names.add(place(thing))
            elif inspect.isroutine(function_of(thing)):
                names.add(place(function_of(thing)))
    return names, members


def definitions(node, path=""):
    """(qualified name, node) of every function and class below a node."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield path + child.name, child
            kind = "." if isinstance(child, ast.ClassDef) else ".<locals>."
            yield from definitions(child, path + child.name + kind)
        else:
            yield from definitions(child, path)


def explained(docstring):
    """Names of the parameters that a docstring explains."""
    parts = SECTION.split(docstring)
    pairs = zip(parts[1::2], parts[2::2], strict=True)
    lists = [text for name, text in pairs if name == "Parameters"]
    heads = re.findall(r"^(\w[\w, ]*)(?= :|$)", "\n".join(lists), re.MULTILINE)
    return {name for head in heads for name in head.split(", ")}


def missing_sections(node, have, known, classes):
    """Sections that the docstring of an exported function must have and does not.

    Parameters may be explained at the head of the file or the room, results with their class.
    """
    returns = ast.unparse(node.returns) if node.returns else "None"
    arguments = {argument.arg for argument in node.args.args + node.args.kwonlyargs}
    if arguments - known and "Parameters" not in have:
        yield "Parameters"
    if returns not in {"None", *classes} and not have & {"Returns", "Yields"}:
        yield "Returns"


def faults(module, text, names, members, room=""):
    """Sentences about the docstrings of one file of a room, whose own docstring is given."""
    tree = ast.parse(text)
    # Members of one family may share a docstring at the head of their file.
    head = ast.get_docstring(tree) or ""
    shared, known = set(SECTION.findall(head)), explained(head) | explained(room)
    classes = {name for _, name in names if name[0].isupper()}
    for name, node in definitions(tree):
        docstring = ast.get_docstring(node) or ""
        have = set(SECTION.findall(docstring))
        lines = len([line for line in docstring.splitlines() if line.strip()])
        if (module, name) in names:
            if isinstance(node, ast.ClassDef):
                continue  # see test_exported_classes_have_sections
            for section in missing_sections(node, have | shared, known, classes):
                yield f"{module}.{name}: exported, without the section {section}"
        elif (module, name) in members:
            continue
        elif have:
            yield f"{module}.{name}: not exported, with the section {min(have)}"
        elif lines > LONGEST:
            yield f"{module}.{name}: not exported, {lines} lines instead of at most {LONGEST}"


def room_of(path):
    """Docstring of the room of a file."""
    parts = path.relative_to(ROOT).with_suffix("").parts[:2]
    return inspect.getdoc(importlib.import_module(".".join(parts).removesuffix(".__init__"))) or ""


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def test_only_exported_names_have_long_docstrings():
    names, members = exported()
    found = [
        fault
        for path in FILES
        for fault in faults(
            module_of(path), path.read_text(encoding="utf-8"), names, members, room_of(path)
        )
    ]
    assert "\n".join(found) == ""


def test_the_help_of_a_function_names_all_its_arguments():
    """With what stands at the head of its file, which its room adds."""
    without = []
    for room in rooms().values():
        for thing in (getattr(room, name) for name in public_names(room)):
            if inspect.isfunction(thing) and thing.__module__ != "robotmodels.cli":
                words = set(re.findall(r"\w+", inspect.getdoc(thing) or ""))
                missing = set(inspect.signature(thing).parameters) - words
                without += [f"{place(thing)}: {name}" for name in sorted(missing)]
    assert without == []


def test_exported_classes_have_sections():
    """Or their base class, or the head of their file; enums and exceptions need a line."""
    without = []
    for module, name in sorted(exported()[0]):
        kind = functools.reduce(getattr, name.split("."), importlib.import_module(module))
        if not inspect.isclass(kind) or issubclass(kind, enum.Enum | str | BaseException):
            continue
        texts = [vars(c).get("__doc__") for c in kind.__mro__] + [inspect.getmodule(kind).__doc__]
        head = "\n".join(inspect.cleandoc(text or "") for text in texts)
        if not SECTION.search(head) and not inspect.isabstract(kind) and not is_protocol(kind):
            without.append(f"{module}.{name}")
    assert without == []


def is_protocol(kind):
    return getattr(kind, "_is_protocol", False)


def test_the_rule_looks_at_every_room():
    names, members = exported()
    assert {"robotmodels.igm", "robotmodels.viz"} <= {m.rsplit(".", 1)[0] for m, _ in names}
    assert len(names) > 300
    assert len(members) > 1000
    # A method, a property, an inherited method and a function behind a lazy import.
    assert {("robotmodels.geometry.table", "DHTable.from_rows")} <= members
    assert ("robotmodels.igm.paul.explain", "explain_igm") in names


SOURCE = '''
def public(q):
    """Public."""


def inner(q):
    """Inner.

    Parameters
    ----------
    q : ndarray
    """


class _Inner:
    def method(self) -> None:
        """One.

        two
        three
        four
        """

    def short(self) -> None:
        """One.

        Shapes: A (m, n).
        """
'''


def test_a_docstring_that_breaks_the_rule_is_found():
    found = list(faults("robotmodels.room", SOURCE, {("robotmodels.room", "public")}, set()))
    assert found == [
        "robotmodels.room.public: exported, without the section Parameters",
        "robotmodels.room.inner: not exported, with the section Parameters",
        "robotmodels.room._Inner.method: not exported, 4 lines instead of at most 3",
    ]


def test_a_family_may_share_the_docstring_of_its_file():
    text = f'"""Family.\n\nParameters\n----------\nq : ndarray\n"""\n{SOURCE}'
    found = "".join(faults("robotmodels.room", text, {("robotmodels.room", "public")}, set()))
    assert "public" not in found


def test_parameters_may_be_explained_at_the_head_of_the_room():
    text = "def public(q, kind): ...\n"
    names = {("robotmodels.room", "public")}
    known, unknown = (f"Room.\n\nParameters\n----------\nq, {x} : ndarray" for x in ("kind", "v"))
    assert list(faults("robotmodels.room", text, names, set(), known)) == []
    assert len(list(faults("robotmodels.room", text, names, set(), unknown))) == 1
