"""No circle of imports between modules, imports for types included."""

import ast
import functools
from pathlib import Path

ROOT = Path(__file__).parents[1] / "robotmodels"


def name_of(path):
    """Module name from the package on; of a folder its own."""
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path, names):
    """Modules of the package that a file imports anywhere; a name in it stands for its module."""
    package = name_of(path) if path.name == "__init__.py" else name_of(path).rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = package.rsplit(".", node.level - 1)[0] if node.level > 1 else package
            module = ".".join(filter(None, (base, node.module))) if node.level else node.module
            for alias in node.names:
                whole = f"{module}.{alias.name}"
                yield whole if whole in names else module


def circles(edges):
    """Strongly connected components of more than one module (R. Tarjan, 1972)."""
    number, low, stack, found = {}, {}, [], []

    def visit(v):
        number[v] = low[v] = len(number)
        stack.append(v)
        for w in edges[v]:
            if w not in number:
                visit(w)
                low[v] = min(low[v], low[w])
            elif w in stack:
                low[v] = min(low[v], number[w])
        if low[v] == number[v]:
            k = stack.index(v)
            if len(stack) > k + 1:
                found.append(sorted(stack[k:]))
            del stack[k:]

    for v in edges:
        if v not in number:
            visit(v)
    return found


@functools.cache
def package_edges():
    """Imports between modules; a door (`__init__`) that imports its own room is no circle."""
    files = {name_of(path): path for path in sorted(ROOT.rglob("*.py"))}
    edges = {}
    for name, path in files.items():
        targets = {other for other in imports(path, files) if other in files and other != name}
        edges[name] = sorted(targets) if path.name != "__init__.py" else []
    return edges


def test_no_circle_of_imports():
    assert circles(package_edges()) == []


def test_a_circle_is_found():
    assert circles({"a": ["b"], "b": ["c"], "c": ["b"], "d": ["a"]}) == [["b", "c"]]
    edges = dict(package_edges())
    assert "robotmodels.identification.forms" in edges["robotmodels.identification.equations"]
    edges["robotmodels.identification.forms"] = ["robotmodels.identification.equations"]
    assert [
        "robotmodels.identification.equations", "robotmodels.identification.forms"
    ] in circles(edges)  # fmt: skip
