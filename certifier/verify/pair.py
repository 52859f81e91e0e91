"""The verifier checks one pair's proof (certifier.proof.pair) exactly here.

What the proof states is true of the scene's numbers, or ProofError says why not.

certifier.verify.residual bounds the residual e_v of every vertex on the box. With this bound, and because den >= sigma,

    a'p_v/den + b >= r kappa + t - max |e_v|

for every configuration of the polytope. If t is larger than the bound and |a| <= kappa, then the volume, its ball included, is strictly on
its side of the plane.

It is enough to check |a| <= kappa at the box's corners, because |a| is convex. certifier.verify.volume checks that the volumes contain the
geometries that they stand for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from flint import Ordering, arb, fmpq, fmpq_mpoly_ctx

from certifier.errors import ProofError
from certifier.model import Array, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.ground import Ground
from certifier.proof.pair import PairProof, Side
from certifier.verify.box import limited, within_limits
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.residual import NumeratorCache, Numerators, largest_residual
from certifier.verify.scene import check_scene
from certifier.verify.volume import check_contained, check_volume

MAX_CORNER_JOINTS = 16
TOGETHER = 1 << 20
"""The vertices are checked in parts of at most this many entries of Gram matrices, or of one vertex."""


@dataclass(frozen=True)
class PairStatement:
    """States what a valid proof proves.

    Attributes:
        pairs: the pairs of the scene that the proof covers.
        gap: lower bound in metres of the distance between the two bodies of each of these pairs on the polytope, with the largest
            padding of the pairs.
    """

    pairs: tuple[Pair, ...]
    gap: float


def verify_pair(proof: PairProof) -> PairStatement:
    """Checks a pair's proof in exact arithmetic and returns what it proves.

    Raises:
        ProofError: the proof does not hold; the code says which part.
    """
    check_scene(proof.scene)
    check_ground(proof.scene, proof.ground)
    check_interior(proof.scene, proof.ground, proof.interior)
    check_contained((proof.scene, proof.volumes))
    return PairCheck(proof.scene, proof.ground).verify(proof)


def check_ground(scene: Scene, ground: Ground) -> None:
    """Checks the shapes of a ground, and that its faces and the joint limits imply its box.

    Raises:
        ProofError: the ground is too large, a shape is wrong, or the box is not implied.
    """
    n, m = scene.n, ground.d.size
    if m > limits.FACES:
        raise ProofError("proof_too_large", f"a polytope has {m} faces; at most {limits.FACES} are checked")
    shapes = {"C": (m, n), "d": (m,), "mid": (n,), "half": (n,), "Y_lower": (n, m + 2 * n), "Y_upper": (n, m + 2 * n)}
    for name, shape in shapes.items():
        if getattr(ground, name).shape != shape:
            raise ProofError("proof_malformed", f"{name} of a polytope is {getattr(ground, name).shape}, not {shape}")
    if not (ground.half > 0).all():
        raise ProofError("proof_box", "the box of a polytope is empty")
    # The doubles just inside the exact corners mid -+ half imply the corners.
    lower, upper = np.nextafter(ground.mid - ground.half, np.inf), np.nextafter(ground.mid + ground.half, -np.inf)
    for i in range(n):
        if not (
            exact(lower[i]) >= exact(ground.mid[i]) - exact(ground.half[i])
            and exact(upper[i]) <= exact(ground.mid[i]) + exact(ground.half[i])
        ):
            raise ProofError("proof_box", "the box of a polytope cannot be represented")
    if not limited(scene, ground.C, ground.d).lie_in_box(lower, upper, ground.Y_lower, ground.Y_upper):
        raise ProofError("proof_box", "the multipliers do not prove the box around the polytope")


def check_interior(scene: Scene, ground: Ground, point: Array) -> None:
    """Checks that the point is in the ground and within the joint limits, so that this polytope is not empty.

    Everything could be said of an empty polytope.

    Raises:
        ProofError: the point is not in the ground, or not within the joint limits.
    """
    if point.shape != (scene.n,) or not (within_limits(scene, point) and limited(scene, ground.C, ground.d).contains(point)):
        raise ProofError("proof_interior", "the point that should show that the polytope is not empty is not in it")


def faces_of(ground: Ground) -> list[list[fmpq]]:
    """Returns the coefficients in [1, u], (m + 2n, n + 1), of the ground's faces d_j - c_j's, then of 1 + u_i, then of 1 - u_i."""
    mid, half = [exact(x) for x in ground.mid], [exact(x) for x in ground.half]
    faces = []
    for c, d in zip(ground.C, ground.d, strict=True):
        terms = [exact(x) for x in c]
        constant = exact(d) - sum((x * m for x, m in zip(terms, mid, strict=True)), fmpq(0))
        faces.append([constant, *(-x * h for x, h in zip(terms, half, strict=True))])
    n, one = len(mid), fmpq(1)
    for sign in (one, -one):
        faces += [[one, *(sign * int(i == j) for i in range(n))] for j in range(n)]
    return faces


class PairCheck:
    """Checks proofs that share one ground, which :func:`check_ground` has accepted.

    Args:
        contained: volumes that are known to contain their geometries, by id. The checks of one scene may share it.
        numerators: what was computed before. The checks of one scene may share it.
    """

    def __init__(
        self, scene: Scene, ground: Ground, contained: dict[int, Volume] | None = None, numerators: NumeratorCache | None = None
    ) -> None:
        self._scene, self._ground = scene, ground
        ring = fmpq_mpoly_ctx.get([f"u{i}" for i in range(scene.n)], Ordering.lex)
        self._kinematics = ExactKinematics.on_box(scene, ring, ground.mid, ground.half)
        self._faces = faces_of(ground)
        self._numerators = NumeratorCache() if numerators is None else numerators
        self._contained: dict[int, Volume] = {} if contained is None else contained

    def verify(self, proof: PairProof) -> PairStatement:
        """Checks one proof on the ground and returns what it proves.

        Raises:
            ProofError: the proof does not hold.
        """
        scene = self._scene
        if proof.scene.hash != scene.hash:
            raise ProofError("proof_scene", "the proof is about another scene")
        pairs = proof.pairs
        if not pairs:
            raise ProofError("proof_pair", f"{proof.title} are not a pair of the scene")
        if proof.frame not in scene.bodies:
            raise ProofError("proof_frame", f"the scene has no body {proof.frame!r}")
        if not all(0 <= j < len(self._faces) for j in proof.faces):
            raise ProofError("proof_malformed", "the proof uses a face that is not there")
        if proof.plane.shape != (4, scene.n + 1):
            raise ProofError("proof_malformed", "the plane has the wrong shape")
        for volume in proof.volumes:
            if id(volume) not in self._contained:
                check_volume(scene, self._kinematics, volume)
                self._contained[id(volume)] = volume
        t, kappa = exact(proof.t), exact(proof.kappa)
        if not t > 0:
            raise ProofError("proof_margin", "the margin is not positive")
        plane = [[exact(x) for x in row] for row in proof.plane]
        padding = exact(scene.padding_between(proof.volumes))
        radii = [exact(volume.radius) + padding for volume in proof.volumes]
        norm = _largest_square_norm(plane[:3])
        if not norm > 0:
            raise ProofError("proof_norm", "the plane has no normal: it separates nothing, were the polytope not empty")
        if any(radii) and not (kappa >= 0 and kappa * kappa >= norm):
            raise ProofError("proof_norm", "kappa does not bound the plane's normal")
        weights = [[fmpq(1), *[fmpq(0)] * scene.n], *(self._faces[j] for j in proof.faces)]
        residuals = []
        for volume, radius, side, sign in zip(proof.volumes, radii, proof.sides, (1, -1), strict=True):
            rows = [[sign * x for x in row] for row in plane]
            rows[3][0] -= radius * kappa + t
            residuals.append(_residual(self._numerators.between(self._kinematics, proof.frame, volume.body), volume, side, rows, weights))
        margin = t - max(residuals)
        if not margin > 0:
            eaten = f"the residual {arb(max(residuals)).str(3, radius=False)} eats up the margin {proof.t:.3g}"
            raise ProofError("proof_residual", f"{proof.title}: {eaten}")
        return PairStatement(pairs, _lower_root(4 * margin * margin / norm))


def _residual(
    numerators: Numerators, volume: Volume, side: Side, plane: Sequence[Sequence[fmpq]], weights: Sequence[Sequence[fmpq]]
) -> fmpq:
    """Returns the largest bound of |e_v| on the box over the volume's vertices, taking as many at once as fit into little memory."""
    k, V = len(side.chain), len(volume.vertices)
    entries = max(len(weights) * 4**k, 4 * len(plane[0]) * 3**k)
    if entries > limits.FACTORS:
        raise ProofError("proof_too_large", f"the Gram matrices of a vertex have {entries} entries; at most {limits.FACTORS} are checked")
    if side.mantissa.ndim != 3 or len(side.mantissa) != V:
        raise ProofError("proof_malformed", f"the Gram factors of {', '.join(volume.geometries)} do not fit")
    parts = [slice(first, first + max(1, TOGETHER // entries)) for first in range(0, V, max(1, TOGETHER // entries))]
    return max(
        largest_residual(
            numerators, replace(volume, vertices=volume.vertices[part]), replace(side, mantissa=side.mantissa[part]), plane, weights
        )
        for part in parts
    )


def _largest_square_norm(normal: Sequence[Sequence[fmpq]]) -> fmpq:
    """Returns the largest |a(u)|^2 over the corners of the box, where a(u) = normal [1; u].

    It is the largest over the whole box, because |a| is convex.

    Raises:
        ProofError: the box has too many corners.
    """
    moving = [i for i in range(1, len(normal[0])) if any(row[i] != 0 for row in normal)]
    if len(moving) > MAX_CORNER_JOINTS:
        raise ProofError("proof_too_large", f"more than {MAX_CORNER_JOINTS} joints")
    unit = max(int(x.q) for row in normal for x in row)
    squares = [0] * 2 ** len(moving)
    for row in normal:
        integers = [int(x * unit) for x in row]
        values = [integers[0]]
        for i in moving:
            values = [value + step for value in values for step in (integers[i], -integers[i])]
        squares = [square + value * value for square, value in zip(squares, values, strict=True)]
    return fmpq(max(squares)) / fmpq(unit) ** 2


def _lower_root(x: fmpq) -> float:
    """Returns a double below the square root of x > 0.

    The root's first bits, rounded down to a multiple of 2^-128, become the nearest double; the one before it is below the root.
    """
    root = math.isqrt((int(x.p) << 256) // int(x.q))
    return float(np.nextafter(root * 2.0**-128, 0.0)) if root < 1 << 1000 else 0.0
