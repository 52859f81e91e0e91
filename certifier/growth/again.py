"""A region of the scene before it changed is the proposal of a growth that has its polytope to begin with, and many proofs already.

The pairs that the change does not touch take over their proofs in the first round (certifier.carry). The others are certified cell by
cell and cut the region back where they cannot be, as ever (certifier.growth.whole). There is one stage: the faces do not move out again.
Where a point that has to stay inside is in contact now, nothing of the region is left, and no search is needed to see it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.conditions import fails
from certifier.errors import ProofError, RegionError
from certifier.growth.actions import Finish, Transition
from certifier.growth.state import GrowthState, Start
from certifier.growth.whole import REVOKED, begin_stage, in_words
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Pair, Polytope, Scene, Volume
from certifier.outcome import Outcome
from certifier.pair.collisions import touching
from certifier.polytopes.closest import closest
from certifier.proof.negative import WitnessProof
from certifier.verify.witness import check_witness
from certifier.words import counted


def begin_again(scene: Scene, state: GrowthState) -> Transition:
    """Asks to certify the polytope of the region; ends with the contact where one is known at a point to keep.

    Raises:
        RegionError: C, d or q are missing, or a configuration to keep is not inside.
    """
    asked = state.options.seed
    if not {"C", "d", "q"} <= asked.keys():
        raise RegionError("polytope_missing", "a region needs C, d and q", field="polytope", hint="give all of them")
    given = Polytope.given(asked["C"], asked["d"], scene.n)
    if any(len(q) != scene.n for q in asked["q"]):
        raise RegionError(
            "seed_wrong_length", f"a configuration to keep has not {counted(scene.n, 'number')}", field="seed.q", hint="one for each joint"
        )
    keep = scene.to_s(scene.in_windows(np.array(asked["q"], dtype=float).reshape(-1, scene.n), "seed.q"))
    limits = scene.polytope([], [])
    rows = {(*c, d) for c, d in zip(limits.C.tolist(), limits.d.tolist(), strict=True)}
    others = [(*c, d) not in rows for c, d in zip(given.C.tolist(), given.d.tolist(), strict=True)]
    # The rows keep their lengths: proofs that are taken over know them as they are.
    polytope = scene.polytope(given.C[others], given.d[others])
    if not len(keep) or not (keep @ polytope.C.T < polytope.d).all():
        raise RegionError(
            "seed_cut_off", "a configuration to keep is not inside the region", field="seed.q", hint="name one that is inside"
        )
    contact = _contact(scene, polytope, keep)
    if contact is not None:
        return Transition(state, contact)
    start = Start(polytope, keep[0], keep, again=True)
    return begin_stage(scene, replace(state, start=start), polytope)


def _contact(scene: Scene, polytope: Polytope, keep: Array) -> Finish | None:
    """Returns the end of a region of which a point to keep is in contact; None where no point is."""
    kinematics = Kinematics.of(scene)
    for pair in scene.pairs:
        volumes = Volume.of(scene.geometry(pair.a)), Volume.of(scene.geometry(pair.b))
        for s in keep[touching(kinematics, volumes, keep)]:
            outcome = Outcome.REFUTED if _is_witness(scene, pair, polytope, s) else Outcome.TOO_CLOSE
            how = "touch" if outcome is Outcome.REFUTED else "come too close"
            return Finish(outcome, f"{REVOKED}{fails(pair.a, pair.b, how)} at {in_words(scene, scene.to_q(s))}, which has to stay inside")
    return None


def _is_witness(scene: Scene, pair: Pair, polytope: Polytope, s: Array) -> bool:
    """Returns whether the verifier agrees that the pair touches at s."""
    kinematics = Kinematics.of(scene)
    a, b = scene.geometry(pair.a), scene.geometry(pair.b)
    A, B = (kinematics.points(WORLD, g.body, g.vertices, s[None])[0] for g in (a, b))
    try:
        check_witness(WitnessProof(scene, pair, polytope.C, polytope.d, s, closest(A, B).weights))
    except ProofError:
        return False
    return True
