"""The pair programs' certificates are the rationals of the polytope step: identities on a trust box, with fixed face multipliers.

Let Z = [a; b] be the plane and g_j = d_j - c_j'w the faces. For every vertex v of a pair's bodies

    +-(a'p_v + b den) - r kappa den - t' den - sum_j lambda_vj g_j   in K,     |a| <= kappa at the corners of the box.

K is the weighted sums of squares over the faces of the trust box (certifier.conic.cone), so the multipliers of 1 and of the box stay free.

A proof is about a polytope and a box of its own. A face of either that holds on all of the trust box needs no multiplier here. Any other
face is written as a nonnegative combination of the region's faces (Farkas), and its multiplier is handed on to them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from certifier.conic.arrow import Group, Term
from certifier.conic.basis import rho, subsets
from certifier.conic.cone import Cone
from certifier.kinematics import Kinematics
from certifier.model import Array, Box, Polytope, Scene
from certifier.pair.program import Sides
from certifier.polytopes.ellipsoid import Ellipsoid
from certifier.polytopes.polytope import support
from certifier.proof.pair import PairProof, Side

CHUNK = 200_000
"""The Schur complements that are formed at once have at most this many entries, or belong to one vertex."""
CEILING = 10.0
"""The plane's function at the centre may grow by this factor."""
CONE_SAMPLES = 300


def holds_on(proof: PairProof, box: Box, faces: Iterable[int]) -> bool:
    """Returns whether these faces, numbered as in the proof, hold on all of the box."""
    return not _cut(*_face_rows(proof, faces), box).any()


def face_multipliers(proof: PairProof, faces: Polytope, box: Box) -> Array:
    """Returns weights Y, (f, m), that hand the multipliers of the proof's f faces on to the region's m faces.

    A weight is 0 where the trust box takes the multiplier over.

    Args:
        faces: m faces, then the 2n of the trust box.
    """
    C, d = _face_rows(proof, proof.faces)
    m = len(faces.d) - 2 * len(box.mid)
    Y = np.zeros((len(proof.faces), m))
    for i in np.flatnonzero(_cut(C, d, box)):
        same = np.flatnonzero((faces.C[:m] == C[i]).all(axis=1) & (faces.d[:m] <= d[i]))
        if same.size:
            Y[i, same[0]] = 1.0
        else:
            Y[i] = support(faces, C[i])[1][:m]
    return Y


def _face_rows(proof: PairProof, faces: Iterable[int]) -> tuple[Array, Array]:
    """Returns faces of a proof, those of its polytope or of its box, as rows c's <= d."""
    ground, chosen = proof.ground, list(faces)
    axes = np.diag(1 / ground.half)
    C = np.concatenate([ground.C, -axes, axes])
    d = np.concatenate([ground.d, 1 - ground.mid / ground.half, 1 + ground.mid / ground.half])
    return C[chosen], d[chosen]


def _cut(C: Array, d: Array, box: Box) -> NDArray[np.bool_]:
    """Returns which rows cut something off the box, except for rounding."""
    reach = np.abs(C) @ box.half
    return np.asarray(C @ box.mid + reach > d + 1e-9 * reach)


def squares(proof: PairProof, side: Side, points: Array) -> Array:
    """Returns the values of |L_j' rho|^2 for the faces used, (V, f, S), at points s (S, n)."""
    u = ((points - proof.ground.mid) / proof.ground.half)[:, list(side.chain)]
    monomials = rho(u) / np.sqrt(3.0) ** subsets(len(side.chain)).sum(axis=1)
    return np.square(np.einsum("nl,vjlk->vjnk", monomials, side.factors[:, 1:])).sum(axis=3)


