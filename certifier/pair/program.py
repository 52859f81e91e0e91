"""The pair program (11) of C-IRIS for two bodies conv(V_A) + ball(r_A) and conv(V_B) + ball(r_B) is built here as data of interior_point.

In the frame F the plane is a(u)'x + b(u) = 0. Here u = (s - mid)/half are the coordinates of P's bounding box, and
[a; b] = Z [1; u - u_c] with u the joints in play alone. With p_v and den the numerator and the denominator of vertex v, the program asks

    a'p_v + b den - (r_A kappa + t) den   in K_A for v in V_A,     -(a'p_v + b den) - (r_B kappa + t) den   in K_B for v in V_B.

K_A and K_B are the weighted sums of squares over P's faces in the joints in play (conic.cone). A joint between F and the body that is
not in play keeps degree 2. Its range counts by the weight 1 - u_i^2 = (1 + u_i)(1 - u_i)^2/2 + (1 - u_i)(1 + u_i)^2/2.

Where a radius is positive, the program also demands |a| <= kappa on the box, by

    [ kappa I   A1                                     ]
    [ A1'       kappa E00 - sum_i tau_i (E00 - E_ii)   ]  psd,   tau >= 0,   a(u) = A1 [1; u]

(the Schur complement at [1; u] says |a|^2 <= kappa (kappa - sum_i tau_i (1 - u_i^2))).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from certifier.conic.basis import Basis, basis
from certifier.conic.cone import Centre, Cone, Weights
from certifier.conic.interior_point import Block
from certifier.kinematics import Kinematics
from certifier.model import Array, Box, Polytope, Volume
from certifier.pair.frames import Frame


class Sides:
    """Makes the cones of all chains on one polytope, for the same joints in play and the same faces, and shares them between the pairs.

    Args:
        polytope: P's faces, (m, n); P must be bounded.
        box: the box around P whose coordinates are u.
        joints: those in play, ascending; the plane moves with them.
        faces: which faces the cones use, in the joints in play alone, numbered as in :class:`certifier.proof.pair.PairProof`.
        center: (n,) interior point of P.
        samples: (S, n) points inside P, with S > 2^k for the longest chain.
    """

    def __init__(
        self,
        kinematics: Kinematics,
        polytope: Polytope,
        box: Box,
        joints: tuple[int, ...],
        faces: tuple[int, ...],
        center: Array,
        samples: Array,
    ) -> None:
        self.kinematics, self.box, self.joints, self.faces = kinematics, box, joints, faces
        self.center, self.u_c = center, box.to_u(center)
        eye = np.eye(len(center))
        constant = np.concatenate([polytope.d - polytope.C @ box.mid, np.ones(2 * len(center))])
        slopes = np.concatenate([-polytope.C * box.half, eye, -eye])
        self._slack = constant + slopes @ self.u_c
        self._constant, self._slopes = constant / self._slack, slopes / self._slack[:, None]
        self._u = box.to_u(samples)
        self._centres: dict[tuple[int, ...], tuple[Cone, Centre]] = {}

    @cached_property
    def norm_blocks(self) -> list[Block]:
        """Returns the blocks that bound |a|, which serve all pairs where a radius is positive."""
        return _norm_blocks(len(self.joints), self.u_c[list(self.joints)])

    @property
    def scales(self) -> Array:
        """Returns what 1 and the used faces were divided by to be 1 at the centre, (f + 1,)."""
        return np.concatenate([[1.0], self._slack[list(self.faces)]])

    def space(self, chain: tuple[int, ...]) -> Basis:
        """Returns the basis of the chain's polynomials."""
        return basis(len(chain), tuple(place for place, joint in enumerate(chain) if joint in self.joints))

    def cone_of(self, chain: tuple[int, ...], faces: tuple[int, ...]) -> Cone:
        """Returns the chain's cone for 1 and any faces; joints that are neither in play nor on the chain are at the centre."""
        inside, outside, chosen = list(chain), self.outside(chain), list(faces)
        slopes = self._slopes[chosen]
        rest = [i for i in range(len(self.u_c)) if i not in inside + outside]
        constant = self._constant[chosen] + slopes[:, rest] @ self.u_c[rest]
        return Cone.of_faces(self.space(chain), constant, slopes[:, inside], slopes[:, outside])

    def points(self, chain: tuple[int, ...]) -> Array:
        """Returns the points u of the chain's basis, (N_A, n), which are 0 outside the chain."""
        space = self.space(chain)
        u = np.zeros((len(space.points), self.kinematics.scene.n))
        u[:, list(chain)] = space.points
        return u

    def outside(self, chain: tuple[int, ...]) -> list[int]:
        """Returns the joints in play that are not on the chain, in the order of the cone's outside coordinates."""
        return [i for i in self.joints if i not in chain]

    def cone(self, chain: tuple[int, ...]) -> tuple[Cone, Centre]:
        """Returns the chain's cone and its centre near den.

        Raises:
            np.linalg.LinAlgError: the cone is numerically degenerate.
        """
        if chain not in self._centres:
            space, inside, outside = self.space(chain), list(chain), self.outside(chain)
            cone = self.cone_of(chain, self.faces)
            unit = np.zeros(cone.N)
            unit[: len(space.points)] = self._denominator(inside, space.points)
            functional, grid = space.functional(self._u[:, inside])
            # Towards the centre the denominator counts alike everywhere; these weights make it do so at the start as well.
            mass = 1 / self._denominator(inside, self._u[:, inside])
            start = np.concatenate([mass @ functional, *((mass * self._u[:, i]) @ grid for i in outside)])
            self._centres[chain] = cone, Centre(cone, unit, start)
        return self._centres[chain]

    def _denominator(self, joints: list[int], u: Array) -> Array:
        """Returns prod (1 + s_i^2) over the revolute ones of some joints, (S, k) -> (S,)."""
        product: Array = np.prod(self.kinematics.scene.of(joints).denominator(self.box.mid[joints] + self.box.half[joints] * u), axis=1)
        return product

    def means(self, chain: tuple[int, ...], x: Array) -> tuple[Array, Array]:
        """Returns the means of s under pseudo-moments x, (R, N) -> (R, n), and the masses x(1), (R,).

        The joints that are neither on the chain nor in play are at the centre.
        """
        space, inside, outside = self.space(chain), list(chain), self.outside(chain)
        first, rest = x[:, : len(space.points)], x[:, len(space.points) :].reshape(len(x), len(outside), space.grid)
        mass = first.sum(axis=1)
        u = np.tile(self.u_c, (len(x), 1))
        u[:, inside] = first @ space.points / mass[:, None]
        u[:, outside] = rest.sum(axis=2) / mass[:, None]
        return self.box.mid + self.box.half * u, mass


