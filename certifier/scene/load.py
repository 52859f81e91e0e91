"""From a scene file to a Scene, with Drake at arm's length."""

from __future__ import annotations

from pathlib import Path

from certifier.child import run_in_child
from certifier.errors import CirisError, SceneError
from certifier.model import Scene


def load_scene(path: str | Path, *, bundle_root: Path | None = None, timeout_s: float = 60, memory_bytes: int = 4 * 2**30) -> Scene:
    """The scene that a scene file describes, read by a child process that may die without harm.

    Args:
        path: the scene file (docs/architecture.md); relative paths in it start at its directory.
        bundle_root: the directory that no file may refer out of, when the files come from a stranger.
        timeout_s: wall-clock limit of the child, seconds.
        memory_bytes: memory limit of the child.

    Raises:
        SceneError: what is wrong and where; ``scene_model_crash`` when reading the models ended the child.
    """
    path = Path(path).absolute()
    if not path.is_file():
        raise SceneError("scene_not_found", f"there is no scene file {path}")
    payload = {"path": str(path), "bundle_root": None if bundle_root is None else str(bundle_root)}
    try:
        document = run_in_child(
            "certifier.scene.parse:parse",
            payload,
            timeout_s=timeout_s,
            memory_bytes=memory_bytes,
            directory=path.parent,  # where SDFormat looks for included files
        )
    except SceneError:
        raise
    except CirisError as death:
        message = f"reading the models of {path.name} failed: {death.message}"
        hint = "look for files that include themselves, broken shapes or meshes"
        raise SceneError("scene_model_crash", message, field="directives", hint=hint) from None
    return Scene.from_document(document)
