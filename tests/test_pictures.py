"""Pages in a real browser: they show arms, and the numbers of the panel are those of the models."""

import json
import os
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from browser import arm_problem, cells, document, drawn, frames_page, link_colors, picture

import robotmodels as rm
from robotmodels import se3

pytestmark = pytest.mark.nightly

H = np.pi / 2
WIDTH, HEIGHT = 400, 300
PANEL_WIDTH = int(0.48 * WIDTH) + 2
Q = np.array([0.3, -0.6, 0.8, 0.4, 0.9, -0.2])

TREE = rm.RobotModel.from_table(
    rm.DHTable(
        antecedent=[0, 1, 2, 1, 4], sigma=[0, 0, 2, 1, 0],
        gamma=[0, 0.4, 0, np.pi, 0], b=[0, 0.1, 0, 0.05, 0], alpha=[0, H, 0.3, H, -H],
        d=[0, 0.2, 0.3, 0.2, 0.1], r=[0.5, 0, 0.1, 0.2, 0],
        lower=[-2.0, -np.inf, 0.05, -np.inf], upper=[1.5, np.inf, 0.4, 2.0],
        mu=[1, 1, 0, 1, 0], names=("turn", "left", "hand", "slide", "right <b>"),
    ),
    base=se3.from_rpy([0.3, -0.2, 0.9], [0.1, 0.2, 0.3]),
    tool=se3.from_rpy([0.5, 1.0, -0.4], [0.02, 0.0, 0.1]), name="tree <i>",
)  # fmt: skip
# the second finger mirrors the first one, and the third joint turns half as far as the wrist
MIMIC = rm.RobotModel.from_table(
    rm.DHTable.from_rows([
        {"sigma": 0, "r": 0.3}, {"sigma": 1, "alpha": H, "lower": 0.0, "upper": 0.05},
        {"antecedent": 1, "sigma": 1, "alpha": -H, "lower": -0.05, "upper": 0.06},
        {"antecedent": 1, "sigma": 0, "d": 0.2, "alpha": 0.5},
    ]),
    transmission=rm.Transmission(
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [-0.5, 0, 0, 0]], [0.0, 0.0, 0.01, 0.2]
    ),
    name="mimic",
)  # fmt: skip


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """Pictures of scenes of every kind, all in one page."""
    folder = tmp_path_factory.mktemp("gallery")
    arm = rm.load("rx90")
    motion = rm.viz.animate(arm, np.linspace(Q, Q + 1.2, 40), dt=0.01, loop=False, height=HEIGHT)
    postures = rm.igm(arm, rm.dgm(arm, Q)).q[:4]
    still = rm.viz.show(arm, Q, frames=True, height=HEIGHT)
    scenes = {
        "rx90": still,
        "names": rm.viz.show(arm, Q, frames=True, names=True, height=HEIGHT),
        "gantry": rm.viz.show(rm.load("gantry"), [1.0, 0.7, 0.4, 0.3, 0.5, 0.0], height=HEIGHT),
        "tree": rm.viz.show(TREE, [0.3, -0.4, 0.2, 0.5], height=HEIGHT),
        "beside": rm.viz.show(arm, postures, columns=2, height=HEIGHT),
        "ellipsoid": rm.viz.show(arm, Q, ellipsoids=rm.velocity_ellipsoid(arm, Q), height=HEIGHT),
        "start": motion,
        "end": motion,
        "jog": rm.viz.jog(arm, Q, height=HEIGHT),
        "dark": rm.viz.show(arm, Q, dark=True, height=HEIGHT),
        "erd:ur5": rm.viz.show(rm.load("erd:ur5"), Q, height=HEIGHT),
        # the check can fail: nothing but the floor
        "empty": replace(still, nodes=tuple(n for n in still.nodes if "robots/" not in n.path)),
    }
    place = list(scenes).index("start")  # held at its start; the other one plays to its end
    script = f"var a = frames[{place}].viewer.animator; a.pause(); a.seek(0);"
    pages = [scene._repr_html_() for scene in scenes.values()]
    page = frames_page(folder / "gallery.html", pages, WIDTH, HEIGHT, script)
    image = picture(page, folder, (4 * WIDTH, (len(scenes) + 3) // 4 * HEIGHT))
    return dict(zip(scenes, cells(image, len(scenes), WIDTH, HEIGHT), strict=True))


def test_scenes_fill_their_pictures(shown):
    for name in ("rx90", "names", "gantry", "tree", "ellipsoid", "start", "end"):
        assert arm_problem(shown[name], link_colors()) == "", name
    for name in ("beside", "erd:ur5"):
        assert arm_problem(shown[name]) == "", name
    assert "of the picture is drawn" in arm_problem(shown["empty"])
    # beside the sliders; the picture leaves room for the joints to move
    assert arm_problem(shown["jog"][:, PANEL_WIDTH:], link_colors(), least=0.004) == ""
    assert shown["dark"][:20].mean() < 0.2 < 0.7 < shown["rx90"][:20].mean()


def test_an_animation_plays_and_other_parts_are_drawn(shown):
    start, end = drawn(shown["start"], link_colors()), drawn(shown["end"], link_colors())
    assert (start & end).sum() / (start | end).sum() < 0.6
    for name, least in (("ellipsoid", 0.02), ("names", 0.003)):
        changed = np.abs(shown[name] - shown["rx90"]).max(axis=-1) > 0.1
        assert changed.mean() > least, name


PANEL = """
  function read(page) {
    var value = id => Number(page.getElementById(id).value);
    return {
      pose: ["x", "y", "z", "roll", "pitch", "yaw"].map(value),
      joints: Array.from(page.querySelectorAll(".value")).map(o => Number(o.value)),
      outside: Array.from(page.querySelectorAll(".limits")).map(
        n => n.classList.contains("outside")),
      posture: page.getElementById("posture").value,
    };
  }
  function put(field, value) {
    field.value = value;
    field.dispatchEvent(new Event("input"));
    field.dispatchEvent(new Event("change"));
  }
  var results = Array.from(frames).map((frame, f) => {
    var page = frame.document, steps = [read(page)];
    var numbers = page.querySelectorAll("#panel input[type=number]");
    TYPED[f].forEach((value, k) => put(numbers[k], value));
    steps.push(read(page));
    // a reader drags each slider to a third of its way
    page.querySelectorAll("#panel input[type=range]").forEach(range =>
      put(range, Number(range.min) + (Number(range.max) - Number(range.min)) / 3));
    steps.push(read(page));
    var menu = page.getElementById("frame"), poses = {};
    Array.from(menu.options).forEach((option, i) => {
      menu.selectedIndex = i;
      menu.dispatchEvent(new Event("change"));
      poses[option.textContent] = read(page).pose;
    });
    menu.selectedIndex = 0;
    var postures = page.getElementById("posture");
    postures.selectedIndex = postures.options.length - 1;
    postures.dispatchEvent(new Event("change"));
    steps.push(read(page));
    page.getElementById("reset").click();
    steps.push(read(page));
    return { steps: steps, poses: poses };
  });
  document.getElementById("results").textContent = JSON.stringify(results);
"""

ROBOTS = {
    "rx90": (rm.load("rx90"), Q),
    "tree": (TREE, [0.3, -0.4, 0.2, 0.5]),
    "mimic": (MIMIC, None),
    "panda": (rm.load("erd:panda"), None),
}
_RNG = np.random.default_rng(8)
TYPED = {name: np.round(_RNG.uniform(-1.0, 1.0, model.n), 4) for name, (model, _) in ROBOTS.items()}


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    """The numbers of the panels of all robots after each step of a reader, in one page."""
    folder = tmp_path_factory.mktemp("panels")
    typed, scenes = [], []
    for name, (model, q) in ROBOTS.items():
        scene = rm.viz.jog(model, q, meshes=False, height=HEIGHT)
        scenes.append(scene._repr_html_())
        leads = scene.sliders.independent
        typed.append((TYPED[name][leads] * units(model)[leads]).tolist())
    script = f"var TYPED = {json.dumps(typed)};\n{PANEL}"
    page = frames_page(folder / "panels.html", scenes, WIDTH, HEIGHT, script)
    text = re.search(r'<pre id="results">(.*?)</pre>', document(page, folder), re.DOTALL)
    assert text
    assert text.group(1), "the script of the page did not end"
    return dict(zip(ROBOTS, json.loads(unescape(text.group(1))), strict=True))


def units(model):
    """Shown numbers of one radian or metre."""
    return np.where(model.table.sigma[model.table.joint_rows] == 1, 1.0, 180.0 / np.pi)


def coupled(model, q):
    """Joint variables whose coupled joints follow the encoders of the others."""
    if model.name != "mimic":
        return np.array(q)
    return np.array([q[0], q[1], q[1] + 0.01, -0.5 * q[0] + 0.2])


def assert_pose(pose, T):
    """Position to a micrometre, orientation to two microradians."""
    shown = se3.from_rpy(np.deg2rad(pose[3:]), pose[:3])
    assert np.abs(shown[:3, 3] - T[:3, 3]).max() < 1e-6
    assert np.abs(shown[:3, :3] - T[:3, :3]).max() < 2e-6


def assert_shown(step, model, q):
    assert_pose(step["pose"], rm.dgm(model, q))
    assert np.abs(np.array(step["joints"]) / units(model) - q).max() < 1e-5
    assert step["outside"] == ((q < model.lower - 1e-9) | (q > model.upper + 1e-9)).tolist()


@pytest.mark.parametrize("name", ROBOTS)
def test_the_panel_moves_the_robot_and_shows_its_poses(panels, name):
    model, start = ROBOTS[name]
    first = coupled(model, np.zeros(model.n) if start is None else start)
    at_first, typed, dragged, named, reset = panels[name]["steps"]
    assert_shown(at_first, model, first)
    assert_shown(typed, model, coupled(model, TYPED[name]))
    free = np.where(units(model) == 1.0, 1.0, np.pi)
    low = np.where(np.isfinite(model.lower), model.lower, np.minimum(-free, model.upper - 2 * free))
    high = np.where(np.isfinite(model.upper), model.upper, np.maximum(free, model.lower + 2 * free))
    q = coupled(model, low + (high - low) / 3.0)
    assert_shown(dragged, model, q)
    assert dragged["posture"] == "moved by hand"
    for frame, pose in panels[name]["poses"].items():
        assert_pose(pose, rm.dgm(model, q, frame=frame))
    frames = ("tool", *model.table.names, *(frame.name for frame in model.frames))
    assert list(panels[name]["poses"]) == list(dict.fromkeys(frames))
    last = list(model.configurations)[-1]
    assert_shown(named, model, coupled(model, model.configurations[last]))
    assert named["posture"].startswith(last)
    assert reset == at_first


def test_executed_notebooks_show_arms(tmp_path):
    """Of a folder with executed notebooks, as the run in CI leaves them."""
    folder = os.environ.get("ROBOTMODELS_NOTEBOOKS")
    if not folder:
        pytest.skip("no executed notebooks: ROBOTMODELS_NOTEBOOKS names a folder that has some")
    found = [
        re.sub(r"height: \d+px", f"height: {HEIGHT}px", "".join(output["data"]["text/html"]))
        for path in sorted(Path(folder).glob("*.ipynb"))
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
        for output in cell.get("outputs", ())
        if "<iframe srcdoc=" in "".join(output.get("data", {}).get("text/html", ""))
    ]
    assert found, f"no notebook of {folder} has a scene in its outputs"
    for start in range(0, len(found), 12):  # a browser keeps so many contexts of WebGL
        some = found[start : start + 12]
        page = frames_page(tmp_path / f"{start}.html", some, WIDTH, HEIGHT)
        image = picture(page, tmp_path, (4 * WIDTH, (len(some) + 3) // 4 * HEIGHT))
        for cell in cells(image, len(some), WIDTH, HEIGHT):
            assert arm_problem(cell, least=0.004, still=False) == ""
