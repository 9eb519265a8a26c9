"""A finished picture: it shows itself in a notebook and saves itself as one offline page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._arrays import Array
from ..errors import FrameNotFoundError, InvalidValueError
from .camera import Camera
from .motion import Motion
from .page import page
from .shapes import Legend, Node
from .sliders import SliderPanel


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
        panel = None if self.sliders is None else self.sliders.data()
        return page(self.title, self.nodes, self.camera, self.motion, self.legend, panel, self.dark)

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
