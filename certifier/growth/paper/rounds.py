"""A round of the alternation (C-IRIS, Algorithm 1) is a polytope step (12) that is certified by (11), and halved while that fails."""

from __future__ import annotations

from dataclasses import replace

from certifier.growth.actions import Finish, Step, Transition
from certifier.growth.paper.state import PaperState, Round
from certifier.growth.paper.trials import certify, effort
from certifier.growth.state import Start
from certifier.model import Polytope, Scene
from certifier.outcome import Outcome
from certifier.polytopes.proved import cleaned
from certifier.step.stepped import Stepped


def next_round(scene: Scene, state: PaperState, start: Start) -> Transition:
    """Returns the next step from the best region, or the end."""
    best, rounds = state.best, state.rounds
    assert best is not None
    if rounds >= effort(scene, state, "max_rounds"):
        return Transition(state, Finish(Outcome.CERTIFIED, "certified; the limit of rounds was reached" if rounds else "certified"))
    return Transition(replace(state, rounds=rounds + 1), Step(best.iteration, best.polytope, start.keep))


def certify_step(scene: Scene, state: PaperState, stepped: Stepped) -> Transition:
    """Asks to certify the polytope that a step resulted in."""
    assert state.best is not None
    assert state.start is not None, "a step follows a region, which comes from a proposal"
    C, d = cleaned(stepped.polytope.C, stepped.polytope.d, scene.s_lower, scene.s_upper, state.start.keep)
    target = Polytope(C, d)
    round_ = Round(stepped.base, state.best.center, target, stepped.center, stepped.growth)
    return certify(scene, replace(state, round=round_), "round", target, stepped.center)


def after_round(scene: Scene, state: PaperState, start: Start, accepted: bool) -> Transition:
    """Accepts and goes on, stops when the growth is small, or backs off towards the last certified polytope."""
    step, options = state.round, state.asked
    assert step is not None
    if accepted:
        if step.growth < options.tolerance:
            return Transition(state, Finish(Outcome.CERTIFIED, "certified; growth is under the tolerance"))
        return next_round(scene, state, start)
    if step.halvings == options.backoff:
        return Transition(state, Finish(Outcome.CERTIFIED, "certified; the last step could not be certified"))
    share = 0.5 ** (step.halvings + 1)
    C, d, center = (
        (1 - share) * base + share * target
        for base, target in (
            (step.base.C, step.target.C),
            (step.base.d, step.target.d),
            (step.base_center, step.target_center),
        )
    )
    halved = replace(state, round=replace(step, halvings=step.halvings + 1))
    return certify(scene, halved, "round", Polytope(C, d), center)
