"""The pair program (11) of C-IRIS for two bodies conv(V_A) + ball(r_A) and conv(V_B) + ball(r_B), as data of interior_point.

In the frame F, with u = (s - mid)/half the coordinates of P's bounding box, the plane is a(u)'x + b(u) = 0,
[a; b] = Z [1; u - u_c], and with p_v, den the numerator and the denominator of vertex v,

    a'p_v + b den - (r_A kappa + t) den   in K_A for v in V_A,     -(a'p_v + b den) - (r_B kappa + t) den   in K_B for v in V_B,

K_A, K_B the weighted sums of squares over P's faces (certifier.cone). Where a radius is positive, |a| <= kappa on the box by

    [ kappa I   A1                                     ]
    [ A1'       kappa E00 - sum_i tau_i (E00 - E_ii)   ]  psd,   tau >= 0,   a(u) = A1 [1; u]

(the Schur complement at [1; u] says |a|^2 <= kappa (kappa - sum_i tau_i (1 - u_i^2))). The normalisation is
a(u_c)'(p_A - p_B) = 1 for the bodies' closest points at the interior point, so t is the least value of +-(a'x + b) over bodies and P.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.basis import basis
from certifier.closest import Closest
from certifier.cone import Centre, Cone
from certifier.frames import Frame
from certifier.interior_point import Block
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope


@dataclass(frozen=True)
class Box:
    """Coordinates u = (s - mid)/half of a box that contains the polytope; (n,) each."""

    mid: Array
    half: Array

    @classmethod
    def around(cls, lower: Array, upper: Array) -> Box:
        """The box of these bounds, rounded outwards to numbers with few bits."""
        mid = (lower + upper) / 2
        return cls(mid, np.nextafter(np.maximum(upper - mid, mid - lower) * (1 + 1e-12), np.inf))

    def to_u(self, s: Array) -> Array:
        return (s - self.mid) / self.half


@dataclass(frozen=True)
class Program:
    """Blocks of the program in the order side A, side B, [LMI, tau]; y = (Z row-major, [kappa, tau], t).

    Attributes:
        normal, start: (p - 1,) normalisation and a point that meets it.
        scales: (m,) g_j(u_c) of the faces as given; the cones use g_j divided by it.
        points: per side, (N, n) tangent-space points of the coordinates that are values at points, for pseudo-moments.
    """

    blocks: list[Block]
    normal: Array
    start: Array
    scales: Array


def build(
    kinematics: Kinematics, pair: Pair, frame: Frame, polytope: Polytope, box: Box, center: Array, samples: Array, contact: Closest
) -> Program:
    """The program of one pair on P.

    Args:
        polytope: the faces used, (m, n); P must be bounded.
        center: (n,) interior point of P.
        samples: (S, n) points inside P, S > 2^k for the longer chain.
        contact: closest points at the centre, in F, with a positive gap beyond the radii.

    Raises:
        np.linalg.LinAlgError: the cone is numerically degenerate.
    """
    scene = kinematics.scene
    u_c = box.to_u(center)
    slack = polytope.d - polytope.C @ center
    constant = (polytope.d - polytope.C @ box.mid) / slack
    slopes = -(polytope.C * box.half) / slack[:, None]
    n = scene.n
    a, b = scene.geometry(pair.a), scene.geometry(pair.b)
    rounded = a.radius + scene.padding > 0 or b.radius + scene.padding > 0
    columns = 4 * (n + 1) + (1 + n if rounded else 0) + 1
    blocks = []
    for geometry, chain, sign in ((a, frame.chain_a, 1.0), (b, frame.chain_b, -1.0)):
        k, outside = len(chain), [i for i in range(n) if i not in chain]
        space = basis(k)
        cone = Cone.of_faces(space, constant, slopes[:, list(chain)], slopes[:, outside])
        u = np.zeros((len(space.points), n))
        u[:, list(chain)] = space.points
        X = kinematics.numerators(frame.body, geometry.body, box.mid + box.half * u)
        p = np.einsum("nij,vj->vni", X, np.column_stack([geometry.vertices, np.ones(len(geometry.vertices))]))
        B = np.zeros((len(p), cone.N, columns))
        for component in range(4):
            for e in range(n + 1):
                column = B[:, :, component * (n + 1) + e]
                value = sign * p[:, :, component]
                if e == 0:
                    column[:, : len(u)] = value
                elif e - 1 in chain:
                    column[:, : len(u)] = value * (u[:, e - 1] - u_c[e - 1])
                else:
                    column[:, : len(u)] = -u_c[e - 1] * value
                    first = len(u) + outside.index(e - 1) * space.grid
                    column[:, first : first + space.grid] = value[:, : space.grid]
        den = X[:, 3, 3]
        if rounded:
            B[:, : len(u), 4 * (n + 1)] = -(geometry.radius + scene.padding) * den
        B[:, : len(u), -1] = -den
        functional, grid_functional = space.functional(box.to_u(samples)[:, list(chain)])
        outer = [(box.to_u(samples)[:, [i]] * grid_functional).mean(axis=0) for i in outside]
        start = np.concatenate([functional.mean(axis=0), *outer])
        blocks.append(Block(cone, B, Centre(cone, -B[0, :, -1], start)))
    normal, start = np.zeros(columns - 1), np.zeros(columns - 1)
    normal[0 : 3 * (n + 1) : n + 1] = contact.p_a - contact.p_b
    start[0 : 3 * (n + 1) : n + 1] = contact.normal / contact.distance
    start[3 * (n + 1)] = -contact.normal @ (contact.p_a + contact.p_b) / 2 / contact.distance
    if rounded:
        start[4 * (n + 1)] = 1.1 / contact.distance
        start[4 * (n + 1) + 1 :] = 0.1 / contact.distance / n
        blocks += _norm_blocks(n, u_c, columns)
    return Program(blocks, normal, start, slack)


def _norm_blocks(n: int, u_c: Array, columns: int) -> list[Block]:
    """|a| <= kappa on the box: the LMI as a cone of one Gram matrix sampled at e_i + e_j, and tau >= 0."""
    size = n + 4
    rows, cols = np.tril_indices(size)
    points = np.eye(size)[rows] + np.where((rows == cols)[:, None], 0.0, np.eye(size)[cols])
    matrices = np.zeros((columns, size, size))
    shift = np.eye(n + 1)
    shift[1:, 0] = -u_c
    for component in range(3):
        for e in range(n + 1):
            matrix = matrices[component * (n + 1) + e]
            matrix[component, 3:] = matrix[3:, component] = shift[e]
    kappa = matrices[4 * (n + 1)]
    kappa[:3, :3], kappa[3, 3] = np.eye(3), 1.0
    for i in range(n):
        tau = matrices[4 * (n + 1) + 1 + i]
        tau[3, 3], tau[4 + i, 4 + i] = -1.0, 1.0
    matrices[-1] = -np.eye(size)
    lmi = Cone(points, len(points), np.ones((1, len(points))), np.zeros((1, 0)))
    B = np.einsum("ni,pij,nj->np", points, matrices, points)[None]
    x_identity = np.linalg.solve((points[:, :, None] * points[:, None, :]).reshape(len(points), -1)[:, rows * size + cols].T, np.eye(size)[rows, cols])
    line = Cone(np.ones((1, 1)), 1, np.ones((1, 1)), np.zeros((1, 0)))
    signs = np.zeros((n, 1, columns))
    signs[np.arange(n), 0, 4 * (n + 1) + 1 + np.arange(n)] = 1.0
    signs[:, 0, -1] = -1.0
    return [Block(lmi, B, Centre(lmi, -B[0, :, -1], x_identity)), Block(line, signs, Centre(line, np.ones(1), np.ones(1)))]
