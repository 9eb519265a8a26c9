"""Pages in a real browser: they show arms, and the panel's numbers are those of the models."""

import json
import os
import re
from dataclasses import replace
from html import escape, unescape
from pathlib import Path

import numpy as np
import pytest
from browser import (
    arm_problem,
    cells,
    document,
    drawn,
    frames_page,
    link_colors,
    picture,
)

import robotmodels as rm
from robotmodels import se3

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
    tool=se3.from_rpy([0.5, 1.0, -0.4], [0.02, 0.0, 0.1]),
    name="tree <i>",
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


def gallery():
    """Scenes of every kind, by name."""
    rx90 = rm.load("rx90")
    motion = rm.viz.animate(rx90, np.linspace(Q, Q + 1.2, 40), dt=0.01, loop=False, height=HEIGHT)
    postures = rm.igm(rx90, rm.dgm(rx90, Q)).q[:4]
    ellipsoid = rm.velocity_ellipsoid(rx90, Q)
    scenes = {
        "rx90": rm.viz.show(rx90, Q, frames=True, height=HEIGHT),
        "stanford": rm.viz.show(rm.load("stanford_arm"), names=True, height=HEIGHT),
        "gantry": rm.viz.show(
            rm.load("gantry"), [1.0, 0.7, 0.4, 0.3, 0.5, 0.0], height=HEIGHT
        ),
        "tree": rm.viz.show(TREE, [0.3, -0.4, 0.2, 0.5], height=HEIGHT),
        "two robots": rm.viz.show(
            [rx90, TREE.with_base(se3.translation(1.2, 0.0, 0.0))], height=HEIGHT
        ),
        "beside": rm.viz.show(rx90, postures, columns=2, height=HEIGHT),
        "ellipsoid": rm.viz.show(rx90, Q, ellipsoids=ellipsoid, height=HEIGHT),
        "start": motion,
        "end": motion,
        "jog": rm.viz.jog(rx90, Q, height=HEIGHT),
    }  # fmt: skip
    for name, q in (
        ("erd:ur5", Q),
        ("erd:panda", [0.1, 0.2, 0.3, -1.5, 0.2, 1.4, 0.3, 0.02, 0.02]),
    ):
        scenes[name] = rm.viz.show(rm.load(name), q, height=HEIGHT)
    return scenes


