"""The verifier checks a dual proof rigorously here. Such a proof says that a pair has no certificate of one form, in one frame.

The form of certificate is this:

- The plane is affine in s.
- The multipliers of 1 and of every face are rho'Q_j rho, where rho are the products of distinct joints of the chain. The faces are those
  of a given polytope and of its box.
- Where a radius is involved, the matrix inequality of certifier.pair.program bounds |a| by kappa.

That no such certificate exists does not mean that no plane separates the pair. A plane may need multipliers of a higher degree. Also,
the check of a pair's proof takes the norm at the box's corners, which admits more normals than the matrix inequality does.

A certificate gives, for every vertex v of a body,

    +-(a'p_v + b den) - (r kappa + t) den = sum_j g_j rho'Q_j rho,   Q_j psd, t > 0.

Let x_v be functionals whose localising matrices Lambda_j(x_v) = x_v(g_j rho rho') are all psd. Let R = sum_v +-x_v(p_v (x) [1, u]), a
matrix (4, n + 1). Apply the functionals to the identities, and add these up. This gives

    0 <= <Z, R> - kappa sum_v r_v x_v(den) - t sum_v x_v(den).

Where no radius is involved and R = 0, it follows that t <= 0, because the check requires that sum_v x_v(den) > 0.

Where a radius is involved, the rows R_a of R that belong to a need not vanish. Let Y = [[Yaa, -R_a/2], [-R_a'/2, Ybb]] be psd, with
Ybb_ii <= Ybb_00 and tr Yaa + Ybb_00 <= sum_v r_v x_v(den). Then the matrix inequality gives <Z_a, R_a> <= kappa sum_v r_v x_v(den). If the
row of R that belongs to b vanishes, t <= 0 follows again.

R never vanishes in floating point. So the proof names as many moments as R has entries that have to vanish. A change c of these moments
with G c = -R makes these entries zero, where G holds what one unit of each moment adds to R. Ball arithmetic bounds |c|. Every matrix is
then shown to be positive definite whatever such a change does.

Where the equations are dependent, as for two balls, fewer of them are solved. The remainder of the others bounds t relative to the plane's
coefficients. This bound is the ``slack``.

Why the matrices are positive definite:

A rounded operation errs by a factor 1 + d, |d| <= eps = 2^-53. Where its result is subnormal, it errs by 2^-1075 at most.

Every face, and the moments of every vertex, are first multiplied by powers of two that bring their largest numbers near 1. This changes
no sign. An entry of Lambda_j is then a sum of n + 1 products of two numbers below 2, of which the face's number is rounded. The entry
errs by less than (n + 4) eps times the sum of the products' magnitudes, plus 4 (n + 1) 2^-1074, which is far below UNDERFLOW. The check
adds more than twice that to what a change can do.

Then powers of two bring the diagonal near 1 again. The check takes the sums of the errors over the rows off the diagonal (Gershgorin).
It also takes off 4 (L + 16) eps times the trace, where L is the size. A Cholesky factorisation follows.

The reduction of the diagonal and the factorisation round. Whatever the order of its sums, this rounding can hide a negative eigenvalue
only if its magnitude is less than (L + 2) eps times the trace. So if the factorisation succeeds, the matrix is positive definite (Rump,
*Verification of positive definiteness*, BIT 46, 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import Ordering, arb, arb_mat, ctx, fmpq, fmpq_mpoly_ctx

from certifier.errors import ProofError
from certifier.model import Array, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.ground import Ground
from certifier.proof.negative import DualProof
from certifier.verify import limbs
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.moments import localised, table
from certifier.verify.pair import check_ground, check_interior, faces_of
from certifier.verify.residual import POSITION_BITS, Numerators, dyadic
from certifier.verify.scene import check_scene

PRECISION = 256
UNDERFLOW = 2.0**-1000
"""This is above what subnormal results can do to an entry of a matrix of numbers near 1."""
LARGEST_SLACK = 1e-9
LOOSENESS = 1e-9
"""Because of rounding, the box may reach beyond a joint's limits by this part of the joint's range."""


@dataclass(frozen=True)
class DualStatement:
    """States what a valid dual proof proves: on its ground there is no certificate of the form that this module is about.

    Attributes:
        pair: the pair that has no such certificate.
        frame: body in whose frame the plane, affine in s, would be.
        rounded: whether a radius is involved. Then only certificates are excluded whose normal is bounded by the matrix inequality.
        slack: bound on a certificate's margin, as a part of its plane's largest coefficient; 0 when there is no certificate at all.
    """

    pair: Pair
    frame: str
    rounded: bool
    slack: float


def verify_dual(proof: DualProof) -> DualStatement:
    """Checks a dual proof and returns what it proves.

    Raises:
        ProofError: the proof does not hold; the code says which part.
    """
    scene = proof.scene
    check_scene(scene)
    if proof.pair not in scene.pairs or proof.frame not in scene.bodies:
        raise ProofError("proof_pair", "the proof is about no pair, or no body, of the scene")
    check_ground(scene, proof.ground)
    _check_tight(scene, proof.ground)
    check_interior(scene, proof.ground, proof.interior)
    with ctx.workprec(PRECISION):
        return _Check(proof).statement()


def _check_tight(scene: Scene, ground: Ground) -> None:
    """Checks that the box ends at the joint limits, because with weaker faces than the joints have there are fewer certificates."""
    for joint, lower, upper, mid, half in zip(scene.moving, scene.s_lower, scene.s_upper, ground.mid, ground.half, strict=True):
        low, high = exact(lower), exact(upper)
        beyond = exact(half) + max(exact(mid) - high, low - exact(mid))
        if beyond > exact(LOOSENESS) * (high - low):
            raise ProofError("proof_box", f"the box of a dual proof reaches beyond the limits of {joint.name}")


class _Check:
    def __init__(self, proof: DualProof) -> None:
        scene, ground = proof.scene, proof.ground
        self._proof, self._n = proof, scene.n
        ring = fmpq_mpoly_ctx.get([f"u{i}" for i in range(scene.n)], Ordering.lex)
        kinematics = ExactKinematics.on_box(scene, ring, ground.mid, ground.half)
        volumes = [Volume.of(scene.geometry(name)) for name in (proof.pair.a, proof.pair.b)]
        numerators = [Numerators.between(kinematics, proof.frame, volume.body) for volume in volumes]
        self._sides = [_Side(*parts, self._n) for parts in zip(volumes, numerators, proof.moments, strict=True)]
        self._radii = [exact(volume.radius) + exact(scene.padding_of(proof.pair)) for volume in volumes]
        self._faces = np.array([_near_one(face) for face in [[fmpq(1), *[fmpq(0)] * self._n], *faces_of(ground)]])
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
            slack = _above(left / mass)
            if not slack <= LARGEST_SLACK:
                raise ProofError("proof_dual", f"the equations are not met: {slack:.3g}")
        for side in self._sides:
            side.check(self._faces, change)
        if self._rounded:
            self._check_normal(R, change)
        return DualStatement(self._proof.pair, self._proof.frame, self._rounded, slack)

    def _correction(self, R: list[list[arb]]) -> tuple[arb, arb]:
        """Returns a bound of the change that makes the named equations vanish, and one of the sum of the others' remainders."""
        proof, named = self._proof, self._proof.equations
        if len(set(named)) != len(named) or len(named) != len(proof.entries) or not all(0 <= k < len(self._vanishing) for k in named):
            raise ProofError("proof_malformed", "the equations and the moments that meet them do not fit")
        if not named:
            return arb(0), sum((abs(R[c][e]) for c, e in self._vanishing), arb(0))
        columns = [self._column(*(int(i) for i in entry)) for entry in proof.entries]
        G = arb_mat([[column[self._vanishing[k]] for column in columns] for k in named])
        try:
            change = G.solve(arb_mat([[-R[c][e]] for c, e in (self._vanishing[k] for k in named)]))
        except ZeroDivisionError as error:
            raise ProofError("proof_dual", "the equations cannot be met by the moments named") from error
        sizes = [abs(change[i, 0]).upper() for i in range(len(columns))]
        if not all(size.is_finite() for size in sizes):
            raise ProofError("proof_dual", "the equations cannot be met by the moments named")
        left = arb(0)
        for k, (c, e) in enumerate(self._vanishing):
            if k not in named:
                left += abs(R[c][e] + sum((column[c, e] * change[i, 0] for i, column in enumerate(columns)), arb(0)))
        return max(sizes), left

    def _column(self, side: int, vertex: int, monomial: int) -> dict[tuple[int, int], arb]:
        """Returns what one unit of a moment adds to R."""
        if side not in (0, 1) or not self._sides[side].has(vertex, monomial):
            raise ProofError("proof_malformed", "the proof names a moment that is not there")
        return self._sides[side].column(vertex, monomial, 1 - 2 * side)

    def _check_normal(self, R: list[list[arb]], change: arb) -> None:
        """Checks the part of the proof that concerns kappa."""
        n, (aa, bb) = self._n, self._proof.normal
        if aa.shape != (3, 3) or bb.shape != (n + 1, n + 1) or not (np.array_equal(aa, aa.T) and np.array_equal(bb, bb.T)):
            raise ProofError("proof_malformed", "the matrices that concern the normal do not fit")
        if not all(bb[i, i] <= bb[0, 0] for i in range(1, n + 1)):
            raise ProofError("proof_dual", "the matrix that concerns the normal has a diagonal entry larger than its first")
        trace = sum((arb(float(aa[i, i])) for i in range(3)), arb(float(bb[0, 0])))
        if not trace <= sum((arb(radius) * side.mass(change) for radius, side in zip(self._radii, self._sides, strict=True)), arb(0)):
            raise ProofError("proof_dual", "the matrix that concerns the normal is too large")
        size = int(np.frexp(max(aa.max(), bb.max()))[1])
        reach = change * sum((side.reach for side in self._sides), arb(0))
        off = [[-(R[c][e] + arb(0, reach)) / 2 / arb(2) ** size for e in range(n + 1)] for c in range(3)]
        middle = np.array([[float(x.mid()) for x in row] for row in off])
        Y, E = np.zeros((n + 4, n + 4)), np.full((n + 4, n + 4), UNDERFLOW)
        Y[:3, :3], Y[3:, 3:], Y[:3, 3:], Y[3:, :3] = np.ldexp(aa, -size), np.ldexp(bb, -size), middle, middle.T
        error = np.array([[_above(abs(x - float(m))) for x, m in zip(*rows, strict=True)] for rows in zip(off, middle, strict=True)])
        E[:3, 3:] += error
        E[3:, :3] += error.T
        _check_positive(Y[None], E[None])


