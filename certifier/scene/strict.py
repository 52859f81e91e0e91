"""The model files of a scene are read strictly here, before Drake reads them, and so are the points of its collision meshes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import NoReturn

from certifier.errors import SceneError
from certifier.model import Array, escaped
from certifier.scene.file import SceneFile, directive_files
from certifier.scene.formats.mjcf import Mjcf
from certifier.scene.formats.model_file import ModelFile, Reference
from certifier.scene.formats.sdf import Sdf
from certifier.scene.formats.urdf import Urdf
from certifier.scene.obj import read_points
from certifier.scene.references import resolve

_FORMATS: dict[str, type[ModelFile]] = {".urdf": Urdf, ".sdf": Sdf, ".xml": Mjcf}
_OBJ = ".obj"


class StrictReader:
    """Reads OBJ meshes and the model files that a scene's directives lead to, also through includes. It finds files as Drake does.

    Attributes:
        unlimited: the continuous joints that have limits in a URDF file, where they do not count: Drake's names of model and joint.
    """

    def __init__(self, scene_file: SceneFile) -> None:
        self._packages, self._root = scene_file.packages, scene_file.path.parent.resolve()
        self._points: dict[Path, Array] = {}
        self._models: dict[tuple[type[ModelFile], Path], ModelFile] = {}
        self.unlimited: list[tuple[str, str]] = []

    def points(self, path: Path) -> Array:
        """Returns every vertex of an OBJ file, (k, 3), as written there.

        Raises:
            SceneError: ``scene_model``, with file and line, when the file is not accepted or is a mesh of another kind.
        """
        if path.suffix.lower() != _OBJ:
            raise _not_read(self._name(path))
        path = path.resolve()
        if path not in self._points:
            self._points[path] = read_points(path, self._name(path))
        return self._points[path]

    def check(self, directives: str, name: str) -> None:
        """Checks every model file and every collision mesh that is found.

        What is not found, or is no model, is left to Drake.

        Args:
            directives: a YAML document of Drake Model Directives; its relative paths have no directory of their own to start from.
            name: the document's name for people.

        Raises:
            SceneError: ``scene_model``, with file and line, or ``scene_yaml``.
        """
        documents: list[tuple[str, str, tuple[str, ...], frozenset[Path]]] = [(directives, name, (), frozenset())]
        for text, document, namespace, around in documents:
            for kind, reference, named in directive_files(text, document):
                path, suffix = self._located(reference, [self._root]), _suffix(reference)
                if path is None or path in around:
                    continue
                if path.is_dir():
                    raise SceneError(
                        "scene_model", f"{self._name(path)} is a directory", field="directives", hint="name a model file in it"
                    )
                full = (*namespace, named) if named else namespace
                if kind == "add_directives":
                    documents.append((_text(path, self._name(path)), self._name(path), full, around | {path}))
                elif suffix.lower() == _OBJ:
                    self.points(path)
                elif suffix.lower() in _FORMATS:
                    model = self._check_model(path, _FORMATS[suffix.lower()])
                    if isinstance(model, Urdf):
                        self.unlimited += [("::".join(full), joint.file) for joint in model.unlimited]

    def _check_model(self, path: Path, kind: type[ModelFile]) -> ModelFile:
        """Checks a model and what it includes. MJCF's paths start at the model's directory, SDFormat's in the working directory."""
        waiting, whole = [(path, kind)], (kind, path)
        for file, kind in waiting:
            known = self._models.get((kind, file))
            model = self._models[kind, file] = known or kind(file, self._name(file))
            if isinstance(model, Urdf) and model.unlimited and file != path:
                joint = model.unlimited[0]
                hint = "leave lower and upper out, or write type revolute"
                self._refuse(model, joint, "is a continuous joint, whose limits do not count, and Drake would apply them", hint)
            if known is not None:
                continue
            start = Path.cwd() if kind is Sdf else path.parent
            for include in model.includes:
                found = self._located(include.file, [start])
                if found is None or not found.is_file():
                    hint = "name the model's file; Drake searches where a check cannot"
                    self._refuse(model, include, "is no file that was found", hint)
                if kind is Sdf and _suffix(include.file) not in _FORMATS:
                    self._refuse(model, include, "would be left out by Drake", f"models that can be included end in {', '.join(_FORMATS)}")
                waiting.append((found, _FORMATS[_suffix(include.file)] if kind is Sdf else kind))
            for mesh in model.meshes:
                self._check_mesh(model, mesh, file.parent if kind is not Mjcf else path.parent)
        return self._models[whole]

    def _check_mesh(self, model: ModelFile, mesh: Reference, start: Path) -> None:
        if _suffix(mesh.file).lower() != _OBJ:
            raise _not_read(f"{model.name}:{mesh.line}: {mesh.file[:200]!a}")
        if (path := self._located(mesh.file, [start / directory for directory in model.mesh_directories])) is not None:
            self.points(path)

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
