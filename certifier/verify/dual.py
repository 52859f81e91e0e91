"""Rigorous check of a dual proof: no certificate of a pair in this frame, with the given polytope's faces, can exist.

A certificate gives, for every vertex v of a body, +-(a'p_v + b den) - (r kappa + t) den = sum_j g_j rho'Q_j rho, Q_j psd, t > 0.
Let x_v be functionals whose localising matrices Lambda_j(x_v) = x_v(g_j rho rho') are all psd, and R = sum_v +-x_v(p_v (x) [1, u]),
(4, n + 1). Applied to the identities and added up, they give

    0 <= <Z, R> - kappa sum_v r_v x_v(den) - t sum_v x_v(den).

Where no radius is involved and R = 0, it follows that t <= 0. Where one is, the rows R_a of R that belong to a need not vanish: with
Y = [[Yaa, -R_a/2], [-R_a'/2, Ybb]] psd, Ybb_ii <= Ybb_00 and tr Yaa + Ybb_00 <= sum_v r_v x_v(den), the matrix inequality by which
kappa bounds |a| (certifier.pair.program) gives <Z_a, R_a> <= kappa sum_v r_v x_v(den).

R never vanishes in floating point. The proof names as many moments as R has entries to vanish; changing them by c, G c = -R, makes R
zero, and |c| is bounded by ball arithmetic. Every matrix is then shown to be positive definite whatever such a change does: it is reduced
by the rounding of its entries and by the most that the change can do (Gershgorin), and by 2^-40 of its trace, far more than the rounding
of any Cholesky factorisation of its size. If that succeeds, the matrix is positive definite (Rump, *Verification of positive
definiteness*, BIT 46, 2006). Where the equations are dependent, as for two balls, fewer are solved; what is left of the others bounds t
relative to the plane's coefficients, the ``slack``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import Ordering, arb, arb_mat, ctx, fmpq, fmpq_mpoly_ctx

from certifier.errors import ProofError
from certifier.model import Array, Pair, Volume
from certifier.proof import limits
from certifier.proof.negative import DualProof
from certifier.verify import limbs
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.moments import localised, table
from certifier.verify.pair import check_ground, check_interior, faces_of
from certifier.verify.residual import POSITION_BITS, Numerators, dyadic
from certifier.verify.scene import check_scene

PRECISION = 256
ENTRY_ROUNDING = 2.0**-45
"""Relative rounding of a sum of fewer than 200 products of doubles, several times over."""
CHOLESKY_ROUNDING = 2.0**-40
LARGEST_SLACK = 1e-9


@dataclass(frozen=True)
class DualStatement:
    """What a valid dual proof proves.

    Attributes:
        pair: the pair that cannot be certified with a plane affine in s, in this frame.
        slack: a certificate's margin would be at most this part of its plane's largest coefficient; 0 when there is none at all.
    """

    pair: Pair
    frame: str
    slack: float


def verify_dual(proof: DualProof) -> DualStatement:
    """Check a dual proof.

    Raises:
        ProofError: it does not hold; the code says which part.
    """
    scene = proof.scene
    check_scene(scene)
    if proof.pair not in scene.pairs or proof.frame not in scene.bodies:
        raise ProofError("proof_pair", "the proof is about no pair, or no body, of the scene")
    check_ground(scene, proof.ground)
    check_interior(scene, proof.ground, proof.interior)
    precision = ctx.prec
    ctx.prec = PRECISION
    try:
        return _Check(proof).statement()
    finally:
        ctx.prec = precision


class _Check:
    def __init__(self, proof: DualProof) -> None:
        scene, ground = proof.scene, proof.ground
        self._proof, self._n = proof, scene.n
        ring = fmpq_mpoly_ctx.get([f"u{i}" for i in range(scene.n)], Ordering.lex)
        kinematics = ExactKinematics.on_box(scene, ring, ground.mid, ground.half)
        volumes = [Volume.of(scene.geometry(name)) for name in (proof.pair.a, proof.pair.b)]
        numerators = [Numerators.between(kinematics, proof.frame, volume.body) for volume in volumes]
        self._sides = [_Side(*parts, self._n) for parts in zip(volumes, numerators, proof.moments, strict=True)]
        self._radii = [exact(volume.radius) + exact(scene.padding) for volume in volumes]
        self._faces = np.array([[float(x) for x in face] for face in [[fmpq(1), *[fmpq(0)] * self._n], *faces_of(ground)]])
        rows = (3,) if self._rounded else range(4)
        self._vanishing = [(c, e) for c in rows for e in range(self._n + 1)]

    @property
    def _rounded(self) -> bool:
        return any(self._radii)

    def statement(self) -> DualStatement:
        A, B = self._sides
        R = [[A.sums[c][e] - B.sums[c][e] for e in range(self._n + 1)] for c in range(4)]
        change, left = self._correction(R)
        mass, slack = A.mass(change) + B.mass(change), 0.0
        if not mass > 0:
            raise ProofError("proof_dual", "the functionals have no mass")
        if len(self._proof.equations) < len(self._vanishing):
            slack = float(np.nextafter(float((left / mass).upper()), np.inf))
            if not slack <= LARGEST_SLACK:
                raise ProofError("proof_dual", f"the equations are not met: {slack:.3g}")
        for side in self._sides:
            side.check(self._faces, change)
        if self._rounded:
            self._check_normal(R, change)
        return DualStatement(self._proof.pair, self._proof.frame, slack)

    def _correction(self, R: list[list[arb]]) -> tuple[float, arb]:
        """Bounds of the change that makes the equations named vanish, and of the sum of what is left of the others."""
        proof, named = self._proof, self._proof.equations
        if len(set(named)) != len(named) or len(named) != len(proof.entries) or not all(0 <= k < len(self._vanishing) for k in named):
            raise ProofError("proof_malformed", "the equations and the moments that meet them do not fit")
        if not named:
            return 0.0, sum((abs(R[c][e]) for c, e in self._vanishing), arb(0))
        columns = [self._column(*(int(i) for i in entry)) for entry in proof.entries]
        G = arb_mat([[column[self._vanishing[k]] for column in columns] for k in named])
        try:
            change = G.solve(arb_mat([[-R[c][e]] for c, e in (self._vanishing[k] for k in named)]))
        except ZeroDivisionError as error:
            raise ProofError("proof_dual", "the equations cannot be met by the moments named") from error
        left = arb(0)
        for k, (c, e) in enumerate(self._vanishing):
            if k not in named:
                left += abs(R[c][e] + sum((column[c, e] * change[i, 0] for i, column in enumerate(columns)), arb(0)))
        return float(np.nextafter(max(float(abs(change[i, 0]).upper()) for i in range(len(columns))), np.inf)), left

    def _column(self, side: int, vertex: int, monomial: int) -> dict[tuple[int, int], arb]:
        """What one unit of a moment adds to R."""
        if side not in (0, 1) or not self._sides[side].has(vertex, monomial):
            raise ProofError("proof_malformed", "the proof names a moment that is not there")
        return self._sides[side].column(vertex, monomial, 1 - 2 * side)

    def _check_normal(self, R: list[list[arb]], change: float) -> None:
        """The part of the proof that concerns kappa."""
        n, (aa, bb) = self._n, self._proof.normal
        if aa.shape != (3, 3) or bb.shape != (n + 1, n + 1) or not (np.array_equal(aa, aa.T) and np.array_equal(bb, bb.T)):
            raise ProofError("proof_malformed", "the matrices that concern the normal do not fit")
        if not all(bb[i, i] <= bb[0, 0] for i in range(1, n + 1)):
            raise ProofError("proof_dual", "the matrix that concerns the normal has a diagonal entry larger than its first")
        trace = sum((arb(float(aa[i, i])) for i in range(3)), arb(float(bb[0, 0])))
        if not trace <= sum((arb(radius) * side.mass(change) for radius, side in zip(self._radii, self._sides, strict=True)), arb(0)):
            raise ProofError("proof_dual", "the matrix that concerns the normal is too large")
        reach = change * sum(side.reach for side in self._sides)
        off = np.array([[-float(R[c][e].mid()) / 2 for e in range(n + 1)] for c in range(3)])
        error = np.array(
            [[float(R[c][e].rad()) + abs(float(R[c][e].mid())) * ENTRY_ROUNDING + reach for e in range(n + 1)] for c in range(3)]
        )
        Y, E = np.zeros((2, n + 4, n + 4))
        Y[:3, :3], Y[3:, 3:], Y[:3, 3:], Y[3:, :3] = aa, bb, off, off.T
        E[:3, 3:], E[3:, :3] = error, error.T
        _check_positive(Y[None], E[None])


class _Side:
    """The functionals of one body's vertices."""

    def __init__(self, volume: Volume, numerators: Numerators, moments: Array, n: int) -> None:
        V, size, self._chain = len(volume.vertices), 3 ** len(numerators.chain), numerators.chain
        self._index = table(self._chain, n)
        if moments.shape != (V, self._index.max() + 1):
            raise ProofError("proof_malformed", f"the moments of {volume.geometries[0]} do not fit")
        if moments.size > limits.MOMENTS:
            raise ProofError("proof_too_large", f"a body has {moments.size} moments; at most {limits.MOMENTS} are checked")
        self._moments = moments
        places, vertex_bits = dyadic([[*(exact(x) for x in vertex), fmpq(1)] for vertex in volume.vertices])
        values, moment_bits = dyadic([[exact(x) for x in row] for row in moments])
        self._bits = POSITION_BITS + vertex_bits
        largest = max(sum(map(abs, place)) for place in places)
        self._positions = limbs.normal(limbs.product(limbs.of_rows(places), numerators.columns)).reshape(-1, V, 4, size)
        # Row m of what the positions are multiplied with holds x_v(u_e m) for all e.
        expanded = [[values[v][i] for i in row] for v in range(V) for row in self._index.T]
        flat = np.moveaxis(self._positions, 2, 1).reshape(len(self._positions), 4, V * size)
        product = limbs.integers(limbs.product(flat, limbs.of_rows(expanded)))
        rounding = largest * max(sum(abs(row[e]) for row in expanded) for e in range(n + 1))
        self.sums = [[_ball(x, rounding, self._bits + moment_bits) for x in row] for row in product]
        self._largest = largest
        (sizes,) = limbs.absolute_sums(self._positions.reshape(len(self._positions), 1, -1))
        self.reach = float(fmpq(sizes + largest * 4 * V * size) / fmpq(2) ** self._bits) * (1 + ENTRY_ROUNDING)

    def has(self, vertex: int, monomial: int) -> bool:
        return 0 <= vertex < len(self._moments) and 0 <= monomial < self._moments.shape[1]

    def mass(self, change: float) -> arb:
        """sum_v x_v(den), whatever the change."""
        return self.sums[3][0] + arb(0, change * self.reach)

    def column(self, vertex: int, monomial: int, sign: int) -> dict[tuple[int, int], arb]:
        """What one unit of a moment adds to R: sign times the coefficients of p_v that meet it."""
        column = {(c, e): arb(0) for c in range(4) for e in range(len(self._index))}
        for e, m in zip(*np.nonzero(self._index == monomial), strict=True):
            for c, (x,) in enumerate(limbs.integers(self._positions[:, vertex, :, m, None])):
                column[c, int(e)] = _ball(sign * x, self._largest, self._bits)
        return column

    def check(self, faces: Array, change: float) -> None:
        """Every localising matrix is positive definite."""
        k = len(self._chain)
        if len(faces) * len(self._moments) * 4**k > limits.LOCALISED:
            raise ProofError("proof_too_large", f"a body's localising matrices have more than {limits.LOCALISED} entries")
        subsets = np.arange(2**k)[:, None] >> np.arange(k) & 1
        code = (subsets[:, None, :] + subsets[None, :, :]) @ 3 ** np.arange(k)
        values = localised(self._moments, faces, self._chain)
        errors = localised(ENTRY_ROUNDING * np.abs(self._moments) + change, np.abs(faces), self._chain)
        _check_positive(values[:, :, code].reshape(-1, 2**k, 2**k), errors[:, :, code].reshape(-1, 2**k, 2**k))


def _ball(x: int, rounding: int, bits: int) -> arb:
    """(x +- rounding) 2^-bits."""
    return arb(fmpq(x) / fmpq(2) ** bits, fmpq(rounding) / fmpq(2) ** bits)


def _check_positive(values: Array, errors: Array) -> None:
    """Every symmetric matrix within the errors of these, (S, L, L), is positive definite.

    Raises:
        ProofError: not shown.
    """
    diagonal = np.einsum("sii->si", values)
    if not (diagonal > 0).all():
        raise ProofError("proof_dual", "a localising matrix has no positive diagonal")
    # Powers of two: the scaling is exact.
    scale = np.exp2(-np.round(np.log2(diagonal) / 2))
    values, errors = (M * scale[:, :, None] * scale[:, None, :] for M in (values, errors))
    trace = np.einsum("sii->s", values)
    reduced = values.copy()
    np.einsum("sii->si", reduced)[:] -= 1.001 * errors.sum(axis=2) + CHOLESKY_ROUNDING * trace[:, None]
    try:
        positive = bool(np.isfinite(np.linalg.cholesky(reduced)).all())
    except np.linalg.LinAlgError:
        positive = False
    if not positive:
        raise ProofError("proof_dual", "a localising matrix is not positive definite")