class _Side:
    """Holds the functionals of one body's vertices."""

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
        # The positions are multiplied with a matrix whose row m holds x_v(u_e m) for all e.
        expanded = [[values[v][i] for i in row] for v in range(V) for row in self._index.T]
        flat = np.moveaxis(self._positions, 2, 1).reshape(len(self._positions), 4, V * size)
        product = limbs.integers(limbs.product(flat, limbs.of_rows(expanded)))
        rounding = largest * max(sum(abs(row[e]) for row in expanded) for e in range(n + 1))
        self.sums = [[_ball(x, rounding, self._bits + moment_bits) for x in row] for row in product]
        self._largest = largest
        (sizes,) = limbs.absolute_sums(self._positions.reshape(len(self._positions), 1, -1))
        self.reach = arb(fmpq(sizes + largest * 4 * V * size) / fmpq(2) ** self._bits)

    def has(self, vertex: int, monomial: int) -> bool:
        return 0 <= vertex < len(self._moments) and 0 <= monomial < self._moments.shape[1]

    def mass(self, change: arb) -> arb:
        """Returns a ball around sum_v x_v(den) that holds whatever the change does."""
        return self.sums[3][0] + arb(0, change * self.reach)

    def column(self, vertex: int, monomial: int, sign: int) -> dict[tuple[int, int], arb]:
        """Returns what one unit of a moment adds to R: ``sign`` times the coefficients of p_v that meet it."""
        column = {(c, e): arb(0) for c in range(4) for e in range(len(self._index))}
        for e, m in zip(*np.nonzero(self._index == monomial), strict=True):
            for c, (x,) in enumerate(limbs.integers(self._positions[:, vertex, :, m, None])):
                column[c, int(e)] = _ball(sign * x, self._largest, self._bits)
        return column

    def check(self, faces: Array, change: arb) -> None:
        """Checks that every localising matrix is positive definite, whatever the change does."""
        k = len(self._chain)
        if len(faces) * len(self._moments) * 4**k > limits.LOCALISED:
            raise ProofError("proof_too_large", f"a body's localising matrices have more than {limits.LOCALISED} entries")
        subsets = np.arange(2**k)[:, None] >> np.arange(k) & 1
        code = (subsets[:, None, :] + subsets[None, :, :]) @ 3 ** np.arange(k)
        values, errors = _enclosed(self._moments, faces, self._chain, change)
        _check_positive(values[:, :, code].reshape(-1, 2**k, 2**k), errors[:, :, code].reshape(-1, 2**k, 2**k))


