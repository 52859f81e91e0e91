"""What the pairs of one polytope share: its faces in their order, the root cell, a point inside, and samples uniform in q."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.proved import ProvedBox
from certifier.proof.ground import Ground

CHAINS, EACH = 100, 20
"""CHAINS chains give EACH samples each."""


class Inside(NamedTuple):
    """The part {C s <= d} of a polytope in a cell, with rows of length 1: the faces that cut the cell, then its upper and lower ones.

    Attributes:
        faces: (f,) the numbers of those that cut the cell, in the polytope.
    """

    faces: Array
    C: Array
    d: Array


@dataclass(frozen=True, eq=False)
class Area:
    """An area is a polytope as the search for its partitions sees it.

    Attributes:
        polytope: its faces, in an order that the proofs refer to; joint limits included.
        lower, upper: (n,) the root cell, which contains the polytope.
        center: (n,) a point inside.
        samples: (S, n) points of the polytope, uniform in q.
        ground: the polytope as proofs hold it, with the root cell as its box.
        norms: (m,) the lengths of the faces' normals.
        unit: the polytope with normals of length 1.
        finer: cells are cut until they are narrower by this factor, and bodies count as touching when they are nearer by it.
    """

    scene: Scene
    kinematics: Kinematics
    polytope: Polytope
    lower: Array
    upper: Array
    center: Array
    samples: Array
    ground: Ground
    norms: Array
    unit: Polytope
    finer: float = 1.0

    @classmethod
    def of(cls, scene: Scene, polytope: Polytope, seed: int, box: ProvedBox | None = None, finer: float = 1.0) -> Area:
        """Looks at a polytope.

        Args:
            box: a box around a polytope of which this one is a part (:meth:`ProvedBox.on`); None for the smallest one around this one.

        Raises:
            RegionError: the polytope is empty or unbounded.
        """
        center = chebyshev_center(polytope, tuple(joint.name for joint in scene.moving))[0]
        box = ProvedBox.of(scene, polytope, center) if box is None else box.on(len(polytope.d))
        ground = Ground(polytope.C, polytope.d, box.mid, box.half, box.Y_lower, box.Y_upper)
        samples = uniform_in_q(polytope, scene, CHAINS, EACH, seed).reshape(-1, scene.n)
        norms = np.linalg.norm(polytope.C, axis=1)
        unit = Polytope(polytope.C / norms[:, None], polytope.d / norms)
        return cls(scene, Kinematics.of(scene), polytope, box.lower, box.upper, center, samples, ground, norms, unit, finer)

    def inside(self, lower: Array, upper: Array) -> Inside:
        """Returns the part of the polytope in a cell."""
        C, d, eye = self.unit.C, self.unit.d, np.eye(len(lower))
        cutting = np.flatnonzero(d - C @ ((lower + upper) / 2) - np.abs(C) @ ((upper - lower) / 2) < 0)
        return Inside(cutting, np.concatenate([C[cutting], eye, -eye]), np.concatenate([d[cutting], upper, -lower]))
