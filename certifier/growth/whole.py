"""The whole proposal is certified cell by cell, and what cannot be is cut off by faces that lose least (certifier.polytopes.cutting).

One round looks at a fixed number of cells of every pair that is not certified yet. Then faces are added where bodies touch, or come too
close. What is proved stays proved, because the polytope only shrinks. The rounds go on until every pair is certified. When the effort is
spent, all cells that are still open are cut off as well.

The first stage certifies the proposal itself. Where the region keeps too little, further stages follow. They move its faces out, as far as
the proposal, and certify all pairs anew.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from certifier.broken import trouble
from certifier.conditions import called
from certifier.growth.actions import Certify, Finish, Outcomes, Transition
from certifier.growth.obstacles import Obstacle, joined
from certifier.growth.options import ENOUGH, MOST_CELLS
from certifier.growth.pairs import by_joints, joints_between
from certifier.growth.state import GrowthState, Start, Whole
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, combine
from certifier.partition.together import LOST, THIN, Together, divided, together
from certifier.polytopes.cutting import BARELY, Cut, cut, lost_together, samples_of
from certifier.polytopes.proved import ProvedBox
from certifier.polytopes.pushed import pushed
from certifier.words import with_units

FAR = 1.2
"""In every further stage, the faces of the region move out to this many times their distance from the seed."""
SMALLER = 0.7
"""Where something would have to be cut off that no face separates from a point to keep, the stage begins anew with a smaller copy of the
polytope: its faces at this part of their distance from the seed."""
LEAST, SHRUNK = 0.01, 0.8
"""A copy is tried only if it keeps the share LEAST of the proposal, and at most SHRUNK of what the polytope keeps. Where nearly all faces
are joint limits, a copy is hardly smaller, and copies would not end."""
GAIN, OWN = 0.02, 0.5
"""Growth ends with a stage that gains less than the share GAIN of the proposal. A small region has to gain the share OWN of itself only."""
SLICE = 100
"""Number of cells to look at in one round, for every part of a pair."""
PARTS, PIECES = 3, 12
"""The open cells of a pair are divided among at least PARTS parts, so that a round has PIECES parts for the solvers to share. A round
counts as at least PARTS slices of the pair's effort, even where it has fewer parts. When a stage is late, one part is enough, so that
rounds are short."""
VERIFIED = 5 * SLICE
"""A pair without open cells is verified in parts: one for every this many cells that were looked at."""
HARD = 6 * SLICE
"""After this many cells of a pair, its open cells are cut off where the bodies are near, not only contacts. Where faces separate volumes
that fewer joints move (certifier.partition.search), cells are cut off from the first round on."""
LOSS, PATIENCE, PARTED = 0.002, 108 * SLICE, 12 * SLICE
"""While open cells of a pair are cut off, its faces lose at most the share LOSS of the polytope in a round. The share doubles after every
PATIENCE cells of a hard pair. Where faces separate volumes that fewer joints move, it doubles after every PARTED cells, because more cells
do not help where these volumes touch."""
FAST_LOSS = 0.05
"""They lose at most this share before that, and when the pair's effort is spent. From then on, the share doubles after every PIECES
slices."""
CONTACT_LOSS = 0.01
"""No cell settles a contact, so it has to be cut off sooner or later. Faces for contacts may always lose this share of the polytope in a
round. The share doubles after every PIECES slices."""
ENDING = 60 * SLICE
"""When the effort is spent, open cells are cut off where coarse volumes touch; after this many more cells, wherever they are."""
LATE = 0.6
"""When this share of a stage's time until the deadline has passed, its effort counts as spent, so that there is still time for a region."""
LATE_LOSS, LATER = 0.01, 0.04
"""From then on, faces for open cells of a pair lose at most the share LATE_LOSS of the polytope in a round. The share doubles whenever
LATER more of the time has passed, so that the rounds end before the deadline, however long they take."""
LATEST = 0.65
"""When this share has passed, all open cells are cut off, not only those where coarse volumes touch."""
REVOKED = "revoked: "
"""The reason begins like this where nothing is left of a region that is certified again."""
AGAIN_EFFORT = 24 * SLICE
"""The effort where a region is certified again."""


