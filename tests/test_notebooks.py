"""The course: thin notebooks in the book's order, whose words name what exists.

Nothing is executed here: `.ci/notebooks.py` does.
"""

import ast
import importlib
import inspect
import re
from pathlib import Path

import nbformat
import pytest

import robotmodels as rm

FOLDER = Path(__file__).parents[1] / "notebooks"
PATHS = sorted(FOLDER.glob("*.ipynb"))

SECTIONS = set((Path(__file__).parent / "oracles/book_sections.txt").read_text().split())
"""Of the book's table of contents."""
NUMBER = r"\d(?:\.\d+)+"
EQUATIONS = {f"1.{k}" for k in range(1, 19)}  # as far as the pages at hand go

every = pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)


def read(path):
    return nbformat.read(path, as_version=4)


def sources(path, kind):
    return [cell.source for cell in read(path).cells if cell.cell_type == kind]


def statements(path):
    return ast.parse("\n".join(sources(path, "code")))


# --- code and form -------------------------------------------------------------------------------


@every
def test_cells_are_no_programs(path):
    """Without functions, classes and while loops: those belong to the package."""
    programs = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda | ast.While
    assert [x.lineno for x in ast.walk(statements(path)) if isinstance(x, programs)] == []


@every
def test_outputs_are_stripped_and_the_format_holds(path):
    notebook = read(path)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in cells)
    assert notebook.metadata.kernelspec.name == "python3"


@every
def test_the_neighbours_are_linked(path):
    k = PATHS.index(path)
    first, last = sources(path, "markdown")[0], sources(path, "markdown")[-1]
    linked = re.findall(r"\]\(([^)]+)\)", first)
    assert linked == [p.name for p in (*PATHS[:k][-1:], *PATHS[k + 1 :][:1])]
    assert last.startswith("## Try yourself")
    assert re.findall(r"\]\(([^)]+)\)", last) == [PATHS[(k + 1) % len(PATHS)].name]


@every
def test_links_lead_somewhere(path):
    for text in sources(path, "markdown"):
        for link in re.findall(r"\]\(([^)#]+)\)", text):
            assert link.startswith("https://") or (FOLDER / link).is_file(), link
        for named in re.findall(r"`((?:benchmarks|notebooks|tests|docs)/[\w./]+)`", text):
            assert (FOLDER.parent / named).exists(), named


def test_the_index_has_all_notebooks_and_their_titles():
    index = next(text for text in sources(PATHS[0], "markdown") if text.startswith("## The course"))
    rows = re.findall(r"^\| \[?(\d\d) ([^\]|(]+?) ?(?:\]\((\S+)\)|\(this one\)) \|", index, re.M)
    assert [path.name[:3] for path in PATHS] == [f"{k:02d}_" for k in range(1, len(PATHS) + 1)]
    assert [number for number, _, _ in rows] == [path.name[:2] for path in PATHS]
    for path, (number, title, link) in zip(PATHS, rows, strict=True):
        assert link in ("", path.name)
        assert sources(path, "markdown")[0].startswith(f"# {number} {title}")


# --- the book's numbers --------------------------------------------------------------------------


def cited_sections(text):
    """Section numbers of the book in a cell: of headings, of 'sections', and all long ones."""
    found = set(re.findall(r"(?<![\w.\[-])\d(?:\.\d){2,3}(?![\w.]*\d)", text))
    for line in text.splitlines():
        if line.startswith("#") and "Exercise" not in line:
            found |= set(re.findall(rf"(?<=# ){NUMBER}|(?<=, ){NUMBER}", line))
        for words in re.findall(rf"[Ss]ections? ((?:(?:, | and )?{NUMBER})+)", line):
            found |= set(re.findall(NUMBER, words))
    return found - set(re.findall(rf"FIGAROH ({NUMBER})", text))


@every
def test_cited_sections_and_equations_are_in_the_book(path):
    texts = sources(path, "markdown")
    sections = set().union(*map(cited_sections, texts))
    assert sections
    assert sections - SECTIONS == set()
    equations = set(re.findall(r"\[(\d\.\d+)\]", "\n".join(texts)))
    assert equations - EQUATIONS == set()


# --- names ---------------------------------------------------------------------------------------


def modules(tree):
    """Modules of the package by the name that a notebook gives them."""
    found = {"rm": rm}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("robotmodels"):
            for name in node.names:
                whole = importlib.import_module(node.module)
                value = getattr(whole, name.name, None)
                if value is None:
                    value = importlib.import_module(f"{node.module}.{name.name}")
                found[name.asname or name.name] = value
    return found


def resolves(value, parts):
    """Whether modules and classes lead along the names; behind a value nothing is known."""
    for part in parts:
        if not (inspect.ismodule(value) or inspect.isclass(value)):
            return True
        if not hasattr(value, part):
            return False
        value = getattr(value, part)
    return True


def chains(tree):
    """Dotted names in code, as lists that begin with a plain name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and re.fullmatch(r"[\w.]+", name := ast.unparse(node)):
            yield name.split(".")


def unknown_names(tree, texts):
    """Names of the package, in code and between backticks, that it does not have."""
    known = modules(tree)
    written, called = [*chains(tree)], set()
    for code in re.findall(r"`([^`]+)`", "\n".join(texts)):
        dotted = rf"\b(?:{'|'.join(known)})\.[\w.]+"
        written += [name.split(".") for name in re.findall(rf"{dotted}\b", code)]
        called |= set(re.findall(r"(?:^|[\s.(])([a-z_]\w+)\(", re.sub(dotted, "", code)))
    rooms = [*known.values(), rm.RobotModel, rm.DHTable]
    lost = [".".join(w) for w in written if w[0] in known and not resolves(known[w[0]], w[1:])]
    return lost + [c for c in called - {"ctraj"} if not any(hasattr(room, c) for room in rooms)]


@every
def test_names_of_the_package_exist(path):
    assert unknown_names(statements(path), sources(path, "markdown")) == []
