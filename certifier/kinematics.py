"""Rational forward kinematics is evaluated here at sample points.

    prod_i (1 + s_i^2) X_FA(s) = product over the joints from F to A of  X_left (T0 + T1 s_i + T2 s_i^2) X_right

Let a revolute joint have the axis u, and let R* = R(q*). With the half-angle substitution s = tan((q - q*)/2) its terms are
T0 = diag(R*, 1), T1 = diag(2 R*[u], 0), T2 = diag(R*(I + 2[u]^2), 1).
A prismatic joint has T0 = [I, u q*; 0, 1], T1 = [0, u; 0, 0], and no denominator; u is as long as it slides fast. A weld contributes its
fixed transform.

On the way up the tree the inverse joint is used: u becomes -u, R* becomes R*', and the outer transforms are inverted and swapped.

The formulas are C-IRIS eq. (4)-(6). Nothing is symbolic.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from certifier.model import WORLD, Array, Joint, JointKind, Scene


@dataclass(frozen=True)
class Factor:
    """A factor is one joint on a path, already multiplied out: X = left (T[0] + T[1] s + T[2] s^2) right.

    Attributes:
        index: position index; None for a weld, of which only T[0] is set.
        terms: (3, 4, 4) T[0], T[1] and T[2], left and right included.
    """

    index: int | None
    terms: Array


class Kinematics:
    """Gives the paths and the numerators of one scene; :meth:`of` makes it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._paths: dict[tuple[str, str], list[Factor]] = {}

    @staticmethod
    @lru_cache(maxsize=8)
    def of(scene: Scene) -> Kinematics:
        """Returns the kinematics of the scene, which is made once and kept."""
        return Kinematics(scene)

    def ancestors(self, body: str) -> list[str]:
        """Returns the bodies from ``body`` up to the world, both included."""
        bodies = [body]
        while bodies[-1] != WORLD:
            bodies.append(self.scene.joint_above[bodies[-1]].parent)
        return bodies

    def common(self, a: str, b: str) -> str:
        """Returns the body at which the ways from a and from b up to the world meet."""
        up_b = self.ancestors(b)
        return next(body for body in self.ancestors(a) if body in up_b)

    def bodies_between(self, a: str, b: str) -> list[str]:
        """Returns the bodies on the path from a to b, both included."""
        up_a, up_b, common = self.ancestors(a), self.ancestors(b), self.common(a, b)
        return up_a[: up_a.index(common) + 1] + up_b[: up_b.index(common)][::-1]

    def frames(self, a: str, b: str) -> list[str]:
        """Returns the bodies on the path from a to b, both included, but those between two joints that move together."""
        return [body for body in self.bodies_between(a, b) if not {*self.chain(body, a)} & {*self.chain(body, b)}]

    def rigid_root(self, body: str) -> str:
        """Returns the first body on the way up, ``body`` included, that a joint moves relative to its parent, or else the world."""
        while body != WORLD and self.scene.joint_above[body].index is None:
            body = self.scene.joint_above[body].parent
        return body

    def path(self, frame: str, body: str) -> list[Factor]:
        """Returns the factors of X_FB from frame body F to body B, in path order.

        Slides that move together are one factor where no other joint is between them: along both, a body moves straight.
        """
        if (frame, body) in self._paths:
            return self._paths[frame, body]
        factors: list[Factor] = []
        slide: int | None = None  # where the last joint that moves is among the factors, if it slides
        for joint, upwards in self.joints(frame, body):
            factors.append(_factor(joint, self.scene.q_star, upwards))
            if slide is not None and joint.index is not None and joint.index == factors[slide].index:
                factors[slide:] = [_as_one(factors[slide:])]
            elif joint.index is not None:
                slide = len(factors) - 1 if joint.kind is JointKind.PRISMATIC else None
        self._paths[frame, body] = factors
        return factors

    def joints(self, frame: str, body: str) -> list[tuple[Joint, bool]]:
        """Returns the joints from F to B, in path order, each with whether it is crossed upwards, from child to parent."""
        above, found = self.scene.joint_above, []
        for here, there in itertools.pairwise(self.bodies_between(frame, body)):
            upwards = here in above and above[here].parent == there
            found.append((above[here if upwards else there], upwards))
        return found

    def chain(self, frame: str, body: str) -> list[int]:
        """Returns the position indices of the factors between F and B, in path order."""
        return [f.index for f in self.path(frame, body) if f.index is not None]

    def numerators(self, frame: str, body: str, s: Array) -> Array:
        """Returns prod(1 + s_i^2) X_FB at the rows of s.

        Args:
            s: (N, n) points of tangent space.

        Returns:
            (N, 4, 4); the entry [3, 3] is the denominator.
        """
        X = None
        for factor in self.path(frame, body):
            motion = factor.terms[0]
            if factor.index is not None:
                si = s[:, factor.index, None, None]
                motion = motion + si * (factor.terms[1] + si * factor.terms[2])
            X = motion if X is None else X @ motion
        return np.broadcast_to(np.eye(4) if X is None else X, (len(s), 4, 4))

    def points(self, frame: str, body: str, vertices: Array, s: Array) -> Array:
        """Returns where the vertices of body B are in F, in metres, at the rows of s.

        Args:
            vertices: (V, 3) metres in B.
            s: (N, n) points of tangent space.

        Returns:
            (N, V, 3) metres in F.
        """
        X = self.numerators(frame, body, s)
        return (vertices @ np.swapaxes(X[:, :3, :3], 1, 2) + X[:, None, :3, 3]) / X[:, 3, 3, None, None]


