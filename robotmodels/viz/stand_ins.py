"""A skeleton in place of mesh files that are not where they were looked for."""

from __future__ import annotations

from dataclasses import replace

from ..model import RobotModel
from ..visual import Mesh, Visual, skeleton


def with_stand_ins(model: RobotModel) -> tuple[RobotModel, tuple[str, ...]]:
    """Robot with skeletons in place of missing mesh files."""
    lost = [v for v in model.visuals if isinstance(v.shape, Mesh) and not _is_there(v.shape)]
    if not lost:
        return model, ()
    frames = {visual.frame for visual in lost}
    bones: list[Visual] = [
        visual
        for visual in skeleton(model.table, model.tool, model.tip, axes=False)
        if visual.frame in frames
    ]
    kept = [visual for visual in model.visuals if visual not in lost]
    names = dict.fromkeys(v.shape.filename for v in lost if isinstance(v.shape, Mesh))
    return replace(model, visuals=(*kept, *bones)), tuple(names)


def _is_there(mesh: Mesh) -> bool:
    return mesh.path is not None and mesh.path.is_file()