def _next_stage(scene: Scene, state: GrowthState, start: Start) -> Transition:
    """Moves the faces of the best region out, after a stage; ends when this one gained little."""
    whole, best = state.whole, state.best
    assert whole is not None
    assert best is not None
    kept = _kept(scene, start, best.polytope)
    if start.again:
        return Transition(state, Finish(Outcome.CERTIFIED, f"certified; {100 * kept:.3g} % of the region is kept"))
    gained_little = whole.stage > 1 and kept <= whole.kept + min(GAIN, OWN * whole.kept)
    if kept >= ENOUGH or whole.stage == state.options.stages or gained_little:
        return Transition(state, Finish(Outcome.CERTIFIED, "certified"))
    return begin_stage(scene, state, pushed(best.polytope, start.seed, FAR, start.rows), kept, whole.passed, whole.stage + 1)


def begin_stage(scene: Scene, state: GrowthState, polytope: Polytope, kept: float = 0.0, passed: float = 0.0, stage: int = 1) -> Transition:
    """Asks to certify all pairs on a polytope; what was proved in the stage before does not carry over to it."""
    box = ProvedBox.of_program(scene, polytope)
    grouped = _together(scene, state, polytope)
    begun = Whole(kept, polytope, **vars(box), since=passed, passed=passed, stage=stage, together=grouped)
    return _next(scene, replace(state, whole=begun))


def in_words(scene: Scene, q: Sequence[float] | Array) -> str:
    """Returns a configuration, (n,), as people read it, in degrees and metres: ``q = (23.5, -11.5) deg``."""
    shown = [joint.shown for joint in scene.moving]
    texts = [
        f"{round(scale * x, digits) + 0.0:.{digits}f}"
        for x, (unit, scale) in zip(q, shown, strict=True)
        for digits in [1 if unit == "deg" else 3]
    ]
    return f"q = {with_units(texts, [unit for unit, _ in shown])}"


def _kept(scene: Scene, start: Start, polytope: Polytope) -> float:
    """Returns the share of the proposal's q-volume that a polytope keeps."""
    return float(polytope.contains(samples_of(scene, start.rows)).mean())


def _smaller_copy(scene: Scene, state: GrowthState, start: Start) -> Polytope | None:
    """Returns a smaller copy of the stage's polytope about the seed; None where it is not worth a try."""
    assert state.whole is not None
    copy = pushed(state.whole.polytope, start.seed, SMALLER, scene.polytope([], []))
    if start.again or not (start.keep @ copy.C.T < copy.d).all():
        return None
    best = _kept(scene, start, state.best.polytope) if state.best else 0.0
    worth = max(LEAST, best) < _kept(scene, start, copy) < SHRUNK * _kept(scene, start, state.whole.polytope)
    return copy if worth else None


def keeps_more(scene: Scene, start: Start, polytope: Polytope, other: Polytope) -> bool:
    """Returns whether a region keeps more of the proposal than another one does, by q-volume, or that one too little to be seen."""
    return _kept(scene, start, polytope) > (_kept(scene, start, other) or -1)


