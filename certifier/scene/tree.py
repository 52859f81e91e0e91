"""The kinematic tree is sorted here. It says what is rigidly joined to what, and how far anything can get from the world's origin."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from certifier.errors import SceneError
from certifier.model import WORLD, Array, Geometry, Joint, JointKind


class Tree:
    """Holds joints, sorted so that every parent comes before its children, and each turned so that it points away from the world.

    To turn a joint round means to swap its two fixed frames and to flip its axis: (X_PF X_FM(q) X_BM^-1)^-1 = X_BM X_FM(q)^-1 X_PF^-1.

    Raises:
        SceneError: ``floating_body`` or ``loop``, when the joints and bodies are no tree.
    """

    def __init__(self, joints: list[Joint], bodies: list[str]) -> None:
        self.bodies = tuple(bodies)
        self.joints = tuple(_outward(joints, bodies))
        """In this order, parents come before children."""

    @cached_property
    def group(self) -> dict[str, str]:
        """Maps every body to the body nearest the world that it is rigidly joined to, which is ``world`` if it cannot move."""
        group = {WORLD: WORLD}
        for j in self.joints:
            group[j.child] = group[j.parent] if j.kind is JointKind.WELD else j.child
        return group

    @cached_property
    def anchored(self) -> dict[str, Array]:
        """Maps every body that cannot move to its pose X_WB, (4, 4), metres."""
        poses = {WORLD: np.eye(4)}
        for j in self.joints:
            if j.kind is JointKind.WELD and j.parent in poses:
                poses[j.child] = poses[j.parent] @ j.X_PF @ np.linalg.inv(j.X_BM)
        return poses

    def reach(self, geometries: list[Geometry], padding: float) -> float:
        """Returns a distance from the world's origin, in metres, that no point of a moving geometry exceeds at any joint positions.

        It adds up the offsets along the chain. A revolute joint turns about its frame's origin, and a prismatic joint moves its child by
        at most its greatest position times its speed.
        """
        distance = {body: float(np.linalg.norm(X[:3, 3])) for body, X in self.anchored.items()}
        for j in self.joints:
            if j.child not in distance:
                slide = max(abs(j.lower or 0.0), abs(j.upper or 0.0)) * j.speed if j.kind is JointKind.PRISMATIC else 0.0
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
            j = j if j.parent == body else turned(j)
            if j.child in reached:
                message = f"joint {j.name} closes a loop of joints"
                raise SceneError("loop", message, field="directives", hint="remove a joint of the loop; only trees are supported")
            reached.add(j.child)
            open_ends.append(j.child)
            found.append(j)
    for body in bodies:
        if body not in reached:
            raise floating(body)
    return found


def floating(body: str) -> SceneError:
    """Returns the error for a body that no joint connects to the world."""
    drake_name = body.replace("/", "::")
    outer, *inside = drake_name.split("::")
    itself = f"weld it: add_weld: {{parent: world, child: {drake_name}}}"
    frame = f"add_frame: {{name: {outer}::stands, X_PF: {{base_frame: {drake_name}}}}}"
    framed = f"weld a frame of it: {frame}, and add_weld: {{parent: world, child: {outer}::stands}}"
    hint = framed if len(inside) > 1 else itself
    return SceneError("floating_body", f"body {body} is not attached to anything", field="directives", hint=hint)


def turned(j: Joint) -> Joint:
    """Returns the joint with parent and child exchanged, at the same positions."""
    if j.kind is JointKind.WELD:
        X = np.linalg.inv(j.X_PF @ np.linalg.inv(j.X_BM))
        return Joint(j.name, j.kind, j.child, j.parent, j.axis, X, np.eye(4))
    return Joint(j.name, j.kind, j.child, j.parent, -j.axis, j.X_BM, j.X_PF, j.index, j.lower, j.upper, j.own_limits, j.follows)
