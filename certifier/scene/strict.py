"""The model files of a scene are read strictly here, before Drake reads them, and so are the points of its collision meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath
from typing import NoReturn

from certifier.errors import SceneError
from certifier.model import escaped
from certifier.scene.file import SceneFile, directive_files
from certifier.scene.formats.mjcf import Mjcf
from certifier.scene.formats.model_file import ModelFile, Reference
from certifier.scene.formats.sdf import Sdf
from certifier.scene.formats.urdf import Urdf
from certifier.scene.obj import ObjMesh, read_mesh
from certifier.scene.references import resolve

_FORMATS: dict[str, type[ModelFile]] = {".urdf": Urdf, ".sdf": Sdf, ".xml": Mjcf}
_OBJ = ".obj"
_BY_PACKAGE = "write model://NAME/FILE, and name the directory of the file as NAME under packages in the scene file"
_Read = tuple[Path, type[ModelFile] | None, Path | None]
"""A file, the format that it is read in, and the directory at which its paths start; directives have neither."""


class StrictReader:
    """Reads OBJ meshes and the model files that a scene's directives lead to, also through includes. It finds files as Drake does.

    Attributes:
        working_directory: the directory in which Drake has to read the models. Relative paths of SDFormat's includes start there.
    """

    def __init__(self, scene_file: SceneFile) -> None:
        self._packages, self._root = scene_file.packages, scene_file.path.parent.resolve()
        self._meshes: dict[Path, ObjMesh] = {}
        self._counts: dict[_Read, int | None] = {}
        self._starts: set[Path] = set()

    @property
    def working_directory(self) -> Path:
        return next(iter(self._starts), self._root)

    def mesh(self, path: Path) -> ObjMesh:
        """Returns the mesh of an OBJ file, as written there.

        Raises:
            SceneError: ``scene_model``, with file and line, when the file is not accepted or is a mesh of another kind.
        """
        if path.suffix.lower() != _OBJ:
            raise _not_read(self._name(path))
        path = path.resolve()
        if path not in self._meshes:
            self._meshes[path] = read_mesh(path, self._name(path))
        return self._meshes[path]

    def check(self, directives: str, name: str) -> int | None:
        """Checks every model file and every collision mesh that is found.

        What is not found, or is no model, is left to Drake.

        Args:
            directives: a YAML document of Drake Model Directives; its relative paths have no directory of their own to start from.
            name: the document's name for people.

        Returns:
            the number of collision geometries that the models have, those of a file once for each time that it is added or included; None
            where a format does not count them.

        Raises:
            SceneError: ``scene_model``, with file and line, or ``scene_yaml``.
        """
        return _sum(self._added(kind, reference, ()) for kind, reference in directive_files(directives, name))

    def _added(self, kind: str, reference: str, around: tuple[_Read, ...]) -> int | None:
        """Returns the number of collision geometries that an ``add_model`` or ``add_directives`` adds."""
        path, suffix = self._located(reference, [self._root]), _suffix(reference).lower()
        if path is None:
            return 0
        if path.is_dir():
            raise SceneError("scene_model", f"{self._name(path)} is a directory", field="directives", hint="name a model file in it")
        if kind == "add_directives":
            return self._once((path, None, None), around, lambda around: self._added_by(path, around))
        if suffix == _OBJ:
            self.mesh(path)
            return 1
        return self._model(path, _FORMATS[suffix], path.parent, around) if suffix in _FORMATS else None

    def _added_by(self, path: Path, around: tuple[_Read, ...]) -> int | None:
        name = self._name(path)
        return _sum(self._added(kind, reference, around) for kind, reference in directive_files(_text(path, name), name))

    def _model(self, file: Path, kind: type[ModelFile], start: Path, around: tuple[_Read, ...]) -> int | None:
        """Checks a model and what it includes, and returns how many collision geometries these have.

        Args:
            start: the directory of the model that was added. MJCF's paths start there, and those of the other formats beside their file.
        """
        start = start if kind is Mjcf else file.parent
        return self._once((file, kind, start), around, lambda around: self._model_and_includes(file, kind, start, around))

    def _model_and_includes(self, file: Path, kind: type[ModelFile], start: Path, around: tuple[_Read, ...]) -> int | None:
        model = kind(file, self._name(file))
        for mesh in model.meshes:
            self._check_mesh(model, mesh, start)
        found = [
            (self._included(model, include, start), kind if kind is Mjcf else _FORMATS[_suffix(include.file)]) for include in model.includes
        ]
        included = [self._model(path, of, start, around) for path, of in found]
        return _sum([None if model.collisions is None else len(model.collisions), *included])

    def _included(self, model: ModelFile, include: Reference, start: Path) -> Path:
        found = self._located(include.file, [start])
        if found is None:
            hint = f"a relative path starts at the directory of the model; or {_BY_PACKAGE}"
            self._refuse(model, include, "is no file that was found", hint)
        if not found.is_file():
            self._refuse(model, include, "is a directory", "name the model's file in it")
        if isinstance(model, Sdf):
            self._check_included(model, include, found, start)
        return found

    def _check_included(self, model: Sdf, include: Reference, found: Path, start: Path) -> None:
        """Refuses what Drake would not read where the model says. It looks for all relative includes of a scene in one directory."""
        if _suffix(include.file) not in _FORMATS:
            self._refuse(model, include, "would be left out by Drake", f"models that can be included end in {', '.join(_FORMATS)}")
        if _FORMATS[_suffix(include.file)] is Mjcf:
            self._refuse(
                model, include, "is MJCF, which Drake would place in the world and not in the model", "add it by a directive of its own"
            )
        if "://" not in include.file:
            self._starts = self._starts or {start}
            if (self.working_directory / include.file).resolve() != found:
                self._refuse(model, include, "is beside a model for which Drake would look in another directory", _BY_PACKAGE)

    def _once(self, read: _Read, around: tuple[_Read, ...], count: Callable[[tuple[_Read, ...]], int | None]) -> int | None:
        """Returns the count of a file, which is read only once."""
        if read in around:
            message = f"{self._name(read[0])} includes itself, or a file that includes it"
            raise SceneError("scene_model", message, field="directives", hint="remove the circle")
        if read not in self._counts:
            self._counts[read] = count((*around, read))
        return self._counts[read]

    def _check_mesh(self, model: ModelFile, mesh: Reference, start: Path) -> None:
        if _suffix(mesh.file).lower() != _OBJ:
            raise _not_read(f"{model.name}:{mesh.line}: {mesh.file[:200]!a}")
        if (path := self._located(mesh.file, [start / directory for directory in model.mesh_directories])) is not None:
            self.mesh(path)

    def _located(self, reference: str, directories: Iterable[Path]) -> Path | None:
        reference = reference.removeprefix("file://")
        for directory in directories:
            try:
                path = Path(reference).resolve() if reference.startswith("/") else resolve(reference, directory, self._packages)
            except SceneError:
                continue
            if path.exists():
                return path
        return None

    def _refuse(self, model: ModelFile, reference: Reference, what: str, hint: str) -> NoReturn:
        message = f"{model.name}:{reference.line}: {reference.file[:200]!a} {what}"
        raise SceneError("scene_model", message, field="directives", hint=hint)

    def _name(self, path: Path) -> str:
        return escaped(path.relative_to(self._root).as_posix() if path.is_relative_to(self._root) else path.name)


def _suffix(reference: str) -> str:
    return PurePosixPath(reference).suffix


def _not_read(what: str) -> SceneError:
    hint = "convert it to OBJ; meshes that are only drawn may be of another kind"
    return SceneError("scene_model", f"{what} is collision geometry, and of that only OBJ meshes are read", field="directives", hint=hint)


def _text(path: Path, name: str) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise SceneError("scene_yaml", f"{name} cannot be read as UTF-8 text", field="directives", hint="is it a YAML file?") from None


def _sum(counts: Iterable[int | None]) -> int | None:
    """Returns the sum of counts, or None where one is not known. Every count is asked for."""
    known = list(counts)
    return None if None in known else sum(count or 0 for count in known)