def _enclosed(moments: Array, faces: Array, chain: tuple[int, ...], change: arb) -> tuple[Array, Array]:
    """Returns x_v(g_j m), (F, V, 3^k), times a power of two for every vertex, and bounds of how far they are off.

    The bounds hold once every moment has changed, and for the faces before they were rounded.

    Args:
        faces: (F, n + 1) rows of :func:`_near_one`.
    """
    sizes = np.frexp(np.abs(moments).max(axis=1))[1]
    scaled = np.ldexp(moments, -sizes[:, None])
    changes = np.array([_above(change / arb(2) ** int(size)) for size in sizes])
    rounding = (faces.shape[1] + 7) * 2.0**-52 * np.abs(scaled)
    # A change beyond all doubles is no factor for a face's 0. The sums of the bounds may be rounded down, n + 2 times.
    finite = np.where(np.isfinite(changes), changes, 0.0)
    bounds = localised(rounding + finite[:, None], np.abs(faces), chain) * (1 + (faces.shape[1] + 4) * 2.0**-52)
    bounds += np.where(np.isfinite(changes), UNDERFLOW, np.inf)[None, :, None]
    return localised(scaled, faces, chain), bounds


def _ball(x: int, rounding: int, bits: int) -> arb:
    """Returns the ball (x +- rounding) 2^-bits."""
    return arb(fmpq(x) / fmpq(2) ** bits, fmpq(rounding) / fmpq(2) ** bits)


