"""What a cover tells while it goes on, and at its end."""

from __future__ import annotations

from typing import Any

from planner.cover.machine import unreached
from planner.cover.state import CoverState


def said(state: CoverState) -> dict[str, Any] | None:
    """Returns the results of a cover, as JSON-able data; None before the first look.

    Keys: ``coverage`` (``value``, ``stderr``, ``samples``: of the collision-free configurations that were drawn, which part is in regions),
    ``regions`` (how many the scene has), ``components`` (how many regions each has), ``largest`` (which part of what is covered is in the
    first component), ``connected``, ``connect`` (for each configuration to connect the component that it is in, or null), ``seeds`` and
    ``paths`` likewise, ``begun``, ``growing`` (what grows), ``goals`` (whether all are reached), ``missing`` (those that are not) and
    ``obstacles``, in words.
    """
    seen = state.last
    if seen is None:
        return None
    missing = unreached(state.options, seen, state.moved or ())
    return {
        "coverage": {"value": seen.coverage, "stderr": seen.stderr, "samples": seen.samples},
        "regions": seen.regions,
        "components": list(seen.components),
        "largest": seen.largest / seen.covered if seen.covered else 0.0,
        "connected": len(seen.components) == 1,
        "connect": list(seen.connect),
        "seeds": list(seen.seeds),
        "paths": list(seen.paths),
        "begun": state.begun,
        "growing": [task.key for task in state.growing.values()],
        "goals": not missing,
        "missing": missing,
        "obstacles": list(seen.obstacles),
    }
