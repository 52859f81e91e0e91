"""A polytope is certified pair by pair: by screens, by the program (11), and by a proof that the verifier has checked.

What was found                                       -> the outcome and what comes with it
centre or a sample in contact, verified              -> refuted, with the configuration
program (11) feasible, proof verified exactly        -> certified, with the proof
program (11) infeasible, dual proof verified         -> not_certifiable, with the proof and points that have no certificate of this degree
planes at rest infeasible, (11) too expensive        -> inconclusive, with those points as well
anything else                                        -> inconclusive, with the reason
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from certifier.conic.interior_point import Block, Solution, Status, solve
from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import Array, Box, Pair, Polytope, Scene, Volume
from certifier.outcome import Outcome, Stage
from certifier.pair.broad_phase import BroadPhase, Volumes
from certifier.pair.dual import dual_proof
from certifier.pair.face_choice import FaceChoice
from certifier.pair.frames import Frame, choose_frame, frames_to_try
from certifier.pair.primal import pair_proof
from certifier.pair.program import Sides, build
from certifier.pair.result import PairResult, Weakness
from certifier.pair.screen import Contact, Screen
from certifier.pair.weakness import pull, weak_points
from certifier.polytopes.polytope import chebyshev_center, drop_redundant
from certifier.polytopes.proved import ProvedBox
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.ground import Ground
from certifier.proof.negative import WitnessProof
from certifier.proof.pair import BITS
from certifier.verify.dual import verify_dual
from certifier.verify.pair import PairCheck, check_ground
from certifier.verify.witness import check_witness

FEW_ITERATIONS = 4
"""Volumes of several geometries get this many iterations; those that can be settled at all are settled within them."""
CONE_SAMPLES = 300
MIDDLE = 1.0
"""A certificate near the middle of the central path has a gap of at most this multiple of its margin."""


class Certification:
    """Holds everything that the pairs of one polytope share: faces, box, samples, cones.

    Args:
        polytope: its rows include the joint limits.
        center: (n,) interior point; default: the Chebyshev centre.
        seed: seeds the samples.
        box: a box around P. Its faces are used before P's, and in place of those of P's smallest box: what they prove holds on all of
            this box.

    Raises:
        RegionError: the polytope is empty or unbounded, or the centre is not inside.
    """

    def __init__(self, scene: Scene, polytope: Polytope, center: Array | None = None, seed: int = 0, box: Box | None = None) -> None:
        middle, _ = chebyshev_center(polytope, tuple(joint.name for joint in scene.moving))
        self.scene = scene
        self.center = middle if center is None else center
        kept = drop_redundant(polytope, inside=middle)
        self._faces = faces = Polytope(polytope.C[kept], polytope.d[kept])
        around = ProvedBox.of(scene, faces, middle)
        self._whole = None if box is None else PairCheck(scene, Ground.of_box(box.mid, box.half))
        self._box = around if box is None else box
        self.ground = Ground(faces.C, faces.d, self._box.mid, self._box.half, around.Y_lower, around.Y_upper)
        check_ground(scene, self.ground)
        self._check = PairCheck(scene, self.ground)
        self._samples = hit_and_run(faces, self.center, CONE_SAMPLES, seed)
        self._kinematics = Kinematics.of(scene)
        self.screen = Screen(self._kinematics, faces, self.center, self._samples)
        self._choice = FaceChoice(faces, box_first=box is not None)
        self._known: dict[tuple[tuple[int, ...], tuple[int, ...]], Sides] = {}
        self._broad_phase = BroadPhase(self._kinematics, self._together)

    def certify(self, index: int, max_iterations: int = 60, every_face: bool = False) -> PairResult:
        """Certifies pair ``scene.pairs[index]``, alone or with others that the same proof covers.

        Where a proof covers several pairs, its time counts for the first of them that is asked for.

        Args:
            every_face: begin with all of P's faces in the joints of the pair's path; this saves time where fewer faces are known to fail.
        """
        start, pair = time.perf_counter(), self.scene.pairs[index]
        found = None if every_face else self._broad_phase.find(pair)
        result = found or self._certify(pair, max_iterations, every_face)
        return replace(result, seconds=time.perf_counter() - start)

    def _together(self, volumes: Volumes) -> PairResult | None:
        """Returns one result for all pairs of two volumes, or None.

        The volumes must be clearly apart, and the first faces must suffice.
        """
        frame = frames_to_try(self._kinematics, volumes)[0]
        if not self.screen.apart(volumes, frame):
            return None
        sides = self._sides(frame, self._choice.first(frame))
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
        contact = self.screen.contact(volumes, frames[0])
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
        contact = self.screen.contact_near(volumes, frame, weak)
        if contact:
            return self._refute(pair, contact, Stage.SOS)
        weakness = Weakness(weak, gains, ranges_alone=frame.at_rest)
        if solution.status is Status.INFEASIBLE and not frame.at_rest:
            return replace(self._disprove(pair, frame, sides, blocks, solution), weakness=weakness)
        detail = f"{solution.status.value} after {solution.iterations} iterations"
        if frame.at_rest:
            memory = choose_frame(self._kinematics, volumes).memory(volumes)
            detail = f"found no plane at rest in the frame of {frame.body}; one that moves would need {memory / 2**30:.1f} GiB ({detail})"
        return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=detail, weakness=weakness)

    def _solve(self, volumes: Volumes, frame: Frame, max_iterations: int, every_face: bool) -> tuple[Sides, list[Block], Solution]:
        """Solves the program with the faces that matter.

        Raises:
            np.linalg.LinAlgError: a cone of P itself is numerically degenerate.
        """
        faces = first = self._choice.first(frame, every_face)
        while True:
            sides = self._sides(frame, faces)
            try:
                blocks = build(sides, volumes, frame)
                # The polytope step holds the multipliers of P's own faces fixed, so they should come from the middle of the central path.
                solution = solve(blocks, max_iterations, MIDDLE if self._whole and faces != first else np.inf)
            except np.linalg.LinAlgError:
                if faces == self._choice.every or frame.at_rest:
                    raise
                faces = self._choice.every
                continue
            more = faces if solution.status is Status.FEASIBLE else self._choice.more(frame, sides, solution)
            if more == faces:
                return sides, blocks, solution
            faces = more

    def _sides(self, frame: Frame, faces: tuple[int, ...]) -> Sides:
        key = self._choice.joints(frame, faces), faces
        if key not in self._known:
            self._known[key] = Sides(self._kinematics, self._faces, self._box, *key, self.center, self._samples)
        return self._known[key]

    def _prove(self, volumes: Volumes, frame: Frame, sides: Sides, solution: Solution) -> PairResult:
        """Makes the proof in as few bits as hold, and verifies it."""
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

    def _refute(self, pair: Pair, contact: Contact, stage: Stage) -> PairResult:
        proof = WitnessProof(self.scene, pair, self.ground.C, self.ground.d, contact.s, contact.weights)
        try:
            check_witness(proof)
        except ProofError as error:
            return PairResult(Outcome.INCONCLUSIVE, stage, detail=f"the contact found does not hold: {error}")
        return PairResult(Outcome.REFUTED, stage, witness_s=contact.s, proof=proof.to_bytes(), weakness=Weakness.of_contact(contact.s))

    def _disprove(self, pair: Pair, frame: Frame, sides: Sides, blocks: list[Block], solution: Solution) -> PairResult:
        try:
            proof = dual_proof(sides, pair, frame, self.ground, blocks, solution.x)
            statement = verify_dual(proof)
        except (ProofError, np.linalg.LinAlgError) as error:
            return PairResult(Outcome.INCONCLUSIVE, Stage.SOS, detail=f"the dual proof found does not hold: {error}")
        detail = f"no certificate of this degree with a plane affine in s, in the frame of {statement.frame}"
        return PairResult(Outcome.NOT_CERTIFIABLE, Stage.SOS, detail=detail, proof=proof.to_bytes())


def certify_pair(scene: Scene, index: int, polytope: Polytope, center: Array | None = None, seed: int = 0) -> PairResult:
    """Certifies one pair on one polytope; use :class:`Certification` to share the preparation between pairs."""
    return Certification(scene, polytope, center, seed).certify(index)
