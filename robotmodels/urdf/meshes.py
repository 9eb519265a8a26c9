"""Finding the mesh files that a URDF names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from os.path import abspath
from pathlib import Path
from urllib.parse import unquote

from ..errors import InvalidValueError, MeshNotFoundError


@dataclass(frozen=True, slots=True)
class MeshFinder:
    """Folders of meshes: nothing outside of these folders and the URDF's package is read."""

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
        for path, folders in candidates:
            if path.is_file() and any(self._holds(folder, path) for folder in folders):
                return path
        if self.package_dirs:
            tried = "; ".join(str(path) for path, _ in candidates) or "nowhere"
            raise MeshNotFoundError(
                f"mesh {filename!r:.200} was not found (looked at {tried:.400}). package_dirs must "
                "name the folders that contain the package's folder, or the mesh."
            )
        return None

    def _holds(self, folder: Path, path: Path) -> bool:
        """Whether a mesh is below a folder; links lead elsewhere only from folders given."""
        if folder in self.package_dirs:
            return Path(abspath(path)).is_relative_to(abspath(folder))
        return path.resolve().is_relative_to(folder.resolve())

    def _candidates(self, filename: str) -> list[tuple[Path, list[Path]]]:
        """Places of a mesh, each with the folders that it may be in."""
        scheme, found, rest = filename.partition("://")
        if not found:
            scheme, rest = "", filename
        if scheme in ("package", "model"):
            package, _, inside = unquote(rest).partition("/")
            paths = []
            for folder in self.package_dirs:
                paths.append((folder / package / inside, [folder]))
                if folder.resolve().name == package:
                    paths.append((folder / inside, [folder]))
            if self.urdf_dir is not None:
                above = (self.urdf_dir, *self.urdf_dir.parents)
                # some files leave the package's name empty: package:///folder/mesh.stl
                paths += [(f / inside, [f]) for f in above if package and f.name == package]
                paths += [(f / inside, self._folders()) for f in above if not package]
            return paths
        path = Path(unquote(rest) if scheme == "file" else rest)
        folders = self._folders()
        if path.is_absolute():
            return [(path, folders)]
        start = [self.urdf_dir] if self.urdf_dir is not None else []
        return [(folder / path, folders) for folder in (*start, *self.package_dirs)]

    def _folders(self) -> list[Path]:
        """Folders whose meshes may be read: those given, the URDF's own and its ROS package."""
        if self.urdf_dir is None:
            return [*self.package_dirs]
        above = (self.urdf_dir, *self.urdf_dir.parents)
        package = next((folder for folder in above if (folder / "package.xml").is_file()), None)
        return [*self.package_dirs, package or self.urdf_dir, self.urdf_dir]
