"""Growth that keeps the whole proposal: what it asks for, and the regions that it comes to."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from certifier import stored
from certifier.errors import CirisError
from certifier.growth import whole
from certifier.growth.actions import Certify, Failed, Finish, Outcomes, Propose
from certifier.growth.machine import advance, begin
from certifier.growth.options import ENOUGH, GrowthOptions
from certifier.growth.state import Best, GrowthState, Start, Whole
from certifier.growth.whole import FAR, GAIN, HARD, LATE, LATEST, LEAST, LOSS, PARTED, PARTS, PATIENCE, PIECES, SLICE, SMALLER, VERIFIED
from certifier.jobs import local
from certifier.jobs.local import grow
from certifier.model import WORLD, Polytope
from certifier.outcome import Outcome
from certifier.pair.collisions import in_collision
from certifier.pair.result import Weakness
from certifier.partition.together import LOST
from certifier.polytopes.cutting import Cut, Made
from certifier.polytopes.gibbs import uniform_in_q
from certifier.scene import load_scene
from certifier.seeding.proposal import Proposal
from certifier.verify.region import verify_region
from tests.certifier.scenes import box, planar_arm
from tests.oracles.original import collision
from tests.scenes import box_seed

EXAMPLES = Path(__file__).parents[3] / "examples"
SCENE = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.2, 0.0)))
PROPOSAL = Proposal(
    C=np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 2.0], [0.0, -2.0]]),
    d=np.array([1.0, 1.0, 2.0, 2.0]),
    center=np.zeros(2),
    contain=np.array([[0.2, 0.0]]),
    info={},
)
CERTIFIED = Outcome.CERTIFIED, None
CORNER = np.array([[0.9, 0.9], [0.85, 0.9]])
OPEN = 1
"""The oracle leaves this many cells open in every part."""


def options(cells=SLICE, **others):
    return GrowthOptions(seed={}, cells=cells, **others)


def drive(verdict, asked, limit=40, passed=lambda action: 0.0, proposal=PROPOSAL):
    """Runs the machine against an oracle: (pair, Certify) -> (outcome, weakness or None).

    Args:
        passed: how much of the time until the deadline has passed after an action.

    Returns:
        The certifications asked for, the candidates and the last action.
    """
    made, accepted = [], []
    transition = begin(SCENE, asked)
    for _ in range(limit):
        document = stored.document(transition.state)
        state = stored.value(GrowthState, json.loads(json.dumps(document)))
        assert stored.document(state) == document, "the state survives JSON"
        if transition.candidate:
            accepted.append(transition.candidate)
        action = transition.action
        if isinstance(action, Finish):
            return made, accepted, action
        report = proposal
        if not isinstance(action, Propose):
            assert isinstance(action, Certify)
            made.append(action)
            found = {i: verdict(i, action) for i in action.pairs}
            reached = [(i, *found[i], OPEN if found[i][1] is not None else None) for i, _ in action.work]
            report = Outcomes.of_parts(action, reached, passed(action))
        transition = advance(SCENE, state, report)
    raise AssertionError("the machine does not end")


def stages(made):
    """Splits certifications where a new stage begins."""
    begins = [i for i, action in enumerate(made) if not action.begun]
    return [made[i:j] for i, j in zip(begins, [*begins[1:], len(made)], strict=True)]


@pytest.fixture
def demanding(monkeypatch):
    """Growth goes on until a stage gains little, however much the region keeps."""
    monkeypatch.setattr(whole, "ENOUGH", 1.0)


def weak(points):
    return Weakness(np.asarray(points, dtype=float).reshape(-1, 2), np.zeros(2))


def test_a_proposal_that_certifies_is_kept_whole():
    (made,), (accepted,), end = drive(lambda i, action: (Outcome.CERTIFIED, None), options())
    assert made.polytope.d[:4].tolist() == accepted.polytope.d[:4].tolist() == [1.0] * 4
    assert made.label == "cells"
    assert (made.box.mid - made.box.half < -1.0).all()
    assert accepted.proofs == {0: 0, 1: 0}
    assert (end.outcome, end.reason) == (Outcome.CERTIFIED, "certified")


def test_where_bodies_touch_is_cut_off_and_what_holds_is_not_asked_for_again():
    def verdict(index, action):
        touching = action.polytope.contains(CORNER)
        if index == 1 and touching.any():
            return Outcome.REFUTED, weak(CORNER[touching])
        return Outcome.CERTIFIED, None

    made, accepted, end = drive(verdict, options())
    ((first, last),) = stages(made)
    assert [action.pairs for action in (first, last)] == [[0, 1], [1]]
    assert last.reuse == {0: 0}
    assert last.begun == {0: 0, 1: 0}
    assert last.box.mid.tolist() == first.box.mid.tolist()
    assert last.box.half.tolist() == first.box.half.tolist()
    assert not last.polytope.contains(CORNER).any()
    assert last.polytope.contains(np.array([[0.0, 0.0], [0.2, 0.0]])).all()
    assert (last.polytope.C[:4] == first.polytope.C[:4]).all()
    assert accepted[0].proofs == {0: 0, 1: 1}
    assert end.outcome is Outcome.CERTIFIED


def test_a_contact_on_a_face_does_not_end_growth():
    """Searches come to it in every round, and faces have no part of it to cut off, until there is nothing else to do."""
    contact = np.array([[1.0, 0.3]])

    def verdict(index, action):
        if index == 1 and action.polytope.contains(contact, 1e-9).any():
            return Outcome.REFUTED, weak(contact)
        return Outcome.CERTIFIED, None

    made, accepted, end = drive(verdict, options(), limit=200)
    assert (made[0].polytope.C @ contact[0] == made[0].polytope.d).any()
    assert not accepted[-1].polytope.contains(contact, 1e-4).any()
    assert end.reason == "certified"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_growth_ends_after_the_stages_that_are_asked_for(count, demanding):
    corner = np.array([[0.4, 0.8], [0.8, 0.4]])

    def verdict(index, action):
        return (Outcome.REFUTED, weak(corner)) if (index, action.iteration) == (1, 0) else (Outcome.CERTIFIED, None)

    made, accepted, end = drive(verdict, options(stages=count))
    assert len(stages(made)) == len(accepted) == count
    assert (end.outcome, end.reason) == (Outcome.CERTIFIED, "certified")


def test_faces_move_out_stage_by_stage_as_far_as_the_proposal(demanding):
    """A face in the first stage cuts off much too much; the stages after it win that back."""
    corner = np.array([[0.4, 0.8], [0.8, 0.4]])

    def verdict(index, action):
        return (Outcome.REFUTED, weak(corner)) if (index, action.iteration) == (1, 0) else (Outcome.CERTIFIED, None)

    made, accepted, end = drive(verdict, options())
    assert [len(stage) for stage in stages(made)] == [2, 1, 1]
    cut, wider, widest = (candidate.polytope for candidate in accepted)
    (face,) = (i for i, row in enumerate(cut.C) if (row != 0).all())
    (moved,) = (i for i, row in enumerate(wider.C) if (row != 0).all())
    assert wider.C[moved].tolist() == cut.C[face].tolist()
    assert wider.d[moved] == pytest.approx(FAR * cut.d[face])
    samples = uniform_in_q(Polytope(PROPOSAL.C, PROPOSAL.d), SCENE, 100, 10, 0).reshape(-1, 2)
    shares = [candidate.polytope.contains(samples).mean() for candidate in accepted]
    assert shares[0] + GAIN < shares[1] < shares[2] == 1.0, "the second stage gained enough for a third one"
    assert (widest.C != 0).all(axis=1).sum() == 0
    assert end.reason == "certified"


@pytest.mark.parametrize("slices", [1, 9])
def test_what_stays_open_is_cut_off_when_the_effort_is_spent_and_where_bodies_are_near_before(slices):
    def verdict(index, action):
        there = action.polytope.contains(CORNER)
        if index == 0 or not there.any():
            return Outcome.CERTIFIED, None
        return Outcome.INCONCLUSIVE, weak(CORNER[there] if index in action.ending else [])

    made, accepted, _ = drive(verdict, options(cells=slices * SLICE))
    later = stages(made)[0]
    spent = [round_ * PARTS for round_ in range(len(later))]
    assert [action.hard for action in later] == [[1] if HARD <= SLICE * s < SLICE * slices else [] for s in spent]
    assert [action.ending for action in later] == [[1] if s >= slices else [] for s in spent]
    assert any(action.hard for action in later) == (slices > HARD // SLICE)
    # Any share may be lost some rounds after the effort is spent.
    assert slices // PARTS + 1 <= len(later) <= slices // PARTS + 5 * PIECES // PARTS
    assert all(action.cells == SLICE for action in later)
    assert all(action.polytope.contains(CORNER).all() for action in later[: 1 + math.ceil(slices / PARTS)])
    assert not accepted[-1].polytope.contains(CORNER).any()


@pytest.mark.parametrize(("passed", "parts"), [(0.0, PARTS), (LATE, 1)])
def test_rounds_of_many_pairs_are_shorter_when_a_stage_is_late(passed, parts):
    pairs = range(2 * PIECES)
    state = Whole(0.5, SCENE.polytope([], []), *np.zeros((2, 2)), *np.zeros((2, 2, 8)), open_cells=dict.fromkeys(pairs, 50), passed=passed)
    assert whole._parts(pairs, state) == (dict.fromkeys(pairs, parts) if parts > 1 else {})


@pytest.mark.parametrize(
    ("lost", "cut", "passed", "costly"),
    [
        (LOST, "off", 0.0, False),
        (1.01 * LOST, "off", 0.0, True),
        (0.0, "not", 0.0, True),  # a face would lose more than it may
        (0.0, "impossible", 0.0, True),  # a configuration to keep is in the way
        (1.01 * LOST, "off", LATE, False),
        (0.0, "not", LATE, True),  # nothing at all was cut off
        (0.0, "impossible", LATE, True),
    ],
)
def test_contacts_are_costly_where_faces_lose_much_or_there_are_none(lost, cut, passed, costly):
    polytope = SCENE.polytope([], [])
    smaller = {"off": SCENE.polytope([[1.0, 0.0]], [0.5]), "not": polytope, "impossible": None}[cut]
    state = Whole(0.5, polytope, *np.zeros((2, 2)), *np.zeros((2, 2, 8)), passed=passed)
    report = SimpleNamespace(weaknesses={3: Weakness(CORNER, np.zeros(2), contacts=len(CORNER))})
    made = Cut(smaller, [Made(int(lost > 0), lost), Made()], polytope)
    assert whole._costly(state, report, [3], made) == ([3] if costly else [])
    report.weaknesses[3] = Weakness(CORNER, np.zeros(2))  # no contacts, but points where a plane is missing
    assert whole._costly(state, report, [3], Cut(smaller, [Made(), Made(1, 0.1)], polytope)) == []


@pytest.mark.parametrize(("joints", "begin", "cells"), [((), HARD, PATIENCE), ((0,), 0, PARTED)])
def test_faces_may_soon_lose_more_where_they_separate_volumes_that_fewer_joints_move(joints, begin, cells):
    report = SimpleNamespace(weaknesses={1: replace(weak(CORNER), joints=joints)})
    for spent, times in ((begin + 1, 0), (HARD + cells - 1, 0), (HARD + cells, 1), (HARD + 2 * cells, 2)):
        state = Whole(0.5, SCENE.polytope([], []), *np.zeros((2, 2)), *np.zeros((2, 2, 8)), spent={1: spent})
        assert whole._most_loss(GrowthState(options(cells=10**6)), state, 1, report) == LOSS * 2**times


@pytest.mark.parametrize(("touching", "when"), [(True, LATE), (False, LATEST)])
def test_what_is_open_is_cut_off_when_the_deadline_comes_near(touching, when):
    """A stage goes on until it is late, and ends a few rounds later: where coarse volumes touch at once, elsewhere at last."""

    def verdict(index, action):
        there = action.polytope.contains(CORNER)
        if index == 0 or not there.any():
            return Outcome.CERTIFIED, None
        named = index in action.ending and (touching or index in action.hard)
        return Outcome.INCONCLUSIVE, weak(CORNER[there] if named else [])

    made, accepted, end = drive(verdict, options(cells=1000 * SLICE), passed=lambda action: 0.1 * action.iteration)
    second = stages(made)[0]
    passed = [0.1 * (action.iteration - 1) for action in second]
    assert [bool(action.ending) for action in second] == [share >= LATE for share in passed]
    assert [bool({*action.hard} & {*action.ending}) for action in second] == [share >= LATEST for share in passed]
    assert all(action.polytope.contains(CORNER).all() for action, share in zip(second, passed, strict=True) if share < when)
    assert when < passed[-1] < when + 0.25
    assert end.outcome is Outcome.CERTIFIED
    assert not accepted[0].polytope.contains(CORNER).any()


def test_open_cells_are_dealt_to_parts_and_a_pair_without_any_is_put_together_in_the_next_round():
    """Both pairs are left open in the first stage; one has no cell open after the second round, the other after the fourth."""
    rounds = {0: 2, 1: 4}

    def reached(action, index, part):
        gone_on = action.iteration - action.begun.get(index, action.iteration)
        if gone_on >= rounds[index]:
            return index, Outcome.CERTIFIED, None, None
        left = 0 if gone_on == rounds[index] - 1 else 50
        return index, Outcome.INCONCLUSIVE, weak([]), left

    made, transition = [], begin(SCENE, options(cells=50 * SLICE))
    while len(made) < 5:
        report = PROPOSAL
        if isinstance(transition.action, Certify):
            made.append(transition.action)
            report = Outcomes.of_parts(transition.action, [reached(transition.action, *work) for work in transition.action.work])
        transition = advance(SCENE, transition.state, report)
    assert [action.begun for action in made] == [{}, *[{0: 0, 1: 0}] * 4]
    shared = PIECES // 2
    # The first round counts as PARTS slices.
    together = (PARTS + shared) * SLICE // VERIFIED
    assert [action.parts.get(0, 1) for action in made] == [1, shared, max(together, 1), 1, 1]
    assert [action.pairs for action in made] == [[0, 1]] * 3 + [[1]] * 2
    assert [action.parts.get(1, 1) for action in made] == [1, shared, shared, PIECES, min(PIECES, (PARTS + 24) * SLICE // VERIFIED)]
    assert made[-1].reuse == {0: 2}
    assert made[-1].work == [(1, part) for part in range(made[-1].parts[1])]
    assert transition.action == Finish(Outcome.CERTIFIED, "certified")
    assert transition.state.best.iteration == 4


FACES = {"all around": PROPOSAL.C, "on one side": PROPOSAL.C[:1], "none": PROPOSAL.C[:0]}


@pytest.mark.parametrize(
    ("faces", "contain", "copies"),
    [
        ("all around", [[0.2, 0.0]], 4),  # the next copy does not have this point inside
        ("all around", [], 7),  # the next copy keeps less than LEAST
        ("on one side", [], 0),  # a copy would hardly be smaller
        ("none", [], 0),
    ],
)
def test_a_contact_at_a_configuration_to_keep_ends_without_a_region(faces, contain, copies):
    """Smaller copies are tried, as long as they become smaller and keep something."""
    proposal = replace(PROPOSAL, C=FACES[faces], d=PROPOSAL.d[: len(FACES[faces])], contain=np.array(contain).reshape(-1, 2))
    at_seed = (Outcome.REFUTED, weak([[0.0, 0.0]]))
    made, accepted, end = drive(lambda i, action: at_seed, options(), proposal=proposal)
    assert len(made) == 1 + copies
    if copies:
        assert [action.polytope.d[0] for action in made] == pytest.approx((SMALLER ** np.arange(1 + copies)).tolist())
        # The sides of a box in q; the proposal's are pi / 2.
        assert (4 / np.pi * np.arctan(SMALLER ** (1 + copies))) ** 2 < LEAST or contain
    assert not accepted
    assert end.outcome is Outcome.REFUTED
    assert SCENE.pairs[0].a in end.reason


def test_a_copy_has_to_keep_more_than_the_best_region(demanding):
    """The stage before has a region of 0.95, and no copy of the second one's polytope keeps that."""
    made, accepted, end = drive(in_the_second_stage((Outcome.REFUTED, weak([[0.0, 0.0]]))), options())
    assert (len(made), len(accepted)) == (3, 1)
    assert "ended early" in end.reason


