"""A pair's proof by sums of squares is held here as data, and is written to and read from its portable file.

A pair's proof on P = {s : C s <= d} is expressed in a frame F and in the coordinates u = (s - mid)/half of a box around P. It holds the
plane [a; b] = Z [1; u], a margin t and a bound kappa of |a|. For every vertex v of either volume it holds Gram factors L_j with

    +-(a'p_v + b den) - (r kappa + t) den - sigma (|L_0' rho|^2 + sum_j g_j |L_j' rho|^2)  ~  0.

The g_j are some of P's faces d_j - c_j's and of its box's faces, 1 + u_i and 1 - u_i. rho are the 2^k products of the chain's coordinates
u_i (plain monomials).

The factors are fixed-point numbers of 30 bits, with one exponent for each face. They have 48 bits where rounding to 30 would eat up the
margin.

Nothing here decides whether a proof holds: certifier.verify does. docs/proofs.md describes the file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, Self

import numpy as np

from certifier.document import Node
from certifier.errors import CirisError
from certifier.model import Array, Volume
from certifier.proof.container import Arrays
from certifier.proof.ground import Ground
from certifier.proof.separation import Common, Separation

BITS = {"int32": 30, "int64": 48}
"""The mantissa of a Gram factor has this many bits, by its type."""


@lru_cache(maxsize=16)
def lower_triangle(length: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the row and the column of every entry of a lower triangle of that many rows, row by row."""
    return np.tril_indices(length)


@dataclass(frozen=True)
class Side:
    """Holds the Gram factors of one volume's vertices: factor = mantissa 2^exponent, as lower triangles row by row.

    Attributes:
        chain: position indices of the joints between F and the body, ascending; rho's coordinates are in this order.
        mantissa: (V, f + 1, L (L + 1) / 2) int32 or int64, with L = 2^k, for 1 and the f faces used.
        exponent: (f + 1,) int32, for 1 and the f faces used.
    """

    chain: tuple[int, ...]
    mantissa: np.ndarray
    exponent: np.ndarray

    @classmethod
    def rounded(cls, chain: tuple[int, ...], factor: Array, kind: str = "int32") -> Side:
        """Rounds factors, (V, f + 1, L, L) lower triangular, of Gram matrices in plain monomials; ``kind`` is a key of BITS."""
        exponent = np.frexp(np.abs(factor).max(axis=(0, 2, 3)))[1].astype(np.int32) - BITS[kind]
        rows, columns = lower_triangle(factor.shape[-1])
        mantissa = np.rint(np.ldexp(factor[:, :, rows, columns], -exponent[:, None])).astype(kind)
        return cls(chain, mantissa, exponent)

    @property
    def factors(self) -> Array:
        """Returns the lower triangular factors, (V, f + 1, L, L)."""
        length = 2 ** len(self.chain)
        rows, columns = lower_triangle(length)
        L = np.zeros((*self.mantissa.shape[:2], length, length))
        L[:, :, rows, columns] = np.ldexp(self.mantissa.astype(float), self.exponent[:, None])
        return L


@dataclass(frozen=True)
class PairProof(Separation):
    """Holds a plane that separates two volumes on a polytope, with the sums of squares that prove it.

    Attributes:
        plane: Z, (4, n + 1).
        t: margin.
        kappa: bound of |a(u)| on the box (0 where no radius is involved).
        faces: the f faces used: j for the ground's face j, m + i for 1 + u_i, m + n + i for 1 - u_i.
        sides: the Gram factors of the two volumes.
    """

    KIND: ClassVar[str] = "pair"
    HEADER: ClassVar[tuple[str, ...]] = ("faces", "chains")

    plane: Array
    t: float
    kappa: float
    faces: tuple[int, ...]
    sides: tuple[Side, Side]

    @property
    def needs_box_alone(self) -> bool:
        """Returns whether the proof uses no face of the polytope but those of the box."""
        return all(j >= len(self.ground.d) for j in self.faces)

    def on_its_box(self) -> PairProof:
        """Returns the same proof, stated on all of its box. The proof must need no other face than the box's."""
        ground = Ground.of_box(self.ground.mid, self.ground.half)
        shift = len(ground.d) - len(self.ground.d)
        return replace(self, ground=ground, faces=tuple(j + shift for j in self.faces))

    def own(self, number: Callable[[Volume], int]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        arrays = {"plane": self.plane, "scalars": np.array([self.t, self.kappa])}
        for i, side in enumerate(self.sides):
            arrays |= {f"mantissa{i}": side.mantissa, f"exponent{i}": side.exponent}
        return {"faces": list(self.faces), "chains": [list(side.chain) for side in self.sides]}, arrays

    @classmethod
    def read(cls, common: Common, header: dict[str, Node], volumes: Sequence[Volume], arrays: Arrays, prefix: str) -> Self:
        scalars = arrays.floats(f"{prefix}/scalars")
        if scalars.shape != (2,):
            raise CirisError("document", f"it is {scalars.shape}, not (2,)", field=f"{prefix}/scalars.npy")
        side_a, side_b = (
            Side(
                tuple(joint.count() for joint in chain.items(common.scene.n)),
                arrays.take(f"{prefix}/mantissa{i}", *BITS),
                arrays.take(f"{prefix}/exponent{i}", "int32"),
            )
            for i, chain in enumerate(header["chains"].two())
        )
        return cls(
            *common,
            plane=arrays.floats(f"{prefix}/plane"),
            t=scalars[0].item(),
            kappa=scalars[1].item(),
            faces=tuple(j.count() for j in header["faces"].items()),
            sides=(side_a, side_b),
        )
