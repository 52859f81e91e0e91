"""Targeted contraction adds faces where pairs fail (:mod:`certifier.growth.paper.faces`) until every pair is certified.

What was certified stays so, since the polytope only shrinks. The contraction of a proposal is tried a few times, each time with another
balance between faces and shorter ranges, and the largest region counts.
"""

from __future__ import annotations

from dataclasses import replace

from certifier.growth.actions import Outcomes, Transition
from certifier.growth.obstacles import Obstacle, joined
from certifier.growth.pairs import joints_between
from certifier.growth.paper.faces import Failure, contract, measure
from certifier.growth.paper.options import NEAR
from certifier.growth.paper.state import Cuts, PaperState
from certifier.growth.paper.trials import certify, effort, is_worth_it
from certifier.growth.state import Start
from certifier.model import Polytope, Scene
from certifier.outcome import Outcome
from certifier.pair.result import Weakness
from certifier.polytopes.pushed import pushed

MAX_ATTEMPTS = 60
"""A contraction gives up after faces were added this many times for one pair."""
FAILURES = 2
"""Faces are added for this many pairs at once, so that two workers can look for such pairs."""
FAR = 8.0
"""The faces of a given polytope are pushed out from the seed by this factor before anything is certified."""


def next_contraction(scene: Scene, state: PaperState, start: Start) -> Transition | None:
    """Begins the next contraction of the proposal that may result in a larger region than the best; returns None when there were enough."""
    starts = contraction_starts(scene, state)
    for tried in range(state.contractions, len(starts)):
        reach, near = starts[tried]
        rows = start.rows
        polytope = rows if reach == 1.0 else pushed(rows, start.seed, reach, scene.polytope([], []))
        state = replace(state, contractions=tried + 1, near=near, reach=reach)
        if is_worth_it(state, polytope):
            return trim(scene, replace(state, cuts=Cuts()), start, "contract", polytope)
    return None


def contraction_starts(scene: Scene, state: PaperState) -> list[tuple[float, float]]:
    """Returns where contractions start: how far the proposal's faces are pushed out first, and one of NEAR.

    What IRIS cut off collides, but beyond a given polytope nothing is known. So there the first contraction begins far outside.
    """
    starts = [(1.0, near) for near in NEAR[: effort(scene, state, "contractions")]]
    return [(FAR, NEAR[0]), *starts] if state.given and effort(scene, state, "pushes") else starts


def trim(scene: Scene, state: PaperState, start: Start, label: str, polytope: Polytope) -> Transition:
    """Asks to certify the polytope that the cuts result in; a pair certified on a larger polytope is certified on this one."""
    cuts, center = state.cuts, measure(polytope, start.keep[0]).center
    hard = sorted(index for index in cuts.attempts if index not in cuts.holds)
    return certify(scene, state, label, polytope, center, reuse=dict(cuts.holds), hard=hard, failures=FAILURES)


def cut(scene: Scene, state: PaperState, start: Start, report: Outcomes) -> Transition | None:
    """Adds faces for the pairs that failed and goes on.

    Returns:
        None when that leads nowhere, or to nothing larger than the best region.
    """
    action, attempts = report.action, dict(state.cuts.attempts)
    certified = {i: action.iteration for i, outcome in report.outcomes.items() if outcome is Outcome.CERTIFIED}
    found, stage, obstacles = [], state.contractions + state.pushes, {}
    for index in report.failures:
        weakness = report.weaknesses.get(index, Weakness.unknown(scene.n))
        s = weakness.points[0] if len(weakness.points) else None
        obstacles[index] = Obstacle.at(stage, s, contact=s is not None and not weakness.pull.any())
        found.append(Failure(joints_between(scene, index), weakness, attempts.get(index, 0)))
        attempts[index] = attempts.get(index, 0) + 1
    smaller = contract(scene, action.polytope, measure(action.polytope, start.keep[0]), start.keep, found, state.near)
    if smaller is None or max(attempts.values()) > MAX_ATTEMPTS or not is_worth_it(state, smaller):
        return None
    state = replace(state, cuts=Cuts(state.cuts.holds | certified, attempts), obstacles=joined(state.obstacles, obstacles))
    return trim(scene, state, start, action.label, smaller)