# what shows that the check can fail: nothing but the floor, and an arm behind the camera's back
def broken(scene):
    without = tuple(n for n in scene.nodes if not n.path.startswith("robots/"))
    away = scene.camera.position + 10.0 * (scene.camera.position - scene.camera.target)
    return {
        "empty": replace(scene, nodes=without),
        "away": replace(scene, camera=replace(scene.camera, target=away)),
    }


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """What each scene of the gallery looks like, all in one page."""
    folder = tmp_path_factory.mktemp("gallery")
    scenes = gallery()
    scenes |= broken(scenes["rx90"])
    place = {name: k for k, name in enumerate(scenes)}
    # one animation is held at its start, the other plays to its end
    script = f"""
      var animator = frames[{place["start"]}].viewer.animator;
      animator.pause();
      animator.seek(0);
    """
    page = frames_page(
        folder / "gallery.html", [s._repr_html_() for s in scenes.values()], WIDTH, HEIGHT, script
    )
    image = picture(page, folder, (4 * WIDTH, (len(scenes) + 3) // 4 * HEIGHT))
    return dict(zip(scenes, cells(image, len(scenes), WIDTH, HEIGHT), strict=True))


SKELETONS = ("rx90", "stanford", "gantry", "tree", "ellipsoid", "start", "end")


@pytest.mark.parametrize("name", SKELETONS)
def test_a_skeleton_fills_its_picture(shown, name):
    assert arm_problem(shown[name], link_colors()) == ""


@pytest.mark.parametrize("name", ["two robots", "beside", "erd:ur5", "erd:panda"])
def test_meshes_and_groups_fill_their_picture(shown, name):
    assert arm_problem(shown[name]) == ""


def test_an_empty_scene_and_a_wrong_camera_are_noticed(shown):
    for name in ("empty", "away"):
        assert "of the picture is drawn" in arm_problem(shown[name])
        assert "of the picture is drawn" in arm_problem(shown[name], link_colors())


def test_the_arm_beside_its_sliders_is_not_cut_off(shown):
    # the picture leaves room for the joints to move, and half of it is the panel
    assert arm_problem(shown["jog"][:, PANEL_WIDTH:], link_colors(), least=0.004) == ""


def test_an_animation_plays(shown):
    start, end = drawn(shown["start"], link_colors()), drawn(shown["end"], link_colors())
    common = (start & end).sum() / (start | end).sum()
    assert common < 0.6


def test_an_ellipsoid_is_in_the_picture(shown):
    changed = np.abs(shown["ellipsoid"] - shown["rx90"]).max(axis=-1) > 0.1
    assert changed.mean() > 0.02


# ---------------------------------------------------------------- sliders

PANEL = """
  function read(page) {
    var value = function (id) { return Number(page.getElementById(id).value); };
    return {
      pose: ["x", "y", "z", "roll", "pitch", "yaw"].map(value),
      joints: Array.from(page.querySelectorAll(".value")).map(function (o) {
        return Number(o.value); }),
      outside: Array.from(page.querySelectorAll(".limits")).map(function (n) {
        return n.classList.contains("outside"); }),
      posture: page.getElementById("posture").selectedOptions[0].textContent,
      link: page.getElementById("link").getAttribute("href"),
    };
  }
  function put(field, value, kind) {
    field.value = value;
    field.dispatchEvent(new Event("input"));
    field.dispatchEvent(new Event("change"));
  }
  var results = Array.from(frames).map(function (frame, f) {
    var page = frame.document, steps = [read(page)];
    var numbers = page.querySelectorAll("#panel input[type=number]");
    var ranges = page.querySelectorAll("#panel input[type=range]");
    TYPED[f].forEach(function (value, k) { put(numbers[k], value); });
    steps.push(read(page));
    // a reader drags each slider to a third of its way
    ranges.forEach(function (range) {
      put(range, Number(range.min) + (Number(range.max) - Number(range.min)) / 3); });
    steps.push(read(page));
    var frames_of = page.getElementById("frame"), poses = {};
    Array.from(frames_of.options).forEach(function (option, i) {
      frames_of.selectedIndex = i;
      frames_of.dispatchEvent(new Event("change"));
      poses[option.textContent] = read(page).pose;
    });
    frames_of.selectedIndex = 0;
    var postures = page.getElementById("posture");
    postures.value = String(postures.options.length - 2);
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
    "tx40": (rm.load("tx40"), None),  # a coupled wrist, all joints independent
    "lab_trr": (rm.load("lab_trr"), None),
    "tree": (TREE, [0.3, -0.4, 0.2, 0.5]),
    "mimic": (MIMIC, None),
    "panda": (rm.load("erd:panda"), None),
    "baxter": (rm.load("erd:baxter"), None),
}
_RNG = np.random.default_rng(8)
TYPED = {name: np.round(_RNG.uniform(-1.0, 1.0, model.n), 4) for name, (model, _) in ROBOTS.items()}


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    """What the panels of all robots say after each step of a reader, in one page."""
    folder = tmp_path_factory.mktemp("panels")
    typed = []
    scenes = []
    for name, (model, q) in ROBOTS.items():
        scene = rm.viz.jog(model, q, meshes=False, height=HEIGHT)
        scenes.append(scene._repr_html_())
        unit = units(model)[scene.sliders.independent]
        typed.append((TYPED[name][scene.sliders.independent] * unit).tolist())
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
    """Position to a micrometre, orientation to a microradian."""
    shown = se3.from_rpy(np.deg2rad(pose[3:]), pose[:3])
    assert np.abs(shown[:3, 3] - T[:3, 3]).max() < 1e-6
    assert np.abs(shown[:3, :3] - T[:3, :3]).max() < 2e-6  # three angles, each to 0.9 microradian


def assert_shown(step, model, q):
    assert_pose(step["pose"], rm.dgm(model, q))
    assert np.abs(np.array(step["joints"]) / units(model) - q).max() < 1e-5
    outside = (q < model.lower - 1e-9) | (q > model.upper + 1e-9)
    assert step["outside"] == outside.tolist()
    # the link holds the sliders' values to 2e-9
    words = np.array([float(w) for w in step["link"].removeprefix("#q=").split(",")])
    leads = [j for j in range(model.n) if model.name != "mimic" or j < 2]
    assert np.abs(words / units(model)[leads] - q[leads]).max() < 2e-9


@pytest.mark.parametrize("name", ROBOTS)
def test_the_panel_says_what_dgm_says(panels, name):
    model, start = ROBOTS[name]
    first = coupled(model, np.zeros(model.n) if start is None else start)
    at_first, typed, _, named, reset = panels[name]["steps"]
    assert_shown(at_first, model, first)
    assert_shown(typed, model, coupled(model, TYPED[name]))
    last = list(model.configurations)[-1]
    assert_shown(named, model, coupled(model, model.configurations[last]))
    assert named["posture"].startswith(last)
    assert_shown(reset, model, first)
    assert panels[name]["steps"][0] == reset


@pytest.mark.parametrize("name", ROBOTS)
def test_sliders_go_from_limit_to_limit(panels, name):
    model, _ = ROBOTS[name]
    free = np.where(units(model) == 1.0, 1.0, np.pi)
    low = np.where(np.isfinite(model.lower), model.lower, np.minimum(-free, model.upper - 2 * free))
    high = np.where(np.isfinite(model.upper), model.upper, np.maximum(free, model.lower + 2 * free))
    q = coupled(model, low + (high - low) / 3.0)
    assert_shown(panels[name]["steps"][2], model, q)
    assert panels[name]["steps"][2]["posture"] == "moved by hand"
    poses = panels[name]["poses"]
    names = ("tool", *model.table.names, *(frame.name for frame in model.frames))
    assert list(poses) == list(dict.fromkeys(names))
    for frame, pose in poses.items():
        assert_pose(pose, rm.dgm(model, q, frame=frame))


def test_the_address_holds_a_posture(tmp_path):
    model = rm.load("stanford_arm")
    page = rm.viz.jog(model).save(tmp_path / "arm.html")
    q = np.array([0.3, -0.5, 0.4, 1.0, -0.6, 2.0])
    shown = ",".join(map(repr, (q * units(model)).round(6).tolist()))
    text = document(page, tmp_path, f"#q={shown}")
    pose = [
        float(re.search(rf'<output id="{a}">([^<]*)</output>', text).group(1))
        for a in ("x", "y", "z", "roll", "pitch", "yaw")
    ]
    assert_pose(pose, rm.dgm(model, q))
    assert f'href="#q={shown}"' in text
    text = document(page, tmp_path, "#q=1%2C2,%nonsense")
    assert "does not hold 6 numbers in the order of the sliders: #q=1%2C2,%nonsense<" in text
    assert 'href="#q=0,0,0,0,0,0"' in text


def test_a_wrong_start_of_coupled_joints_is_refused():
    with pytest.raises(rm.errors.InvalidValueError, match=r"joint_4 moves with.* -0\.3, got 0;"):
        rm.viz.jog(MIMIC, [1.0, 0.0, 0.01, 0.0])


# ---------------------------------------------------------------- notebooks


def exported(notebook):
    from nbconvert import HTMLExporter

    text, _ = HTMLExporter().from_notebook_node(notebook)
    return text


def laid_out(text: str, count: int) -> str:
    """The exported page with its frames side by side over everything else."""
    script = f"""<script>window.addEventListener("load", function () {{
      Array.from(document.querySelectorAll("iframe")).slice(0, {count}).forEach(function (f, k) {{
        f.style.cssText = "position: fixed; border: 0; z-index: 9999; width: {WIDTH}px; height: " +
          "{HEIGHT}px; left: " + k % 4 * {WIDTH} + "px; top: " +
          Math.floor(k / 4) * {HEIGHT} + "px";
      }});
    }});</script>"""
    return text.replace("</body>", f"{script}</body>")


def frames_of(text: str, folder: Path, name: str):
    """Pictures of the frames of an exported notebook."""
    count = min(text.count("<iframe srcdoc="), 12)
    assert count
    page = folder / f"{name}.html"
    page.write_text(laid_out(text, count), encoding="utf-8")
    image = picture(page, folder, (4 * WIDTH, (count + 3) // 4 * HEIGHT))
    return cells(image, count, WIDTH, HEIGHT)


def test_a_scene_in_an_exported_notebook_is_an_arm(tmp_path):
    from nbformat.v4 import new_code_cell, new_notebook, new_output

    scenes = [rm.viz.show(rm.load("rx90"), Q), rm.viz.jog(rm.load("rx90"), Q)]
    outputs = [
        new_output("display_data", {"text/html": s._repr_html_(), "text/plain": repr(s)})
        for s in scenes
    ]
    text = exported(new_notebook(cells=[new_code_cell("show(arm)", outputs=outputs)]))
    first, second = frames_of(text, tmp_path, "notebook")
    assert arm_problem(first, link_colors()) == ""
    assert arm_problem(second[:, PANEL_WIDTH:], link_colors(), least=0.004) == ""


def test_executed_notebooks_show_arms(tmp_path):
    """Of a folder with executed notebooks, as the run in CI leaves them."""
    import nbformat

    folder = os.environ.get("ROBOTMODELS_NOTEBOOKS")
    if not folder:
        pytest.skip("no executed notebooks: ROBOTMODELS_NOTEBOOKS names a folder that has some")
    seen = 0
    for path in sorted(Path(folder).glob("*.ipynb")):
        text = exported(nbformat.read(path, as_version=4))
        if "<iframe srcdoc=" not in text:
            continue
        played = ["set_animation&quot;," in frame for frame in text.split("<iframe srcdoc=")[1:]]
        for k, cell in enumerate(frames_of(text, tmp_path, path.stem)):
            # a picture that plays has room for the whole motion, of which one posture is a part
            problem = arm_problem(cell, least=0.004 if played[k] else 0.01)
            assert problem == "", f"{escape(path.name)}, frame {k + 1}"
            seen += 1
    assert seen, f"no notebook of {folder} has a scene in its outputs"