@pytest.mark.parametrize("cells", [1, 10_000_000])
def test_faces_for_contacts_may_lose_twice_as_much_again_and_again(cells):
    """A face in the way of a contact would lose a third of the polytope. No cell settles the contact, so it goes at last."""
    contact = np.array([[0.3, 0.3]])

    def verdict(index, action):
        return (
            (Outcome.REFUTED, replace(weak(contact), contacts=1)) if index == 1 and action.polytope.contains(contact).any() else CERTIFIED
        )

    made, accepted, _ = drive(verdict, options(cells=cells, stages=1), limit=100)
    assert 1 < len(made) < 40
    assert not accepted[-1].polytope.contains(contact).any()
    assert whole._doubled(0.01, 10**9) == 1.0


def test_where_nothing_can_be_cut_off_a_smaller_copy_is_tried():
    """A point between those to keep fails, but not in a polytope that is small enough."""

    def verdict(index, action):
        return (Outcome.CERTIFIED, None) if action.polytope.d[0] < 0.6 else (Outcome.TOO_CLOSE, weak([[0.1, 0.0]]))

    made, accepted, end = drive(verdict, options(stages=1))
    assert [action.polytope.d[0] for action in made] == pytest.approx([1.0, SMALLER, SMALLER**2])
    assert accepted[-1].polytope is made[-1].polytope
    assert (end.outcome, end.reason) == (Outcome.CERTIFIED, "certified")


