"""The panel of joint sliders in a page: its HTML and the script that moves the robot with it."""

from __future__ import annotations

import json
from html import escape
from typing import Any

import numpy as np

from .sliders import Slider, SliderPanel

STYLE = """body { display: flex; }
#meshcat-pane { flex: 1; min-width: 0; }
#panel { box-sizing: border-box; width: min(300px, 48vw); height: 100vh; overflow-y: auto;
 padding: 8px 12px; font: 13px/1.4 sans-serif; color: #222; background: #fafafa;
 border-right: 1px solid #ccc; }
#panel h1 { margin: 0 0 4px; font-size: 16px; overflow-wrap: anywhere; }
#panel button, #panel select, #panel input { font: inherit; max-width: 100%; }
#panel #frame { max-width: 10em; }
#panel .joint { margin-top: 8px; }
#panel .line { display: flex; gap: 4px; align-items: baseline; }
#panel .line label { flex: 1; min-width: 0; overflow-wrap: anywhere; }
#panel .line input { width: 6.5em; text-align: right; }
#panel .line output { text-align: right; }
#panel .unit { width: 2.2em; }
#panel input[type=range] { display: block; width: 100%; margin: 2px 0 0; }
#panel small { color: #555; overflow-wrap: anywhere; }
#panel .outside { color: #b00020; font-weight: bold; }
#panel table { border-collapse: collapse; margin: 4px 0; font-variant-numeric: tabular-nums; }
#panel td { padding: 0 4px 0 0; white-space: nowrap; }
#panel td:nth-child(2), #panel td:nth-child(5) { min-width: 5.6em; text-align: right; }
#panel td:nth-child(3) { padding-right: 12px; }
#panel .row { margin-top: 6px; }
@media (max-width: 560px) { #panel { font-size: 11px; padding: 6px; } }
#problem { color: #b00020; }
#problem:empty { display: none; }
"""

