"""A bundle is a scene in one file, to be sent to a service: a zip of the scene file and of everything that it refers to.

``bundle.json`` names the scene file, or a robot's model for which a scene is drafted. A zip without it has one ``scene.yaml``, one YAML
file with directives, or one model. All paths in the zip are relative to one directory that holds every file.
"""

from __future__ import annotations

import io
import json
import os
import tempfile
import time
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from certifier.errors import CirisError, SceneError
from certifier.isolation.child import prepare
from certifier.isolation.confinement import probed
from certifier.scene.file import existing, for_bundle, read_scene_file
from certifier.scene.load import read_in_child
from certifier.scene.macros import EXPAND, MEMORY_BYTES, TIMEOUT_S, Expander, in_xacro
from certifier.scene.references import is_mjcf, mjcf_references, references, resolve

if TYPE_CHECKING:  # The command packs bundles without numpy, which the model needs.
    from certifier.model import Scene

INDEX = "bundle.json"
"""In this file the bundle says which file is the scene file."""
BYTES_A_SECOND = 100_000
"""For every BYTES_A_SECOND bytes of its zip, a bundle may take one second more. What it unpacks to does not count.
"""
SMALLER = "use smaller meshes, or fewer of them"
"""This is what to do about a bundle that is too large."""
_READER = "certifier.scene.unpack:parse_bundle"
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class BundleLimits:
    """Limits what a service accepts.

    Attributes:
        bytes: bytes of the zip.
        unpacked_bytes: bytes of its content.
        files: number of its files.
        timeout_s: seconds that parsing the smallest one may take; a second more for every ``BYTES_A_SECOND`` bytes of the zip.
        longest_s: seconds that parsing any may take.
        memory_bytes: bytes of memory that parsing it may take.
    """

    bytes: int = 64 * 2**20
    unpacked_bytes: int = 256 * 2**20
    files: int = 1000
    timeout_s: float = 20
    longest_s: float = 60
    memory_bytes: int = 4 * 2**30

    def seconds(self, size: int) -> float:
        """Returns how many seconds parsing a zip of ``size`` bytes may take."""
        return min(self.timeout_s + size / BYTES_A_SECOND, self.longest_s)


def pack_bundle(path: str | Path) -> bytes:
    """Returns a zip of the scene file and every file that it refers to, directly or through others; equal files give equal bytes.

    Where the scene file gives a package's absolute path, the bundle has the relative one: the package lies elsewhere there.

    The bundle has the expansion of a model that is written in xacro.

    A file that is referred to but does not exist is left out. Loading the bundle then gives Drake's message about it.

    Raises:
        SceneError: the scene file is wrong, or a reference cannot travel (``bundle_uri``).
    """
    scene_file = read_scene_file(existing(path))
    expander = Expander(scene_file.path.parent, scene_file.packages, scene_file.xacro)
    files, expanded = {scene_file.path}, dict[Path, bytes]()
    waiting = [resolve(model, scene_file.path.parent, scene_file.packages) for model in scene_file.files]
    while waiting:
        file = waiting.pop()
        if file not in files and file.is_file():
            files.add(file)
            if in_xacro(file, file.name):
                expanded[file] = expander.expanded(file, file.name)
            waiting += [resolve(r, file.parent, scene_file.packages) for r in references(file, expanded.get(file))]
            if is_mjcf(file):
                waiting += mjcf_references(file, scene_file.packages)
    expander.check_arguments()
    root = Path(os.path.commonpath([f.parent for f in files] + list(scene_file.packages.values())))
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        _write(archive, INDEX, json.dumps({"scene": scene_file.path.relative_to(root).as_posix()}).encode())
        for directory in sorted(set(scene_file.packages.values()) - {root}):
            _write(archive, f"{directory.relative_to(root).as_posix()}/", b"")
        for file in sorted(files):
            content = for_bundle(file).encode() if file == scene_file.path else expanded.get(file) or file.read_bytes()
            _write(archive, file.relative_to(root).as_posix(), content)
    return data.getvalue()


def expect_bundles() -> None:
    """Begins to load what :func:`load_bundle` needs, without waiting."""
    prepare(_READER)


@dataclass(frozen=True)
class Bundled:
    """What a bundle holds.

    Attributes:
        meshes: the meshes of its models, to be drawn, as :func:`certifier.scene.drawn.document` returns them; None where it has none.
    """

    scene: Scene
    meshes: dict[str, Any] | None


def load_bundle(data: bytes, limits: BundleLimits | None = None) -> Bundled:
    """Returns what a bundle from a stranger holds. A child process unpacks it within limits, checks it and parses it.

    Raises:
        SceneError: ``bundle_too_large``, ``bundle_zip``, ``bundle_choice``, ``bundle_path``, ``bundle_file``, ``bundle_uri``,
            ``bundle_xml``, ``bundle_text``, ``scene_package``, or what :func:`load_scene` raises.
    """
    from certifier.model import Scene

    limits = limits or BundleLimits()
    if len(data) > limits.bytes:
        message = f"the bundle has {len(data)} bytes; at most {limits.bytes} are accepted"
        raise SceneError("bundle_too_large", message, field="bundle", hint=SMALLER)
    with tempfile.TemporaryDirectory(prefix="ciris-") as directory:
        own = Path(directory).resolve()
        archive, root = own / "bundle.zip", own / "files"
        archive.write_bytes(data)
        root.mkdir()
        payload = {"archive": str(archive), "root": str(root), "limits": asdict(limits)}
        try:
            until = time.monotonic() + limits.seconds(len(data))
            found = read_in_child(_READER, payload, "the bundle", _left(until), limits.memory_bytes, str(own))
            if "expand" in found:
                expanded = {one["path"]: _expanded(one, str(own), min(TIMEOUT_S, _left(until))) for one in found["expand"]}
                again = {**payload, "scene": found["scene"], "expanded": expanded}
                found = read_in_child(_READER, again, "the bundle", _left(until), limits.memory_bytes, str(own))
            return Bundled(Scene.from_document(found["scene"]), found["meshes"])
        except CirisError as error:
            error.message = error.message.replace(f"{root}/", "")
            raise


def _left(until: float) -> float:
    """Returns the seconds until then, a little where none are left. All children of one bundle share its time."""
    return max(until - time.monotonic(), 0.1)


def _expanded(wanted: dict[str, Any], own: str, seconds: float) -> dict[str, Any]:
    """Returns the expansion of a stranger's model in xacro, from a process that the kernel confines. What xacro evaluates is Python.

    Raises:
        SceneError: ``scene_xacro``, or ``scene_model_crash``; ``bundle_file`` where the kernel confines no process.
    """
    name, layers = Path(wanted["path"]).name, probed()
    if not (layers.landlock and layers.seccomp):
        message = f"{name} is written in xacro, and this machine cannot keep a stranger's xacro from its files and its network"
        hint = f"expand it, as `xacro {name} > robot.urdf` does, or use `ciris scene init` and `ciris scene add`, which expand it"
        raise SceneError("bundle_file", message, hint=hint)
    return read_in_child(EXPAND, wanted, name, seconds, MEMORY_BYTES, own)


def _write(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, content)
