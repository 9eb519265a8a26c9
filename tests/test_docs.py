"""The documentation: every public name is in the reference, every example and reference holds."""

import doctest
import importlib
import inspect
import operator
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


def test_every_listed_name_exists_and_stands_once():
    names = [(page, room, name) for page, room, name in listed()]
    assert [f"{page}: {name}" for page, room, name in names if not hasattr(room, name)] == []
    things = [id(getattr(room, name)) for _, room, name in names]
    assert len(set(things)) == len(things)


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


def test_every_room_of_the_package_is_in_the_reference():
    packages = {path.parent.name for path in (ROOT / "robotmodels").glob("[!_]*/__init__.py")}
    assert packages - {"cli", "kernels"} <= set(ROOMS)


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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_name_on_a_page_exists(page):
    """Code that names something of the package: ``rm.dgm`` outside of blocks."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    for path in re.findall(r"`rm\.([A-Za-z_][\w.]*)(?:\([^`]*\))?`", text):
        assert operator.attrgetter(path)(rm) is not None


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


def test_what_docstrings_cite_is_on_a_page_of_the_book():
    """Sections, and equations such as [1.16]; of ranges both ends."""
    pages = "".join(map(text_of, CHAPTERS))
    on_pages = {*re.findall(r"\b\d(?:\.\d+)+", pages), *re.findall(r"\[\d\.\d+\]", pages)}
    cited = set()
    for path in (ROOT / "robotmodels").rglob("*.py"):
        text = " ".join(text_of(path).split())
        for some in re.findall(r"\beq\. ((?:\[\d\.\d+\](?:, | and | to )?)+)", text):
            cited |= {(path.name, each) for each in re.findall(r"\[\d\.\d+\]", some)}
        for some in re.findall(r"[Bb]ook,? sections? ((?:\d(?:\.\d+)+(?:, | and | to )?)+)", text):
            cited |= {(path.name, each) for each in re.findall(r"\d(?:\.\d+)+", some)}
    assert len({each for _, each in cited}) >= 50
    assert sorted(one for one in cited if one[1] not in on_pages) == []


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
