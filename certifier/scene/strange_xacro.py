"""A stranger's models that are written in xacro are found and replaced by their expansions here, in the process that reads the bundle.

What xacro evaluates is Python. So each is expanded in a process of its own, which ends with it, and this one goes on with the text.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from certifier.errors import SceneError
from certifier.scene.file import for_bundle, read_scene_file
from certifier.scene.macros import check_declared, in_xacro, packages_named, request
from certifier.scene.packages import places_of
from certifier.scene.references import resolve

MOST = 8
"""A bundle may have this many models in xacro."""


def to_expand(root: Path, scene: Path, *, alone: bool) -> list[dict[str, Any]]:
    """Returns what :func:`certifier.scene.expansion.expand` has to be asked, for each model that is written in xacro.

    What is wrong with a file is said by who reads it later.

    Args:
        root: the directory of the bundle's files.
        scene: its scene file; or the model of a robot, where it came ``alone``.

    Raises:
        SceneError: ``bundle_file`` for more models than MOST.
    """
    if alone:
        packages = packages_named(scene, lambda name: _package(name, scene, root)) if _in_xacro(scene) else {}
        return [request(scene, root, packages, {})] if _in_xacro(scene) else []
    scene_file = read_scene_file(scene)
    models = []
    for model in dict.fromkeys(scene_file.models):
        with suppress(SceneError):
            models.append(resolve(model, scene.parent, scene_file.packages))
    wanted = [model for model in dict.fromkeys(models) if model.is_relative_to(root) and _in_xacro(model)]
    if len(wanted) > MOST:
        message = f"the scene has {len(wanted)} models in xacro, and at most {MOST} are expanded"
        raise SceneError("bundle_file", message, hint="make the bundle with `ciris scene add`, which expands them")
    return [request(model, scene.parent, scene_file.packages, scene_file.xacro) for model in wanted]


def put(scene: Path, expanded: dict[str, dict[str, Any]], *, alone: bool) -> None:
    """Writes the expansions in the place of the models, and a scene file without the arguments.

    Args:
        expanded: what :func:`certifier.scene.expansion.expand` has returned, by the path of the model.

    Raises:
        SceneError: ``scene_xacro`` for an argument that no model declares.
    """
    for path, found in expanded.items():
        Path(path).write_text(found["text"], encoding="utf-8")
    if not alone:
        check_declared(read_scene_file(scene).xacro, {name for found in expanded.values() for name in found["declared"]})
        scene.write_text(for_bundle(scene), encoding="utf-8")


def _in_xacro(model: Path) -> bool:
    with suppress(SceneError):
        return model.is_file() and in_xacro(model, model.name)
    return False


def _package(name: str, model: Path, root: Path) -> Path | None:
    return next((place for place in places_of(name, model, {}) if place.is_dir() and place.is_relative_to(root)), None)
