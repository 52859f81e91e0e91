"""A region is grown by a pure state machine: propose, certify the proposal and cut off what cannot be certified, move the faces out.

Before the proposal, a box about the seed is certified (:mod:`certifier.growth.nearby`).

:func:`begin` and :func:`advance` decide what to do next and compute nothing heavy. The caller (the service's coordinator, or
:mod:`certifier.jobs.local`) carries out the action and reports back.

This module says what all ways to grow have in common. :mod:`certifier.growth.whole` decides what follows a certification, or
:mod:`certifier.growth.paper` where a job asks for the papers' algorithm.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from certifier import stored
from certifier.errors import RegionError
from certifier.growth.actions import Candidate, Certify, Failed, Finish, Outcomes, Propose, Report, Transition
from certifier.growth.again import begin_again
from certifier.growth.nearby import nearby
from certifier.growth.options import GrowthOptions
from certifier.growth.pairs import by_joints
from certifier.growth.paper import machine as papers
from certifier.growth.paper.rounds import certify_step
from certifier.growth.paper.state import PaperState
from certifier.growth.refusal import ended_by
from certifier.growth.state import Best, GrowthState, Start
from certifier.growth.whole import SLICE, after_cells, begin_stage, keeps_more
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, combine
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.proved import ProvedBox
from certifier.polytopes.pushed import pushed
from certifier.positions import check_magnitude
from certifier.seeding.options import IRIS_SEEDS
from certifier.seeding.proposal import Proposal


def begin(scene: Scene, options: GrowthOptions) -> Transition:
    """Returns the first action of a job.

    Raises:
        RegionError: a ``certify`` job without C and d, with the wrong number of columns, or with a number that is too large.
    """
    state = GrowthState(options) if options.paper is None else PaperState(options)
    return _FIRST[options.kind](scene, state)


def _grow(scene: Scene, state: GrowthState) -> Transition:
    box = None if isinstance(state, PaperState) else nearby(scene, state.options.seed)
    if box is None:
        return _propose(state)
    polytope, seed = box
    proved, work = ProvedBox.of_program(scene, polytope), by_joints(scene)
    action = Certify(0, NEARBY, polytope, seed, work, reuse={}, hard=[], failures=None, cells=SLICE, box=proved)
    return Transition(replace(state, next=1), action)


def _propose(state: GrowthState) -> Transition:
    options, seed = state.options, state.options.seed.get("random_seed")
    return Transition(state, Propose({**options.seed, "random_seed": options.random_seed % IRIS_SEEDS if seed is None else seed}))


def _given(scene: Scene, state: GrowthState) -> Transition:
    options = state.options
    if "C" not in options.seed or "d" not in options.seed:
        raise RegionError("polytope_missing", "a polytope needs C and d", field="polytope", hint="give both")
    given, center = Polytope.given(options.seed["C"], options.seed["d"], scene.n), options.seed.get("center")
    limited = scene.polytope(given.C, given.d)
    if center is not None:
        check_magnitude(center, "polytope.center")
        center = np.array(center)
    action = Certify(0, GIVEN, limited, center, by_joints(scene), reuse={}, hard=[], failures=None, cells=options.cells or 1)
    return Transition(replace(state, next=1), action)


GIVEN, NEARBY = "given", "box"
"""The labels of certifying a given polytope, and a box about the seed."""
_FIRST = {"grow": _grow, "certify": _given, "recertify": begin_again}
"""kind of the job -> what its first transition is"""


def stored_state(document: dict[str, Any]) -> GrowthState:
    """Returns the state that the document of a transition's state describes.

    Raises:
        CirisError: as :func:`certifier.stored.value`.
    """
    return stored.value(GrowthState if document.get("options", {}).get("paper") is None else PaperState, document)


def advance(scene: Scene, state: GrowthState, report: Report) -> Transition:
    """Returns what follows a report; the state is the one of the last transition and is not changed."""
    hindrance = _hindrance(state, report)
    try:
        transition = _advanced(scene, state, report)
    except RegionError as error:
        transition = _failed(state, Failed(ended_by(error, hindrance)))
    if hindrance and isinstance(transition.action, Finish) and transition.state.best is None:
        return replace(transition, action=replace(transition.action, reason=hindrance))
    return transition


def _hindrance(state: GrowthState, report: Report) -> str:
    if isinstance(report, Proposal):
        return str(report.info.get("hindrance", ""))
    return "" if state.start is None else state.start.hindrance


def _advanced(scene: Scene, state: GrowthState, report: Report) -> Transition:
    if isinstance(report, Failed):
        return _failed(state, report)
    if isinstance(report, Proposal):
        return _proposed(scene, state, report)
    if isinstance(report, Outcomes):
        return _certified(scene, state, report)
    assert isinstance(state, PaperState), "only the papers' algorithm asks for steps"
    return certify_step(scene, state, report)


def _failed(state: GrowthState, report: Failed) -> Transition:
    if state.best is not None:
        return Transition(state, Finish(Outcome.CERTIFIED, f"certified; growth ended early: {report.error}"))
    return Transition(state, Finish(Outcome.ERROR, str(report.error)))


def _proposed(scene: Scene, state: GrowthState, proposal: Proposal) -> Transition:
    limited = scene.polytope(proposal.C, proposal.d)
    norms = np.linalg.norm(limited.C, axis=1)
    rows = Polytope(limited.C / norms[:, None], limited.d / norms)
    keep = np.concatenate([proposal.center[None], proposal.contain])
    start = Start(rows, proposal.center, keep, _hindrance(state, proposal))
    if isinstance(state, PaperState):
        return papers.begin(scene, replace(state, start=start), start, proposal.info.get("method"))
    # Rows that other rows imply are dropped, because every cell would carry them.
    return begin_stage(scene, replace(state, start=start), pushed(rows, start.seed, 1.0, scene.polytope([], [])))


def _certified(scene: Scene, state: GrowthState, report: Outcomes) -> Transition:
    action = report.action
    if action.label == GIVEN:
        candidate = _candidate(state, report, None, None) if report.complete else None
        return Transition(state, Finish(combine(list(report.outcomes.values())), "the given polytope, every pair"), candidate)
    if action.label == NEARBY:
        return _begun(state, report)
    start = state.start
    assert start is not None, "what is certified comes from a proposal"
    candidate = None
    if report.complete:
        volume = inscribed_ellipsoid(action.polytope).volume
        if state.best is None or _better(scene, state, start, action, volume, state.best):
            candidate = _candidate(state, report, start.seed, volume)
            center = chebyshev_center(action.polytope)[0] if action.center is None else action.center
            state = replace(state, best=Best(action.iteration, action.polytope, center, volume))
    if isinstance(state, PaperState):
        return replace(papers.after_certification(scene, state, start, report, candidate is not None), candidate=candidate)
    return replace(after_cells(scene, state, start, report), candidate=candidate)


def _begun(state: GrowthState, report: Outcomes) -> Transition:
    """Asks for the proposal, with the box about the seed as the best region so far where it is certified."""
    action = report.action
    if not report.complete:
        return _propose(state)
    assert action.center is not None
    volume = inscribed_ellipsoid(action.polytope).volume
    state = replace(state, best=Best(action.iteration, action.polytope, action.center, volume, box=True))
    return replace(_propose(state), candidate=_candidate(state, report, action.center, volume))


def _better(scene: Scene, state: GrowthState, start: Start, action: Certify, volume: float, best: Best) -> bool:
    """Returns whether a certified polytope is better than the best so far, by what the way to grow makes larger.

    That is the share of the proposal, or the inscribed ellipsoid for the papers' algorithm.
    """
    if isinstance(state, PaperState):
        return volume > best.ellipsoid_volume
    return keeps_more(scene, start, action.polytope, best.polytope)


def _candidate(state: GrowthState, report: Outcomes, seed: Array | None, volume: float | None) -> Candidate:
    action = report.action
    proofs = {**dict.fromkeys(action.pairs, action.iteration), **action.reuse}
    return Candidate(action.iteration, action.polytope, action.center, seed, volume, proofs, action.together, state.obstacles)
