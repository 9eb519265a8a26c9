"""Mesh files (STL, Collada, OBJ and others that trimesh reads) as coloured triangles."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import read_only
from ..errors import MissingExtraError, UrdfError
from ..model import RobotModel
from ..visual import Color, Mesh, skeleton
from .shapes import Triangles

_FORMATS = (".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".off")
_LARGEST, _MOST = 200_000_000, 5_000_000  # bytes of a file, vertices
_CREASE = np.radians(35.0)  # sharper edges stay sharp, others are shaded as one smooth surface


def with_stand_ins(model: RobotModel) -> tuple[RobotModel, tuple[str, ...]]:
    """Robot with a skeleton in place of missing mesh files, and the names of these files."""
    missing = [
        v
        for v in model.visuals
        if isinstance(v.shape, Mesh) and not (v.shape.path and v.shape.path.is_file())
    ]
    if not missing:
        return model, ()
    frames = {visual.frame for visual in missing}
    bones = skeleton(model.table, model.tool, model.tip, axes=False)
    kept = [visual for visual in model.visuals if visual not in missing]
    names = dict.fromkeys(v.shape.filename for v in missing if isinstance(v.shape, Mesh))
    visuals = (*kept, *(bone for bone in bones if bone.frame in frames))
    return replace(model, visuals=visuals), tuple(names)


def mesh_parts(mesh: Mesh) -> tuple[tuple[Triangles, Color | None], ...]:
    """Surfaces of a mesh file, one for each of its colours."""
    path = Path(mesh.path or mesh.filename)
    return _read(path, mesh.scale, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _read(
    path: Path, scale: tuple[float, float, float], changed: int
) -> tuple[tuple[Triangles, Color | None], ...]:
    """`mesh_parts`, cached until the file changes."""
    try:
        import trimesh
    except ImportError:
        raise MissingExtraError(
            "drawing mesh files needs trimesh; run: pip install 'yourdfpy>=0.0.58'"
        ) from None
    size = path.stat().st_size
    if path.suffix.lower() not in _FORMATS or size > _LARGEST:
        raise UrdfError(
            f"mesh file {path.name!r:.100} ({size / 1e6:.1f} MB): expected "
            f"{', '.join(_FORMATS)} and at most {_LARGEST / 1e6:.0f} MB; archives are not read."
        )
    try:
        with warnings.catch_warnings():  # deprecations in its readers do not concern the caller
            warnings.simplefilter("ignore", DeprecationWarning)
            scene = trimesh.load_scene(str(path), process=False)
        if scene.units is not None:
            scene = scene.convert_units("meters")
        parts = []
        for node in scene.graph.nodes_geometry:
            T, name = scene.graph[node]
            geometry = scene.geometry[name]
            if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces):
                surface = geometry.copy()
                surface.apply_transform(np.diag((*scale, 1.0)) @ T)
                points = np.asarray(surface.vertices)
                if len(points) > _MOST or not np.isfinite(points).all():
                    raise ValueError(f"expected finite vertices, at most {_MOST}")
                parts.append((_creased(surface), _color(geometry)))
    except Exception as error:  # each format's reader has errors of its own
        raise UrdfError(f"mesh file {path.name!r} cannot be read: {error}.") from error
    if not parts:
        raise UrdfError(f"mesh file {path.name!r} holds no triangles.")
    return tuple(parts)


def _creased(surface: Any) -> Triangles:
    """Triangles of a surface, cut along its sharp edges: the viewer smooths shared vertices."""
    from trimesh.graph import smooth_shade

    surface.merge_vertices(merge_norm=True, merge_tex=True)
    smooth = smooth_shade(surface, angle=_CREASE, facet_minarea=None)
    return Triangles(read_only(smooth.vertices, np.float32), read_only(smooth.faces, np.uint32))


def _color(geometry: Any) -> Color | None:
    """Colour of a surface, None if the file defines none."""
    visual = geometry.visual
    if not visual.defined:
        return None
    rgba = visual.material.main_color if hasattr(visual, "material") else visual.main_color
    r, g, b, a = (float(c) / 255.0 for c in rgba)
    return r, g, b, a
