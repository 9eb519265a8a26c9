"""One HTML page with meshcat's viewer and a scene in it: nothing is fetched, no server is needed.

meshcat's own ``static_html`` asks a server process for the same page. The page is written here
instead, so that pictures leave no process and no port behind, and the same scene is the same text.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from functools import lru_cache
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import MissingExtraError
from ..visual import Box, Color, Cylinder, Sphere
from .camera import ASPECT, FIELD_OF_VIEW, Camera
from .motion import Motion
from .nodes import Drawable, Label, Node, Segments, Triangles
from .palette import Legend
from .sliders import SliderPanel
from .sliders_page import SCRIPT, STYLE, panel_html

_SKY = ([0.86, 0.91, 0.97], [1.0, 1.0, 1.0])
# Lights far away (directional), so that a gantry of ten metres is as bright as a finger.
_LIGHTS = (
    ("Sky", "AmbientLight", 0.50, (0.0, 0.0, 1.0)),
    ("Key", "DirectionalLight", 0.40, (0.55, -0.75, 1.1)),
    ("Fill", "DirectionalLight", 0.16, (-0.9, -0.5, 0.4)),
    ("Back", "DirectionalLight", 0.14, (0.1, 1.0, 0.5)),
)
_MANY = 1_000_000_000

# three.js draws cylinders along y
_Y_TO_Z = se3.rotation("x", np.pi / 2)

_TEMPLATE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline';
 style-src 'unsafe-inline'; img-src data: blob:; worker-src blob:">
<title>{title}</title>
<style>
body {{ margin: 0; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#legend {{ position: absolute; left: 10px; bottom: 10px; margin: 0; padding: 6px 10px;
 list-style: none; font: 13px/1.5 sans-serif; color: #222; background: rgba(255, 255, 255, 0.8);
 border-radius: 4px; }}
#legend span {{ display: inline-block; width: 0.9em; height: 0.9em; margin-right: 0.5em;
 vertical-align: -0.1em; border-radius: 2px; }}
.dg.main .close-button {{ background: none !important; color: #444 !important;
 text-align: right !important; padding-right: 8px; box-sizing: border-box; }}
#message {{ display: none; margin: 2em; font-family: sans-serif; }}
{style}</style>
</head>
<body>
<p id="message">This picture needs WebGL, which this browser or its settings do not offer.</p>
{panel}<div id="meshcat-pane"></div>
{legend}<script>
{viewer}
</script>
<script type="application/json" id="scene">
{scene}
</script>
<script>
(function () {{
  var scene = JSON.parse(document.getElementById("scene").textContent);
  var kinds = {{ Float32Array: Float32Array, Uint16Array: Uint16Array, Uint32Array: Uint32Array }};
  var arrays = scene.arrays.map(function (a) {{
    var bytes = Uint8Array.from(atob(a[1]), function (c) {{ return c.charCodeAt(0); }});
    return new kinds[a[0]](bytes.buffer);
  }});
  scene.commands.forEach(function (command) {{
    ((command.object || {{}}).geometries || []).forEach(function (geometry) {{
      if (!geometry.data) return;
      var parts = [geometry.data.attributes.position];
      if (geometry.data.index) parts.push(geometry.data.index);
      parts.forEach(function (part) {{ part.array = arrays[part.array]; }});
    }});
  }});
  try {{
    var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
  }} catch (error) {{
    document.getElementById("message").style.display = "block";
    throw error;
  }}
  window.viewer = viewer;
  scene.commands.forEach(function (command) {{ viewer.handle_command(command); }});
  viewer.controls.target.fromArray(scene.target);
  // In a picture narrower than the camera was placed for, step back until nothing is cut off:
  // a point at depth z is seen if its distance from the axis is below slope (distance + z).
  var pane = document.getElementById("meshcat-pane"), touched = false;
  var eye = viewer.camera.position, target = viewer.controls.target;
  var distance = eye.distanceTo(target);
  function fit() {{
    var across = pane.offsetWidth / window.innerHeight;
    if (touched || !(across > 0)) return;
    var wider = Math.max(scene.aspect / across, 1);
    eye.sub(target).setLength(wider * distance + (wider - 1) * scene.depth).add(target);
    viewer.set_dirty();
  }}
  ["pointerdown", "wheel"].forEach(function (event) {{
    pane.addEventListener(event, function () {{ touched = true; }}, true);
  }});
  window.addEventListener("resize", fit);
  fit();
  viewer.set_3d_pane_size();
}})();
</script>
{script}</body>
</html>
"""