@pytest.mark.parametrize(
    ("before", "now", "ends"),
    [(0.5, 0.51, True), (0.5, 0.53, False), (0.004, 0.005, True), (0.004, 0.007, False), (0.0, 0.0, True), (0.5, ENOUGH, True)],
)
def test_a_small_region_grows_on_although_it_gains_little_of_the_proposal(monkeypatch, before, now, ends):
    polytope = SCENE.polytope(PROPOSAL.C, PROPOSAL.d)
    stage = Whole(before, polytope, *np.zeros((2, 2)), *np.zeros((2, 2, 8)), stage=2)
    state = GrowthState(options(), best=Best(0, polytope, np.zeros(2), 1.0), whole=stage)
    monkeypatch.setattr(whole, "_kept", lambda *_: now)
    following = whole._next_stage(SCENE, state, Start(polytope, np.zeros(2), np.zeros((1, 2))))
    assert isinstance(following.action, Finish) == ends


def in_the_second_stage(found):
    """Returns verdicts: the first stage cuts a corner off, and then pair 1 has this one."""
    corner = np.array([[0.4, 0.8], [0.8, 0.4]])

    def verdict(index, action):
        if index == 0 or action.iteration == 1:
            return Outcome.CERTIFIED, None
        return (Outcome.REFUTED, weak(corner)) if action.iteration == 0 else found

    return verdict


