"""A scene file is read into a Scene here. Drake reads the models in a child process, which may crash."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from certifier.errors import CirisError, SceneError
from certifier.isolation.child import run_in_child
from certifier.isolation.confinement import Confinement
from certifier.scene.file import existing, read_scene_file

if TYPE_CHECKING:  # The command packs scene files without numpy, which the model needs.
    from certifier.model import Scene

TIMEOUT_S, MEMORY_BYTES = 60.0, 4 * 2**30
DECOMPOSE_S = 120.0
"""Decomposing one mesh may take this many seconds."""


def load_scene(path: str | Path, *, timeout_s: float = TIMEOUT_S, memory_bytes: int = MEMORY_BYTES) -> Scene:
    """Returns the scene that a scene file describes. A child process reads it, and may die without harm.

    Args:
        path: the scene file (docs/scenes.md); relative paths in it start at its directory.
        timeout_s: wall-clock limit of the child, seconds, besides ``DECOMPOSE_S`` for every mesh that is decomposed.
        memory_bytes: memory limit of the child, bytes.

    Raises:
        SceneError: what is wrong and where; ``scene_model_crash`` when reading the models ended the child.
    """
    from certifier.model import Scene

    path = existing(path)
    timeout_s += DECOMPOSE_S * len(read_scene_file(path).decompose)
    document = read_in_child("certifier.scene.parse:parse", {"path": str(path)}, path.name, timeout_s, memory_bytes)
    return Scene.from_document(document)


def read_in_child(
    function: str, payload: dict[str, Any], name: str, timeout_s: float, memory_bytes: int, strange: str | None = None
) -> dict[str, Any]:
    """Returns the document that a function returns in a child process.

    The function gets the payload and, as its ``scratch``, the path of an empty directory for its files. It writes only there.

    Args:
        name: name of what is read, for people.
        strange: the directory of a stranger's files; the child reads and writes only there, and its scratch is in it. None: it may read
            every file, for models may be anywhere.

    Raises:
        SceneError: whatever the function raises, or ``scene_model_crash``.
    """
    try:
        with tempfile.TemporaryDirectory(dir=strange, prefix="ciris-") as scratch:  # it goes even if the child is killed
            call, confinement = {**payload, "scratch": scratch}, Confinement(strange or scratch, strange is not None)
            document: dict[str, Any] = run_in_child(function, call, timeout_s=timeout_s, memory_bytes=memory_bytes, confinement=confinement)
    except SceneError:
        raise
    except CirisError as death:
        message = f"reading the models of {name} failed: {death.message}"
        hint = (
            "look for files that include themselves, broken shapes or meshes, and meshes that take long to decompose; where time ran out, "
            "try again when the machine has less to do"
        )
        raise SceneError("scene_model_crash", message, field="directives", hint=hint) from None
    return document
