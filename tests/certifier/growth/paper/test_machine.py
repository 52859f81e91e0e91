"""The papers' algorithm: what follows what, against an oracle for pairs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from certifier import stored
from certifier.errors import CirisError
from certifier.growth.actions import Certify, Failed, Finish, Outcomes, Propose, Step
from certifier.growth.machine import advance, begin, stored_state
from certifier.growth.options import GrowthOptions
from certifier.growth.paper.options import PaperOptions
from certifier.growth.paper.uniform import SMALLEST_SCALE
from certifier.jobs.local import grow
from certifier.model import WORLD, Polytope
from certifier.outcome import Outcome
from certifier.pair.result import Weakness
from certifier.polytopes.polytope import bounds
from certifier.seeding.proposal import Proposal
from certifier.step.stepped import Stepped
from tests.certifier.scenes import box, planar_arm

SCENE = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.2, 0.0)))
PROPOSAL = Proposal(
    C=np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 2.0], [0.0, -2.0]]),
    d=np.array([1.0, 1.0, 2.0, 2.0]),
    center=np.zeros(2),
    contain=np.zeros((0, 2)),
    info={},
)
UNIFORM = PaperOptions("uniform", pushes=0, max_rounds=0)


def drive(scene, options, verdict, limit=100):
    """Run the machine against an oracle for pairs; returns the certifications made and the last transition."""
    options = GrowthOptions(paper=options)
    made, accepted = [], []
    transition = begin(scene, options)
    for _ in range(limit):
        action, document = transition.action, stored.document(transition.state)
        state = stored_state(json.loads(json.dumps(document)))
        assert stored.document(state) == document, "the state survives JSON"
        if transition.candidate:
            accepted.append(transition.candidate)
        if isinstance(action, Finish):
            return made, accepted, action
        if isinstance(action, Propose):
            report = PROPOSAL
        elif isinstance(action, Step):
            moved = Polytope(action.polytope.C, action.polytope.d * 1.1)
            report = Stepped(moved, np.zeros(2), action.polytope, 0.2, {})
        else:
            assert isinstance(action, Certify)
            made.append(action)
            outcomes = {}
            for index in action.pairs:
                outcomes[index] = verdict(index, action.polytope.d)
                if sum(outcome is not Outcome.CERTIFIED for outcome in outcomes.values()) == action.failures:
                    break
            report = Outcomes(action, outcomes)
        transition = advance(scene, state, report)
    raise AssertionError("the machine does not end")


def certified_if(limit):
    return lambda index, d: Outcome.CERTIFIED if d[0] <= limit else Outcome.NOT_CERTIFIABLE


def test_a_proposal_that_certifies_is_taken_whole():
    made, accepted, end = drive(SCENE, UNIFORM, certified_if(5.0))
    assert [action.label for action in made] == ["contract"]
    assert accepted[-1].polytope.d[:4].tolist() == [1.0, 1.0, 1.0, 1.0]
    assert end.outcome is Outcome.CERTIFIED


@pytest.mark.parametrize("limit", [0.02, 0.3, 0.77])
def test_bisection_finds_the_largest_trial_and_never_loses_an_accepted_region(limit):
    made, accepted, end = drive(SCENE, replace(UNIFORM, bisection_steps=12), certified_if(limit))
    sizes = [region.polytope.d[0] for region in accepted]
    assert sizes == sorted(sizes)
    assert limit * SMALLEST_SCALE ** (1 / 2**11) <= sizes[-1] <= limit
    assert len(made) == 14
    assert end.outcome is Outcome.CERTIFIED


def test_a_pair_certified_on_a_larger_trial_is_not_certified_again():
    def verdict(index, d):
        return Outcome.CERTIFIED if index == 0 or d[0] <= 0.1 else Outcome.INCONCLUSIVE

    made, accepted, _ = drive(SCENE, replace(UNIFORM, bisection_steps=4), verdict)
    assert made[0].pairs == [0, 1]
    assert all(action.reuse == {0: 0} and action.pairs == [1] for action in made[1:])
    assert accepted[-1].proofs[0] == 0
    assert set(accepted[-1].proofs) == {0, 1}


def test_pairs_that_failed_last_come_first():
    made, _, _ = drive(SCENE, replace(UNIFORM, bisection_steps=3), lambda i, d: certified_if(0.3)(i, d) if i else Outcome.CERTIFIED)
    assert made[1].pairs[0] == 1


def test_a_seed_that_cannot_be_certified_ends_with_the_pair_named():
    made, accepted, end = drive(SCENE, UNIFORM, lambda index, d: Outcome.REFUTED)
    assert not accepted
    assert end.outcome is Outcome.REFUTED
    assert SCENE.pairs[0].a in end.reason
    assert len(made) == 2


def test_alternation_accepts_rounds_and_backs_off():
    made, accepted, end = drive(SCENE, replace(UNIFORM, max_rounds=3, bisection_steps=3, backoff=2), certified_if(1.15))
    assert [action.label for action in made] == ["contract"] + 7 * ["round"]
    assert [round(region.polytope.d[0], 6) for region in accepted] == [1.0, 1.1, 1.1275]
    assert end.outcome is Outcome.CERTIFIED


def test_a_failed_step_keeps_the_certified_region_and_a_failed_seeding_ends():
    options = replace(UNIFORM, max_rounds=3)
    first = begin(SCENE, GrowthOptions(paper=options))
    assert isinstance(first.action, Propose)
    error = CirisError("seed_in_collision", "a and b touch")
    assert advance(SCENE, first.state, Failed(error)).action == Finish(Outcome.ERROR, "a and b touch")
    certify = advance(SCENE, first.state, PROPOSAL)
    stepping = advance(SCENE, certify.state, Outcomes(certify.action, {0: Outcome.CERTIFIED, 1: Outcome.CERTIFIED}))
    assert isinstance(stepping.action, Step)
    assert stepping.candidate is not None
    end = advance(SCENE, stepping.state, Failed(CirisError("step_too_large", "too large"))).action
    assert isinstance(end, Finish)
    assert end.outcome is Outcome.CERTIFIED


@pytest.mark.parametrize(("joints", "pushes", "rounds"), [(2, 10, 3), (5, 2, 0), (7, 0, 0)])
def test_the_longer_the_chains_the_less_is_done_unasked(joints, pushes, rounds):
    scene = planar_arm(joints)
    proposal = Proposal(np.eye(joints), np.full(joints, 0.01), np.zeros(joints), np.zeros((0, joints)), {"method": "iris_np2"})
    transition, said = begin(scene, GrowthOptions(paper=PaperOptions(tolerance=1e-6))), []
    while not isinstance(transition.action, Finish):
        report = proposal
        if isinstance(transition.action, Certify):
            said.append(transition.action.label)
            whole = transition.action.label == "contract" and len(transition.action.polytope.d) == 3 * joints
            outcome = Outcome.NOT_CERTIFIABLE if whole else Outcome.CERTIFIED
            report = Outcomes(transition.action, dict.fromkeys(transition.action.pairs, outcome))
        elif isinstance(transition.action, Step):
            said.append("step")
            report = Failed(CirisError("step_failed", "no"))
        transition = advance(scene, transition.state, report)
    assert said.count("push") <= pushes
    assert ("push" in said, "step" in said) == (pushes > 0, rounds > 0)


GIVEN = replace(PROPOSAL, info={"method": "polytope"})


def first_starts(options, verdict, count):
    """Half-widths in the first joint of the polytopes that a given one's contractions start from, each decided by the verdict."""
    transition, widths = advance(SCENE, begin(SCENE, GrowthOptions(paper=options)).state, GIVEN), []
    while len(widths) < count:
        action = transition.action
        assert isinstance(action, Certify)
        if action.label != "contract" or not transition.state.cuts.attempts:
            widths.append((action.label, round(bounds(action.polytope)[1][0], 6)))
        outcomes = {index: verdict(len(widths)) for index in action.pairs}
        weak = dict.fromkeys(action.pairs, Weakness(np.array([[0.9 * action.polytope.d[0], 0.0]]), np.ones(2)))
        transition = advance(SCENE, transition.state, Outcomes(action, outcomes, weak))
    return widths