def page(
    title: str,
    nodes: Iterable[Node],
    camera: Camera,
    motion: Motion | None,
    legend: Legend = (),
    sliders: SliderPanel | None = None,
) -> str:
    """Write a scene as one HTML page."""
    store = _ArrayStore()
    commands = list(_stage(camera))
    for node in nodes:
        if node.shape is not None:
            commands.append(_set_object(node.path, node.shape, node.color, store))
        commands.append(_set_transform(node.path, node.pose))
    if motion is not None and motion.tracks:
        commands.append(_set_animation(motion))
    # the viewer has no command for the point that the camera turns about
    content = {"arrays": store.arrays, "commands": commands,
               "target": _y_upwards(camera.target), "aspect": ASPECT,
               "depth": round(camera.depth, 6)}  # fmt: skip
    scene = json.dumps(content, separators=(",", ":"))
    # a "<" could end the script element or open a comment in it
    return _TEMPLATE.format(
        title=escape(title), viewer=_viewer_script(), scene=scene.replace("<", "\\u003c"),
        legend=_legend_list(legend), style="" if sliders is None else STYLE,
        panel="" if sliders is None else panel_html(title, sliders) + "\n",
        script="" if sliders is None else f"<script>\n{SCRIPT}</script>\n",
    )  # fmt: skip


def _legend_list(legend: Legend) -> str:
    """A list of coloured squares with their texts, or nothing."""
    if not legend:
        return ""
    items = [
        f'<li><span style="background: #{_rgb(color):06x}"></span>{escape(text)}</li>'
        for text, color in legend
    ]
    return "\n".join(('<ul id="legend">', *items, "</ul>\n"))


def _rgb(color: Color) -> int:
    """Red, green and blue as the number that a browser writes in six hexadecimal digits."""
    r, g, b = (round(255 * min(max(c, 0.0), 1.0)) for c in color[:3])
    return (r << 16) + (g << 8) + b


class _ArrayStore:
    """Arrays as text, each once, however many postures or robots show the same mesh."""

    def __init__(self) -> None:
        self.arrays: list[tuple[str, str]] = []
        self._known: dict[tuple[str, str], int] = {}

    def add(self, array: np.ndarray, kind: str) -> int:
        dtype = {"Float32Array": "<f4", "Uint16Array": "<u2", "Uint32Array": "<u4"}[kind]
        text = base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode("ascii")
        if (kind, text) not in self._known:
            self._known[kind, text] = len(self.arrays)
            self.arrays.append((kind, text))
        return self._known[kind, text]


def _stage(camera: Camera) -> Iterable[dict[str, Any]]:
    """Background, lights and camera; meshcat's grid and axes give way to ours."""
    for key, value in zip(("top_color", "bottom_color"), _SKY, strict=True):
        yield _set_property("Background", key, value)
    for path in ("Grid", "Axes"):
        yield _set_property(path, "visible", False)
    for name in ("SpotLight", "PointLightNegativeX", "PointLightPositiveX", "AmbientLight",
                 "FillLight"):  # fmt: skip
        yield {"type": "delete", "path": f"Lights/{name}"}
    for name, kind, intensity, position in _LIGHTS:
        path = f"Lights/{name}"
        yield {"type": "set_object", "path": path, "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "object": {"uuid": path, "type": kind, "color": 0xFFFFFF, "intensity": intensity,
                       "matrix": _numbers(se3.translation(*position).T)},
        }}  # fmt: skip
        # the viewer lets every object that it loads cast shadows
        yield _set_property(f"{path}/<object>", "castShadow", False)
    far = max(camera.distance, 1.0)
    yield {"type": "set_object", "path": "Cameras/default/rotated", "object": {
        "metadata": {"version": 4.5, "type": "Object"},
        "object": {"uuid": "camera", "type": "PerspectiveCamera", "fov": FIELD_OF_VIEW,
                   "aspect": 1.0, "near": camera.distance / 200.0, "far": 50.0 * far, "zoom": 1.0},
    }}  # fmt: skip
    yield _set_property("Cameras/default/rotated/<object>", "position", _y_upwards(camera.position))


def _y_upwards(point: Array) -> list[float]:
    """A point of the world in the axes that the camera lives in."""
    x, y, z = (round(float(v), 6) for v in point)
    return [x, z, -y]


def _set_transform(path: str, pose: Array) -> dict[str, Any]:
    return {"type": "set_transform", "path": path, "matrix": _numbers(pose.T)}


def _set_property(path: str, key: str, value: Any) -> dict[str, Any]:
    return {"type": "set_property", "path": path, "property": key, "value": value}


