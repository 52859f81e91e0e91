"""The catalogue holds the scenes that are measured, and the regions about their seeds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from benchmarks.variants import variant
from certifier.errors import CirisError
from certifier.model import Array, Scene
from certifier.scene import load_scene

ROOT = Path(__file__).parents[1]
EXAMPLES = ("planar_2dof", "arm_3dof", "ur3e_bin", "iiwa_shelf", "dual_ur3e", "sphere_arm", "ur3e_gripper", "iiwa_gripper")
"""The examples are in the order of their cost."""
FILES = {name: ROOT / "examples" / name / "scene.yaml" for name in EXAMPLES} | {
    "rail_arm": ROOT / "benchmarks" / "scenes" / "rail_arm" / "scene.yaml"
}
VARIANTS = {
    f"iiwa_{figure}_{furniture or 'shelf'}": (figure, furniture)
    for figure, furniture in (
        ("box", "cupboard"),
        ("box", "bins"),
        ("box", "tables"),
        ("sphere", None),
        ("dense", "cupboard"),
        ("primitive", "bins"),
        ("polytope", "tables"),
    )
}
SCENES = (*FILES, *VARIANTS)

REGIONS = {
    "tiny": "a cube of half-width 0.001",
    "middle": "12 faces with random normals, 0.05 from the seed: a simplex-like polytope that reaches far where no face is",
    "wide": "a cube of half-width 0.4",
    "whole": "the joint limits alone",
}
"""These are the kinds of regions, in s. The joint limits always hold as well."""


class Instance(NamedTuple):
    """An instance is one pair of a scene on one of the scene's regions."""

    scene: str
    a: str
    b: str
    region: str


LADDER = [
    Instance("planar_2dof", "arm/lower/bar", "obstacles/body/post", "middle"),
    Instance("planar_2dof", "arm/lower/bar", "obstacles/body/post", "wide"),
    Instance("arm_3dof", "arm/fore/rod", "obstacles/body/table", "middle"),
    Instance("arm_3dof", "arm/fore/rod", "obstacles/body/table", "whole"),
    Instance("iiwa_shelf", "iiwa/link_3/box", "shelf/boards/upper", "middle"),
    Instance("iiwa_shelf", "iiwa/link_3/box", "shelf/boards/upper", "whole"),
    Instance("iiwa_shelf", "iiwa/link_5/box", "shelf/boards/upper", "middle"),
    Instance("iiwa_shelf", "iiwa/link_5/box", "shelf/boards/upper", "wide"),
    Instance("iiwa_shelf", "iiwa/link_7/box", "shelf/boards/upper", "middle"),
    Instance("iiwa_shelf", "iiwa/link_7/box", "shelf/boards/upper", "wide"),
]
"""``ciris bench pairs`` measures these instances: the chains grow, and each pair is on a region where it can be certified and on one
where it cannot.
"""


@dataclass(frozen=True)
class Region:
    """Describes {C s <= d} within the joint limits, and a point inside.

    Attributes:
        C, d: (m, n), (m,) in s; the joint limits are not among them.
        center: (n,) in s.
    """

    C: Array
    d: Array
    center: Array


@cache
def scene(name: str) -> Scene:
    """Returns a scene of the catalogue with all its pairs.

    Raises:
        CirisError: ``unknown_scene``.
    """
    if name in VARIANTS:
        return variant(scene("iiwa_shelf"), *VARIANTS[name])
    if name not in FILES:
        raise CirisError("unknown_scene", f"the catalogue has no scene {name!r}", field="scene", hint=f"scenes: {', '.join(SCENES)}")
    return load_scene(FILES[name])


def seed(name: str) -> Array:
    """Returns the seed of a scene, joint positions (n,)."""
    file = FILES["iiwa_shelf" if name in VARIANTS else name]
    return np.array(yaml.safe_load((file.parent / "seed.yaml").read_text(encoding="utf-8"))["q"])


def region(name: str, kind: str) -> Region:
    """Returns the region of this kind (one of REGIONS) about the seed of a scene."""
    center = scene(name).to_s(seed(name))
    if kind == "middle":
        return Region(*tangent(np.random.default_rng(0), center, 12, 0.05), center)
    if kind == "whole":
        return Region(np.zeros((0, len(center))), np.zeros(0), center)
    return Region(*cube(center, {"tiny": 1e-3, "wide": 0.4}[kind]), center)


def cube(center: Array, half_width: float) -> tuple[Array, Array]:
    """Returns |s - center|_inf <= half_width as C (2n, n) and d (2n,)."""
    eye = np.eye(len(center))
    return np.concatenate([eye, -eye]), np.concatenate([center + half_width, half_width - center])


def tangent(rng: np.random.Generator, center: Array, count: int, distance: float) -> tuple[Array, Array]:
    """Returns faces with random normals, all at one distance from the centre: C (count, n), d (count,). None of them is redundant."""
    C = rng.normal(size=(count, len(center)))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    return C, C @ center + distance