def test_a_given_polytope_is_first_contracted_from_far_outside_where_pushes_are_allowed():
    options = PaperOptions(contractions=1, pushes=2, max_rounds=0)
    assert first_starts(options, lambda _: Outcome.CERTIFIED, 1) == [("contract", pytest.approx(SCENE.polytope([], []).d[0], abs=1e-6))]
    assert first_starts(replace(options, pushes=0), lambda _: Outcome.CERTIFIED, 1) == [("contract", 1.0)]


def test_a_given_polytope_is_tried_itself_when_nothing_far_outside_can_be_certified():
    options = PaperOptions(contractions=1, pushes=2, max_rounds=0)
    fails_far = lambda start: Outcome.NOT_CERTIFIABLE if start == 1 else Outcome.CERTIFIED  # noqa: E731
    assert [width for _, width in first_starts(options, fails_far, 2)][1] == 1.0


def test_pairs_that_failed_are_hard_until_they_are_certified():
    options = GrowthOptions(paper=PaperOptions(contractions=1, pushes=0, max_rounds=0))
    begun = advance(SCENE, begin(SCENE, options).state, PROPOSAL)
    assert begun.action.hard == []
    weak = Weakness(np.array([[0.9, 0.0]]), np.ones(2))
    failed = advance(SCENE, begun.state, Outcomes(begun.action, {0: Outcome.CERTIFIED, 1: Outcome.NOT_CERTIFIABLE}, {1: weak}))
    assert (failed.action.hard, failed.action.pairs, failed.action.reuse) == ([1], [1], {0: 0})
    held = advance(SCENE, failed.state, Outcomes(failed.action, {1: Outcome.CERTIFIED}))
    assert held.candidate.proofs == {0: 0, 1: 1}


def test_what_has_to_be_contained_stays_in_every_region():
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.2, 0.0)))
    contain = [[-0.6, 0.7], [-0.9, -0.4]]
    seed = {"q": [0.0, 0.0], "contain": contain, "method": "box", "half_width": 0.2}
    region = grow(scene, GrowthOptions(seed=seed, paper=PaperOptions(max_rounds=1)))
    points = scene.to_s(np.array([[0.0, 0.0], *contain]))
    C, d = (np.array(region.manifest[name]) for name in ("halfspace_normals", "halfspace_offsets"))
    assert (d[:, None] > C @ points.T).all()
    assert len(region.manifest["provenance"]["growth_curve"]) > 1


def test_points_that_cannot_be_contained_together_are_refused():
    seed = {"q": [0.0, 0.0], "contain": [[1.9, 0.1]], "method": "box", "half_width": 1e-3}
    with pytest.raises(CirisError) as refusal:
        grow(SCENE, GrowthOptions(seed=seed, paper=PaperOptions(max_rounds=0, pushes=0)))
    assert refusal.value.code == "contain_blocked"
