"""This module makes the document of ``ciris certify --json``, whether the service, this process or Drake has certified."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from certifier.conditions import condition_named
from certifier.outcome import Guarantee, Outcome

_RESULT = ("outcome", "margin", "seconds", "stage", "witness_q", "detail")


def document(
    name: str,
    scene_hash: str,
    outcome: Outcome,
    guarantee: Guarantee,
    seconds: float,
    pairs: Sequence[dict[str, Any]],
    region: str | None = None,
) -> dict[str, Any]:
    """Returns the document: one outcome for each pair, with stable keys.

    Args:
        guarantee: of the whole polytope.
        region: id of the region on the service; None where there is none.
        pairs: each with ``a`` and ``b``, ``outcome``, ``margin``, ``seconds``, ``stage``, ``witness_q`` and ``detail``.
    """
    return {
        "region": region,
        "scene": {"name": name, "hash": scene_hash},
        "outcome": outcome.value,
        "guarantee": guarantee.value,
        "seconds": seconds,
        "pairs": [_pair(pair) for pair in pairs],
    }


def _pair(pair: dict[str, Any]) -> dict[str, Any]:
    """Returns a pair's entry. What stands for a condition has no distance in metres."""
    distance = pair["margin"] if condition_named(pair["a"], pair["b"]) is None else None
    return {**{key: pair[key] for key in ("a", "b", *_RESULT)}, "margin": distance, "proved_distance": distance}
