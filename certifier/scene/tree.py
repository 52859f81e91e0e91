"""The kinematic tree as a table: what is rigidly joined to what, and how far anything can get from the world's origin."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from certifier.errors import SceneError
from certifier.model import WORLD, Array, Geometry, Joint, JointKind


class Tree:
    """Joints sorted so that every parent comes before its children, each turned to point away from the world.

    Turning a joint round swaps its two fixed frames and flips its axis: (X_PF X_FM(q) X_BM^-1)^-1 = X_BM X_FM(q)^-1 X_PF^-1.

    Raises:
        SceneError: ``floating_body`` or ``loop``.
    """

    def __init__(self, joints: list[Joint], bodies: list[str]) -> None:
        self.bodies = tuple(bodies)
        self.joints = tuple(_outward(joints, bodies))
        """Parents before children."""

    @cached_property
    def group(self) -> dict[str, str]:
        """For every body, the body nearest the world that it is rigidly joined to; ``world`` if it cannot move."""
        group = {WORLD: WORLD}
        for j in self.joints:
            group[j.child] = group[j.parent] if j.kind is JointKind.WELD else j.child
        return group

    @cached_property
    def anchored(self) -> dict[str, Array]:
        """X_WB, (4, 4), of the bodies that cannot move."""
        poses = {WORLD: np.eye(4)}
        for j in self.joints:
            if j.kind is JointKind.WELD and j.parent in poses:
                poses[j.child] = poses[j.parent] @ j.X_PF @ np.linalg.inv(j.X_BM)
        return poses

    def reach(self, geometries: list[Geometry], padding: float) -> float:
        """Metres from the world's origin that no point of a moving geometry gets beyond, whatever the joint positions.

        The sum of the offsets along the chain: a revolute joint turns about its frame's origin, a prismatic one moves
        its child by at most its greatest position.
        """
        distance = {body: float(np.linalg.norm(X[:3, 3])) for body, X in self.anchored.items()}
        for j in self.joints:
            if j.child not in distance:
                slide = max(abs(j.lower or 0.0), abs(j.upper or 0.0)) if j.kind is JointKind.PRISMATIC else 0.0
                offsets = np.linalg.norm(j.X_PF[:3, 3]) + slide + np.linalg.norm(j.X_BM[:3, 3])
                distance[j.child] = distance[j.parent] + float(offsets)
        return max(
            (
                distance[g.body] + float(np.linalg.norm(g.vertices, axis=1).max()) + g.radius + 2 * padding
                for g in geometries
                if g.body not in self.anchored
            ),
            default=1.0,
        )


def _outward(joints: list[Joint], bodies: list[str]) -> list[Joint]:
    found, open_ends, rest = [], [WORLD], list(joints)
    reached = {WORLD}
    while open_ends:
        body = open_ends.pop(0)
        for j in [j for j in rest if body in (j.parent, j.child)]:
            rest.remove(j)
            j = j if j.parent == body else _turned(j)
            if j.child in reached:
                raise SceneError("loop", f"joint {j.name} closes a loop of joints; only trees are supported")
            reached.add(j.child)
            open_ends.append(j.child)
            found.append(j)
    for body in bodies:
        if body not in reached:
            raise floating(body)
    return found


def floating(body: str) -> SceneError:
    """The error for a body that no joint connects to the world."""
    drake_name = body.replace("/", "::")
    hint = f"weld it: add_weld: {{parent: world, child: {drake_name}}}"
    return SceneError("floating_body", f"body {body} is not attached to anything", field="directives", hint=hint)


def _turned(j: Joint) -> Joint:
    if j.kind is JointKind.WELD:
        X = np.linalg.inv(j.X_PF @ np.linalg.inv(j.X_BM))
        return Joint(j.name, j.kind, j.child, j.parent, j.axis, X, np.eye(4))
    return Joint(j.name, j.kind, j.child, j.parent, -j.axis, j.X_BM, j.X_PF, j.index, j.lower, j.upper)