def after_cells(scene: Scene, state: GrowthState, start: Start, report: Outcomes) -> Transition:
    """Cuts off what cannot be certified, and goes on with the open cells."""
    whole, action = state.whole, report.action
    assert whole is not None
    holds = whole.holds | {i: action.iteration for i, outcome in report.outcomes.items() if outcome is Outcome.CERTIFIED}
    begun = dict.fromkeys(action.pairs, action.iteration) | action.begun
    spent = whole.spent | {i: whole.spent.get(i, 0) + SLICE * max(action.parts.get(i, 1), PARTS) for i in action.pairs}
    whole = replace(whole, holds=holds, begun=begun, open_cells=dict(report.open_cells), spent=spent, passed=report.passed)
    if report.complete:
        return _next_stage(scene, replace(state, whole=whole), start)
    unknown = next((i for i in report.failures if i not in report.weaknesses), None)
    if unknown is not None:  # Nothing can be cut off for it, so it would fail again and again.
        pair = scene.pairs[unknown]
        return _ended(state, report, f"{called(pair.a, pair.b)} could not be certified, and nothing is known of where they fail")
    failing = [i for i in report.failures if report.open_cells.get(i) != 0]
    made = _cut_off(scene, state, start, whole, report, failing)
    while (smaller_groups := _regrouped(scene, start, whole, report, _costly(whole, report, failing, made))) is not whole:
        whole, failing = smaller_groups, [i for i in failing if i in smaller_groups.begun]
        made = _cut_off(scene, state, start, whole, report, failing)
    if not failing:
        return _next(scene, replace(state, whole=whole))
    final = {*action.ending} & {*action.hard}
    # Cells without a point to cut off miss the polytope, and are settled in the next rounds.
    named = any(len(report.weaknesses[i].points) for i in failing)
    stuck = named and made.polytope is whole.polytope and all(i in final and _most_loss(state, whole, i, report) >= 1 for i in failing)
    if stuck:  # A contact on a face would be found again and again.
        made = _cut_off(scene, state, start, whole, report, failing, BARELY)
    smaller = made.polytope
    state = replace(state, obstacles=joined(state.obstacles, _obstacles(whole.stage, failing, made)))
    if stuck and smaller is whole.polytope:
        pair = scene.pairs[failing[0]]
        return _ended(state, report, f"{called(pair.a, pair.b)} could not be certified, and nothing more could be cut off for them")
    if smaller is None:
        copy = _smaller_copy(scene, state, start)
        if copy is not None:
            return begin_stage(scene, state, copy, whole.kept, whole.passed, whole.stage)
        pair = scene.pairs[failing[0]]
        reason = f"{trouble(scene, pair)}, or nearly so, at or between configurations that have to stay inside"
        return _ended(state, report, reason)
    gone = {i for i in failing if not smaller.contains(report.weaknesses[i].points).all()} if smaller is not whole.polytope else set()
    cuts = whole.cuts | {i: whole.cuts.get(i, 0) + 1 for i in gone}
    return _next(scene, replace(state, whole=replace(whole, polytope=smaller, cuts=cuts)))


def _costly(whole: Whole, report: Outcomes, failing: Sequence[int], made: Cut) -> list[int]:
    """Returns the pairs whose contacts faces cut off at the cost of more than a group may lose, or do not cut off at all.

    When a stage is late, it is too late for new cells, except where nothing can be cut off.
    """
    if _gone(whole) >= LATE and made.polytope is not None and made.polytope is not whole.polytope:
        return []
    found = []
    for i, of_contacts in zip(failing, made.made[::2], strict=True):
        weakness = report.weaknesses[i]
        contacts = weakness.points[: weakness.contacts]
        if of_contacts.lost > LOST or (len(contacts) and (made.polytope is None or made.polytope.contains(contacts).any())):
            found.append(i)
    return found


def _regrouped(scene: Scene, start: Start, whole: Whole, report: Outcomes, costly: Sequence[int]) -> Whole:
    """Divides those of the costly groups of pairs whose volumes touch where none of their geometries do.

    The pairs of such a group begin anew in the next round, in smaller groups or alone. This takes longer than a few faces.

    Args:
        costly: pairs, as :func:`_costly` returns them.
    """
    grouped, anew = dict(whole.together), set()
    for i in (i for i in costly if i in grouped):
        contacts = report.weaknesses[i].points[: report.weaknesses[i].contacts]
        smaller = divided(scene, [i, *grouped[i]], contacts, start.keep)
        if smaller is not None:
            del grouped[i]
            grouped |= smaller
            anew.add(i)
    if not anew:
        return whole
    begun, open_cells, spent = (
        {i: number for i, number in known.items() if i not in anew} for known in (whole.begun, whole.open_cells, whole.spent)
    )
    return replace(whole, together=grouped, begun=begun, open_cells=open_cells, spent=spent)


