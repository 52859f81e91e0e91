"""Exact check of one pair's proof (certifier.proof): what it states is true of the scene's numbers, or ProofError says why not.

For every vertex v of the body on the positive side (and likewise, with the sign changed, on the other)

    e(u) = a'p_v + b den - (r kappa + t) den - sigma sum_j g_j |L_j' rho|^2,   g_0 = 1,   sigma = prod (1 + tau_i^2),

is expanded exactly; on the box |u_i| <= 1 it is at most the sum of its coefficients' absolute values. den >= sigma, so if
that sum is below t sigma then a'p_v/den + b > r kappa >= r |a|, for every point of the polytope: the body, ball included, is strictly
on its side of the plane. That |a| <= kappa on the box is checked at the box's corners, |a| being convex.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from certifier.model import Geometry, Scene
from certifier.proof import Ground, PairProof, ProofError, Side
from certifier.verify.box import check_box
from certifier.verify.kinematics import ExactKinematics, exact

MAX_CORNER_JOINTS = 16
MAX_CHAIN = 7
LIMB = 24
"""Factors are split into limbs of this many bits; sums of 4^k products of two limbs stay exact in 64 bits up to MAX_CHAIN."""


@dataclass(frozen=True)
class PairStatement:
    """What a valid proof proves.

    Attributes:
        gap: lower bound in metres of the distance between the two (padded) bodies on the polytope.
    """

    a: str
    b: str
    gap: float


def verify_pair(scene: Scene, proof: PairProof) -> PairStatement:
    """Check a pair's proof in exact rational arithmetic.

    Raises:
        ProofError: the proof does not hold; the code says which part.
    """
    check_ground(scene, proof.ground)
    return PairCheck(scene, proof.ground).verify(proof)


def check_ground(scene: Scene, ground: Ground) -> None:
    """Check shapes, and that the faces and the joint limits imply the box.

    Raises:
        ProofError: they do not.
    """
    n, m = scene.n, len(ground.d)
    shapes = {"C": (m, n), "d": (m,), "mid": (n,), "half": (n,), "Y_lower": (n, m + 2 * n), "Y_upper": (n, m + 2 * n)}
    for name, shape in shapes.items():
        if getattr(ground, name).shape != shape:
            raise ProofError("proof_malformed", f"{name} of a polytope is {getattr(ground, name).shape}, not {shape}")
    if not (ground.half > 0).all():
        raise ProofError("proof_box", "the box of a polytope is empty")
    limited = scene.polytope(ground.C, ground.d)
    # Doubles just inside the exact corners mid -+ half imply the corners.
    lower, upper = np.nextafter(ground.mid - ground.half, np.inf), np.nextafter(ground.mid + ground.half, -np.inf)
    for i in range(n):
        if not (
            exact(lower[i]) >= exact(ground.mid[i]) - exact(ground.half[i])
            and exact(upper[i]) <= exact(ground.mid[i]) + exact(ground.half[i])
        ):
            raise ProofError("proof_box", "the box of a polytope cannot be represented")
    if not check_box(limited.C, limited.d, lower, upper, ground.Y_lower, ground.Y_upper):
        raise ProofError("proof_box", "the multipliers do not prove the box around the polytope")


class PairCheck:
    """Checks pairs' proofs that share one ground, which :func:`check_ground` has accepted."""

    def __init__(self, scene: Scene, ground: Ground) -> None:
        self._scene, self._ground = scene, ground
        self._ring = fmpq_mpoly_ctx.get([f"u{i}" for i in range(scene.n)], Ordering.lex)
        self._kinematics = ExactKinematics(scene, self._ring, ground.mid, ground.half)
        mid, half = [exact(x) for x in ground.mid], [exact(x) for x in ground.half]
        self._faces = []
        for c, d in zip(ground.C, ground.d, strict=True):
            terms = [exact(x) for x in c]
            constant = exact(d) - sum((x * m for x, m in zip(terms, mid, strict=True)), fmpq(0))
            self._faces.append(self._affine([constant, *(-x * h for x, h in zip(terms, half, strict=True))]))
        one = self._ring.constant(fmpq(1))
        self._faces += [one + u for u in self._ring.gens()] + [one - u for u in self._ring.gens()]

    def verify(self, proof: PairProof) -> PairStatement:
        """Check one proof on the ground.

        Raises:
            ProofError: it does not hold.
        """
        scene = self._scene
        if proof.scene_hash != scene.hash:
            raise ProofError("proof_scene", "the proof is about another scene")
        if not any({p.a, p.b} == {proof.a, proof.b} for p in scene.pairs):
            raise ProofError("proof_pair", f"{proof.a} and {proof.b} are not a pair of the scene")
        if proof.frame not in scene.bodies:
            raise ProofError("proof_frame", f"the scene has no body {proof.frame!r}")
        if not all(0 <= j < len(self._faces) for j in proof.faces):
            raise ProofError("proof_malformed", "the proof uses a face that is not there")
        if proof.plane.shape != (4, scene.n + 1):
            raise ProofError("proof_malformed", "the plane has the wrong shape")
        t, kappa = exact(proof.t), exact(proof.kappa)
        if not t > 0:
            raise ProofError("proof_margin", "the margin is not positive")
        plane = [self._affine([exact(x) for x in row]) for row in proof.plane]
        a, b = scene.geometry(proof.a), scene.geometry(proof.b)
        padding = exact(scene.padding)
        radii = [exact(g.radius) + padding for g in (a, b)]
        norm = self._largest_square_norm(proof)
        if any(radii) and not (kappa >= 0 and kappa * kappa >= norm):
            raise ProofError("proof_norm", "kappa does not bound the plane's normal")
        weights = [self._ring.constant(fmpq(1)), *(self._faces[j] for j in proof.faces)]
        worst = max(
            self._side(geometry, radius, proof.frame, side, sign, plane, t, kappa, weights)
            for geometry, radius, side, sign in ((a, radii[0], proof.sides[0], 1), (b, radii[1], proof.sides[1], -1))
        )
        margin = t - worst
        if not margin > 0:
            raise ProofError("proof_residual", f"{proof.a} and {proof.b}: the residual {float(worst):.3g} eats up the margin {proof.t:.3g}")
        return PairStatement(proof.a, proof.b, 2 * float(margin) / math.sqrt(float(norm)) * (1 - 1e-9))

    def _affine(self, coefficients: list[fmpq]) -> fmpq_mpoly:
        n = self._scene.n
        powers = [tuple(int(i == j - 1) for i in range(n)) for j in range(n + 1)]
        return self._ring.from_dict({p: c for p, c in zip(powers, coefficients, strict=True) if c != 0})

    def _largest_square_norm(self, proof: PairProof) -> fmpq:
        """Largest |a(u)|^2 over the corners of the box; |a| is convex, so over the box."""
        n = self._scene.n
        if n > MAX_CORNER_JOINTS:
            raise ProofError("proof_too_large", f"more than {MAX_CORNER_JOINTS} joints")
        rows = [[exact(x) for x in row] for row in proof.plane[:3]]
        moving = [i for i in range(n) if any(row[i + 1] != 0 for row in rows)]
        largest = fmpq(0)
        for signs in itertools.product((1, -1), repeat=len(moving)):
            normal = [row[0] + sum((s * row[i + 1] for s, i in zip(signs, moving, strict=True)), fmpq(0)) for row in rows]
            largest = max(largest, sum((x * x for x in normal), fmpq(0)))
        return largest

    def _side(
        self,
        geometry: Geometry,
        radius: fmpq,
        frame: str,
        side: Side,
        sign: int,
        plane: list[fmpq_mpoly],
        t: fmpq,
        kappa: fmpq,
        weights: list[fmpq_mpoly],
    ) -> fmpq:
        """The largest residual over the body's vertices, divided by sigma."""
        joints = [joint.index for joint, _ in self._kinematics.path(frame, geometry.body) if joint.index is not None]
        length = 2 ** len(side.chain)
        shape = (len(geometry.vertices), len(weights))
        if (
            len(joints) > MAX_CHAIN
            or sorted(joints) != sorted(side.chain)
            or side.exponent.shape != shape
            or side.mantissa.shape != (*shape, length * (length + 1) // 2)
        ):
            raise ProofError("proof_malformed", f"the Gram factors of {geometry.name} do not fit")
        X = self._kinematics.pose(frame, geometry.body)
        sigma = self._kinematics.scale(frame, geometry.body)
        den = X[3][3]
        fixed = sign * (sum((plane[i] * X[i][3] for i in range(3)), start=plane[3] * den)) - (radius * kappa + t) * den
        axes = [sign * sum((plane[i] * X[i][j] for i in range(3)), start=self._ring.constant(fmpq(0))) for j in range(3)]
        worst = fmpq(0)
        for v, vertex in enumerate(geometry.vertices):
            residual = fixed + sum((exact(x) * axis for x, axis in zip(vertex, axes, strict=True)), start=self._ring.constant(fmpq(0)))
            certificate = self._ring.constant(fmpq(0))
            for weight, square in zip(weights, self._squares(side, v), strict=True):
                certificate += weight * square
            residual -= sigma * certificate
            worst = max(worst, sum((abs(c) for c in residual.coeffs()), fmpq(0)))
        return worst / sigma

    def _squares(self, side: Side, v: int) -> list[fmpq_mpoly]:
        """|L_j' rho|^2 of vertex v for every face, exactly."""
        gather, powers = _monomials(side.chain, self._scene.n)
        length = 2 ** len(side.chain)
        rows, columns = np.tril_indices(length)
        mantissa = side.mantissa[v].astype(np.int64)
        if (np.abs(mantissa) > 1 << 2 * LIMB).any() or (np.abs(side.exponent[v]) > 1000).any():
            raise ProofError("proof_malformed", "a Gram factor is out of range")
        L = np.zeros((2, len(mantissa), length, length), dtype=np.int64)
        L[0][:, rows, columns], L[1][:, rows, columns] = mantissa >> LIMB, mantissa & (1 << LIMB) - 1
        squares = []
        for high, low, exponent in zip(*L, side.exponent[v], strict=True):
            coefficients = np.zeros(len(powers), dtype=object)
            for shift, product in ((2 * LIMB, high @ high.T), (LIMB, high @ low.T), (LIMB, low @ high.T), (0, low @ low.T)):
                gathered = np.zeros(len(powers), dtype=np.int64)
                np.add.at(gathered, gather, product)
                coefficients += gathered.astype(object) << shift
            polynomial = self._ring.from_dict({p: fmpq(c) for p, c in zip(powers, coefficients, strict=True) if c})
            squares.append(fmpq(2) ** (2 * int(exponent)) * polynomial)
        return squares


def _monomials(chain: tuple[int, ...], n: int) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Index of rho_i rho_j among the monomials, (L, L), and the monomials' exponents."""
    subsets = np.array(list(itertools.product(range(2), repeat=len(chain))), dtype=int).reshape(2 ** len(chain), len(chain))
    sums = subsets[:, None, :] + subsets[None, :, :]
    index = sums @ (3 ** np.arange(len(chain))) if chain else np.zeros((1, 1), dtype=int)
    powers = []
    for code in range(3 ** len(chain)):
        exponents = [0] * n
        for position, joint in enumerate(chain):
            exponents[joint] = code // 3**position % 3
        powers.append(tuple(exponents))
    return index, powers