def test_a_contact_at_a_configuration_to_keep_leaves_the_smaller_region(demanding):
    _, accepted, end = drive(in_the_second_stage((Outcome.REFUTED, weak([[0.1, 0.0]]))), options())
    assert [candidate.iteration for candidate in accepted] == [1]
    assert end.outcome is Outcome.CERTIFIED
    assert "ended early" in end.reason


def test_a_pair_that_fails_nobody_knows_where_ends_the_growth(demanding):
    """An error, or a proof that does not hold, would come again and again."""
    made, accepted, end = drive(lambda index, action: (Outcome.ERROR if index == 1 else Outcome.CERTIFIED, None), options())
    assert (len(made), len(accepted), end.outcome) == (1, 0, Outcome.ERROR)
    assert SCENE.pairs[1].a in end.reason
    made, accepted, end = drive(in_the_second_stage((Outcome.ERROR, None)), options())
    assert (len(made), len(accepted), end.outcome) == (3, 1, Outcome.CERTIFIED)
    assert SCENE.pairs[1].a in end.reason


def test_an_error_of_one_part_ends_the_growth_at_once():
    """The part has left nothing of its cells, so going on with the others would come to no proof."""
    made, transition = [], begin(SCENE, options(cells=50 * SLICE))
    while isinstance(transition.action, Certify | Propose):
        report = PROPOSAL
        if isinstance(transition.action, Certify):
            made.append(transition.action)
            failed = [(index, Outcome.INCONCLUSIVE, weak([]), 50) for index, _ in made[-1].work]
            if len(made) == 2:
                failed[1] = (failed[1][0], Outcome.ERROR, None, None)
            report = Outcomes.of_parts(made[-1], failed)
        transition = advance(SCENE, transition.state, report)
    assert len(made) == 2
    assert made[1].parts[failed[1][0]] > 1
    assert transition.action.outcome is Outcome.ERROR
    assert "nothing is known of where they fail" in transition.action.reason


