"""The README's examples print what it says, one after the other; its words name what exists."""

import doctest
import operator
import re
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
DICTIONARY = (ROOT / "docs/dictionary.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```pycon\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)


def test_examples_print_what_they_say(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(BLOCKS) == 6
    names, said = {}, []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    with np.printoptions():  # the examples set them
        for number, block in enumerate(BLOCKS, start=1):
            test = doctest.DocTestParser().get_doctest(
                block, names, f"example {number}", "README.md", 0
            )
            runner.run(test, out=said.append, clear_globs=False)
            names = test.globs
    assert runner.summarize(verbose=False).failed == 0, "".join(said)
    assert (tmp_path / "ur5.html").stat().st_size > 500_000
    assert [path.name for path in tmp_path.iterdir()] == ["ur5.html"]


@pytest.mark.parametrize(
    "table", [TEXT.partition("## More\n")[2].partition("\n## ")[0], DICTIONARY]
)
def test_tables_name_what_exists(table):
    rows = [line.split("|")[1:-1] for line in table.splitlines() if line.startswith("|")][2:]
    assert len(rows) > 5
    rooms = ["trajectories", "calibration", "identification", "performance", "control", "parallel"]
    places = [rm, rm.RobotModel, rm.calibration.CalibrationResult, *(getattr(rm, x) for x in rooms)]
    for row in rows:
        for name in re.findall(r"`([A-Za-z_.0-9]+)(?:\([^`]*\))?`", row[1]):
            get = operator.attrgetter(name)
            assert any(exists(get, place) for place in places) or name == "fit", name


def exists(get, place):
    try:
        get(place)
    except AttributeError:
        return False
    return True


def test_it_is_short():
    assert len(TEXT.split()) <= 1500


def test_what_it_links_to_is_in_the_repository():
    linked = re.findall(r"\]\(([^)#]+)\)", re.sub(r"^```.*?^```", "", TEXT, flags=re.M | re.S))
    inside = [link for link in linked if not link.startswith("https://")]
    assert any(link.endswith(".png") for link in inside)
    assert [link for link in inside if not (ROOT / link).is_file()] == []
