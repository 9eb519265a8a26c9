"""Mesh files (STL, Collada, OBJ and what else trimesh reads) as coloured triangles."""

from __future__ import annotations

import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import read_only
from ..errors import MeshNotFoundError, MissingExtraError, UrdfError
from ..visual import Color, Mesh
from .nodes import Triangles

# Edges sharper than this stay sharp, gentler ones are shaded as one smooth surface.
_CREASE = np.radians(35.0)


def mesh_parts(mesh: Mesh) -> tuple[tuple[Triangles, Color | None], ...]:
    """Read a mesh file: one surface for each of its colours."""
    try:
        if mesh.path is None:
            raise FileNotFoundError(mesh.filename)
        changed = mesh.path.stat().st_mtime_ns
    except OSError:
        raise MeshNotFoundError(
            f"mesh {mesh.filename!r} was not found. Pass package_dirs=[...] to "
            "RobotModel.from_urdf (the folders that contain the package's folder), or draw a "
            "skeleton sized from the table with meshes=False."
        ) from None
    return _read(mesh.path, mesh.scale, changed)


@lru_cache(maxsize=64)
def _read(
    path: Path, scale: tuple[float, float, float], changed: int
) -> tuple[tuple[Triangles, Color | None], ...]:
    """`mesh_parts`, remembered until the file changes."""
    try:
        import trimesh
    except ImportError:
        raise MissingExtraError(
            "drawing mesh files needs trimesh; run: pip install 'yourdfpy>=0.0.58'"
        ) from None
    try:
        with warnings.catch_warnings():  # what its readers will have to change is not the caller's
            warnings.simplefilter("ignore", DeprecationWarning)
            scene = trimesh.load_scene(str(path), process=False)
        if scene.units is not None:
            scene = scene.convert_units("meters")
        parts = []
        for node in scene.graph.nodes_geometry:
            T, name = scene.graph[node]
            geometry = scene.geometry[name]
            if not isinstance(geometry, trimesh.Trimesh) or not len(geometry.faces):
                continue
            color = _color(geometry)
            surface = geometry.copy()
            surface.apply_transform(np.diag((*scale, 1.0)) @ T)
            parts.append((_creased(surface), color))
    except Exception as error:  # each format's reader has errors of its own
        raise UrdfError(f"mesh file {path.name!r} cannot be read: {error}.") from error
    if not parts:
        raise UrdfError(f"mesh file {path.name!r} holds no triangles.")
    return tuple(parts)


def _creased(surface: Any) -> Triangles:
    """The triangles of a surface, cut along its sharp edges.

    The viewer computes normals from shared vertices, so none need to be stored.
    """
    from trimesh.graph import connected_component_labels

    surface.merge_vertices(merge_norm=True, merge_tex=True)
    gentle = surface.face_adjacency[surface.face_adjacency_angles < _CREASE]
    patch = connected_component_labels(gentle, node_count=len(surface.faces))
    # one vertex for each patch that meets there
    meeting = np.asarray(surface.faces, dtype=np.int64) + len(surface.vertices) * patch[:, None]
    unique, faces = np.unique(meeting, return_inverse=True)
    points = np.asarray(surface.vertices)[unique % len(surface.vertices)]
    vertices = read_only(points, np.float32)
    dtype = np.uint16 if len(vertices) < 65536 else np.uint32
    return Triangles(vertices, read_only(faces.reshape(-1, 3), dtype))


def _color(geometry: Any) -> Color | None:
    """The colour of a surface, None if the file defines none."""
    visual = geometry.visual
    if not visual.defined:
        return None
    rgba = visual.material.main_color if hasattr(visual, "material") else visual.main_color
    r, g, b, a = (float(c) / 255.0 for c in rgba)
    return r, g, b, a