class Identities:
    """The identities belong to some vertices of one body of one pair; the class implements :class:`certifier.conic.arrow.Rationals`.

    Args:
        lift: basis functions of [1; u] in the coordinates of the cone, see :class:`Lift`.
        p: (R, N_A, 4) numerators and denominator of the vertices, the side's sign included.
        rounding: (N_A,) what kappa is multiplied by, or None without kappa.
        margin: (N_A,) t' den.
        multipliers: (R, q, N_A) of the q faces ``used``.
        used: (q,) indices of the faces that have multipliers.
    """

    def __init__(
        self, cone: Cone, start: Array, lift: Lift, p: Array, rounding: Array | None, margin: Array, multipliers: Array, used: Array
    ) -> None:
        self.cone, self.start = cone, start
        self._lift, self._p, self._rounding, self._margin, self._multipliers = lift, p, rounding, margin, multipliers
        n = lift.n
        self.coupled = (used[:, None] * (n + 2) + np.arange(n + 1)).ravel()

    def __len__(self) -> int:
        return len(self._p)

    def columns(self) -> tuple[Array, Array, Array]:
        """Returns constant (R, N), local (R, N, p) and coupled (R, N, q (n + 1))."""
        R, N, n = len(self._p), self.cone.N, self._lift.n
        constant = np.zeros((R, N))
        constant[:, : len(self._margin)] = -self._margin
        local = np.zeros((R, N, 4 * (n + 1) + (self._rounding is not None)))
        for component in range(4):
            local[:, :, component * (n + 1) : (component + 1) * (n + 1)] = self._lift(self._p[:, :, component])
        if self._rounding is not None:
            local[:, : len(self._rounding), -1] = self._rounding
        coupled = np.zeros((R, N, self._multipliers.shape[1], n + 1))
        for face in range(coupled.shape[2]):
            lifted = self._lift(self._multipliers[:, face])
            coupled[:, :, face, :n] = lifted @ self._lift.ball.T
            coupled[:, :, face, n] = -lifted[:, :, 0]
        return constant, local, coupled.reshape(R, N, -1)


class Lift:
    """Multiplies polynomials of a chain by 1 and u, with products in the coordinates of the cone.

    Args:
        u: (N_A, n) the chain's points, 0 outside the chain.
        grid: how many leading points carry the outside joints.
        outside: the other joints, in the order of the cone.
        ball: (n, n + 1) with w = ball [1; u].
    """

    def __init__(self, u: Array, grid: int, outside: list[int], ball: Array) -> None:
        self.n, self.ball = u.shape[1], ball
        self._affine = np.concatenate([np.ones((len(u), 1)), u], axis=1)
        self._grid, self._outside = grid, outside

    def __call__(self, values: Array) -> Array:
        """Returns the products of polynomials with 1 and u: (R, N_A) values at the points -> (R, N, n + 1)."""
        points = values.shape[1]
        lifted = np.zeros((len(values), points + len(self._outside) * self._grid, self.n + 1))
        lifted[:, :points] = values[:, :, None] * self._affine
        for position, joint in enumerate(self._outside):
            start = points + position * self._grid
            lifted[:, start : start + self._grid, 1 + joint] = values[:, : self._grid]
        return lifted


