"""A zip without a scene file is taken for the robot whose model it has: which model that is, and where its packages are."""

from __future__ import annotations

import itertools
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from certifier.errors import SceneError
from certifier.names import escaped
from certifier.scene.bundle import BundleLimits
from certifier.scene.draft import beside_model
from certifier.scene.packages import packages_of, places_of, taken_from
from certifier.scene.references import is_mjcf, mjcf_references, references, resolve

SCENE_FILE = "scene.yaml"
"""A zip without an index has its scene in this file."""
MODELS = (".urdf", ".sdf", ".mjcf")
"""A zip without a scene file is taken for the robot whose model it has."""
_IN_XACRO = (".urdf.xacro", ".sdf.xacro")
"""Without one of these, it is taken for that whose model in xacro it has. Macros for such models have other names."""
_XML = ".xml"
"""MuJoCo's models mostly end so, and much else does."""
_DIRECTIVES = re.compile(rb"""(?:^|[\s{,])["']?directives["']?\s*:""")
"""A scene file has this key. Other YAML, such as the limits of a robot's joints, has not."""
_MUJOCO = re.compile(rb"<mujoco[\s>]")
_NAMED = 3
"""At most this many files are named where there are several."""


def only_scene(root: Path) -> str:
    """Returns the path of the scene file in a zip that somebody made of a directory, which names none; or of the only model there is.

    Raises:
        SceneError: ``bundle_zip`` where there is none, ``bundle_choice`` where there are several.
    """
    written = list(root.rglob("*.yaml"))
    found = [file for file in written if file.name == SCENE_FILE] or [file for file in written if _DIRECTIVES.search(file.read_bytes())]
    found = found or _models(root) or (written if len(written) == 1 else [])
    if not found and any(root.rglob("*.xacro")):
        hint = f"give the robot's model a name that ends in {' or '.join(_IN_XACRO)}, or name it in bundle.json"
        raise SceneError("bundle_zip", "the zip has no scene file, and no model of a robot but macros in xacro", field="bundle", hint=hint)
    if not found:
        hint = f"add a {SCENE_FILE}, or a robot's model: {', '.join(MODELS)}"
        raise SceneError("bundle_zip", "the zip has no scene file, and no model of a robot", field="bundle", hint=hint)
    if len(found) > 1:
        names = sorted(escaped(file.relative_to(root).as_posix())[:100] for file in found)
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        message = f"the zip has {len(names)} files that may be the scene file or the robot's model: {', '.join(names[:_NAMED])}{more}"
        hint = f'say which one in a file bundle.json, as in {{"scene": "{names[0]}"}}, or leave one of them in the zip'
        raise SceneError("bundle_choice", message, field="bundle", hint=hint)
    return found[0].relative_to(root).as_posix()


def _models(root: Path) -> list[Path]:
    """Returns the models, of the first kind that there is. One that another of them includes is a part of that one."""
    found = next((some for kind in MODELS if (some := list(root.rglob(f"*{kind}")))), [])
    found = found or [file for file in root.rglob(f"*{_XML}") if _MUJOCO.search(file.read_bytes())]
    found = found or [file for kind in _IN_XACRO for file in root.rglob(f"*{kind}")]
    parts = {(file.parent / reference).resolve() for file in found for reference in references(file) if "://" not in reference}
    return [file for file in found if file.resolve() not in parts] or found


def packages_in(model: Path, root: Path, limits: BundleLimits) -> dict[str, Path]:
    """Returns where the packages are that a model names, in a zip that was unpacked below ``root``.

    A zip may have only a part of a package, or have it under another name. Then the package is where all files are that the model takes
    from it. Where that begins below the package's own directory, the files are copied into such directories.

    Raises:
        SceneError: ``scene_package``; ``bundle_too_large`` where the copies would have more bytes or files than a zip may have.
    """
    given: dict[str, Path] = {}
    copies = _Copies(root, limits.unpacked_bytes, limits.files)
    for name, files in taken_from(model).items():
        if not any(place.is_dir() for place in places_of(name, model, {})):
            given[name] = _lent(name, files, model, root, copies)
    return packages_of(model, given, {}, {}, root)[0]


def _lent(name: str, files: list[str], model: Path, root: Path, copies: _Copies) -> Path:
    above = [place for place in model.parents if place.is_relative_to(root)]
    paths = [[part for part in file.split("/") if part not in ("", ".")] for file in files]
    climbs = any(".." in path for path in paths)  # nobody learns which files this machine has
    for left in range(0 if climbs else min(map(len, paths))):
        head = paths[0][:left]
        for place in above:
            if all(path[:left] == head and place.joinpath(*path[left:]).is_file() for path in paths):
                return copies.make(head, place, ["/".join(path) for path in paths]) if head else place
    count = f"{len(files)} files" if len(files) > 1 else "a file"
    there = (not climbs and any(place.joinpath(*path).is_file() for place in above) for path in paths)
    missing = next((file for file, known in zip(files, there, strict=True) if not known), files[0])
    message = f"{model.name} takes {count} from the package {name}, and the zip has no {escaped(missing)[:200]}"
    hint = f"make the zip of the folder that has the model and these files, or put the package into it, as a folder {name}"
    raise SceneError("scene_package", message, hint=hint)


@dataclass
class _Copies:
    """Makes packages of files that lie elsewhere in a zip. The process that unpacks may make no links.

    Attributes:
        bytes, files: all copies together may have this many.
    """

    root: Path
    bytes: int
    files: int

    def make(self, head: list[str], place: Path, files: list[str]) -> Path:
        """Returns a new directory below the root. In it ``head`` has the files that begin so, and what they refer to, as in ``place``.

        Raises:
            SceneError: ``bundle_too_large``.
        """
        package = next(path for k in itertools.count() if not (path := self.root / f"package-{k}").exists())
        inside = package.joinpath(*head)
        waiting = [place.joinpath(*file.split("/")[len(head) :]) for file in files]
        copied = set[Path]()
        while waiting:
            file = waiting.pop().resolve()
            if file in copied or not file.is_file() or not file.is_relative_to(place.resolve()):
                continue
            copied.add(file)
            self._count(file)
            copy = inside / file.relative_to(place.resolve())
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
            waiting += [file.parent / reference for reference in references(file) if "://" not in reference]
        return package

    def _count(self, file: Path) -> None:
        self.bytes -= file.stat().st_size
        self.files -= 1
        if self.bytes < 0 or self.files < 0:
            hint = "put the packages into the zip under their own names"
            raise SceneError("bundle_too_large", "the model takes the same files from too many packages", field="bundle", hint=hint)


def keep_only(model: Path, root: Path, packages: dict[str, Path]) -> None:
    """Deletes what the model does not use, such as models of other robots and settings of programs.

    Raises:
        SceneError: as :func:`certifier.scene.references.references` and :func:`certifier.scene.references.resolve`.
    """
    semantics = beside_model(model)
    waiting, used = [model, *([semantics] if semantics else [])], set[Path]()
    while waiting:
        file = waiting.pop().resolve()
        if file not in used and file.is_file() and file.is_relative_to(root):
            used.add(file)
            waiting += _used(file, packages)
    for file in root.rglob("*"):
        if file.is_file() and file.resolve() not in used:
            file.unlink()


def _used(file: Path, packages: dict[str, Path]) -> Iterator[Path]:
    yield from (resolve(reference, file.parent, packages) for reference in references(file))
    if is_mjcf(file):
        yield from mjcf_references(file, packages)