SCRIPT = """(function () {
  var viewer = window.viewer;
  var robot = JSON.parse(document.getElementById("sliders").textContent);
  var each = function (selector) { return Array.from(document.querySelectorAll(selector)); };
  var byId = function (id) { return document.getElementById(id); };
  var numbers = each("#panel input[type=number]"), ranges = each("#panel input[type=range]");
  var values = each("#panel .value"), notes = each("#panel .limits");
  var framed = window.parent !== window;
  var x = robot.start.slice();

  // what is shown is in degrees, or in metres as it is
  function factor(joint) { return joint.prismatic ? 1 : 180 / Math.PI; }
  function leader(k) { return robot.joints[robot.independent[k]]; }
  function digits(joint) { return joint.prismatic ? 5 : 3; }
  function text(value, count) {
    var written = value.toFixed(count);
    return Number(written) === 0 ? written.replace("-", "") : written;
  }

  function joints() {
    return robot.offset.map(function (offset, j) {
      return robot.matrix[j].reduce(function (sum, c, k) { return sum + c * x[k]; }, offset);
    });
  }

  function motion(joint, value) {
    var c = Math.cos(value), s = Math.sin(value);
    return joint.prismatic
      ? [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, value, 1]
      : [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  }

  // the pose of a frame as it is drawn: the placements of the nodes it hangs on
  function pose(target) {
    var node = viewer.scene_tree, T = viewer.scene.matrix.clone().identity();
    target.path.split("/").forEach(function (name) {
      node = node.find([name]);
      node.object.updateMatrix();
      T.multiply(node.object.matrix);
    });
    return T.multiply(T.clone().fromArray(target.pose)).elements;
  }

  function showPose() {
    var T = pose(robot.targets[byId("frame").selectedIndex]);
    var yaw = Math.atan2(T[1], T[0]), c = Math.cos(yaw), s = Math.sin(yaw);
    var pitch = Math.atan2(-T[2], Math.hypot(T[0], T[1]));
    // by back-substitution of yaw: exact also where pitch is +-90 degrees
    var roll = Math.atan2(s * T[8] - c * T[9], c * T[5] - s * T[4]);
    ["x", "y", "z"].forEach(function (name, i) { byId(name).value = text(T[12 + i], 6); });
    [["roll", roll], ["pitch", pitch], ["yaw", yaw]].forEach(function (angle) {
      byId(angle[0]).value = text(angle[1] * 180 / Math.PI, 4);
    });
  }

  // "from" is the field being typed in, which is left as it is
  function show(from) {
    joints().forEach(function (value, j) {
      var joint = robot.joints[j];
      viewer.handle_command({
        type: "set_transform", path: joint.path, matrix: motion(joint, value)
      });
      values[j].value = text(value * factor(joint), digits(joint));
      var outside = (joint.lower !== null && value < joint.lower - 1e-9) ||
        (joint.upper !== null && value > joint.upper + 1e-9);
      notes[j].classList.toggle("outside", outside);
    });
    x.forEach(function (value, k) {
      var joint = leader(k), shown = value * factor(joint);
      if (numbers[k] !== from) numbers[k].value = text(shown, digits(joint));
      if (ranges[k] !== from) ranges[k].value = shown;
    });
    var named = robot.postures.findIndex(function (posture) {
      return posture[1].every(function (value, k) { return Math.abs(value - x[k]) < 1e-7; });
    });
    byId("posture").value = named < 0 ? "" : String(named);
    showPose();
    byId("link").setAttribute("href", link());
  }

  function link() {
    return "#q=" + x.map(function (value, k) {
      var joint = leader(k);
      return Number(text(value * factor(joint), joint.prismatic ? 9 : 7));
    }).join(",");
  }

  // in a frame of a notebook the address is not the reader's to share
  function remember() {
    if (framed) return;
    try { history.replaceState(null, "", link()); } catch (error) { /* the link still has it */ }
  }

  function set(posture) {
    x = posture.slice();
    byId("problem").textContent = "";
    show();
  }

  function fromAddress() {
    var found = /^#q=(.*)$/.exec(location.hash);
    if (!found) return;
    // some programs write a comma as %2C when they pass an address on
    var words = found[1].replace(/%2C/gi, ",").split(","), read = words.map(Number);
    var good = words.every(function (word, k) { return word.trim() && isFinite(read[k]); });
    if (!good || read.length !== x.length) {
      byId("problem").textContent = "The link does not hold " + x.length +
        " numbers in the order of the sliders: " + location.hash;
      return;
    }
    set(read.map(function (value, k) { return value / factor(leader(k)); }));
  }

  function moved(field, k) {
    if (field.value.trim() === "" || !isFinite(field.value)) return;
    x[k] = Number(field.value) / factor(leader(k));
    byId("problem").textContent = "";
    show(field);
  }

  numbers.concat(ranges).forEach(function (field, i) {
    field.addEventListener("input", function () { moved(field, i % x.length); });
    field.addEventListener("change", function () { show(); remember(); });
  });
  byId("posture").addEventListener("change", function () {
    var k = byId("posture").value;
    if (k !== "") set(robot.postures[Number(k)][1]);
    remember();
  });
  byId("reset").addEventListener("click", function () { set(robot.start); remember(); });
  byId("frame").addEventListener("change", showPose);
  window.addEventListener("hashchange", fromAddress);
  if (framed) byId("link").style.display = "none";
  show();
  fromAddress();
  viewer.set_3d_pane_size();
})();
"""


