"""This module finds the seed of a scene file."""

from __future__ import annotations

import re
from pathlib import Path

from certifier.errors import CirisError
from certifier.scene.file import existing
from client.inputs import Given, configuration, is_scene_file
from client.number_files import UNREADABLE, NotNumbers, checked, document_of


def seed_file(scene: str | Path) -> Path:
    """Returns where the seed of a scene file is: seed.yaml beside scene.yaml, and NAME.seed.yaml beside NAME.yaml."""
    path = Path(scene)
    return path.with_name("seed.yaml" if path.stem == "scene" else f"{path.stem}.seed.yaml")


def seed_of(scene: str, q: str | None) -> Given:
    """Returns the seed configuration: ``q``, or the ``q`` of the scene file's seed file. Either may name configurations.

    Raises:
        CirisError: scene_not_found for a scene file that is not there; seed_missing; seed_file.
        RegionError: bad_number.
    """
    if q is not None:
        return configuration(q)
    if is_scene_file(scene):
        existing(scene)
    path = seed_file(scene if is_scene_file(scene) else "scene.yaml")
    if not is_scene_file(scene) or not path.is_file():
        hint = f"give one, or put q into {path.name} beside the scene file"
        raise CirisError("seed_missing", "no seed was given", field="--q", hint=hint)
    try:
        written = document_of(path)["q"]
        if isinstance(written, str):
            return configuration(written, f"{path}: q")
        return [float(value) for value in checked(written, "q")]
    except NotNumbers as error:
        raise CirisError("seed_file", str(error), field=str(path), hint="write q: [0, 0.3] into it, one number for each joint") from None
    except (*UNREADABLE, KeyError):
        hint = "write q: [0, 0.3] into it, one number for each joint"
        raise CirisError("seed_file", "it holds no list of numbers called q", field=str(path), hint=hint) from None


def place_of_seed(field: str | None, scene: str, q: str | None) -> str | None:
    """Returns the place of an error in a request about a seed: where the seed was not given as ``q``, its file has the place."""
    if q is not None or not field or not re.match(r"seed\.q(?![\w.])", field):
        return field
    return f"{seed_file(scene)}: {field.removeprefix('seed.')}"