def test_cells_that_miss_the_polytope_are_settled_before_growth_gives_up():
    """There is nothing to cut off for them, however late it is."""
    made, transition = [], begin(SCENE, options(cells=SLICE))
    while isinstance(transition.action, Certify | Propose) and len(made) < 60:
        report = PROPOSAL
        if isinstance(transition.action, Certify):
            made.append(transition.action)
            results = [(index, Outcome.INCONCLUSIVE, weak([]), 50) for index, _ in made[-1].work]
            if len(made) >= 50:
                results = [(index, Outcome.CERTIFIED, None, None) for index, _ in made[-1].work]
            report = Outcomes.of_parts(made[-1], results)
            final = {*made[-1].ending} & {*made[-1].hard}
        transition = advance(SCENE, transition.state, report)
        if transition.candidate is not None:
            break
    assert len(made) == 50
    assert final == {0, 1}, "everything may be cut off already"
    assert transition.candidate is not None


@cache
def example(name):
    path = EXAMPLES / name / "scene.yaml"
    return path, load_scene(path), yaml.safe_load((path.parent / "seed.yaml").read_text())["q"]


@pytest.mark.parametrize(("name", "half"), [("planar_2dof", 0.4), pytest.param("arm_3dof", 0.5, marks=pytest.mark.slow)])
def test_a_region_of_an_example_is_verified_contains_what_it_has_to_and_is_free(name, half):
    path, scene, q = example(name)
    contain = (np.array(q) + 0.02).tolist()
    seed = box_seed(scene.to_s(q), half, contain=[contain])
    region = grow(scene, GrowthOptions(seed=seed, cells=2 * SLICE))
    statement = verify_region(region.proof)
    assert set(statement.gaps) == set(scene.pairs)
    assert statement.gap > 0
    kept, proposal = (
        Polytope(np.array(part["halfspace_normals"]), np.array(part["halfspace_offsets"]))
        for part in (region.manifest, region.manifest["provenance"]["proposal"])
    )
    assert kept.contains(scene.to_s([q, contain])).all()
    assert collision(path, scene, kept, 5000) is None
    # The proposal itself does collide, so that something had to be cut off; and it is the proposal that was cut.
    assert region.manifest["share"]["collision_free"] < 1
    assert 0 < region.manifest["share"]["value"] < 1
    samples = uniform_in_q(kept, scene, 50, 10, 1).reshape(-1, scene.n)
    assert proposal.contains(samples, 1e-9).all()
    assert not in_collision(scene, samples).any()


