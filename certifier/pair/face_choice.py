"""The faces that a pair's program uses are chosen here: few first, and more as the dual point asks for them.

Every face costs time in each iteration. Faces in other joints than those between the bodies bring these joints into play.
"""

from __future__ import annotations

import numpy as np

from certifier.conic.interior_point import Solution, Status
from certifier.model import Polytope
from certifier.pair.frames import Frame
from certifier.pair.program import Sides

FACES_AT_A_TIME = 16
"""A polytope with many faces is first replaced by its box; then the dual point asks for faces, and this many are added at a time."""
DEAR_JOINTS = 10.0
"""Few faces that couple the path's joints with others are tried all at once, unless the others make the program take this many times as
long."""


class FaceChoice:
    """Chooses faces on one polytope.

    Faces are numbered as in a proof: first the polytope's m faces, then 1 + u_i and then 1 - u_i of its box.

    Args:
        faces: P's faces, without those that are redundant.
        box_first: begin with the box's faces, whatever P's are.
    """

    def __init__(self, faces: Polytope, box_first: bool) -> None:
        self._faces, self._box_first = faces, box_first
        self._moved = faces.C != 0
        self.every = tuple(range(len(faces.d)))

    def first(self, frame: Frame, every_face: bool = False) -> tuple[int, ...]:
        """Returns the faces to begin with.

        They are P's faces in the joints that the plane moves with, and the box's faces where P's may not bound those joints.
        Where P has many such faces, or the box comes first, the box's faces are used alone, unless ``every_face`` is set.
        Where P has few faces and some couple those joints with others, all of P's faces are used, unless the other joints are expensive.
        """
        (m, n), joints = self._faces.C.shape, list(frame.joints)
        box = [(m + n * (sign > 0) + i, i, sign) for sign in (-1, 1) for i in joints]
        others = self._moved.copy()
        others[:, joints] = False
        own = np.flatnonzero(~others.any(axis=1))
        alone = own[self._moved[own].sum(axis=1) == 1]
        C = self._faces.C[alone]
        needed = [face for face, i, sign in box if len(own) < m and not (C[:, i] * sign > 0).any()]
        coupled = bool((others.any(axis=1) & self._moved[:, joints].any(axis=1)).any())
        if coupled and not self._box_first and m <= 2 * n + FACES_AT_A_TIME and frame.growth(n) < DEAR_JOINTS:
            return self.every
        many = self._box_first or len(own) + len(needed) > len(box) + FACES_AT_A_TIME
        if not joints or (many and not every_face):
            return tuple(face for face, _, _ in box)
        return (*own.tolist(), *needed)

    def joints(self, frame: Frame, faces: tuple[int, ...]) -> tuple[int, ...]:
        """Returns the joints in play, ascending: those that the plane moves with and those of the faces."""
        joints = set(frame.joints)
        for j in faces:
            joints |= set(np.flatnonzero(self._moved[j]).tolist()) if j < len(self.every) else set()
        return tuple(sorted(joints))

    def more(self, frame: Frame, sides: Sides, solution: Solution) -> tuple[int, ...]:
        """Returns the faces to go on with after a program on a superset of P had no solution; the same ones when P itself has none either.

        The dual point shows infeasibility for every face j with Lambda_j(x) psd. The faces where Lambda_j(x) is not psd are worth adding.
        """
        unused = tuple(j for j in self.every if j not in sides.faces)
        if not unused or frame.at_rest:
            return sides.faces
        if solution.status is not Status.INFEASIBLE:
            return self.every
        lowest = np.full(len(unused), np.inf)
        for chain, x in zip((frame.chain_a, frame.chain_b), solution.x[:2], strict=True):
            Z = sides.cone_of(chain, unused).adjoint(x)[0]
            mass = np.trace(Z[:, 0], axis1=1, axis2=2)[:, None]
            lowest = np.minimum(lowest, (np.linalg.eigvalsh(Z[:, 1:])[:, :, 0] / mass).min(axis=0))
        wanted = [i for i in np.argsort(lowest) if lowest[i] < 0]
        inside = [i for i in wanted if not np.delete(self._moved[unused[i]], sides.joints).any()]
        # Where most faces are used already, choosing among the rest does not pay.
        most = 2 * (len(sides.faces) + FACES_AT_A_TIME) > len(self.every) + 2 * len(frame.joints)
        return (*sides.faces, *(unused[i] for i in (inside or wanted)[: None if most else FACES_AT_A_TIME]))