def skew(u: Array) -> Array:
    """Returns the matrix [u], (3, 3), with [u] v = u x v."""
    return np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])


def rotation(axis: Array, angle: float) -> Array:
    """Returns the rotation R(angle) about a unit axis, (3, 3), by Rodrigues' formula; the angle is in radians."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def rigid_inverse(X: Array) -> Array:
    """Returns the inverse of a rigid transform, (4, 4)."""
    inverse = np.eye(4)
    inverse[:3, :3] = X[:3, :3].T
    inverse[:3, 3] = -X[:3, :3].T @ X[:3, 3]
    return inverse


def _homogeneous(R: Array, p: Array, scale: float) -> Array:
    """Returns the matrix [R, p; 0, scale], (4, 4)."""
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3], X[3, 3] = R, p, scale
    return X


def _as_one(factors: list[Factor]) -> Factor:
    """Returns the product of a slide, welds and a slide of the same position: (A0 + A1 s) W (B0 + B1 s), in which A1 W B1 is 0."""
    W = np.eye(4)
    for weld in factors[1:-1]:
        W = W @ weld.terms[0]
    A, B = factors[0].terms, factors[-1].terms
    return Factor(factors[0].index, np.array([A[0] @ W @ B[0], A[1] @ W @ B[0] + A[0] @ W @ B[1], np.zeros((4, 4))]))


def _factor(joint: Joint, q_star: Array, inverse: bool) -> Factor:
    """Returns the factor of a joint or, on the way up the tree, of its inverse."""
    left, right = joint.X_PF, rigid_inverse(joint.X_BM)
    if inverse:
        left, right = joint.X_BM, rigid_inverse(joint.X_PF)
    zero = np.zeros(3)
    if joint.index is None:
        return Factor(None, np.array([left @ right, np.zeros((4, 4)), np.zeros((4, 4))]))
    axis = -joint.axis if inverse else joint.axis
    if joint.kind is JointKind.PRISMATIC:
        terms = [_homogeneous(np.eye(3), axis * q_star[joint.index], 1), _homogeneous(np.zeros((3, 3)), axis, 0), np.zeros((4, 4))]
    else:
        R, K = rotation(axis, q_star[joint.index]), skew(axis)
        terms = [_homogeneous(R, zero, 1), _homogeneous(2 * R @ K, zero, 0), _homogeneous(R @ (np.eye(3) + 2 * K @ K), zero, 1)]
    return Factor(joint.index, np.array([left @ T @ right for T in terms]))
