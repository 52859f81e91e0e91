"""Certification of a polytope, pair by pair: screens, the program (11), the proof and its verification.

centre or a sample in contact, verified              -> refuted, with the configuration
program (11) feasible, proof verified exactly        -> certified, with the proof
program (11) infeasible, dual proof verified         -> not_certifiable, with the proof and the points where no plane of this degree works
planes at rest infeasible, (11) too dear             -> inconclusive, with those points all the same
anything else                                        -> inconclusive, with the reason
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from certifier.broad_phase import BroadPhase, Volumes
from certifier.closest import first_within
from certifier.disproof import WitnessProof
from certifier.dual import dual_proof
from certifier.frames import Frame, choose_frame, frames_to_try
from certifier.interior_point import Block, Solution, Status, solve
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope, Scene
from certifier.outcome import Outcome, Stage
from certifier.polytope import bound_multipliers, chebyshev_center, drop_redundant
from certifier.primal import pair_proof
from certifier.program import Box, Sides, build
from certifier.proof import BITS, Ground, Volume
from certifier.proof_file import ProofError
from certifier.sampling import hit_and_run
from certifier.verify.dual import verify_dual
from certifier.verify.pair import PairCheck, check_ground
from certifier.verify.witness import check_witness
from certifier.weakness import pull, weak_points

SCREEN_SAMPLES = 64
NEAREST_JOINTS = 4
"""Up to so many joints the contact nearest to the centre is what a refutation tells of."""
GAP_SAMPLES = 16
APART = 0.15
"""Least gap at the samples, relative to the way that vertices sweep, for which volumes of several geometries are tried."""
FEW_ITERATIONS = 4
"""Those that are settled at all are settled at once."""
CONE_SAMPLES = 300
FACES_AT_A_TIME = 16
"""A polytope with many faces is first replaced by its box; then this many faces are added at a time, as the dual asks for them."""
DEAR_JOINTS = 10.0
"""Few faces that couple the path's joints with others are all tried at once, unless the other joints make the program dearer by this."""
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
        weak_points: (w, n) configurations near which no plane of those tried works, when the program had no solution.
        pull: (n,) how much it would help to shorten each joint's range, like ``weak_points``; only the proportions matter.
        ranges_alone: only planes at rest were tried, for which of the polytope the joints' ranges count and nothing else.
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
    ranges_alone: bool = False


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
        kept = drop_redundant(polytope, inside=middle)
        self._faces = faces = Polytope(polytope.C[kept], polytope.d[kept])
        lower, upper, Y_lower, Y_upper = bound_multipliers(scene.polytope(faces.C, faces.d), middle)
        self._whole = None if box is None else PairCheck(scene, Ground.of_box(box.mid, box.half))
        box = Box.around(lower, upper) if box is None else box
        self.ground = Ground(faces.C, faces.d, box.mid, box.half, Y_lower, Y_upper)
        check_ground(scene, self.ground)
        self._check = PairCheck(scene, self.ground)
        samples = hit_and_run(faces, self.center, CONE_SAMPLES, seed)
        self._screen = np.concatenate([self.center[None], samples])
        self._contacts = self._screen[:SCREEN_SAMPLES]
        if scene.n <= NEAREST_JOINTS:
            gauge = ((self._contacts - self.center) @ faces.C.T / (faces.d - faces.C @ self.center)).max(axis=1)
            self._contacts = self._contacts[np.argsort(gauge)]
        self._kinematics = Kinematics.of(scene)
        self._box, self._samples = box, samples
        self._every = tuple(range(len(kept)))
        self._moved = faces.C != 0
        self._known: dict[tuple[tuple[int, ...], tuple[int, ...]], Sides] = {}
        self._broad_phase = BroadPhase(self._kinematics, self._together)

    def certify(self, index: int, max_iterations: int = 60, every_face: bool = False) -> PairResult:
        """Certify pair ``scene.pairs[index]``, alone or with others that the same proof covers; the first of them takes the time.

        Args:
            every_face: begin with all of P's faces in the joints of the pair's path, which saves time where less is known to fail.
        """
        start, pair = time.perf_counter(), self.scene.pairs[index]
        found = None if every_face else self._broad_phase.find(pair)
        result = found or self._certify(pair, max_iterations, every_face)
        return replace(result, seconds=time.perf_counter() - start)

    def _together(self, volumes: Volumes) -> PairResult | None:
        """One proof for all pairs of two volumes, if they are clearly apart and it takes no more than the first faces."""
        frame = frames_to_try(self._kinematics, volumes)[0]
        if not self._apart(volumes, frame):
            return None
        sides = self._sides(frame, self._first(frame))
        try:
            solution = solve(build(sides, volumes, frame), FEW_ITERATIONS)
        except np.linalg.LinAlgError:
            return None
        if solution.status is not Status.FEASIBLE:
            return None
        result = self._prove(volumes, frame, sides, solution)
        return result if result.outcome is Outcome.CERTIFIED else None

    def _certify(self, pair: Pair, max_iterations: int, every_face: bool) -> PairResult:
        volumes = (Volume.of(self.scene.geometry(pair.a)), Volume.of(self.scene.geometry(pair.b)))
        frames = frames_to_try(self._kinematics, volumes)
        contact = self._contact(volumes, frames[0], self._contacts)
        if contact:
            return self._refute(pair, contact, Stage.SCREEN)
        for frame in frames:
            try:
                sides, blocks, solution = self._solve(volumes, frame, max_iterations, every_face)
            except np.linalg.LinAlgError as error:
                return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=f"numerical trouble: {error}")
            if solution.status is Status.FEASIBLE:
                return self._prove(volumes, frame, sides, solution)
        weak, gains = weak_points(frame, sides, solution), pull(frame, sides, self._faces, solution)
        witness = self._contact(volumes, frame, np.concatenate([self._screen, weak[self._faces.contains(weak)]]))
        if witness:
            return self._refute(pair, witness, Stage.SOS)
        if solution.status is Status.INFEASIBLE and not frame.at_rest:
            return replace(self._disprove(pair, frame, sides, blocks, solution), weak_points=weak, pull=gains)
        detail = f"{solution.status.value} after {solution.iterations} iterations"
        if frame.at_rest:
            memory = choose_frame(self._kinematics, volumes).memory(volumes)
            detail = f"no plane at rest in the frame of {frame.body}; one that moves would need {memory / 2**30:.1f} GiB ({detail})"
        return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=detail, weak_points=weak, pull=gains, ranges_alone=frame.at_rest)

    def _solve(self, volumes: Volumes, frame: Frame, max_iterations: int, every_face: bool) -> tuple[Sides, list[Block], Solution]:
        """The program with the faces that matter.

        Raises:
            np.linalg.LinAlgError: a cone of P itself is numerically degenerate.
        """
        faces = first = self._first(frame, every_face)
        while True:
            sides = self._sides(frame, faces)
            try:
                blocks = build(sides, volumes, frame)
                # Multipliers of P's own faces are what the polytope step holds fixed: they should come from the middle.
                solution = solve(blocks, max_iterations, MIDDLE if self._whole and faces != first else np.inf)
            except np.linalg.LinAlgError:
                if faces == self._every or frame.at_rest:
                    raise
                faces = self._every
                continue
            more = faces if solution.status is Status.FEASIBLE else self._more_faces(frame, sides, solution)
            if more == faces:
                return sides, blocks, solution
            faces = more

    def _first(self, frame: Frame, every_face: bool = False) -> tuple[int, ...]:
        """The faces to begin with: P's in the joints that the plane moves with, and its box's where those may not bound them; unless it
        has to be every face, its box's alone where P has many. Where P has few and they couple those joints with others, all of them."""
        m, n, joints = len(self._every), self.scene.n, list(frame.joints)
        box = [(m + n * (sign > 0) + i, i, sign) for sign in (-1, 1) for i in joints]
        others = self._moved.copy()
        others[:, joints] = False
        own = np.flatnonzero(~others.any(axis=1))
        alone = own[self._moved[own].sum(axis=1) == 1]
        C = self._faces.C[alone]
        needed = [face for face, i, sign in box if len(own) < m and not (C[:, i] * sign > 0).any()]
        coupled = bool((others.any(axis=1) & self._moved[:, joints].any(axis=1)).any())
        if coupled and not self._whole and m <= 2 * n + FACES_AT_A_TIME and frame.growth(n) < DEAR_JOINTS:
            return self._every
        many = self._whole or len(own) + len(needed) > len(box) + FACES_AT_A_TIME
        if not joints or (many and not every_face):
            return tuple(face for face, _, _ in box)
        return (*own.tolist(), *needed)

    def _sides(self, frame: Frame, faces: tuple[int, ...]) -> Sides:
        joints = set(frame.joints)
        for j in faces:
            joints |= set(np.flatnonzero(self._moved[j]).tolist()) if j < len(self._every) else set()
        key = tuple(sorted(joints)), faces
        if key not in self._known:
            self._known[key] = Sides(self._kinematics, self._faces, self._box, *key, self.center, self._samples)
        return self._known[key]

    def _more_faces(self, frame: Frame, sides: Sides, solution: Solution) -> tuple[int, ...]:
        """The faces to go on with after a program on a superset of P had no solution; the same ones when it had none on P either.

        The dual point shows infeasibility for every face j with Lambda_j(x) psd; the faces where it is not are worth having.
        """
        unused = tuple(j for j in self._every if j not in sides.faces)
        if not unused or frame.at_rest:
            return sides.faces
        if solution.status is not Status.INFEASIBLE:
            return self._every
        lowest = np.full(len(unused), np.inf)
        for chain, x in zip((frame.chain_a, frame.chain_b), solution.x[:2], strict=True):
            Z = sides.cone_of(chain, unused).adjoint(x)[0]
            mass = np.trace(Z[:, 0], axis1=1, axis2=2)[:, None]
            lowest = np.minimum(lowest, (np.linalg.eigvalsh(Z[:, 1:])[:, :, 0] / mass).min(axis=0))
        wanted = [i for i in np.argsort(lowest) if lowest[i] < 0]
        inside = [i for i in wanted if not np.delete(self._moved[unused[i]], sides.joints).any()]
        # Where most faces are used already, it is not worth being choosy.
        most = 2 * (len(sides.faces) + FACES_AT_A_TIME) > len(self._every) + 2 * len(frame.joints)
        return (*sides.faces, *(unused[i] for i in (inside or wanted)[: None if most else FACES_AT_A_TIME]))

    def _prove(self, volumes: Volumes, frame: Frame, sides: Sides, solution: Solution) -> PairResult:
        """The proof in as few bits as hold."""
        failure = ""
        for kind in BITS:
            proof, check = pair_proof(sides, volumes, frame, self.ground, solution, kind), self._check
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
            check_witness(proof)
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


@dataclass(frozen=True)
class _Witness:
    s: Array
    weights: tuple[Array, Array]


def certify_pair(scene: Scene, index: int, polytope: Polytope, center: Array | None = None, seed: int = 0) -> PairResult:
    """Certify one pair on one polytope; :class:`Certification` shares the preparation between pairs."""
    return Certification(scene, polytope, center, seed).certify(index)
