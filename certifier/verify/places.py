"""The fixed poses between the joints of a scene are computed here in balls, and rounded to doubles once.

Every pose is exact in certifier.verify.kinematics. Composed there, its numbers gain bits with every weld. Here they are balls of 512 bits:
a length is at most 2^30 m, so what 64 welds and a few products round is below 2^-400 m. Each ball is checked to be smaller than 2^-200, so
that a double next to its middle is wrong by at most an ulp and 2^-199.

A *place* is a body, or a joint as its child or as its parent sees it. A *root* is the world, or the body behind a joint that moves; welds
lead from it to places, which rest in its frame. A chain goes from place to place: from the frame up over joints, each from the child's to
the parent's place, then down over others, each from the parent's to the child's place, to the body. A pose between two places of one root
is made of two poses in its frame. So what a chain takes is linear in its joints that move, however many welds there are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flint import arb, arb_mat, ctx

from certifier.errors import ProofError
from certifier.model import WORLD, Array, Joint, JointKind, Scene
from certifier.verify.chains import Chain, lengths
from certifier.verify.kinematics import axis_of, has_speed, rigid

BITS = 512
_SMALL = 2.0**-200


class _Ball(NamedTuple):
    """Holds a pose in balls: R (3, 3) and p (3, 1), metres."""

    R: arb_mat
    p: arb_mat

    def times(self, other: _Ball) -> _Ball:
        return _Ball(self.R * other.R, self.R * other.p + self.p)

    def to(self, other: _Ball) -> _Ball:
        """Returns the inverse of this pose, times the other one."""
        back = self.R.transpose()
        return _Ball(back * other.R, back * (other.p - self.p))


_NOWHERE = _Ball(arb_mat(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]), arb_mat(3, 1, [0, 0, 0]))


class _Place(NamedTuple):
    """Names a place: a body, or the joint above the body as its child or as its parent sees it."""

    kind: str
    body: str


class Places:
    """Makes the chains of a scene. What chains share is computed once."""

    def __init__(self, scene: Scene) -> None:
        self._above = scene.joint_above
        self._in_root: dict[str, tuple[str, _Ball]] = {}
        self._balls: dict[_Place, _Ball] = {}
        self._fixed: dict[tuple[_Place, _Place], tuple[Array, Array]] = {}
        self._axes: dict[str, Array] = {}
        self._chains: dict[tuple[str, str], Chain] = {}

    def chain(self, frame: str, body: str) -> Chain:
        """Returns the chain from a body's frame to a body."""
        if (frame, body) not in self._chains:
            self._chains[frame, body] = self._made(frame, body)
        return self._chains[frame, body]

    def _made(self, frame: str, body: str) -> Chain:
        with ctx.workprec(BITS):
            up, down = self._roots(frame), self._roots(body)
            while up and down and up[-1] == down[-1]:
                up.pop()
                down.pop()
            crossed = [(self._above[root], -1.0) for root in up] + [(self._above[root], 1.0) for root in reversed(down)]
            places = [_Place("body", frame)]
            for joint, sign in crossed:
                sides = _Place("child", joint.child), _Place("parent", joint.child)
                places += sides if sign < 0 else sides[::-1]
            places.append(_Place("body", body))
            fixed = [self._between(*places[i : i + 2]) for i in range(0, len(places), 2)]
            axes = [sign * self._axis(joint) for joint, sign in crossed]
        return Chain(
            np.array([joint.index for joint, _ in crossed], dtype=np.int64),
            np.array([_speed(joint) for joint, _ in crossed]),
            np.array(axes).reshape(-1, 3),
            np.array([R for R, _ in fixed]),
            np.array([p for _, p in fixed]),
        )

    def _roots(self, body: str) -> list[str]:
        """Returns the bodies behind the joints that move on the way from a body to the world."""
        found: list[str] = []
        root, _ = self._local(body)
        while root != WORLD:
            found.append(root)
            root, _ = self._local(self._above[root].parent)
        return found

    def _local(self, body: str) -> tuple[str, _Ball]:
        """Returns a body's root and where the body is in it."""
        if body not in self._in_root:
            joint = self._above.get(body)
            if joint is None or joint.index is not None:
                self._in_root[body] = body, _NOWHERE
            else:
                root, parent = self._local(joint.parent)
                self._in_root[body] = root, parent.times(_rigid(joint.X_PF)).times(_rigid(joint.X_BM).to(_NOWHERE))
        return self._in_root[body]

    def _ball(self, place: _Place) -> _Ball:
        """Returns where a place is in its root."""
        if place not in self._balls:
            if place.kind == "body":
                return self._local(place.body)[1]
            joint = self._above[place.body]
            own = place.kind == "child"
            self._balls[place] = _rigid(joint.X_BM) if own else self._local(joint.parent)[1].times(_rigid(joint.X_PF))
        return self._balls[place]

    def _between(self, first: _Place, then: _Place) -> tuple[Array, Array]:
        """Returns the pose of a place in another one of the same root, in doubles."""
        if (first, then) not in self._fixed:
            R, p = self._ball(first).to(self._ball(then))
            self._fixed[first, then] = _doubles(R).reshape(3, 3), _doubles(p)
        return self._fixed[first, then]

    def _axis(self, joint: Joint) -> Array:
        if joint.child not in self._axes:
            self._axes[joint.child] = np.array([float(int(x.p) / int(x.q)) for x in axis_of(joint)])
        return self._axes[joint.child]


def _speed(joint: Joint) -> float:
    """Returns by how many metres a joint slides for a metre of its position, rounded upwards; 0 for one that turns."""
    if joint.kind is not JointKind.PRISMATIC:
        return 0.0
    return float(lengths(joint.axis[None])[0]) if has_speed(joint) else 1.0


def _rigid(X: Array) -> _Ball:
    """Returns the rigid transform that 16 doubles stand for."""
    rows = rigid(np.asarray(X, dtype=float).tobytes())
    scale = arb(rows[3][3])
    return _Ball(
        arb_mat(3, 3, [arb(rows[i][k]) / scale for i in range(3) for k in range(3)]),
        arb_mat(3, 1, [arb(rows[i][3]) / scale for i in range(3)]),
    )


def _doubles(matrix: arb_mat) -> Array:
    """Returns doubles that are wrong by an ulp and 2^-199 at most.

    Raises:
        ProofError: a ball is too large, which no scene within the limits makes.
    """
    entries = matrix.entries()
    if not all(x.rad() < _SMALL for x in entries):
        raise ProofError("proof_too_large", "the fixed poses of the model are too large to be computed to 2^-200 m")
    return np.array([float(x.mid()) for x in entries])
