"""Says of the pairs of a scene which joints move them, in which order to certify them, and which are alike."""

from __future__ import annotations

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Scene


def joints_between(scene: Scene, index: int) -> tuple[int, ...]:
    """Returns the position indices of the joints between the bodies of pair ``scene.pairs[index]``, ascending."""
    a, b = (scene.geometry(name).body for name in (scene.pairs[index].a, scene.pairs[index].b))
    return tuple(sorted(Kinematics.of(scene).chain(a, b)))


def by_joints(scene: Scene) -> list[int]:
    """Returns the pairs' indices, those with few joints between their bodies first."""
    return sorted(range(len(scene.pairs)), key=lambda i: len(joints_between(scene, i)))


def alike(scene: Scene, index: int) -> frozenset[str]:
    """Returns the rigid parts of a pair, by their first bodies; for the world's part, the geometry. Pairs of the same parts are alike."""
    kinematics, pair = Kinematics.of(scene), scene.pairs[index]
    roots = {name: kinematics.rigid_root(scene.geometry(name).body) for name in (pair.a, pair.b)}
    return frozenset(name if root == WORLD else root for name, root in roots.items())
