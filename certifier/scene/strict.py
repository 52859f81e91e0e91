"""The model files of a scene are read strictly here, before Drake reads them, and so are the points of its collision meshes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath
from typing import NoReturn

import numpy as np

from certifier.errors import SceneError
from certifier.names import escaped
from certifier.positions import MAGNITUDE
from certifier.scene.directives import AddedFile, added_by
from certifier.scene.file import SceneFile
from certifier.scene.formats.mjcf import Mjcf
from certifier.scene.formats.model_file import FileReference, MeshReference, ModelFile, Reference
from certifier.scene.formats.sdf import Sdf
from certifier.scene.formats.urdf import Urdf
from certifier.scene.macros import EXPANDED, XACRO, Expander, in_xacro, root_of
from certifier.scene.meshes.mesh import Mesh
from certifier.scene.meshes.read import MESHES, read_mesh
from certifier.scene.nodes import read_yaml
from certifier.scene.paths import beside
from certifier.scene.references import resolve

_FORMATS: dict[str, type[ModelFile]] = {".urdf": Urdf, ".sdf": Sdf, ".xml": Mjcf}
_BY_PACKAGE = "write model://NAME/FILE, and name the directory of the file as NAME under packages in the scene file"
_Read = tuple[Path, type[ModelFile] | None, tuple[str, ...]]
"""A model file and its format; or a file of directives, None, and the namespace of what it adds."""


class StrictReader:
    """Reads the meshes and the model files that a scene's directives lead to, also through includes. It finds files as Drake does.

    Attributes:
        working_directory: the directory in which Drake has to read the models. Relative paths of SDFormat's includes start there.
        unlimited: the continuous joints that have limits in a URDF file, where they do not count: Drake's names of model and joint.
        followers: the joints that mimic another one in a URDF file: Drake's names of model and joint.
    """

    def __init__(self, scene_file: SceneFile) -> None:
        self._packages, self._root = scene_file.packages, Path(os.path.abspath(scene_file.path.parent))
        self._expander = Expander(self._root, scene_file.packages, scene_file.xacro)
        self._expanded: set[Path] = set()
        self.unlimited: list[tuple[str, str]] = []
        self.followers: list[tuple[str, str]] = []
        self._meshes: dict[Path, Mesh] = {}
        self._models: dict[tuple[Path, type[ModelFile]], ModelFile] = {}
        self._counts: dict[_Read, int] = {}
        self._starts: set[Path] = set()

    @property
    def notes(self) -> list[str]:
        """What Drake does not read: that another axis than z of a mesh is up, and SDFormat's <mimic>; one line for each of these."""
        turned = [f"{self.name(path)} ({mesh.up})" for path, mesh in self._meshes.items() if mesh.up]
        more = f" and {len(turned) - 1} more" if len(turned) > 1 else ""
        found = (
            [f"the up_axis of {turned[0]}{more} is not applied, as in RViz and MoveIt; coordinates stay as they stand"] if turned else []
        )
        places = [f"{model.name}:{line}" for model in self._models.values() if isinstance(model, Sdf) for line in model.mimics]
        if places:
            how = "these joints move by themselves, unless fix holds or sweeps them (<drake:mimic> lets them follow)"
            found.append(f"SDFormat's <mimic> in {', '.join(places[:5])} is not read: {how}")
        return found

    @property
    def working_directory(self) -> Path:
        return next(iter(self._starts), self._root)

    def mesh(self, path: Path) -> Mesh:
        """Returns the mesh of a file, as written there.

        Raises:
            SceneError: ``scene_model``, with file and line, when the file is not accepted or is a mesh of another kind.
        """
        if path.suffix.lower() not in MESHES:
            raise _not_read(self.name(path))
        name, path = self.name(path), path.resolve()
        if path not in self._meshes:
            self._meshes[path] = read_mesh(path, name)
        return self._meshes[path]

    def taken(self, path: Path) -> Mesh:
        """Returns the mesh of a file that Drake has taken.

        Raises:
            SceneError: ``scene_model``, when no model and no directive led :meth:`check` to this file.
        """
        if (mesh := self._meshes.get(path.resolve())) is None:
            message = f"Drake has taken another mesh than the models name: {self.name(path)}"
            raise SceneError("scene_model", message, field="directives", hint=_BY_PACKAGE)
        return mesh

    def check(self, directives: str, name: str) -> int:
        """Checks every model file and every collision mesh that is found.

        A mesh that is not found is left to Drake.

        Args:
            directives: a YAML document of Drake Model Directives; its relative paths have no directory of their own to start from.
            name: the document's name for people.

        Returns:
            the number of collision geometries that the models have, those of a file once for each time that it is added or included.

        Raises:
            SceneError: ``scene_model``, with file and line, or ``scene_yaml``.
        """
        count = self._added_by(directives, name, (), ())
        self._expander.check_arguments()
        return count

    def _added_by(self, directives: str, name: str, namespace: tuple[str, ...], around: tuple[_Read, ...]) -> int:
        """Returns the number of collision geometries that a document of directives adds.

        Args:
            namespace: Drake's names of the models begin with it.
            around: the files that led here, from the first to the last.
        """
        return sum(
            self._added(added, name, (*namespace, added.named) if added.named else namespace, around)
            for added in added_by(directives, name)
        )

    def _added(self, added: AddedFile, name: str, named: tuple[str, ...], around: tuple[_Read, ...]) -> int:
        """Returns the number of collision geometries that an ``add_model`` or ``add_directives`` adds under a name or namespace.

        Args:
            name: name of the document, for people.
        """
        path, suffix = self.found(added, name), _suffix(added.file).lower()
        if path.is_dir():
            raise SceneError("scene_model", f"{self.name(path)} is a directory", field="directives", hint="name a model file in it")
        if added.kind == "add_directives":
            name = self.name(path)
            return self._once((path, None, named), around, lambda around: self._added_by(read_yaml(path, name), name, named, around))
        if suffix in MESHES:
            self.mesh(path)
            return 1
        if suffix not in (*_FORMATS, XACRO):
            raise SceneError(
                "scene_model", f"{self.name(path)} is no model", field="directives", hint=f"models end in {', '.join((*_FORMATS, XACRO))}"
            )
        model = self.model(path, self.kind(path))
        if isinstance(model, Urdf):
            self.unlimited += [("::".join(named), joint.file) for joint in model.unlimited]
            self.followers += [("::".join(named), name) for name in model.followers]
        return self._counted(model, path, around)

    def found(self, added: AddedFile, name: str) -> Path:
        """Returns the file that a directive adds. Drake is not asked for one that is not found here."""
        where = f"{name}:{added.line}"
        try:
            if added.file.startswith("file:///"):
                path = beside(Path("/"), added.file.removeprefix("file://"))
            else:
                path = resolve(added.file, self._root, self._packages)
        except SceneError as error:
            raise SceneError("scene_model", f"{where}: {error.message}", field="directives", hint=error.hint) from None
        if not path.exists():
            hint = "a relative path starts at the directory of the scene file, and that of package://NAME/FILE at the package"
            raise SceneError("scene_model", f"{where}: there is no file {self.name(path)}", field="directives", hint=hint)
        return path

    def model(self, file: Path, kind: type[ModelFile]) -> ModelFile:
        """Returns a model file, which is read once."""
        if (file, kind) not in self._models:
            content = self._content(file)  # from now on, the name says whether it is expanded
            self._models[file, kind] = kind(file, self.name(file), content)
        return self._models[file, kind]

    def kind(self, file: Path) -> type[ModelFile]:
        """Returns the format of a model file: what its name says, or its root where it ends in .xacro."""
        suffix = file.suffix.lower()
        if suffix != XACRO:
            return _FORMATS[suffix]
        return Sdf if root_of(self._content(file), self.name(file)) == "sdf" else Urdf

    def _content(self, file: Path) -> bytes:
        """Returns the content of a model file, expanded."""
        if not in_xacro(file, self.name(file)):
            return file.read_bytes()
        content = self._expander.expanded(file, self.name(file))
        self._expanded.add(file)
        return content

    def adapted(self, file: Path) -> bool:
        """Says whether Drake cannot read a model file in place, whatever it holds."""
        return file in self._expanded or file.suffix.lower() == XACRO

    def _counted(self, model: ModelFile, file: Path, around: tuple[_Read, ...]) -> int:
        """Checks the meshes and the includes of a model, and returns how many collision geometries it has with them."""
        added = next((read for read, kind, _ in around if kind is not None), file).parent
        return self._once((file, type(model), (str(added),)), around, lambda around: self._with_includes(model, file, added, around))

    def _with_includes(self, model: ModelFile, file: Path, added: Path, around: tuple[_Read, ...]) -> int:
        """Does the work of :meth:`_counted`; ``added`` is the directory of the model that the directive adds."""
        for mesh in model.meshes:
            self._check_mesh(model, mesh, file.parent, added)
        count = len(model.collisions)
        for include in model.includes:
            found = self.included(model, include, file.parent)
            included = self.model(found, _FORMATS[_suffix(include.file)])
            count += self._counted(included, found, around)
        return count

    def included(self, model: ModelFile, include: FileReference, start: Path) -> Path:
        """Returns the model file that one of a directory includes."""
        found = self.located(include.file, [start])
        if found is None:
            hint = f"a relative path starts at the directory of the model; or {_BY_PACKAGE}"
            self._refuse(model, include, "is no file that was found", hint)
        if not found.is_file():
            self._refuse(model, include, "is a directory", "name the model's file in it")
        self._check_included(model, include, found, start)
        return found

    def _check_included(self, model: ModelFile, include: Reference, found: Path, start: Path) -> None:
        """Refuses what Drake would not read where the model says. It looks for all relative includes of a scene in one directory."""
        if _suffix(include.file) not in _FORMATS:
            self._refuse(model, include, "would be left out by Drake", f"models that can be included end in {', '.join(_FORMATS)}")
        kind, hint = _FORMATS[_suffix(include.file)], "add it by a directive of its own"
        if kind is Mjcf:
            self._refuse(model, include, "is MJCF, which Drake would place in the world and not in the model", hint)
        if kind is Urdf:
            self._refuse(model, include, "is URDF, whose links Drake would place elsewhere if SDFormat includes it", hint)
        if "://" not in include.file:
            self._starts = self._starts or {start}
            if Path(os.path.abspath(self.working_directory / include.file)) != found:
                self._refuse(model, include, "is beside a model for which Drake would look in another directory", _BY_PACKAGE)

    def _once(self, read: _Read, around: tuple[_Read, ...], count: Callable[[tuple[_Read, ...]], int]) -> int:
        """Returns the count of a file, which is read only once."""
        if read in around:
            message = f"{self.name(read[0])} includes itself, or a file that includes it"
            raise SceneError("scene_model", message, field="directives", hint="remove the circle")
        if read not in self._counts:
            self._counts[read] = count((*around, read))
        return self._counts[read]

    def _check_mesh(self, model: ModelFile, mesh: MeshReference, start: Path, added: Path) -> None:
        """Checks a mesh. Drake looks for it from the model that the directive adds, also where an included file names it."""
        if _suffix(mesh.file).lower() not in MESHES:
            raise _not_read(f"{model.name}:{mesh.line}: {mesh.file[:200]!a}")
        if "://" not in mesh.file.removeprefix("file://") and (added / mesh.file).resolve() != (start / mesh.file).resolve():
            self._refuse(model, mesh, "is beside an included model, and Drake would look beside the model that includes it", _BY_PACKAGE)
        if (path := self.located(mesh.file, [start / directory for directory in model.mesh_directories])) is not None:
            reach = float(np.abs(self.mesh(path).points * mesh.scale).max())
            if reach > MAGNITUDE:
                self._refuse(model, mesh, f"has a coordinate of {reach:g} m; at most {MAGNITUDE:g} m is read", "mend the file or the scale")

    def located(self, reference: str, directories: Iterable[Path]) -> Path | None:
        """Returns the file that a reference means in a file of one of the directories, or None where there is none."""
        reference = reference.removeprefix("file://")
        for directory in directories:
            try:
                path = beside(directory, reference) if reference.startswith("/") else resolve(reference, directory, self._packages)
            except SceneError as error:
                if error.code != "bundle_uri":
                    raise
                continue
            if path.exists():
                return path
        return None

    def _refuse(self, model: ModelFile, reference: Reference, what: str, hint: str) -> NoReturn:
        message = f"{model.name}:{reference.line}: {reference.file[:200]!a} {what}"
        raise SceneError("scene_model", message, field="directives", hint=hint)

    def name(self, path: Path) -> str:
        """Returns the name of a file for people."""
        behind = EXPANDED if path in self._expanded else ""
        return escaped(path.relative_to(self._root).as_posix() if path.is_relative_to(self._root) else path.name) + behind


def _suffix(reference: str) -> str:
    return PurePosixPath(reference).suffix


def _not_read(what: str) -> SceneError:
    message = f"{what} is collision geometry, and of that only OBJ, STL and DAE meshes are read"
    hint = "convert it to one of these; meshes that are only drawn may be of another kind"
    return SceneError("scene_model", message, field="directives", hint=hint)
