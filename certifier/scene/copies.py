"""Where Drake cannot take a model as it is written, it reads a copy, which is written here.

In a copy, references lead to collision meshes that were written to OBJ, and elements that Drake need not read are blank. Every line keeps
its number. A model that needs none of this is read in place.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from certifier.scene.directives import AddedFile, added_by, replaced
from certifier.scene.file import SceneFile
from certifier.scene.formats.mjcf import Mjcf
from certifier.scene.formats.model_file import FileReference, ModelFile
from certifier.scene.formats.places import Place, changed
from certifier.scene.formats.sdf import Sdf
from certifier.scene.macros import XACRO
from certifier.scene.meshes.mesh import Mesh
from certifier.scene.meshes.read import DRAKES, MESHES
from certifier.scene.nodes import read_yaml
from certifier.scene.strict import StrictReader

_DRAWN = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
"""This stands for a mesh of MJCF that is only drawn, where Drake would not read its kind."""
_LEFT_OUT = "they say nothing about where the robot can be"
_Changes = dict[Path, list[tuple[Place, str | None]]]


class Copies:
    """Writes the copies of a scene's files that Drake needs.

    Attributes:
        directives: the document of directives for Drake.
        working_directory: the directory in which Drake has to read the models.
    """

    def __init__(self, scene_file: SceneFile, strict: StrictReader, directory: Path) -> None:
        """Writes the copies into an empty directory, once ``strict`` has checked everything."""
        self._strict, self._directory = strict, directory
        self._originals: dict[Path, Path] = {}
        """The user's files, by the paths of their copies."""
        self._meshes: dict[Path, Path] = {}
        self._models: dict[tuple[Path, Path], Path] = {}
        self._left_out: dict[str, None] = {}
        self.working_directory = strict.working_directory
        self.directives = self._document(scene_file.resolved_directives, scene_file.path.name) or scene_file.resolved_directives

    @property
    def warnings(self) -> list[str]:
        """One line that says which elements were left out, if any were."""
        return [f"left out of the models: {', '.join(sorted(self._left_out))}; {_LEFT_OUT}"] if self._left_out else []

    def original(self, path: Path) -> Path:
        """Returns the user's file that a file stands for, which may be itself."""
        return self._originals.get(path, path)

    def named(self, message: str) -> str:
        """Returns a message of Drake's with the names of the user's files in the place of the copies."""
        for copy, original in self._originals.items():
            name = self._strict.name(original).replace("\\", r"\\")
            message = re.sub(rf"(file:)?/*{re.escape(str(copy))}", name, message)
        return message

    def _document(self, text: str, name: str) -> str | None:
        """Returns a document of directives that names the copies, or None if it names none."""
        added = sorted(added_by(text, name), key=lambda added: added.node.start_mark.index)
        paths = [(self._strict.found(file, name), file) for file in added]
        copies = [self._added(path, file) for path, file in paths]
        if all(copy == path for copy, (path, _) in zip(copies, paths, strict=True)):
            return None
        uris = [json.dumps(f"file://{copy}", ensure_ascii=False) for copy in copies]
        return replaced(text, 0, len(text), [(file.node, uri) for (_, file), uri in zip(paths, uris, strict=True)])

    def _added(self, path: Path, added: AddedFile) -> Path:
        """Returns the file that Drake shall read in the place of one that a directive adds."""
        if added.kind == "add_directives":
            name = self._strict.name(path)
            document = self._document(read_yaml(path, name), name)
            return path if document is None else self._write(path, path.name, document.encode())
        if path.suffix.lower() in MESHES:
            return self._mesh(path)
        return self._model(path, self._strict.kind(path), path.parent)

    def _mesh(self, path: Path) -> Path:
        if path.suffix.lower() == DRAKES:
            return path
        if path not in self._meshes:
            mesh: Mesh = self._strict.mesh(path)
            self._meshes[path] = self._write(path, f"{path.stem}{DRAKES}", mesh.obj().encode())
        return self._meshes[path]

    def _model(self, path: Path, kind: type[ModelFile], added: Path) -> Path:
        """Returns the file that Drake shall read in the place of a model file.

        Args:
            added: the directory of the model that the directive adds. Drake looks there for files.
        """
        if (path, added) not in self._models:
            model = self._strict.model(path, kind)
            changes = self._changes(model, path, added)
            apart = any(changes.values()) or self._strict.adapted(path)
            self._models[path, added] = self._copied(model, path, changes, added) if apart else path
        return self._models[path, added]

    def _changes(self, model: ModelFile, path: Path, added: Path) -> _Changes:
        """Returns what has to be changed in the files of a model."""
        changes: _Changes = {source: [] for source in model.sources}
        for name, source, place in model.left_out:
            changes[source].append((place, None))
            self._left_out[name] = None
        for mesh in model.meshes:
            found = self._located(model, mesh, path.parent)
            if found is not None and (copy := self._mesh(found)) != found:
                changes[mesh.source].append((mesh.place, str(copy)))
        for include in model.includes:
            found = self._strict.included(model, include, path.parent)
            if (copy := self._model(found, self._strict.kind(found), added)) != found:
                changes[include.source].append((include.place, f"file://{copy}"))
        if isinstance(model, Mjcf):
            for drawn in model.drawn:
                if Path(drawn.file).suffix.lower() != DRAKES:
                    changes[drawn.source].append((drawn.place, str(self._stand_in())))
        return changes

    def _copied(self, model: ModelFile, path: Path, changes: _Changes, added: Path) -> Path:
        taken = {(source, place) for source, found in changes.items() for place, _ in found}
        for reference in (*model.meshes, *model.drawn, *model.includes):
            if (reference.source, reference.place) not in taken and "://" not in reference.file.removeprefix("file://"):
                absolute = self._absolute(model, reference, path, added)
                changes[reference.source].append((reference.place, absolute))
        if isinstance(model, Mjcf):
            return self._tree(model, path, changes)
        name = path.name
        if path.suffix.lower() == XACRO:
            name = f"{path.name.partition('.')[0] or 'model'}{'.sdf' if isinstance(model, Sdf) else '.urdf'}"
        return self._write(path, name, changed(model.sources[path], changes[path]))

    def _tree(self, model: Mjcf, path: Path, changes: _Changes) -> Path:
        """Writes all files of an MJCF model, and returns the first one."""
        copies = {source: self._place(source, source.name) for source in model.sources}
        for reference, source in model.parts:
            changes[reference.source].append((reference.place, str(copies[source])))
        for source, copy in copies.items():
            copy.write_bytes(changed(model.sources[source], changes[source]))
        return copies[path]

    def _absolute(self, model: ModelFile, reference: FileReference, path: Path, added: Path) -> str:
        """Returns the absolute path of a reference that is relative or absolute."""
        if isinstance(model, Mjcf):
            return str(self._located(model, reference, path.parent) or path.parent / model.mesh_directories[-1] / reference.file)
        file = reference.file.removeprefix("file://")
        if reference in model.includes:
            return f"file://{self._strict.included(model, reference, path.parent)}"
        return str(added / file)

    def _located(self, model: ModelFile, reference: FileReference, start: Path) -> Path | None:
        return self._strict.located(reference.file, [start / directory for directory in model.mesh_directories])

    def _stand_in(self) -> Path:
        path = self._directory / "drawn.obj"
        if not path.exists():
            path.write_text(_DRAWN)
        return path

    def _write(self, original: Path, name: str, content: bytes) -> Path:
        path = self._place(original, name)
        path.write_bytes(content)
        return path

    def _place(self, original: Path, name: str) -> Path:
        """Returns a path of the given name for the copy of a file."""
        directory = self._directory / str(len(self._originals))
        directory.mkdir()
        self._originals[directory / name] = original
        return directory / name
