"""A finished picture: it shows itself in a notebook and saves itself as one offline page.

meshcat's classes write their commands to a recorder instead of the window of a server; the page
holds them in MessagePack, the format in which the viewer receives them.
"""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from html import escape
from importlib import import_module
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import FrameNotFoundError, InvalidValueError
from ..visual import Box, Color, Cylinder, Sphere
from .camera import ASPECT, FIELD_OF_VIEW, Camera
from .motion import Motion
from .shapes import Label, Legend, Node, Segments, Triangles
from .sliders import SliderPanel

_SKY = ([0.86, 0.91, 0.97], [1.0, 1.0, 1.0])
_NIGHT = ([0.05, 0.06, 0.09], [0.13, 0.15, 0.19])
# Lights far away (directional), so that a gantry of ten metres is as bright as a finger.
_LIGHTS = (
    ("Sky", "AmbientLight", 0.50, (0.0, 0.0, 1.0)),
    ("Key", "DirectionalLight", 0.40, (0.55, -0.75, 1.1)),
    ("Fill", "DirectionalLight", 0.16, (-0.9, -0.5, 0.4)),
    ("Back", "DirectionalLight", 0.14, (0.1, 1.0, 0.5)),
)
_OTHER_LIGHTS = ("SpotLight", "PointLightNegativeX", "PointLightPositiveX")
_MANY = 1_000_000_000
_Y_TO_Z = se3.rotation("x", np.pi / 2)  # the viewer draws cylinders along y


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A picture of robots, made by `show`, `animate` or `jog`. It holds no process, port or file.

    Parameters
    ----------
    title : str
        Of the page.
    nodes : tuple of Node
        The drawn shapes as a tree; upper nodes first.
    camera : Camera
        The first view; the mouse turns, shifts and zooms.
    motion : Motion or None
        The motion that is played.
    height : int
        Pixels in a notebook.
    legend : tuple of (str, Color)
        Texts and the colours they explain, listed in a corner.
    sliders : SliderPanel or None
        The joints that the reader moves.
    dark : bool
        Whether the background is dark.

    Examples
    --------
    >>> import robotmodels as rm
    >>> rm.viz.show(rm.load("planar_2r"), [0.0, 0.5]).paths[0]
    'robots/planar_2r'
    """

    title: str
    nodes: tuple[Node, ...]
    camera: Camera
    motion: Motion | None = None
    height: int = 480
    legend: Legend = ()
    sliders: SliderPanel | None = None
    dark: bool = False

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of all nodes."""
        return tuple(node.path for node in self.nodes)

    def pose(self, path: str) -> Array:
        """World pose (4, 4) of a node, by its path, of the first sample if the scene moves."""
        poses = {node.path: node.pose for node in self.nodes}
        if path not in poses:
            raise FrameNotFoundError("node", path, poses)
        T, names = np.eye(4), path.split("/")
        for k in range(len(names)):
            T = T @ poses.get("/".join(names[: k + 1]), np.eye(4))
        return T

    def html(self) -> str:
        """The picture as one HTML page that loads nothing; about 0.9 MB without meshes."""
        from umsgpack import packb, unpackb

        from ._meshcat import VIEWER  # the package first: its absence is explained

        recorder, labels, motion = Recorder(), [], self.motion
        _set_stage(recorder, self.camera, self.dark)
        for node in self.nodes:
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
            "target": _y_upwards(self.camera.target),
            "aspect": ASPECT,
            "depth": round(self.camera.depth, 6),
            "panel": None if self.sliders is None else self.sliders.data(),
        }
        items = "".join(
            f'<li><span style="background: #{_rgb(color):06x}"></span>{escape(text)}</li>'
            for text, color in self.legend
        )
        template = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
        return Template(template).substitute(
            title=escape(self.title),
            theme="dark" if self.dark else "",
            viewer=VIEWER.read_text(encoding="utf-8"),
            scene=b64encode(packb(scene)).decode("ascii"),
            legend=f'<ul id="legend">{items}</ul>' if items else "",
            panel='<div id="panel"></div>\n' if self.sliders else "",
        )

    def save(self, path: str | Path) -> Path:
        """Write the picture as one offline page, with its animation, and return the path."""
        path = Path(path)
        if path.is_dir():
            raise InvalidValueError(f"path: {path} is a folder; give a file, such as arm.html.")
        if not path.parent.is_dir():
            raise InvalidValueError(f"path: there is no folder {path.parent}; make it first.")
        path.write_text(self.html(), encoding="utf-8")
        return path

    def _repr_html_(self) -> str:
        text = self.html().replace("&", "&amp;").replace('"', "&quot;")
        return (
            f'<iframe srcdoc="{text}" style="width: 100%; height: {self.height}px; '
            'border: 1px solid #ddd; box-sizing: border-box; display: block;"></iframe>'
        )

    def __repr__(self) -> str:
        shapes = sum(node.shape is not None for node in self.nodes)
        played = ""
        if self.motion is not None:
            m = self.motion
            played = f", {m.duration:g} s from {m.samples} samples in {m.keyframes} keyframes"
        if self.sliders is not None:
            played = f", {self.sliders.independent.size} sliders"
        return f"<Scene {self.title!r}: {shapes} shapes{played}>"


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
    for name in ("AmbientLight", "FillLight", *_OTHER_LIGHTS):
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