class IdentityGroups:
    """Makes the group of identities of each proof.

    Args:
        scale: (m,) what the faces are multiplied by in the step's coordinates.
        share: the part of a proof's margin that is kept.
    """

    def __init__(self, scene: Scene, box: Box, ellipsoid: Ellipsoid, scale: Array, share: float) -> None:
        self._scene, self._box, self._scale, self._share = scene, box, scale, share
        self._kinematics = Kinematics.of(scene)
        n = scene.n
        samples = np.random.default_rng(0).uniform(box.lower, box.upper, (CONE_SAMPLES, n))
        none, every = Polytope(np.zeros((0, n)), np.zeros(0)), tuple(range(n))
        self._sides = Sides(self._kinematics, none, box, every, tuple(range(2 * n)), box.mid, samples)
        inverse = np.linalg.inv(ellipsoid.shape)
        self._ball = inverse @ np.column_stack([box.mid - ellipsoid.center, np.diag(box.half)])
        self._center = ellipsoid.center

    def group(self, proof: PairProof, Y: Array) -> Group:
        """Returns the pair's identities with multipliers handed on by Y, (f, m).

        Raises:
            np.linalg.LinAlgError: a cone of the trust box is numerically degenerate.
        """
        n, box, ground = self._scene.n, self._box, proof.ground
        used = np.flatnonzero(Y.any(axis=0))
        padding = self._scene.padding_between(proof.volumes)
        radii = [volume.radius + padding for volume in proof.volumes]
        rounded = max(radii) > 0
        blocks = []
        height = np.zeros(4 * (n + 1))
        for volume, radius, side, sign in zip(proof.volumes, radii, proof.sides, (1.0, -1.0), strict=True):
            chain = side.chain
            space, (cone, centre) = self._sides.space(chain), self._sides.cone(chain)
            u = self._sides.points(chain)
            s = box.mid + box.half * u
            lift = Lift(u, space.grid, self._sides.outside(chain), self._ball)
            vertices = np.column_stack([volume.vertices, np.ones(len(volume.vertices))])
            X = self._kinematics.numerators(proof.frame, volume.body, s)
            p = sign * np.einsum("nij,vj->vni", X, vertices)
            multipliers = np.einsum("vfn,fm->vmn", squares(proof, side, s), Y[:, used] / self._scale[used])
            rounding = -radius * X[:, 3, 3] if rounded else None
            size = max(1, CHUNK // cone.N**2)
            for first in range(0, len(p), size):
                part = slice(first, first + size)
                margin = self._share * proof.t * X[:, 3, 3]
                blocks.append(Identities(cone, centre.x, lift, p[part], rounding, margin, multipliers[part], used))
            at_center = self._kinematics.numerators(proof.frame, volume.body, self._center[None])[0]
            height += np.outer(sign * (at_center @ vertices.T).sum(axis=1), np.append(1.0, box.to_u(self._center))).ravel()
        plane = np.column_stack(
            [proof.plane[:, 0] + proof.plane[:, 1:] @ ((box.mid - ground.mid) / ground.half), proof.plane[:, 1:] * box.half / ground.half]
        )
        start = plane.ravel()
        if rounded:
            start = np.append(start, 1.001 * np.sqrt(_corner_norms(plane).max()))
        ceiling = CEILING * float(height @ plane.ravel())
        return Group(blocks, start, _plane_barrier(n, height, ceiling, rounded))


def _corners(n: int) -> Array:
    return np.array(list(itertools.product((1.0, -1.0), repeat=n))).reshape(-1, n)


def _corner_norms(plane: Array) -> Array:
    return np.square(plane[:3, :1] + plane[:3, 1:] @ _corners(plane.shape[1] - 1).T).sum(axis=0)


def _plane_barrier(n: int, height: Array, ceiling: float, rounded: bool) -> Term:
    """Returns the barrier -log of ceiling - height'z and, with kappa, of the second-order cones |a| <= kappa at the corners of the box."""
    size = 4 * (n + 1) + rounded
    lifted = np.concatenate([np.ones((2**n, 1)), _corners(n)], axis=1) if rounded else np.zeros((0, n + 1))
    height = np.append(height, np.zeros(size - len(height)))

    def term(z: Array) -> tuple[float, Array, Array]:
        slack = ceiling - float(height @ z)
        gradient, hessian = height / slack, np.outer(height, height) / slack**2
        normals = lifted @ z[: 3 * (n + 1)].reshape(3, n + 1).T
        cone = z[-1] ** 2 - np.square(normals).sum(axis=1)
        if slack <= 0 or (rounded and (z[-1] <= 0 or cone.min() <= 0)):
            return np.inf, gradient, hessian
        if rounded:
            rows = np.zeros((len(cone), size))
            rows[:, : 3 * (n + 1)] = (-2 * normals[:, :, None] * lifted[:, None, :]).reshape(len(cone), -1)
            rows[:, -1] = 2 * z[-1]
            gradient = gradient - (rows / cone[:, None]).sum(axis=0)
            curvature = np.einsum("ke,kf->ef", lifted / cone[:, None], lifted)
            hessian = hessian + (rows / cone[:, None]).T @ (rows / cone[:, None])
            for i in range(3):
                at = slice(i * (n + 1), (i + 1) * (n + 1))
                hessian[at, at] += 2 * curvature
            hessian[-1, -1] -= 2 * float((1 / cone).sum())
        return -float(np.log(slack) + np.log(cone).sum()), gradient, hessian

    return term