def build(sides: Sides, volumes: tuple[Volume, Volume], frame: Frame) -> list[Block]:
    """Builds the program of two volumes: the blocks of side A, of side B and, where a radius is positive, of the LMI and of tau.

    The unknowns are y = (Z row-major, [kappa, tau], t), where Z is (4, j + 1) and tau (j,) for j joints in play. The brackets hold what is
    there only where a radius is positive.

    Raises:
        np.linalg.LinAlgError: a cone is numerically degenerate.
    """
    scene, joints, j = sides.kinematics.scene, list(sides.joints), len(sides.joints)
    a, b = volumes
    radii = [volume.radius + scene.padding_between(volumes) for volume in volumes]
    rounded = max(radii) > 0
    columns = _columns(j, rounded)
    blocks = []
    for volume, chain, radius, sign in ((a, frame.chain_a, radii[0], 1.0), (b, frame.chain_b, radii[1], -1.0)):
        cone, centre = sides.cone(chain)
        u, grid, outside = sides.points(chain), sides.space(chain).grid, sides.outside(chain)
        X = sides.kinematics.numerators(frame.body, volume.body, sides.box.mid + sides.box.half * u)
        p = sign * np.einsum("nij,vj->vin", X, np.column_stack([volume.vertices, np.ones(len(volume.vertices))]))
        B = np.zeros((len(p), cone.N, columns))
        plane = np.zeros((len(p), cone.N, 4, j + 1))
        first = np.swapaxes(plane[:, : len(u)], 1, 2)
        first[..., 0] = p
        first[..., 1:] = p[..., None] * (u[:, joints] - sides.u_c[joints])
        for position, joint in enumerate(outside):
            start = len(u) + position * grid
            np.swapaxes(plane[:, start : start + grid], 1, 2)[..., 1 + joints.index(joint)] = p[:, :, :grid]
        B[:, :, : 4 * (j + 1)] = plane.reshape(len(p), cone.N, -1)
        if rounded:
            B[:, : len(u), 4 * (j + 1)] = -radius * X[:, 3, 3]
        B[:, :, -1] = -centre.w
        blocks.append(Block(cone, B, centre))
    return blocks + (sides.norm_blocks if rounded else [])


def _columns(n: int, rounded: bool) -> int:
    """Returns how many unknowns y has for n joints in play."""
    return 4 * (n + 1) + (1 + n if rounded else 0) + 1


def _norm_blocks(n: int, u_c: Array) -> list[Block]:
    """Returns the blocks that say |a| <= kappa on the box: the LMI as a cone of one Gram matrix sampled at e_i + e_j, and tau >= 0."""
    size, columns = n + 4, _columns(n, rounded=True)
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
    lmi = Cone(len(points), Weights(points, np.ones((1, len(points))), np.zeros((1, 0))))
    B = np.einsum("ni,pij,nj->np", points, matrices, points)[None]
    x_identity = np.linalg.solve(
        (points[:, :, None] * points[:, None, :]).reshape(len(points), -1)[:, rows * size + cols].T, np.eye(size)[rows, cols]
    )
    line = Cone(1, Weights(np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 0))))
    signs = np.zeros((n, 1, columns))
    signs[np.arange(n), 0, 4 * (n + 1) + 1 + np.arange(n)] = 1.0
    signs[:, 0, -1] = -1.0
    blocks = [Block(lmi, B, Centre(lmi, -B[0, :, -1], x_identity))]
    if n:
        blocks.append(Block(line, signs, Centre(line, np.ones(1), np.ones(1))))
    for block in blocks:
        block.columns[:, :, -1] = -block.centre.w
    return blocks