@cache
def two_stages():
    """Returns a scene, options, and the region that they give. The region grows in two stages."""
    _, scene, q = example("planar_2dof")
    asked = GrowthOptions(seed=box_seed(scene.to_s(q), 0.22), cells=SLICE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole, "ENOUGH", 1.0)
        region = grow(scene, asked)
    assert len(region.manifest["provenance"]["growth_curve"]) == 2
    assert region.manifest["share"]["collision_free"] < 1, "something had to be cut off"
    return scene, asked, region


@pytest.mark.parametrize("processes", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_same_job_comes_to_the_same_bytes(processes, demanding):
    scene, asked, first = two_stages()
    second = grow(scene, asked, processes=processes)
    assert first.proof == second.proof
    assert first.manifest["halfspace_offsets"] == second.manifest["halfspace_offsets"]


def test_more_effort_does_not_come_to_less():
    _, scene, q = example("arm_3dof")
    shares = []
    for cells in (2, 10 * SLICE):
        asked = GrowthOptions(seed=box_seed(scene.to_s(q), 0.3), cells=cells)
        shares.append(grow(scene, asked).manifest["share"])
    assert 0.9 < shares[0]["value"] <= shares[1]["value"]


def test_a_deadline_ends_growth_with_the_best_region_so_far(monkeypatch, demanding):
    scene, asked, _ = two_stages()
    # The clock stands still until a region is reported, and then the deadline is over.
    clock = [0.0]
    monkeypatch.setattr(local, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    accept = local._Memory._accept

    def accepted(*arguments):
        accept(*arguments)
        clock[0] += 10.0

    monkeypatch.setattr(local._Memory, "_accept", accepted)
    region = grow(scene, asked, deadline_s=10.0)
    assert region.reason == "the deadline was reached"
    assert len(region.manifest["provenance"]["growth_curve"]) == 1
    later = grow(scene, asked, deadline_s=1000.0)
    assert later.reason == "certified"
    assert len(later.manifest["provenance"]["growth_curve"]) > 1
    with pytest.raises(CirisError, match="the deadline was reached") as refused:
        grow(scene, asked, deadline_s=0.0)
    assert (refused.value.code, refused.value.hint) == ("not_grown", "allow more time")


def test_a_round_ends_with_the_pair_in_which_the_deadline_passes(monkeypatch, demanding):
    scene, asked, _ = two_stages()
    clock, told = [0.0], []
    monkeypatch.setattr(local, "time", SimpleNamespace(perf_counter=lambda: clock[0]))

    def tell(kind, what):
        if kind == "pairs":
            told.append(what["iteration"])
            clock[0] += 10.0

    assert len(scene.pairs) > 1
    with pytest.raises(CirisError, match="the deadline was reached"):
        grow(scene, asked, tell, deadline_s=10.0)
    assert len(told) == 1

    # After the box about the seed, the first pair of the proposal is the last one.
    board = planar_arm(2, box("world/board", WORLD, (4.0, 0.2, 0.3), (0.0, 0.17, 0.0)))
    codes, save = [], local._Memory.save

    def saved(job, turn, decision):
        codes.extend([turn.report.error.code] if isinstance(turn.report, Failed) else [])
        return save(job, turn, decision)

    monkeypatch.setattr(local._Memory, "save", saved)
    told.clear()
    clock[0] = -10.0 * len(board.pairs)
    region = grow(board, GrowthOptions(seed={"q": [0.0, 0.0]}), tell, deadline_s=10.0 * (1 + len(board.pairs)))
    assert region.reason == "the deadline was reached; the region is a small box about the seed"
    assert told == [0] * len(board.pairs) + [1]
    assert codes == ["child_timeout"]


def test_regions_are_delivered_as_they_are_certified_and_time_is_left_for_growing(monkeypatch, demanding):
    scene, asked, _ = two_stages()
    # Faces that move out by little make three stages, of which the last one gains next to nothing. Its region is the one returned.
    monkeypatch.setattr(whole, "FAR", 1.002)
    monkeypatch.setattr(whole, "GAIN", 0.0)
    asked = replace(asked, stages=3)
    monkeypatch.setattr(local, "REST", 0.0)
    delivered = []
    last = grow(scene, asked, deliver=delivered.append)
    assert len(delivered) == 2 <= len(last.manifest["provenance"]["growth_curve"])
    for region in delivered:
        assert verify_region(region.proof).faces == len(region.manifest["halfspace_offsets"])
    first, second = (region.manifest["share"]["value"] for region in delivered)
    assert first < second <= last.manifest["share"]["value"]
    # Verifying takes no time here, but rests for ever after the first.
    monkeypatch.setattr(local, "REST", 1e9)
    few = []
    assert grow(scene, asked, deliver=few.append).proof == last.proof
    assert [region.proof for region in few] == [delivered[0].proof]


def test_a_seed_in_contact_is_refused():
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (1.5, 0.0, 0.0)))
    with pytest.raises(CirisError):
        grow(scene, GrowthOptions(seed={"q": [0.0, 0.0]}))


def test_a_child_that_dies_leaves_the_region_before(monkeypatch, demanding):
    scene, asked, _ = two_stages()
    certifier = local.part_certifier

    def dying(scene, action, *others):
        in_the_second_stage = action.iteration > 1 and not action.begun
        return (lambda index, part: os._exit(1)) if in_the_second_stage else certifier(scene, action, *others)

    monkeypatch.setattr(local, "part_certifier", dying)
    region = grow(scene, asked, processes=2)
    assert "a process that certified pairs died" in region.reason
    assert 0 < region.manifest["share"]["value"] < 1
    verify_region(region.proof)