def _cut_off(
    scene: Scene, state: GrowthState, start: Start, whole: Whole, report: Outcomes, failing: Sequence[int], beyond: float = 0.0
) -> Cut:
    """Cuts off what is to be cut off for pairs: contacts, which have to go sooner or later, and other points where they fail."""
    corners = []
    for i in failing:
        weakness, joints, most = report.weaknesses[i], joints_between(scene, i), _most_loss(state, whole, i, report)
        points, k = weakness.points, weakness.contacts
        of_contacts = _doubled(CONTACT_LOSS, whole.spent[i] // (PIECES * SLICE))
        corners += [(joints, points[:k], max(most, of_contacts)), (weakness.joints or joints, points[k:], most)]
    return cut(scene, whole.polytope, start.keep, corners, start.rows, beyond)


def _doubled(share: float, times: float) -> float:
    """Returns the share after it was doubled this many times; 1 where it would be more."""
    return 1.0 if times >= -math.log2(share) else share * 2.0**times


def _obstacles(stage: int, failing: Sequence[int], cut: Cut) -> dict[int, Obstacle]:
    """Returns pair index -> what was cut off for it in this round; pairs without a face of their own are left out."""
    found = {}
    for place, index in enumerate(failing):
        contacts, others = cut.made[2 * place : 2 * place + 2]
        if contacts.faces or others.faces:
            s, lost = contacts.s if contacts.faces else others.s, lost_together(contacts.lost, others.lost)
            found[index] = Obstacle.at(stage, s, contact=contacts.faces > 0, faces=contacts.faces + others.faces, lost=lost)
    return found


def _most_loss(state: GrowthState, whole: Whole, pair: int, report: Outcomes) -> float:
    """Returns which share of the polytope the faces for a pair may lose in this round, for points that are no contacts."""
    hard = 0 if report.weaknesses[pair].joints else HARD
    if _gone(whole) >= LATE:
        return _doubled(LATE_LOSS, (_gone(whole) - LATE) / LATER)
    effort, spent = _effort(state, whole, pair), whole.spent[pair]
    if hard < spent < effort:
        return _doubled(LOSS, max(spent - HARD, 0) // (PATIENCE if hard else PARTED))
    return _doubled(FAST_LOSS, max(spent - effort, 0) // (PIECES * SLICE))


def _effort(state: GrowthState, whole: Whole, pair: int) -> int:
    """Returns how many cells of a pair are looked at before its open cells are cut off."""
    effort = state.options.cells or MOST_CELLS
    if _again(state):
        effort = min(effort, AGAIN_EFFORT)
    return min(effort, whole.spent.get(pair, 0)) if _gone(whole) >= LATE else effort


def _again(state: GrowthState) -> bool:
    """Returns whether a region is certified again, and not grown."""
    return state.start is not None and state.start.again


def _gone(whole: Whole) -> float:
    """Returns which share of the time from the stage's beginning to the deadline has passed; 0 without a deadline."""
    return min((whole.passed - whole.since) / (1 - whole.since), 1.0) if whole.since < 1 else 1.0


def _parts(pairs: Sequence[int], whole: Whole) -> dict[int, int]:
    """Returns how many parts each pair is divided into, where there are several: its open cells, or those to verify when none is open."""
    known = [i for i in pairs if i in whole.open_cells]
    each = max(1 if _gone(whole) >= LATE else PARTS, math.ceil(PIECES / max(len(known), 1)))
    parts = {i: min(each, whole.open_cells[i] or whole.spent[i] // VERIFIED) for i in known}
    return {i: count for i, count in parts.items() if count > 1}


def _ended(state: GrowthState, report: Outcomes, reason: str) -> Transition:
    """Ends the growth with the best region so far, or without one."""
    if state.best is not None:
        return Transition(state, Finish(Outcome.CERTIFIED, f"certified; growth ended early: {reason}"))
    if _again(state):
        reason = f"{REVOKED}{reason}"
    return Transition(state, Finish(combine(list(report.outcomes.values())), reason))


def _together(scene: Scene, state: GrowthState, polytope: Polytope) -> Together:
    """Returns which pairs are grouped to share one certificate on a stage's polytope; none where a region is certified again."""
    if state.start is None or state.start.again:
        return {}
    return together(scene, samples_of(scene, polytope)[::THIN], state.start.keep)


def _next(scene: Scene, state: GrowthState) -> Transition:
    whole = state.whole
    assert whole is not None
    others = {other for members in whole.together.values() for other in members}
    pairs = [i for i in by_joints(scene) if i not in whole.holds and i not in others]
    ending = 0 if _gone(whole) >= LATEST else ENDING
    spent, effort = {i: whole.spent.get(i, 0) for i in pairs}, {i: _effort(state, whole, i) for i in pairs}
    action = Certify(
        state.next,
        "cells",
        whole.polytope,
        None,
        pairs,
        reuse=dict(whole.holds),
        hard=[i for i in pairs if HARD <= spent[i] < effort[i] or spent[i] >= effort[i] + ending],
        failures=None,
        cells=SLICE,
        box=ProvedBox(whole.mid, whole.half, whole.Y_lower, whole.Y_upper),
        begun=whole.begun,
        parts=_parts(pairs, whole),
        ending=[i for i in pairs if spent[i] >= effort[i]],
        keep=None if state.start is None else state.start.keep,
        together=whole.together,
    )
    return Transition(replace(state, next=state.next + 1), action)
