"""This module turns what users type and the files they name into numbers."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import yaml

from certifier.errors import CirisError, RegionError
from certifier.model import Array, Polytope

_NPZ = "np.savez(FILE, C=C, d=d) writes one"
_LIST = "joint positions, separated by commas"


def configuration(text: str, field: str = "--q") -> list[float]:
    """Returns the numbers of a text such as ``"0, 0.3, -1.8"``.

    Raises:
        RegionError: bad_number, naming the place.
    """
    values = []
    for i, part in enumerate(text.replace(",", " ").split()):
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise RegionError("bad_number", f"{part!r} is not a finite number", field=f"{field}[{i}]", hint=_LIST)
        values.append(value)
    if not values:
        raise RegionError("bad_number", "no numbers were given", field=field, hint=_LIST)
    return values


def is_scene_file(scene: str) -> bool:
    """Says whether the user means a file, and not a name or id that the service knows."""
    return scene.endswith((".yaml", ".yml")) or "/" in scene


def seed_file(scene: str | Path) -> Path:
    """Returns where the seed of a scene file is: seed.yaml beside scene.yaml, and NAME.seed.yaml beside NAME.yaml."""
    path = Path(scene)
    return path.with_name("seed.yaml" if path.stem == "scene" else f"{path.stem}.seed.yaml")


def seed_of(scene: str, q: str | None) -> list[float]:
    """Returns the seed configuration: ``q``, or the ``q`` of the scene file's seed file.

    Raises:
        CirisError: scene_not_found for a scene file that does not exist; seed_missing; seed_file.
        RegionError: bad_number.
    """
    if q is not None:
        return configuration(q)
    if is_scene_file(scene) and not Path(scene).is_file():
        raise CirisError("scene_not_found", f"there is no scene file {scene}", field="SCENE")
    path = seed_file(scene if is_scene_file(scene) else "scene.yaml")
    if not is_scene_file(scene) or not path.is_file():
        raise CirisError("seed_missing", "no seed was given", field="--q", hint=f"or put q into {path.name} beside the scene file")
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        return configuration(" ".join(str(float(value)) for value in document["q"]), field=f"{path}: q")
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError, ValueError) as error:
        raise CirisError("seed_file", f"{path} holds no list of numbers called q: {error}".splitlines()[0], field="--q") from None


@dataclass(frozen=True)
class PolytopeFile:
    """Holds a polytope in s, without the joint limits, and optionally a point inside, (n,), in s."""

    polytope: Polytope
    center: Array | None


def polytope_file(path: str) -> PolytopeFile:
    """Reads C, d and optionally center from an npz, JSON or YAML file. A region that was exported as JSON will do as well.

    Raises:
        RegionError: polytope_file, polytope_shape, or as :meth:`Polytope.given`.
    """
    suffix = Path(path).suffix.lower()
    try:
        content = _arrays(path) if suffix == ".npz" else _document(path) if suffix in (".json", ".yaml", ".yml") else None
    except FileNotFoundError:
        raise RegionError("polytope_file", f"there is no file {path}", field="--polytope") from None
    except (OSError, ValueError, TypeError, BadZipFile, EOFError, yaml.YAMLError, RecursionError):
        kind = "npz" if suffix == ".npz" else suffix[1:].upper()
        raise RegionError("polytope_file", f"{path} is no {kind} file of numbers", field="--polytope", hint=_NPZ) from None
    if content is None:
        raise RegionError("polytope_file", f"{path} is neither .npz nor .json nor .yaml", field="--polytope", hint=_NPZ)
    missing = {"C", "d"} - content.keys()
    if missing:
        raise RegionError("polytope_file", f"{path} has no array {' and no array '.join(sorted(missing))}", field="--polytope")
    polytope, center = Polytope.given(content["C"], content["d"], field="--polytope"), content.get("center")
    if center is not None and not (center.shape == polytope.C.shape[1:] and np.isfinite(center).all()):
        raise RegionError(
            "polytope_shape", f"center must be {polytope.C.shape[1]} finite numbers, as many as C has columns", field="--polytope"
        )
    return PolytopeFile(polytope, center)


def _arrays(path: str) -> dict[str, Array]:
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name].astype(float, casting="same_kind") for name in arrays.files if name in ("C", "d", "center")}


def _document(path: str) -> dict[str, Array]:
    text = Path(path).read_text(encoding="utf-8")
    document: Any = json.loads(text) if path.lower().endswith(".json") else yaml.safe_load(text)
    if not isinstance(document, dict):
        raise TypeError("not a mapping")
    names = {"C": ("C", "halfspace_normals"), "d": ("d", "halfspace_offsets"), "center": ("center", "interior_point")}
    found = {name: next((document[key] for key in keys if key in document), None) for name, keys in names.items()}
    return {name: np.array(value, dtype=float) for name, value in found.items() if value is not None}
