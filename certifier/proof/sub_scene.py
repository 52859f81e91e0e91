"""What some pairs are about, as a scene of its own: the bodies and joints between their geometries, with names that say nothing.

Whether two bodies touch depends on the joints between them alone, so a proof about this scene is one about the pairs in every scene that
gives the same one. Its hash names what is proved. Names, welds outside of the chain and all that stands elsewhere do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from certifier.model import WORLD, Geometry, Joint, Pair, Scene

ROOT = "root"
"""The name of bodies that carry joints which others follow, but no geometry."""


class SubScene(NamedTuple):
    """A scene about some pairs of another one.

    Attributes:
        scene: its pairs are those that were named, in their order.
        positions: (k,) which position of the other scene each of its joints has.
    """

    scene: Scene
    positions: np.ndarray


def sub_scene(scene: Scene, pairs: Sequence[Pair]) -> SubScene:
    """Returns what some pairs of a scene are about.

    The body where the ways to all of their geometries meet is its world. q* and the joint limits are those of the scene, and each pair
    has its padding.

    Args:
        pairs: of the scene, at least one.
    """
    sides = [list(dict.fromkeys(getattr(pair, side) for pair in pairs)) for side in ("a", "b")]
    geometries = [scene.geometry(name) for name in dict.fromkeys(sides[0] + sides[1])]
    ways = [way(scene, geometry.body) for geometry in geometries]
    shared = next((i for i, level in enumerate(zip(*ways, strict=False)) if len(set(level)) > 1), min(map(len, ways))) - 1
    body = {ways[0][shared]: WORLD}
    for bodies in ways:
        for name in bodies[shared + 1 :]:
            body.setdefault(name, f"body{len(body)}")
    above = [scene.joint_above[name] for name in list(body)[1:]]
    positions: list[int] = list(dict.fromkeys(joint.index for joint in above if joint.index is not None))
    joints = [_renamed(joint, body[joint.parent], body[joint.child], positions) for joint in above]
    led = {joint.index for joint in joints if not joint.follows}
    for place in sorted({joint.index for joint in joints if joint.follows and joint.index is not None} - led):
        joints.append(_leader(scene.moving[positions[place]], place))
    names = {geometry.name: f"geometry{number:06d}" for number, geometry in enumerate(geometries)}
    found = Scene(
        name="",
        joints=tuple(joints),
        bodies=(*body.values(), *(joint.child for joint in joints[len(above) :])),
        geometries=tuple(_plain(geometry, names[geometry.name], body[geometry.body]) for geometry in geometries),
        pairs=tuple(Pair(*sorted((names[p.a], names[p.b])), padding=scene.padding_of(p)) for p in pairs),
        ignored=(),
        q_star=scene.q_star[positions],
    )
    return SubScene(found, np.array(positions))


def contents_of(scene: Scene) -> dict[Pair, str]:
    """Returns what each pair of a scene is about: the first 16 hexadecimal digits of its scene's hash."""
    return {pair: sub_scene(scene, [pair]).scene.hash[:16] for pair in scene.pairs}


def way(scene: Scene, body: str) -> list[str]:
    """Returns the bodies from the world to a body, both included."""
    found = [body]
    while found[-1] != WORLD:
        found.append(scene.joint_above[found[-1]].parent)
    return found[::-1]


def _renamed(joint: Joint, parent: str, child: str, positions: list[int]) -> Joint:
    index = None if joint.index is None else positions.index(joint.index)
    return replace(joint, name=f"joint of {child}", parent=parent, child=child, index=index)


def _leader(joint: Joint, index: int) -> Joint:
    """Returns a joint that others follow, which moves neither geometry itself."""
    still, child = np.eye(4), f"{ROOT}{index}"
    return replace(
        joint, name=f"joint of {child}", parent=WORLD, child=child, axis=np.array([0.0, 0.0, 1.0]), X_PF=still, X_BM=still, index=index
    )


def _plain(geometry: Geometry, name: str, body: str) -> Geometry:
    return Geometry(name, body, geometry.vertices, geometry.radius, {})
