"""Certification of a polytope, pair by pair: screens, the program (11), the proof and its verification.

centre or a sample in contact, verified              -> refuted, with the configuration
program (11) feasible, proof verified exactly        -> certified, with the proof
program (11) infeasible, dual proof verified         -> not_certifiable, with the proof and the points where no plane of this degree works
anything else                                        -> inconclusive, with the reason
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from certifier.basis import subsets
from certifier.broad_phase import BroadPhase, Volumes
from certifier.closest import first_within
from certifier.disproof import WitnessProof
from certifier.dual import dual_proof
from certifier.frames import Frame, choose_frame
from certifier.interior_point import Block, Solution, Status, solve
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope, Scene
from certifier.outcome import Outcome, Stage
from certifier.polytope import bound_multipliers, chebyshev_center, drop_redundant
from certifier.program import Box, Sides, build
from certifier.proof import BITS, Ground, PairProof, Side, Volume
from certifier.proof_file import ProofError
from certifier.sampling import hit_and_run
from certifier.verify.dual import verify_dual
from certifier.verify.pair import PairCheck, check_ground
from certifier.verify.witness import verify_witness

SCREEN_SAMPLES = 64
GAP_SAMPLES = 16
APART = 0.15
"""Least gap at the samples, relative to the way that vertices sweep, for which volumes of several geometries are tried."""
FEW_ITERATIONS = 4
"""Those that are settled at all are settled at once."""
CONE_SAMPLES = 300
FACES_AT_A_TIME = 16
"""A polytope with many faces is first replaced by its box; then this many faces are added at a time, as the dual asks for them."""

MIDDLE = 1.0
"""Gap of a certificate near the middle, relative to its margin."""


@dataclass(frozen=True)
class PairResult:
    """What is known about one pair on the polytope.

    Attributes:
        margin: certified lower bound in metres of the distance between the padded bodies; None unless certified.
        detail: a sentence for people; empty when the outcome says it all.
        witness_s: (n,) a configuration in contact, when refuted.
        proof: verified, as bytes: a :class:`certifier.proof.PairProof` when certified, a :class:`certifier.disproof.WitnessProof` when
            refuted, a :class:`certifier.disproof.DualProof` when not certifiable.
        weak_points: (w, n) configurations near which no plane of this degree works, when not certifiable.
        pull: (n,) how much it would help to shorten each joint's range, when not certifiable; only the proportions matter.
    """

    outcome: Outcome
    stage: Stage
    seconds: float = 0.0
    margin: float | None = None
    detail: str = ""
    witness_s: Array | None = None
    proof: bytes | None = None
    weak_points: Array | None = None
    pull: Array | None = None


class Certification:
    """Everything the pairs of one polytope share: faces, box, samples, cones.

    Args:
        polytope: joint limits included.
        center: (n,) interior point; default the Chebyshev centre.
        seed: seeds the samples.
        box: a box around P, to use its faces before P's and in place of those of the smallest one: what they prove holds on all of it.

    Raises:
        RegionError: the polytope is empty or unbounded, or the centre is not inside.
    """

    def __init__(self, scene: Scene, polytope: Polytope, center: Array | None = None, seed: int = 0, box: Box | None = None) -> None:
        middle, _ = chebyshev_center(polytope, tuple(joint.name for joint in scene.moving))
        self.scene = scene
        self.center = middle if center is None else center
        kept = drop_redundant(polytope)
        self._faces = faces = Polytope(polytope.C[kept], polytope.d[kept])
        lower, upper, Y_lower, Y_upper = bound_multipliers(scene.polytope(faces.C, faces.d))
        self._whole = None if box is None else PairCheck(scene, Ground.of_box(box.mid, box.half))
        box = Box.around(lower, upper) if box is None else box
        self.ground = Ground(faces.C, faces.d, box.mid, box.half, Y_lower, Y_upper)
        check_ground(scene, self.ground)
        self._check = PairCheck(scene, self.ground)
        samples = hit_and_run(faces, self.center, CONE_SAMPLES, seed)
        self._screen = np.concatenate([self.center[None], samples])
        self._kinematics = Kinematics.of(scene)
        self._box, self._samples = box, samples
        m = len(kept)
        self._every = tuple(range(m))
        few = tuple(range(m, m + 2 * scene.n))
        self._first = self._sides(few if self._whole or m > len(few) + FACES_AT_A_TIME else self._every)
        self._broad_phase = BroadPhase(self._kinematics, self._together)

    def certify(self, index: int, max_iterations: int = 60, every_face: bool = False) -> PairResult:
        """Certify pair ``scene.pairs[index]``, alone or with others that the same proof covers; the first of them takes the time.

        Args:
            every_face: try nothing less than all faces, which saves time where less is known to fail.
        """
        start, pair = time.perf_counter(), self.scene.pairs[index]
        if every_face:
            result = self._certify(pair, max_iterations, self._all)
        else:
            result = self._broad_phase.find(pair) or self._certify(pair, max_iterations, self._first)
        return replace(result, seconds=time.perf_counter() - start)

    def _together(self, volumes: Volumes) -> PairResult | None:
        """One proof for all pairs of two volumes, if they are clearly apart and it takes no more than the first faces."""
        frame = choose_frame(self._kinematics, volumes)
        if not self._apart(volumes, frame):
            return None
        try:
            solution = solve(build(self._first, volumes, frame), FEW_ITERATIONS)
        except np.linalg.LinAlgError:
            return None
        if solution.status is not Status.FEASIBLE:
            return None
        result = self._prove(volumes, frame, self._first, solution)
        return result if result.outcome is Outcome.CERTIFIED else None

    def _certify(self, pair: Pair, max_iterations: int, sides: Sides) -> PairResult:
        volumes = (Volume.of(self.scene.geometry(pair.a)), Volume.of(self.scene.geometry(pair.b)))
        frame = choose_frame(self._kinematics, volumes)
        contact = self._contact(volumes, frame, self._screen[:SCREEN_SAMPLES])
        if contact:
            return self._refute(pair, contact, Stage.SCREEN)
        while True:
            try:
                blocks = build(sides, volumes, frame)
                # Multipliers of P's own faces are what the polytope step holds fixed: they should come from the middle.
                gap = MIDDLE if self._whole and sides is not self._first else np.inf
                solution = solve(blocks, max_iterations, gap)
            except np.linalg.LinAlgError as error:
                if sides.faces == self._every:
                    return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=f"numerical trouble: {error}")
                sides = self._all
                continue
            if solution.status is Status.FEASIBLE:
                return self._prove(volumes, frame, sides, solution)
            more = self._more_faces(frame, sides, solution)
            if more == sides.faces:
                break
            sides = self._all if more == self._every else self._sides(more)
        weak, pull = self._weak_points(frame, sides, solution), self._pull(frame, sides, solution)
        witness = self._contact(volumes, frame, np.concatenate([self._screen, weak[self._faces.contains(weak)]]))
        if witness:
            return self._refute(pair, witness, Stage.SOS)
        if solution.status is Status.INFEASIBLE:
            return replace(self._disprove(pair, frame, sides, blocks, solution), weak_points=weak, pull=pull)
        detail = f"{solution.status.value} after {solution.iterations} iterations"
        return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=detail, weak_points=weak, pull=pull)

    @cached_property
    def _all(self) -> Sides:
        """Those of all faces."""
        return self._first if self._first.faces == self._every else self._sides(self._every)

    def _sides(self, faces: tuple[int, ...]) -> Sides:
        return Sides(self._kinematics, self._faces, self._box, faces, self.center, self._samples)

    def _more_faces(self, frame: Frame, sides: Sides, solution: Solution) -> tuple[int, ...]:
        """The faces to go on with after a program on a superset of P had no solution; the same ones when it had none on P either.

        The dual point shows infeasibility for every face j with Lambda_j(x) psd; the faces where it is not are worth having.
        """
        unused = tuple(j for j in self._every if j not in sides.faces)
        if not unused:
            return sides.faces
        if solution.status is not Status.INFEASIBLE or 2 * (len(sides.faces) + FACES_AT_A_TIME) > len(self._every) + len(self._first.faces):
            return self._every
        lowest = np.full(len(unused), np.inf)
        for chain, x in zip((frame.chain_a, frame.chain_b), solution.x[:2], strict=True):
            Z = sides.cone_of(chain, unused).adjoint(x)
            mass = np.trace(Z[:, 0], axis1=1, axis2=2)[:, None]
            lowest = np.minimum(lowest, (np.linalg.eigvalsh(Z[:, 1:])[:, :, 0] / mass).min(axis=0))
        worst = [unused[i] for i in np.argsort(lowest)[:FACES_AT_A_TIME] if lowest[i] < 0]
        return (*sides.faces, *worst)

    def _prove(self, volumes: Volumes, frame: Frame, sides: Sides, solution: Solution) -> PairResult:
        """The proof in as few bits as hold."""
        failure = ""
        for kind in BITS:
            proof, check = self._proof(volumes, frame, sides, solution, kind), self._check
            if self._whole and proof.needs_box_alone:
                proof, check = proof.on_its_box(), self._whole
            try:
                statement = check.verify(proof)
            except ProofError as error:
                failure = str(error)
                continue
            return PairResult(Outcome.CERTIFIED, Stage.SOS, margin=statement.gap, proof=proof.to_bytes())
        return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=f"the proof found does not hold: {failure}")

    def _refute(self, pair: Pair, witness: _Witness, stage: Stage) -> PairResult:
        proof = WitnessProof(self.scene, pair, self.ground.C, self.ground.d, witness.s, witness.weights)
        try:
            verify_witness(proof)
        except ProofError as error:
            return PairResult(Outcome.INCONCLUSIVE, stage, detail=f"the contact found does not hold: {error}")
        return PairResult(Outcome.REFUTED, stage, witness_s=witness.s, proof=proof.to_bytes())

    def _disprove(self, pair: Pair, frame: Frame, sides: Sides, blocks: list[Block], solution: Solution) -> PairResult:
        try:
            proof = dual_proof(sides, pair, frame, self.ground, blocks, solution.x)
            statement = verify_dual(proof)
        except (ProofError, np.linalg.LinAlgError) as error:
            return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=f"the dual proof found does not hold: {error}")
        detail = f"no plane affine in s, in the frame of {statement.frame}"
        return PairResult(Outcome.NOT_CERTIFIABLE, Stage.SOS, detail=detail, proof=proof.to_bytes())

    def _points(self, volume: Volume, frame: Frame, s: Array) -> Array:
        return self._kinematics.points(frame.body, volume.body, volume.vertices, s)

    def _apart(self, volumes: Volumes, frame: Frame) -> bool:
        """Whether the padded volumes keep a distance at some of the samples that is large against what they sweep in the frame."""
        A, B = (self._points(volume, frame, self._screen[:GAP_SAMPLES]) for volume in volumes)
        least = APART * sum(float(np.linalg.norm(np.ptp(points, axis=0), axis=1).max()) for points in (A, B))
        least += sum(volume.radius for volume in volumes) + 2 * self.scene.padding
        return first_within(A, B, least) is None

    def _contact(self, volumes: Volumes, frame: Frame, s: Array) -> _Witness | None:
        """A configuration among s (S, n), the centre first, at which the padded bodies touch."""
        a, b = volumes
        reach = a.radius + b.radius + 2 * self.scene.padding
        A, B = self._points(a, frame, s), self._points(b, frame, s)
        found = first_within(A, B, reach)
        return None if found is None else _Witness(s[found[0]], found[1].weights)

    def _proof(self, volumes: Volumes, frame: Frame, sides: Sides, solution: Solution, kind: str) -> PairProof:
        n, u_c = self.scene.n, sides.u_c
        plane = solution.y[: 4 * (n + 1)].reshape(4, n + 1).copy()
        plane[:, 0] -= plane[:, 1:] @ u_c
        kappa = float(solution.y[4 * (n + 1)]) if len(solution.y) > 4 * (n + 1) + 1 else 0.0
        factors = []
        for chain, Q in zip((frame.chain_a, frame.chain_b), solution.Q[:2], strict=True):
            monomial = np.sqrt(3.0) ** subsets(len(chain)).sum(axis=1)
            factors.append(Side.from_gram(chain, Q * (monomial[:, None] * monomial) / sides.scales[:, None, None], kind))
        return PairProof(self.scene, volumes, frame.body, self.ground, plane, solution.t, kappa, sides.faces, (factors[0], factors[1]))

    def _pull(self, frame: Frame, sides: Sides, solution: Solution) -> Array:
        """What the program's optimum gains, to first order, when a joint's range shrinks towards the centre, (n,).

        The derivative for a face's offset is <Q_j, Lambda_0(x)>. A box's face belongs to its joint, any other to its joints by
        their parts in its reach.
        """
        n = self.scene.n
        share = np.abs(np.concatenate([self._faces.C * self._box.half, np.eye(n), np.eye(n)]))
        share /= share.sum(axis=1, keepdims=True)
        gains = np.zeros(len(sides.faces))
        for chain, Q, x in zip((frame.chain_a, frame.chain_b), solution.Q[:2], solution.x[:2], strict=True):
            gains += np.einsum("rkij,rij->k", Q[:, 1:], sides.cone(chain)[0].adjoint(x)[:, 0])
        pull: Array = gains @ share[list(sides.faces)]
        return pull

    def _weak_points(self, frame: Frame, sides: Sides, solution: Solution) -> Array:
        """Means (w, n) of the pseudo-moments that carry weight."""
        found = [sides.means(chain, x) for chain, x in zip((frame.chain_a, frame.chain_b), solution.x[:2], strict=True)]
        means, mass = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return means[mass > 0.15 * mass.max()]


@dataclass(frozen=True)
class _Witness:
    s: Array
    weights: tuple[Array, Array]


def certify_pair(scene: Scene, index: int, polytope: Polytope, center: Array | None = None, seed: int = 0) -> PairResult:
    """Certify one pair on one polytope; :class:`Certification` shares the preparation between pairs."""
    return Certification(scene, polytope, center, seed).certify(index)
