"""Uniform contraction (C-IRIS B.4) looks for the largest {C s <= d - delta} that certifies, by bisection.

The polytope keeps its Chebyshev centre and shrinks to it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from certifier.conditions import fails
from certifier.growth.actions import Finish, Outcomes, Transition
from certifier.growth.paper.state import Bisection, PaperState
from certifier.growth.paper.trials import certify
from certifier.growth.state import Start
from certifier.model import Scene
from certifier.outcome import Outcome, combine

SMALLEST_SCALE = 1e-3
"""No trial is smaller than this, relative to the proposal; where this trial fails, growing ends."""


def shrink(scene: Scene, state: PaperState, start: Start, bisection: Bisection) -> Transition:
    """Asks to certify the bisection's trial."""
    offsets = start.rows.d - (1 - bisection.scale) * bisection.radius
    reuse = {index: iteration for index, (iteration, scale) in bisection.holds.items() if scale >= bisection.scale}
    trial = scene.polytope(start.rows.C, offsets)
    return certify(scene, replace(state, bisection=bisection), "contract", trial, bisection.center, reuse=reuse)


def bisect(scene: Scene, state: PaperState, start: Start, report: Outcomes) -> Transition | None:
    """Returns the next trial: its scale lies in the logarithm between one that was certified and one that was not.

    Where the smallest trial fails, the job is finished instead.

    Returns:
        None when no further trial is needed.
    """
    bisection, iteration = state.bisection, report.action.iteration
    assert bisection is not None
    scale, holds = bisection.scale, dict(bisection.holds)
    for index, outcome in report.outcomes.items():
        if outcome is Outcome.CERTIFIED and (index not in holds or holds[index][1] < scale):
            holds[index] = iteration, scale
    bisection = replace(bisection, holds=holds)
    bisection = replace(bisection, certified=scale) if report.complete else replace(bisection, failed=scale)
    if report.complete and scale == 1.0:
        return None
    if bisection.certified is None:
        if scale == SMALLEST_SCALE:
            pair = scene.pairs[report.failures[0]]
            reason = f"not even the smallest of the uniform contractions can be certified: {fails(pair.a, pair.b, 'are too close')} there"
            return Transition(state, Finish(combine(list(report.outcomes.values())), reason))
        return shrink(scene, state, start, replace(bisection, scale=SMALLEST_SCALE))
    if bisection.steps == 0:
        return None
    assert bisection.failed is not None
    middle = math.sqrt(bisection.certified * bisection.failed)
    return shrink(scene, state, start, replace(bisection, steps=bisection.steps - 1, scale=middle))
