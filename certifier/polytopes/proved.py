"""A box around a polytope is claimed here, never smaller than the multipliers prove, and faces are made that leave multipliers room.

Linear programs are solved to rounding, so a bound that is their value may be what no multipliers reach. A coefficient of 1e-12 is enough,
where its joint has s = 11.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from certifier.model import Array, Box, Polytope, Scene
from certifier.polytopes.polytope import bound_multipliers, bounds, drop_redundant

CLEAN = 1e-8
"""Coefficients of a face are tiny if leaving them out moves the face by this part of its distance from the points to keep, or less."""


@dataclass(frozen=True, eq=False)
class ProvedBox(Box):
    """A box with the multipliers that prove that it contains a polytope {s : C s <= d} within the joint limits.

    Attributes:
        Y_lower, Y_upper: (n, m + 2n) multipliers of the polytope's m rows, then of the upper and the lower joint limits. Row i proves the
            bound of axis i.
    """

    Y_lower: Array
    Y_upper: Array

    @classmethod
    def of(cls, scene: Scene, polytope: Polytope, inside: Array | None = None) -> Self:
        """Returns the smallest box that multipliers prove around a polytope within the joint limits.

        Args:
            inside: (n,) a point inside, if one is known.

        Raises:
            RegionError: as :func:`certifier.polytopes.polytope.bound_multipliers`.
        """
        lower, upper, Y_lower, Y_upper = bound_multipliers(scene.polytope(polytope.C, polytope.d), inside)
        box = Box.around(lower, upper)
        return cls(box.mid, box.half, Y_lower, Y_upper)

    @classmethod
    def of_program(cls, scene: Scene, polytope: Polytope) -> Self:
        """Returns the box of the linear programs' values where multipliers prove it, and else :meth:`of`, which is larger by roundings.

        Args:
            polytope: joint limits included.

        Raises:
            RegionError: as :func:`certifier.polytopes.polytope.bound_multipliers`.
        """
        lower, upper, Y_lower, Y_upper = bound_multipliers(scene.polytope(polytope.C, polytope.d))
        box = Box.around(*bounds(polytope))
        # The verifier rounds the joint limits outwards, by the last digit.
        if (box.lower >= lower).any() or (box.upper <= upper).any():
            box = Box.around(lower, upper)
        return cls(box.mid, box.half, Y_lower, Y_upper)

    def on(self, rows: int) -> Self:
        """Returns the box with the multipliers that prove it around a part of the polytope.

        Args:
            rows: how many rows the part has. They are those of the polytope, some of them moved in, with new ones before the joint limits,
                which are the last 2n rows of both.
        """
        limits = 4 * len(self.mid)
        place, width = self.Y_lower.shape[1] - limits, rows + limits // 2
        pad = np.zeros((len(self.mid), width - self.Y_lower.shape[1]))
        padded = (np.concatenate([Y[:, :place], pad, Y[:, place:]], axis=1) for Y in (self.Y_lower, self.Y_upper))
        return replace(self, **dict(zip(("Y_lower", "Y_upper"), padded, strict=True)))


def needed_faces(scene: Scene, C: Array, d: Array, keep: Array) -> tuple[Array, Array]:
    """Returns the faces that are needed beside the joint limits, without their tiny coefficients.

    Args:
        C, d: (m, n), (m,) the faces, |c_j| = 1.
        keep: (k, n) points that stay inside, k >= 1.

    Raises:
        RegionError: as :func:`certifier.polytopes.polytope.chebyshev_center`.
    """
    needed = drop_redundant(scene.polytope(C, d), fixed=2 * scene.n)[: -2 * scene.n]
    return cleaned(C[needed], d[needed], scene.s_lower, scene.s_upper, keep)


def cleaned(C: Array, d: Array, lower: Array, upper: Array, keep: Array) -> tuple[Array, Array]:
    """Returns faces without their tiny coefficients; within the joint limits they contain no more than the given ones.

    Without c_i, a face c's <= d has the offset d less the largest c_i s_i. A face that lets a point to keep out stays as it is.

    Args:
        C, d: (m, n), (m,) the faces.
        lower, upper: (n,) the joint limits in s.
        keep: (k, n) points that stay inside, k >= 1.
    """
    room = (d[:, None] - C @ keep.T).min(axis=1)
    tiny = np.abs(C) * (upper - lower) <= CLEAN / C.shape[1] * room[:, None]
    tiny &= (C != 0) & ~tiny.all(axis=1, keepdims=True)
    moved = np.where(tiny, np.maximum(C * lower, C * upper), 0.0).sum(axis=1)
    clean = tiny.any(axis=1)
    return np.where(tiny, 0.0, C), np.where(clean, np.nextafter(d - moved * (1 + 1e-9 * np.sign(moved)), -np.inf), d)