def _set_object(path: str, shape: Drawable, color: Color, store: _ArrayStore) -> dict[str, Any]:
    data: dict[str, Any] = {"metadata": {"version": 4.5, "type": "Object"}}
    thing: dict[str, Any] = {"uuid": path, "material": "material"}
    data["materials"] = [_material(shape, color)]
    match shape:
        case Label(text, size):
            thing |= {"type": "Sprite", "matrix": _numbers(np.diag((size, size, 1.0, 1.0)))}
            # canvas of the viewer: 256 pixels square
            data["textures"] = [{"uuid": "text", "type": "_text", "text": text, "font_size": 48,
                                 "font_face": "sans-serif"}]  # fmt: skip
        case Segments():
            thing |= {"type": "LineSegments", "geometry": "geometry"}
            data["geometries"] = [_geometry(shape, store)]
        case _:
            thing |= {"type": "Mesh", "geometry": "geometry"}
            if isinstance(shape, Cylinder):
                thing["matrix"] = _numbers(_Y_TO_Z.T)
            data["geometries"] = [_geometry(shape, store)]
    data["object"] = thing
    return {"type": "set_object", "path": path, "object": data}


def _geometry(shape: Drawable, store: _ArrayStore) -> dict[str, Any]:
    match shape:
        case Box(size):
            a, b, c = (float(v) for v in size)
            return {"uuid": "geometry", "type": "BoxGeometry", "width": a, "height": b, "depth": c}
        case Cylinder(radius, length):
            return {"uuid": "geometry", "type": "CylinderGeometry", "radiusTop": float(radius),
                    "radiusBottom": float(radius), "height": float(length),
                    "radialSegments": 32}  # fmt: skip
        case Sphere(radius):
            return {"uuid": "geometry", "type": "SphereGeometry", "radius": float(radius),
                    "widthSegments": 32, "heightSegments": 24}  # fmt: skip
        case Segments(points):
            return {"uuid": "geometry", "type": "BufferGeometry",
                    "data": {"attributes": {"position": _position(points, store)}}}  # fmt: skip
        case Triangles(vertices, faces):
            kind = "Uint16Array" if len(vertices) < 65536 else "Uint32Array"
            index = {"type": kind, "array": store.add(faces.ravel(), kind)}
            return {"uuid": "geometry", "type": "BufferGeometry",
                    "data": {"attributes": {"position": _position(vertices, store)},
                             "index": index}}  # fmt: skip
        case Label():
            return {}


def _position(points: np.ndarray, store: _ArrayStore) -> dict[str, Any]:
    return {"itemSize": 3, "type": "Float32Array", "normalized": False,
            "array": store.add(points, "Float32Array")}  # fmt: skip


def _material(shape: Drawable, color: Color) -> dict[str, Any]:
    material: dict[str, Any] = {
        "uuid": "material",
        "color": _rgb(color),
        "transparent": color[3] < 1.0,
        "opacity": float(color[3]),
    }
    match shape:
        case Label():
            # drawn over everything, as large as its distance makes it
            return material | {"type": "SpriteMaterial", "map": "text", "transparent": True,
                               "depthTest": False}  # fmt: skip
        case Segments():
            return material | {"type": "LineBasicMaterial"}
        case _:
            # both sides: a mesh may be mirrored or have holes
            return material | {"type": "MeshPhongMaterial", "specular": 0x1C1C1C, "shininess": 40,
                               "side": 2, "depthWrite": color[3] > 0.2}  # fmt: skip


def _set_animation(motion: Motion) -> dict[str, Any]:
    animations = [
        {
            "path": track.path,
            "clip": {
                # one frame a second makes the keys' times seconds
                "fps": 1, "name": "default",
                "tracks": [{
                    "name": ".position[z]" if track.prismatic else ".rotation[z]",
                    "type": "number",
                    "times": np.round(track.times, 5).tolist(),
                    "values": np.round(track.values, 6).tolist(),
                }],
            },
        }
        for track in motion.tracks
    ]  # fmt: skip
    options = {"play": True, "repetitions": _MANY if motion.loop else 1}
    return {"type": "set_animation", "path": "", "animations": animations, "options": options}


def _numbers(matrix: Array) -> list[float]:
    """Column-major numbers of a matrix given transposed, without digits nobody can see."""
    return (np.round(matrix, 9) + 0.0).ravel().tolist()


@lru_cache(maxsize=1)
def _viewer_script() -> str:
    """The viewer that meshcat ships."""
    found = find_spec("meshcat")
    folders = list(found.submodule_search_locations or []) if found else []
    for folder in folders:
        path = Path(folder) / "viewer" / "dist" / "main.min.js"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise MissingExtraError("pictures need meshcat; run: pip install 'meshcat>=0.3.2'")
