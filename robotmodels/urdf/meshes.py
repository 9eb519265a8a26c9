"""Finding the mesh files that a URDF names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from ..errors import InvalidValueError, MeshNotFoundError


@dataclass(frozen=True, slots=True)
class MeshFinder:
    """Where to look for meshes."""

    package_dirs: tuple[Path, ...] = ()
    urdf_dir: Path | None = None

    @classmethod
    def of(
        cls, package_dirs: Iterable[str | Path] | str | Path, urdf_dir: Path | None
    ) -> MeshFinder:
        """A finder from what a caller passes: one folder or several."""
        if isinstance(package_dirs, (str, Path)):
            package_dirs = (package_dirs,)
        try:
            return cls(tuple(Path(p) for p in package_dirs), urdf_dir)
        except TypeError:
            raise InvalidValueError(
                f"package_dirs: expected a folder or a list of folders, got {package_dirs!r:.80}."
            ) from None

    def find(self, filename: str) -> Path | None:
        """Locate one mesh."""
        candidates = self._candidates(filename)
        for path in candidates:
            if path.is_file():
                return path
        if self.package_dirs:
            tried = "; ".join(str(path) for path in candidates) or "nowhere"
            raise MeshNotFoundError(
                f"mesh {filename!r} was not found (looked at {tried}). package_dirs must name the "
                "folders that contain the package's folder."
            )
        return None

    def _candidates(self, filename: str) -> list[Path]:
        scheme, found, rest = filename.partition("://")
        if not found:
            scheme, rest = "", filename
        if scheme in ("package", "model"):
            package, _, inside = unquote(rest).partition("/")
            paths = []
            for folder in self.package_dirs:
                paths.append(folder / package / inside)
                if folder.resolve().name == package:
                    paths.append(folder / inside)
            if self.urdf_dir is not None:
                above = (self.urdf_dir, *self.urdf_dir.parents)
                # some files leave the package's name empty: package:///folder/mesh.stl
                paths += [folder / inside for folder in above if package in (folder.name, "")]
            return paths
        path = Path(unquote(rest) if scheme == "file" else rest)
        if path.is_absolute():
            return [path]
        start = [self.urdf_dir] if self.urdf_dir is not None else []
        return [folder / path for folder in (*start, *self.package_dirs)]
