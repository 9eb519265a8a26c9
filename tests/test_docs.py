"""The documentation: every public name is in the reference, every example and reference holds."""

import doctest
import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from test_notebooks import SECTIONS

import robotmodels as rm

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "notebooks" not in path.parts)
CHAPTERS = sorted((DOCS / "book").glob("chapter_*.md"))
ROOMS = (
    "robotmodels", "calibration", "control", "datasets", "drive", "dynamics", "errors",
    "estimation", "export", "flexible", "friction", "geometry", "identification", "igm", "inertia",
    "kinematics", "logs", "loops", "minimal_parameters", "model", "obstacles", "parallel",
    "performance", "regressors", "robots", "se3", "simulation", "symbolic", "symoro",
    "trajectories", "urdf", "visual_servoing", "viz",
)  # fmt: skip
FOR_OTHER_ROOMS = {
    "geometry": {"FIXED", "constant_names", "NOT_XML", "PRISMATIC", "REVOLUTE"},
    "inertia": {"PARAMETERS"},
    "model": {"FrameOfInterest", "GRAVITY", "PinocchioTwin", "as_positions", "check_model"},
    "se3": {"ROTATION_TOLERANCE"},
}  # fmt: skip
"""What the ground floor lists for the rooms above it, and users have no need of."""
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def text_of(page):
    return page.read_text(encoding="utf-8")


def module(name):
    return importlib.import_module(name if name == "robotmodels" else f"robotmodels.{name}")


# --- the reference -------------------------------------------------------------------------------


def listed():
    """(page, room, name) of every name that the reference pages list."""
    for page in sorted((DOCS / "reference").glob("*.rst")):
        directives = re.findall(
            r"^\.\. names:: (\S+)\n\n((?: {3}\S+\n)+)", text_of(page) + "\n", flags=re.MULTILINE
        )
        for room, names in directives:
            for name in names.split():
                yield page.name, importlib.import_module(room), name


def test_every_listed_name_exists():
    assert [f"{page}: {name}" for page, room, name in listed() if not hasattr(room, name)] == []


def test_every_public_name_is_in_the_reference():
    documented = {id(getattr(room, name)) for _, room, name in listed()}
    missing = [
        f"{room}.{name}"
        for room in ROOMS
        for name in set(module(room).__all__) - FOR_OTHER_ROOMS.get(room, set())
        if not inspect.ismodule(thing := getattr(module(room), name))
        and id(thing) not in documented
    ]
    assert missing == []


def test_the_reference_lists_a_name_once():
    seen = {}
    for page, room, name in listed():
        seen.setdefault(id(getattr(room, name)), []).append(f"{page}: {name}")
    assert [places for places in seen.values() if len(places) > 1] == []


def test_every_room_of_the_package_is_in_the_reference():
    """A new package with an ``__all__`` is either public, and listed above, or named here."""
    inner = {"cli", "kernels"}
    packages = {path.parent.name for path in (ROOT / "robotmodels").glob("[!_]*/__init__.py")}
    assert packages - inner <= set(ROOMS)


# --- the pages -----------------------------------------------------------------------------------


