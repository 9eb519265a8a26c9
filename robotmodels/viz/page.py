"""One HTML page with meshcat's viewer and a scene in it: no server, and nothing is loaded.

meshcat's classes write their commands to a recorder instead of the window of a server; the page
holds them in MessagePack, the format in which the viewer receives them.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from importlib import import_module
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array
from ..visual import Box, Color, Cylinder, Sphere
from .camera import ASPECT, FIELD_OF_VIEW, Camera
from .motion import Motion
from .shapes import Label, Legend, Node, Segments, Triangles

_SKY = ([0.86, 0.91, 0.97], [1.0, 1.0, 1.0])
_NIGHT = ([0.05, 0.06, 0.09], [0.13, 0.15, 0.19])
# Lights far away (directional), so that a gantry of ten metres is as bright as a finger.
_LIGHTS = (
    ("Sky", "AmbientLight", 0.50, (0.0, 0.0, 1.0)),
    ("Key", "DirectionalLight", 0.40, (0.55, -0.75, 1.1)),
    ("Fill", "DirectionalLight", 0.16, (-0.9, -0.5, 0.4)),
    ("Back", "DirectionalLight", 0.14, (0.1, 1.0, 0.5)),
)
_OTHER_LIGHTS = (
    "SpotLight",
    "PointLightNegativeX",
    "PointLightPositiveX",
    "AmbientLight",
    "FillLight",
)
_MANY = 1_000_000_000
_Y_TO_Z = se3.rotation("x", np.pi / 2)  # the viewer draws cylinders along y


class Recorder:
    """Commands of meshcat's classes; geometries that repeat are kept once."""

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []
        self.geometries: dict[bytes, int] = {}

    def record(self, command: str, *values: Any, path: str = "", **options: Any) -> None:
        """Record a command by the name of its class; paths begin at the scene's root."""
        from umsgpack import packb

        if path:
            values += (_part("path").Path(tuple(path.split("/"))),)
        data = getattr(_part("commands"), command)(*values, **options).lower()
        found = data.get("object", {})
        if found.get("geometries"):
            # meshcat's random names would make each page of the same scene another text
            (geometry,), (material,) = found.pop("geometries"), found["materials"]
            geometry["uuid"], material["uuid"] = "geometry", "material"
            found["object"] |= {
                "uuid": data["path"],
                "geometry": "geometry",
                "material": "material",
            }
            key = packb(geometry)
            data["geometry"] = self.geometries.setdefault(key, len(self.geometries))
        self.commands.append(data)


def page(
    title: str,
    nodes: Iterable[Node],
    camera: Camera,
    motion: Motion | None = None,
    legend: Legend = (),
    panel: dict[str, Any] | None = None,
    dark: bool = False,
) -> str:
    """A scene as one HTML page; the panel of sliders is given as data for its script."""
    from umsgpack import packb, unpackb

    from ._meshcat import VIEWER  # the package first: its absence is explained

    recorder = Recorder()
    _set_stage(recorder, camera, dark)
    labels = []
    for node in nodes:
        if isinstance(node.shape, Label):
            labels.append([node.path, node.shape.text, node.shape.large])
        elif node.shape is not None:
            recorder.record("SetObject", _object(node), None, path=node.path)
        turned = node.pose @ _Y_TO_Z if isinstance(node.shape, Cylinder) else node.pose
        recorder.record("SetTransform", np.round(turned, 9) + 0.0, path=node.path)
    if motion is not None and motion.tracks:
        repetitions = _MANY if motion.loop else 1
        recorder.record("SetAnimation", _animation(motion), play=True, repetitions=repetitions)
    scene = {
        "commands": recorder.commands,
        "geometries": [unpackb(geometry) for geometry in recorder.geometries],
        "labels": labels,
        "target": _y_upwards(camera.target),
        "aspect": ASPECT,
        "depth": round(camera.depth, 6),
        "panel": panel,
    }
    items = (
        f'<li><span style="background: #{_rgb(color):06x}"></span>{escape(text)}</li>'
        for text, color in legend
    )
    template = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    return Template(template).substitute(
        title=escape(title),
        theme="dark" if dark else "",
        viewer=VIEWER.read_text(encoding="utf-8"),
        scene=b64encode(packb(scene)).decode("ascii"),
        legend=f'<ul id="legend">{"".join(items)}</ul>' if legend else "",
        panel='<div id="panel"></div>\n' if panel else "",
    )


