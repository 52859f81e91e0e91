"""The named instances of catalogue.yaml: a pair of bodies on a polytope, with the answer where it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from certifier.errors import CirisError
from certifier.model import Array, Pair, Scene
from certifier.outcome import Outcome
from certifier.scene import load_scene

ROOT = Path(__file__).parent


@dataclass(frozen=True)
class Region:
    """{C s <= d} within the joint limits, and a point inside.

    Attributes:
        C, d: (m, n), (m,); the joint limits are not among them.
        center: (n,) the scene's seed.
    """

    C: Array
    d: Array
    center: Array


@dataclass(frozen=True)
class Instance:
    """One pair on one polytope.

    Attributes:
        name: scene/pair/polytope.
        pair: names of the two geometries.
        answer: None where it is unknown.
    """

    name: str
    scene_name: str
    pair: Pair
    polytope: str
    answer: Outcome | None

    @property
    def scene(self) -> Scene:
        """The scene with this pair alone."""
        return replace(scene(self.scene_name), pairs=(self.pair,))

    @property
    def region(self) -> Region:
        return region(self.scene_name, self.polytope)


@cache
def _document() -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load((ROOT / "catalogue.yaml").read_text(encoding="utf-8"))
    return document


@cache
def instances() -> dict[str, Instance]:
    """All instances by name."""
    found = {}
    for scene_name, entry in _document()["scenes"].items():
        for pair_name, known in entry["pairs"].items():
            for answer in (*Outcome, None):
                for polytope in known.get(answer or "unknown", ()):
                    name = f"{scene_name}/{pair_name}/{polytope}"
                    found[name] = Instance(name, scene_name, Pair(*known["bodies"]), polytope, answer)
    return found


def named(names: list[str]) -> list[Instance]:
    """The instances of these names; the catalogue's ladder if there are none.

    Raises:
        CirisError: ``unknown_instance``.
    """
    known = instances()
    for name in names:
        if name not in known:
            hint = "ciris bench pairs --list names them all"
            raise CirisError("unknown_instance", f"the catalogue has no instance {name!r}", field="NAMES", hint=hint)
    return [known[name] for name in names or _document()["ladder"]]


def scenes() -> list[str]:
    """The names of the scenes."""
    return list(_document()["scenes"])


def path(scene_name: str) -> Path:
    """The scene file."""
    return (ROOT / _document()["scenes"][scene_name]["file"]).resolve()


@cache
def scene(scene_name: str) -> Scene:
    """The scene with all its pairs; read once."""
    return load_scene(path(scene_name))


def region(scene_name: str, polytope: str) -> Region:
    """A polytope of the catalogue around a scene's seed."""
    whole = scene(scene_name)
    seed = yaml.safe_load((path(scene_name).parent / "seed.yaml").read_text(encoding="utf-8"))["q"]
    center, made = whole.to_s(seed), _document()["polytopes"][polytope]
    if "half_width" in made:
        return Region(*cube(center, made["half_width"]), center)
    if "faces" in made:
        return Region(*tangent(np.random.default_rng(made["random_seed"]), center, made["faces"], made["distance"]), center)
    if "proposal" in made:
        with np.load(ROOT / "proposals" / f"{scene_name}.npz") as arrays:
            C, d = arrays["C"], arrays["d"]
        return Region(C, C @ center + made["proposal"] * (d - C @ center), center)
    return Region(np.zeros((0, whole.n)), np.zeros(0), center)


def cube(center: Array, half_width: float) -> tuple[Array, Array]:
    """|s - center|_inf <= half_width as C (2n, n) and d (2n,)."""
    eye = np.eye(len(center))
    return np.concatenate([eye, -eye]), np.concatenate([center + half_width, half_width - center])


def tangent(rng: np.random.Generator, center: Array, count: int, distance: float) -> tuple[Array, Array]:
    """Faces with random normals, all at one distance from the centre: C (count, n), d (count,), none of them redundant."""
    C = rng.normal(size=(count, len(center)))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    return C, C @ center + distance
