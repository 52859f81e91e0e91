"""This module finds numbers of a scene that look as if they were not metres and radians, and says it in sentences for people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.model import Geometry, JointKind, Scene
from certifier.scene.tree import Tree

_HUGE = 10.0
"""A geometry that is longer than this, in metres, is remarked on."""
_LARGE = 1.0
"""So is one on a body that moves, if it is longer than this and than ``_TIMES`` its model's others."""
_TIMES = 10.0
"""A slide that is more than this many times as long as the robot is remarked on too."""


def units(scene: Scene, tree: Tree) -> list[str]:
    """Returns findings about slides, turns and geometries whose numbers may be millimetres, degrees or no limits at all."""
    return [*_slides(scene, tree), *_degrees(scene), *_lengths(scene, tree)]


def _slides(scene: Scene, tree: Tree) -> list[str]:
    still = [replace(j, lower=0.0, upper=0.0) if j.kind is JointKind.PRISMATIC else j for j in tree.joints]
    reach = max(Tree(still, list(tree.bodies)).reach(list(scene.geometries), 0.0), 1.0)
    return [
        f"joint {j.name} slides {upper - lower:.3g} m, and the robot reaches {reach:.3g} m: "
        f"are its limits metres? If it goes less far, say so by limits: {{{j.name}: [LOWER, UPPER]}}"
        for j, lower, upper in zip(scene.moving, scene.q_lower, scene.q_upper, strict=True)
        if j.kind is JointKind.PRISMATIC and upper - lower > _TIMES * reach
    ]


def _degrees(scene: Scene) -> list[str]:
    """Returns a finding about every joint with a limit beyond a whole turn that is a whole number, as limits in degrees are."""
    return [
        f"joint {j.name} has the limits {lower:g} and {upper:g}: are its units radians?"
        for j, lower, upper in zip(scene.moving, *scene.own_limits, strict=True)
        if j.kind is JointKind.REVOLUTE and any(np.isfinite(x) and abs(x) > 2 * np.pi and x == round(x) for x in (lower, upper))
    ]


def _lengths(scene: Scene, tree: Tree) -> list[str]:
    sizes = {g.name: _size(g) for g in scene.geometries if g.shape["kind"] != "half_space"}
    findings = []
    for g in (g for g in scene.geometries if sizes.get(g.name, 0.0) > _LARGE):
        size = sizes[g.name]
        others = [sizes[o.name] for o in scene.geometries if o is not g and o.name in sizes and _of_one_robot(o, g, tree)]
        compared = (
            f", and the other ones of its model about {np.median(others):.3g} m" if others and size > _TIMES * np.median(others) else ""
        )
        if compared or size > _HUGE:
            findings.append(f"geometry {g.name} is {size:.3g} m long{compared}: are its units metres?")
    return findings


def _of_one_robot(a: Geometry, b: Geometry, tree: Tree) -> bool:
    """Says whether both are on bodies that move, of the same model."""
    models = {g.body.rsplit("/", 1)[0] for g in (a, b)}
    return len(models) == 1 and not tree.anchored.keys() & {a.body, b.body}


def _size(geometry: Geometry) -> float:
    return float(np.ptp(geometry.vertices, axis=0).max()) + 2 * geometry.radius