def panel_html(title: str, panel: SliderPanel) -> str:
    """The panel beside the picture."""
    rows = [
        _leader(joint, k) if (k := _place(panel, i)) is not None else _follower(joint)
        for i, joint in enumerate(panel.joints)
    ]
    postures = "".join(
        f'<option value="{k}">{escape(name)}</option>' for k, (name, _) in enumerate(panel.postures)
    )
    frames = "".join(f"<option>{escape(target.name)}</option>" for target in panel.targets)
    cells = "".join(
        f'<tr><td>{a}</td><td><output id="{a}"></output></td><td>m</td>'
        f'<td>{b}</td><td><output id="{b}"></output></td><td>deg</td></tr>'
        for a, b in zip("xyz", ("roll", "pitch", "yaw"), strict=True)
    )
    return "\n".join((
        '<div id="panel">',
        f"<h1>{escape(title)}</h1>",
        '<div><label>Frame <select id="frame">' + frames + "</select></label> in the world</div>",
        f"<table>{cells}</table>",
        '<div class="row"><label>Posture <select id="posture"><option value="">moved by hand'
        f"</option>{postures}</select></label></div>",
        '<div class="row"><button type="button" id="reset">Reset</button> '
        '<a id="link" href="#">Link to this posture</a></div>',
        '<div id="problem" role="alert"></div>',
        *rows,
        "</div>",
        '<script type="application/json" id="sliders">',
        # a "<" could end the script element or open a comment in it
        json.dumps(_content(panel), separators=(",", ":")).replace("<", "\\u003c"),
        "</script>",
    ))  # fmt: skip


def _place(panel: SliderPanel, joint: int) -> int | None:
    """Number of the slider of a joint, None for a joint that follows others."""
    places = np.flatnonzero(panel.independent == joint)
    return int(places[0]) if places.size else None


def _leader(joint: Slider, k: int) -> str:
    unit, scale = _unit(joint)
    low, high = (end * scale for end in joint.ends)
    step = "0.01" if joint.prismatic else "1"
    return (
        f'<div class="joint"><div class="line"><label for="n{k}">{escape(joint.name)}</label>'
        f'<input type="number" id="n{k}" step="{step}"><output class="value" hidden></output>'
        f'<span class="unit">{unit}</span></div>'
        f'<input type="range" min="{low!r}" max="{high!r}" step="any" aria-label="'
        f'{escape(joint.name)}"><small class="limits">{_limits(joint)}</small></div>'
    )


def _follower(joint: Slider) -> str:
    unit, _ = _unit(joint)
    leaders = ", ".join(joint.follows)
    how = f"follows {leaders}" if leaders else "does not move"
    return (
        f'<div class="joint"><div class="line"><label>{escape(joint.name)}</label>'
        f'<output class="value"></output><span class="unit">{unit}</span></div>'
        f'<small>{escape(how)}; </small><small class="limits">{_limits(joint)}</small></div>'
    )


def _unit(joint: Slider) -> tuple[str, float]:
    return ("m", 1.0) if joint.prismatic else ("deg", 180.0 / np.pi)


def _limits(joint: Slider) -> str:
    """The limits in words; where one is missing, how far the slider goes."""
    unit, scale = _unit(joint)
    low, high = (f"{end * scale:.5g}" for end in joint.ends)
    if np.isfinite(joint.lower) and np.isfinite(joint.upper):
        text = f"{low} to {high} {unit}"
    elif np.isfinite(joint.lower):
        text = f"from {low} {unit}, no upper limit, slider to {high} {unit}"
    elif np.isfinite(joint.upper):
        text = f"up to {high} {unit}, no lower limit, slider from {low} {unit}"
    else:
        text = f"no limits, slider {low} to {high} {unit}"
    return text + (", passive" if joint.passive else "")


def _content(panel: SliderPanel) -> dict[str, Any]:
    """What the script reads."""
    return {
        "joints": [
            {"path": joint.path, "prismatic": joint.prismatic, "lower": _finite(joint.lower),
             "upper": _finite(joint.upper)}
            for joint in panel.joints
        ],
        "independent": panel.independent.tolist(),
        "matrix": panel.matrix.tolist(),
        "offset": panel.offset.tolist(),
        "start": panel.start.tolist(),
        "postures": [[name, x.tolist()] for name, x in panel.postures],
        "targets": [
            {"path": target.path, "pose": target.pose.T.ravel().tolist()}
            for target in panel.targets
        ],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