def _above(x: arb) -> float:
    """Returns a double above every number of a ball; the result is not finite where there is no such double."""
    return float(np.nextafter(float(x.upper()), np.inf))


def _near_one(row: Sequence[fmpq]) -> list[float]:
    """Returns the row, rounded, times the power of two that brings its largest number between 1/2 and 2; zeros stay zeros."""
    largest = max(abs(x) for x in row)
    size = int(largest.p).bit_length() - int(largest.q).bit_length()
    return [float(x / fmpq(2) ** size) for x in row]


def _check_positive(values: Array, errors: Array) -> None:
    """Checks that every symmetric matrix within ``errors`` of ``values``, both (S, L, L), is positive definite.

    Raises:
        ProofError: this is not shown.
    """
    diagonal = np.einsum("sii->si", values)
    if not (diagonal > 0).all():
        raise ProofError("proof_dual", "a localising matrix has no positive diagonal")
    halves = -(np.frexp(diagonal)[1] // 2)
    with np.errstate(over="ignore", invalid="ignore"):
        values, errors = (np.ldexp(M, halves[:, :, None] + halves[:, None, :]) for M in (values, errors))
        rounding = (values.shape[1] + 16) * 2.0**-51 * np.einsum("sii->s", values)
        np.einsum("sii->si", values)[:] -= 1.001 * errors.sum(axis=2) + rounding[:, None]
    try:
        positive = bool(np.isfinite(values).all() and np.isfinite(np.linalg.cholesky(values)).all())
    except np.linalg.LinAlgError:
        positive = False
    if not positive:
        raise ProofError("proof_dual", "a localising matrix is not positive definite")
