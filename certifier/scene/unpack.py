"""The child process that reads a stranger's bundle unpacks it here within limits, and checks every file before Drake sees it."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

from certifier.errors import SceneError
from certifier.scene.bundle import INDEX, SMALLER, BundleLimits
from certifier.scene.draft import draft
from certifier.scene.file import read_scene_file
from certifier.scene.macros import XACRO, in_xacro
from certifier.scene.parse import parse_with_meshes
from certifier.scene.references import is_mjcf, is_read, references, resolve
from certifier.scene.robot import MODELS, keep_only, only_scene, packages_in
from certifier.scene.strange_xacro import put, to_expand

_DEPTH = 32
_BELOW = "keep the file below the directory of the model"
_PACK = "make bundles with `ciris scene add`"
_CHUNK = 2**20
_LITTER = {"__MACOSX", ".DS_Store"}
"""A Mac puts these into every zip. They are left out."""


def parse_bundle(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns the document of the bundle's ``scene``, and its ``meshes`` to be drawn. Drake sees the files once they have passed.

    Where models are written in xacro, it returns what is to ``expand`` first, and is then called again, with the expansions.

    Raises:
        SceneError: as :func:`certifier.scene.bundle.load_bundle` says.
    """
    root = Path(payload["root"])
    limits = BundleLimits(**payload["limits"])
    found = root / (payload.get("scene") or unpack(Path(payload["archive"]), root, limits))
    alone = found.is_file() and (found.suffix in (*MODELS, XACRO) or is_mjcf(found))
    if "expanded" in payload:
        put(found, payload["expanded"], alone=alone)
    elif wanted := to_expand(root, found, alone=alone):
        return {"scene": str(found.relative_to(root)), "expand": wanted}
    if alone:
        found = _drafted(root, found, limits)
    else:
        check_bundle(root, found)
    return parse_with_meshes(found)


def _drafted(root: Path, model: Path, limits: BundleLimits) -> Path:
    """Returns the scene file of a robot's model that came without one, as ``ciris scene init`` drafts it.

    Drake sees the model once it has passed with a scene file that has nothing but the model.
    """
    scene = root / f"{(Path(model.stem) if model.suffix == XACRO else model).stem}.yaml"
    packages = packages_in(model, root, limits)
    keep_only(model, root, packages)
    directive = {"add_model": {"name": "model", "file": model.relative_to(root).as_posix()}}
    besides = {"packages": {name: path.relative_to(root).as_posix() for name, path in packages.items() if path.is_relative_to(root)}}
    scene.write_text(json.dumps({"name": "draft", "directives": [directive], **(besides if packages else {})}), encoding="utf-8")
    check_bundle(root, scene)
    scene.write_text(draft(model, [], scene, packages).text, encoding="utf-8")
    return scene


def check_bundle(root: Path, scene: Path) -> None:
    """Checks every file of an unpacked bundle before Drake sees it: known kinds, no entities, no reference out of ``root``.

    A zip of a robot's package has more in it, such as its licence and xacro. What Drake would not read and no file refers to is deleted.

    Raises:
        SceneError: as :func:`certifier.scene.bundle.load_bundle` says.
    """
    scene_file = read_scene_file(scene)
    packages = scene_file.packages
    for name, directory in packages.items():
        _inside(directory, root, f"packages.{name}")
    for model, srdf in scene_file.srdf.items():
        _inside(resolve(srdf, scene.parent, packages), root, f"srdf.{model}")
    files = sorted(file for file in root.rglob("*") if file.is_file() and file.name != INDEX)
    others = {file.resolve(): file for file in files if file != scene and not is_read(file)}
    waiting = [file for file in files if file.resolve() not in others]
    while waiting:
        file = waiting.pop(0)
        waiting += [others.pop(target) for target in _needed(file, root, packages) if target in others]
    for file in others.values():
        file.unlink()


def _needed(file: Path, root: Path, packages: dict[str, Path]) -> list[Path]:
    """Checks a file, and returns the paths that it refers to.

    Raises:
        SceneError: as :func:`check_bundle`.
    """
    where = file.relative_to(root).as_posix()
    if in_xacro(file, where):
        message = f"{where} is written in xacro, and only models that the scene file names are expanded"
        raise SceneError("bundle_file", message, hint="make the bundle with `ciris scene add`, which expands it")
    found = []
    for reference in references(file):
        if is_mjcf(file) and ".." in PurePosixPath(reference).parts:
            raise SceneError("bundle_uri", f"{where}: {reference!r}: .. is not accepted here", hint=_BELOW)
        target = resolve(reference, file.parent, packages)
        _inside(target, root, f"{where}: {reference!r}")
        found.append(target.resolve())
    return list(dict.fromkeys(found))


def _inside(path: Path, root: Path, what: str) -> None:
    if not path.is_relative_to(root):
        raise SceneError("bundle_uri", f"{what} leads out of the bundle", hint="`ciris scene add` packs every file that is needed")


def unpack(bundle: Path, root: Path, limits: BundleLimits) -> str:
    """Writes the zip's files below root, and returns the path of the scene file.

    Raises:
        SceneError: ``bundle_too_large``, ``bundle_zip``, ``bundle_choice``, ``bundle_path``.
    """
    try:
        with zipfile.ZipFile(bundle) as archive:
            entries = archive.infolist()
            if len(entries) > limits.files:
                message = f"the bundle has {len(entries)} files; at most {limits.files} are accepted"
                raise SceneError("bundle_too_large", message, field="bundle", hint=SMALLER)
            left = limits.unpacked_bytes
            for entry in entries:
                left -= _extract(archive, entry, root, left)
        index = root / INDEX
        scene = str(json.loads(index.read_text(encoding="utf-8"))["scene"]) if index.is_file() else only_scene(root)
    except SceneError:
        raise
    except Exception:  # zipfile and the decompressors raise many kinds of error
        message = "this is no zip of a scene, or it cannot be unpacked"
        raise SceneError("bundle_zip", message, field="bundle", hint=_PACK) from None
    _checked_name(scene)
    return scene


def _extract(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, root: Path, left: int) -> int:
    """Writes one entry and returns the number of its bytes.

    An entry of more than ``left`` bytes is refused, whatever size it claims.
    """
    target = root / _checked_name(entry.filename)
    if _LITTER & {*PurePosixPath(entry.filename).parts}:
        return 0
    if entry.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return 0
    if (entry.external_attr >> 16) & 0o170000 not in (0, 0o100000):
        raise SceneError("bundle_path", f"{entry.filename!r} is not a plain file", field="bundle", hint=_PACK)
    target.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with archive.open(entry) as source, target.open("xb") as sink:
        while chunk := source.read(_CHUNK):
            written += len(chunk)
            if written > left:
                message = f"the bundle unpacks to more than is accepted; {entry.filename!r} goes beyond it"
                raise SceneError("bundle_too_large", message, field="bundle", hint=SMALLER)
            sink.write(chunk)
    return written


def _checked_name(name: str) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name or not path.parts:
        raise SceneError("bundle_path", f"{name!r} is not a path inside the bundle", field="bundle", hint=_PACK)
    if len(path.parts) > _DEPTH:
        message = f"{name[:80]!r}... may be nested at most {_DEPTH} directories deep"
        raise SceneError("bundle_path", message, field="bundle", hint=_PACK)
    return name