def _rgb(color: Color) -> int:
    """Red, green and blue as the number that a browser writes in six hexadecimal digits."""
    r, g, b = (round(255 * min(max(c, 0.0), 1.0)) for c in color[:3])
    return (r << 16) + (g << 8) + b


def _part(name: str) -> Any:
    """A module of meshcat."""
    return import_module(f"._meshcat.{name}", __package__)


def _set_stage(recorder: Recorder, camera: Camera, dark: bool) -> None:
    """Background, lights and camera in place of meshcat's."""
    top, bottom = _NIGHT if dark else _SKY
    recorder.record("SetProperty", "top_color", top, path="Background")
    recorder.record("SetProperty", "bottom_color", bottom, path="Background")
    for path in ("Grid", "Axes"):
        recorder.record("SetProperty", "visible", False, path=path)
    for name in _OTHER_LIGHTS:
        recorder.record("Delete", path=f"Lights/{name}")
    for name, kind, intensity, position in _LIGHTS:
        matrix = se3.translation(*position).T.ravel().tolist()
        light = {"uuid": name, "type": kind, "color": 0xFFFFFF, "intensity": intensity}
        lamp = {
            "metadata": {"version": 4.5, "type": "Object"},
            "object": light | {"matrix": matrix},
        }
        path = f"/Lights/{name}"
        recorder.commands.append({"type": "set_object", "path": path, "object": lamp})
        # the viewer lets every object that it loads cast shadows
        _set(recorder, f"{path}/<object>", "castShadow", False)
    near, far = camera.distance / 200.0, 50.0 * max(camera.distance, 1.0)
    lens = _part("geometry").PerspectiveCamera(FIELD_OF_VIEW, 1, near, far)
    lens.uuid = "camera"
    recorder.record("SetObject", lens, None, path="Cameras/default/rotated")
    position = _y_upwards(camera.position)
    _set(recorder, "/Cameras/default/rotated/<object>", "position", position)


def _set(recorder: Recorder, path: str, name: str, value: Any) -> None:
    """Record a property; meshcat's own command writes its name in small letters."""
    recorder.commands.append(
        {"type": "set_property", "path": path, "property": name, "value": value}
    )


def _y_upwards(point: Array) -> list[float]:
    """A point of the world in the axes of the viewer's camera."""
    x, y, z = (round(float(v), 6) for v in point)
    return [x, z, -y]


def _object(node: Node) -> Any:
    """The shape of a node as an object of meshcat."""
    g = _part("geometry")
    look = {"color": _rgb(node.color), "opacity": float(node.color[3])}
    # a transparent surface hides nothing behind it; both sides of meshes are drawn
    solid = g.MeshPhongMaterial(
        **look, side=2, specular=0x1C1C1C, shininess=40, depthWrite=node.color[3] > 0.2
    )
    match node.shape:
        case Box(size):
            return g.Mesh(g.Box([float(v) for v in size]), solid)
        case Cylinder(radius, length):
            return g.Mesh(g.Cylinder(float(length), float(radius)), solid)
        case Sphere(radius):
            return g.Mesh(g.Sphere(float(radius)), solid)
        case Triangles(vertices, faces):
            both = vertices.astype(np.float32), faces.astype(np.uint32)
            return g.Mesh(g.TriangularMeshGeometry(*both), solid)
        case Segments(points):
            thin = g.LineBasicMaterial(**look)
            return g.LineSegments(g.PointsGeometry(points.T), thin)


def _animation(motion: Motion) -> Any:
    """Turns about and shifts along z of the joints, at common times."""
    animation, clips = _part("animation"), {}
    for track in motion.tracks:
        name = "position[z]" if track.prismatic else "rotation[z]"
        times, values = np.round(track.times, 5).tolist(), np.round(track.values, 6).tolist()
        # one frame a second makes the frames' numbers times
        frames = animation.AnimationTrack(name, "number", times, values)
        path = _part("path").Path(tuple(track.path.split("/")))
        clips[path] = animation.AnimationClip({name: frames}, fps=1)
    return animation.Animation(clips)
