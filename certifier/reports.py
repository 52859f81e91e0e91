"""What certifier.growth is told of what was computed."""

from __future__ import annotations

from typing import Any

from certifier.growth_actions import Stepped
from certifier.pair import PairResult
from certifier.polytope_step import Step


def weakness(result: PairResult) -> dict[str, Any] | None:
    """Where a pair failed, for the report of its certification; None when nothing is known."""
    if result.witness_s is not None:
        return {"points": [result.witness_s.tolist()], "pull": [0.0] * len(result.witness_s)}
    if result.weak_points is None or result.pull is None:
        return None
    return {"points": result.weak_points.tolist(), "pull": result.pull.tolist(), "ranges_alone": result.ranges_alone}


def stepped(found: Step) -> Stepped:
    """The report of a polytope step."""
    C, d, center, base_C, base_d = (a.tolist() for a in (found.C, found.d, found.center, found.base_C, found.base_d))
    return Stepped(C, d, center, base_C, base_d, found.growth, found.info)
