"""The document of ``ciris certify --json``."""

from __future__ import annotations

from certifier.outcome import Guarantee, Outcome
from client import verdicts


def test_what_stands_for_a_condition_has_no_distance() -> None:
    names = [("arm/link1/bar", "world/post"), ("conditions/upright/arm", "conditions/upright/world")]
    result = {"outcome": "certified", "margin": 0.3, "seconds": 0.1, "stage": "sos", "witness_q": None, "detail": ""}
    pairs = [{"a": a, "b": b, **result} for a, b in names]
    document = verdicts.document("cell", "0" * 64, Outcome.CERTIFIED, Guarantee.EXACT, 1.0, pairs)
    assert [(pair["margin"], pair["proved_distance"]) for pair in document["pairs"]] == [(0.3, 0.3), (None, None)]