def examples(page):
    """The Python blocks with prompts, each at its line of the page."""
    text = text_of(page)
    for match in re.finditer(r"^```python\n(>>> .*?)^```$", text, flags=re.MULTILINE | re.DOTALL):
        yield text.count("\n", 0, match.start(1)), match[1]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_examples(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, report = {}, []
    with np.printoptions():  # a page may set its own
        for line, block in examples(page):
            test = doctest.DocTestParser().get_doctest(block, names, page.name, str(page), line)
            runner = doctest.DocTestRunner(optionflags=FLAGS)
            runner.run(test, out=report.append, clear_globs=False)
            names = test.globs
    assert "".join(report) == ""


def named(page):
    """Code of a page that names something of the package: ``rm.dgm`` outside of blocks."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    return re.findall(r"`rm((?:\.[A-Za-z_]\w*)+)(?:\([^`]*\))?`", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_name_on_a_page_exists(page):
    missing = []
    for path in named(page):
        thing = rm
        for name in path[1:].split("."):
            thing = getattr(thing, name, None)
        if thing is None:
            missing.append(f"rm{path}")
    assert missing == []


def test_links_between_pages_lead_somewhere():
    broken = []
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", text_of(page)):
            if link.endswith(".ipynb"):  # the build brings them beside the pages
                there = ROOT / "notebooks" / Path(link).name
            else:
                there = page.parent / link
            if "://" not in link and not there.exists():
                broken.append(f"{page.name}: {link}")
    assert broken == []


# --- the book ------------------------------------------------------------------------------------


def sources():
    """(file, text) of every module of the package; its lines are joined."""
    for path in sorted((ROOT / "robotmodels").rglob("*.py")):
        yield path.name, " ".join(text_of(path).split())


def cited():
    """{equation: files} that docstrings cite, such as 1.16; ranges are taken apart."""
    found = {}
    for file, text in sources():
        for equations in re.findall(r"\beq\. ((?:\[\d\.\d+\](?:, | and | to )?)+)", text):
            for first, last in re.findall(r"\[1\.(\d+)\](?: to \[1\.(\d+)\])?", equations):
                for number in range(int(first), int(last or first) + 1):
                    found.setdefault(f"[1.{number}]", set()).add(file)
    return found


def test_every_equation_that_docstrings_cite_is_on_a_page_of_the_book():
    pages = "".join(text_of(page) for page in CHAPTERS)
    equations = cited()
    assert len(equations) >= 15
    assert {e: sorted(files) for e, files in equations.items() if e not in pages} == {}


def test_every_section_that_docstrings_cite_is_on_a_page_of_the_book():
    pages = "".join(text_of(page) for page in CHAPTERS)
    on_pages = set(re.findall(r"\b\d(?:\.\d+)+", pages))
    found = {}
    for file, text in sources():
        sections = re.findall(r"[Bb]ook,? sections? ((?:\d(?:\.\d+)+(?:, | and | to )?)+)", text)
        for number in re.findall(r"\d(?:\.\d+)+", " ".join(sections)):
            found.setdefault(number, set()).add(file)
    assert len(found) >= 40
    assert {s: sorted(files) for s, files in found.items() if s not in on_pages} == {}


# --- the tables of the book's chapters ------------------------------------------------------------


PROSE = {
    "1.1", "1.4.1", "1.6.1", "1.7", "1.8", "2.5", "3.1", "3.5.1", "4.1", "4.5", "4.6", "4.7",
    "5.1", "5.4", "5.5", "6.1", "6.5", "6.6", "7.1", "7.2.1", "7.3.1", "7.3.2", "7.4", "7.5",
}  # fmt: skip
"""Introductions, conclusions, bibliographies."""


def chapter_rows(chapter):
    """Cells of the rows that begin with section numbers of a chapter."""
    text = (DOCS / f"book/chapter_{chapter}.md").read_text(encoding="utf-8")
    rows = [re.split(r" \| ", line.strip("| ")) for line in text.splitlines()]
    return [row for row in rows if re.match(rf"{chapter}\.\d", row[0]) and len(row) > 1]


@pytest.mark.parametrize("chapter", "1234567")
def test_a_chapter_has_all_its_sections_with_notebooks_and_tests(chapter):
    rows = chapter_rows(chapter)
    assert len(rows) > 10
    listed = set()
    for first, *cells in rows:
        numbers = re.findall(rf"{chapter}(?:\.\d+)+", first)
        if re.match(r"\S+ to \d", first):
            head, _, last = numbers[0].rpartition(".")
            numbers += [f"{head}.{k}" for k in range(int(last), int(numbers[1][-1]) + 1)]
        listed |= set(numbers)
        line = " | ".join(cells)
        for number, section in re.findall(r"\b(\d\d) \((\d(?:\.\d+)+)\)", line):
            (notebook,) = (ROOT / "notebooks").glob(f"{number}_*.ipynb")
            assert section in notebook.read_text(encoding="utf-8"), (first, number, section)
        for test in re.findall(r"`((?:identities/)?test_\w+\.py)`", line):
            assert (ROOT / "tests" / test).is_file(), (first, test)
        tested = "test_" in line and re.search(r"\b\d\d\b", line)
        assert "not here" in line or tested, first
    missing = [
        section
        for section in sorted(SECTIONS - PROSE)
        if section.startswith(f"{chapter}.")
        and not any(
            section == s or section.startswith(f"{s}.") or s.startswith(f"{section}.")
            for s in listed
        )
    ]
    assert missing == []
