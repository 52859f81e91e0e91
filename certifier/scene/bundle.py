"""A scene as one file: a zip of the scene file and everything it refers to, for sending to a service.

``bundle.json`` names the scene file; all paths in the zip are relative to one directory that holds every file.
"""

from __future__ import annotations

import io
import json
import os
import tempfile
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from certifier.errors import CirisError, SceneError
from certifier.model import Scene
from certifier.scene.file import read_scene_file
from certifier.scene.load import read_in_child
from certifier.scene.references import references, resolve

_INDEX = "bundle.json"
_EPOCH = (1980, 1, 1, 0, 0, 0)
_DEPTH = 32
_CHUNK = 2**20


@dataclass(frozen=True)
class BundleLimits:
    """What a service accepts: bytes of the zip and of its content, number of files, seconds and bytes of memory to parse it."""

    bytes: int = 64 * 2**20
    unpacked_bytes: int = 256 * 2**20
    files: int = 1000
    timeout_s: float = 60
    memory_bytes: int = 4 * 2**30


def pack_bundle(path: str | Path) -> bytes:
    """The scene file and every file it refers to, directly or through others, as a zip; equal files give equal bytes.

    A file that is referred to but does not exist is left out: whoever loads the bundle gets Drake's word on it.

    Raises:
        SceneError: the scene file is wrong, or a reference cannot travel (``bundle_uri``).
    """
    scene_file = read_scene_file(Path(path).resolve())
    files = {scene_file.path}
    waiting = [resolve(model, scene_file.path.parent, scene_file.packages) for model in scene_file.models]
    while waiting:
        file = waiting.pop()
        if file not in files and file.is_file():
            files.add(file)
            starts = _starts(file, scene_file.path)
            waiting += [resolve(r, start, scene_file.packages) for r in references(file) for start in starts]
    root = Path(os.path.commonpath([f.parent for f in files] + list(scene_file.packages.values())))
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        _write(archive, _INDEX, json.dumps({"scene": scene_file.path.relative_to(root).as_posix()}).encode())
        for directory in sorted(set(scene_file.packages.values()) - {root}):
            _write(archive, f"{directory.relative_to(root).as_posix()}/", b"")
        for file in sorted(files):
            _write(archive, file.relative_to(root).as_posix(), file.read_bytes())
    return data.getvalue()


def load_bundle(data: bytes, limits: BundleLimits | None = None) -> Scene:
    """The scene in a bundle from a stranger: unpacked within limits, checked and parsed, all of it in a child process.

    Raises:
        SceneError: ``bundle_too_large``, ``bundle_zip``, ``bundle_path``, ``bundle_file``, ``bundle_uri``, ``bundle_xml``,
            ``bundle_text``, or what :func:`load_scene` raises.
    """
    limits = limits or BundleLimits()
    if len(data) > limits.bytes:
        raise SceneError("bundle_too_large", f"the bundle has {len(data)} bytes; at most {limits.bytes} are accepted")
    with tempfile.TemporaryDirectory(prefix="ciris-") as directory:
        archive, root = Path(directory).resolve() / "bundle.zip", Path(directory).resolve() / "files"
        archive.write_bytes(data)
        root.mkdir()
        payload = {"archive": str(archive), "root": str(root), "limits": asdict(limits)}
        try:
            return read_in_child("certifier.scene.bundle:parse_bundle", payload, "the bundle", None, limits.timeout_s, limits.memory_bytes)
        except CirisError as error:
            error.message = error.message.replace(f"{root}/", "")
            raise


def parse_bundle(payload: dict[str, Any]) -> dict[str, Any]:
    """The child's side of :func:`load_bundle`: the document of the Scene. Drake is loaded once the files have passed.

    Raises:
        SceneError: as :func:`load_bundle`.
    """
    root = Path(payload["root"])
    scene = root / unpack(Path(payload["archive"]), root, BundleLimits(**payload["limits"]))
    check_bundle(root, scene)
    os.chdir(scene.parent)  # where SDFormat looks for included files
    from certifier.scene.parse import parse

    return parse({"path": str(scene)})


def check_bundle(root: Path, scene: Path) -> None:
    """Check every file of an unpacked bundle before Drake sees it: known kinds, no entities, no reference out of ``root``.

    Raises:
        SceneError: as :func:`load_bundle`.
    """
    packages = read_scene_file(scene).packages
    for name, directory in packages.items():
        _inside(directory, root, f"packages.{name}")
    for file in sorted(f for f in root.rglob("*") if f.is_file() and f.name != _INDEX):
        where = file.relative_to(root).as_posix()
        for reference in references(file):
            if file.suffix.lower() in (".mjcf", ".xml") and ".." in PurePosixPath(reference).parts:
                raise SceneError("bundle_uri", f"{where}: {reference!r}: .. is not accepted here")
            for start in _starts(file, scene):
                _inside(resolve(reference, start, packages), root, f"{where}: {reference!r}")


def _starts(file: Path, scene: Path) -> set[Path]:
    """The directories that a relative reference in ``file`` may start at: its own, and for SDFormat's include the working directory."""
    return {file.parent, scene.parent} if file.suffix.lower() == ".sdf" else {file.parent}


def _inside(path: Path, root: Path, what: str) -> None:
    if not path.is_relative_to(root):
        raise SceneError("bundle_uri", f"{what} leads out of the bundle")


def _write(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, content)


def unpack(bundle: Path, root: Path, limits: BundleLimits) -> str:
    """Write the zip's files below root; the path of the scene file.

    Raises:
        SceneError: ``bundle_too_large``, ``bundle_zip``, ``bundle_path``.
    """
    try:
        with zipfile.ZipFile(bundle) as archive:
            entries = archive.infolist()
            if len(entries) > limits.files:
                raise SceneError("bundle_too_large", f"the bundle has {len(entries)} files; at most {limits.files} are accepted")
            left = limits.unpacked_bytes
            for entry in entries:
                left -= _extract(archive, entry, root, left)
        scene = str(json.loads((root / _INDEX).read_text(encoding="utf-8"))["scene"])
    except SceneError:
        raise
    except Exception as error:  # zipfile and the decompressors raise a dozen kinds
        hint = "make bundles with pack_bundle or `ciris scene add`"
        raise SceneError("bundle_zip", f"this is not a scene bundle: {type(error).__name__}: {error}", hint=hint) from None
    _checked_name(scene)
    return scene


def _extract(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, root: Path, left: int) -> int:
    """Write one entry, unless it has more than ``left`` bytes, whatever it says; the number of its bytes."""
    target = root / _checked_name(entry.filename)
    if entry.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return 0
    if (entry.external_attr >> 16) & 0o170000 not in (0, 0o100000):
        raise SceneError("bundle_path", f"{entry.filename!r} is not a plain file")
    target.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with archive.open(entry) as source, target.open("xb") as sink:
        while chunk := source.read(_CHUNK):
            written += len(chunk)
            if written > left:
                raise SceneError("bundle_too_large", f"the bundle unpacks to more than is accepted; {entry.filename!r} goes beyond it")
            sink.write(chunk)
    return written


def _checked_name(name: str) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name or not path.parts:
        raise SceneError("bundle_path", f"{name!r} is not a path inside the bundle")
    if len(path.parts) > _DEPTH:
        raise SceneError("bundle_path", f"{name[:80]!r}... is nested more than {_DEPTH} directories deep")
    return name
