"""What certifier.growth.machine is told of what was computed."""

from __future__ import annotations

from typing import Any

from certifier.growth.actions import Stepped
from certifier.pair.result import PairResult
from certifier.step.step import Step


def weakness(result: PairResult) -> dict[str, Any] | None:
    """Where a pair failed, for the report of its certification; None when nothing is known."""
    return None if result.weakness is None else result.weakness.to_document()


def stepped(found: Step) -> Stepped:
    """The report of a polytope step."""
    C, d, center, base_C, base_d = (a.tolist() for a in (found.C, found.d, found.center, found.base_C, found.base_d))
    return Stepped(C, d, center, base_C, base_d, found.growth, found.info)
