"""What is known about one pair on one polytope: the one shape in which a result travels from the certifier to the database."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.model import Array
from certifier.outcome import Outcome, Stage


@dataclass(frozen=True)
class Weakness:
    """Where a pair's certification fails and what would help.

    Attributes:
        points: (w, n) configurations near which no plane of those tried works, or the one that is in contact.
        pull: (n,) how much it would help to shorten each joint's range; only the proportions matter. 0 where the bodies are in contact.
        ranges_alone: only planes at rest were tried, for which of the polytope the joints' ranges count and nothing else.
    """

    points: Array
    pull: Array
    ranges_alone: bool = False

    @classmethod
    def of_contact(cls, s: Array) -> Weakness:
        """The bodies touch at s, (n,)."""
        return cls(s[None], np.zeros(len(s)))

    @classmethod
    def unknown(cls, n: int) -> Weakness:
        """Nothing is known but that the certification fails."""
        return cls(np.zeros((0, n)), np.zeros(n))

    def to_document(self) -> dict[str, Any]:
        """The weakness as JSON-able data."""
        return {"points": self.points.tolist(), "pull": self.pull.tolist(), "ranges_alone": self.ranges_alone}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Weakness:
        """Inverse of :meth:`to_document`."""
        pull = np.array(document["pull"], dtype=float)
        points = np.array(document["points"], dtype=float).reshape(-1, len(pull))
        return cls(points, pull, bool(document["ranges_alone"]))


@dataclass(frozen=True)
class PairResult:
    """What is known about one pair on the polytope.

    Attributes:
        stage: which part of the certifier settled the pair; None where the program could not be run.
        seconds: what it took.
        margin: certified lower bound in metres of the distance between the padded bodies; None unless certified.
        detail: a sentence for people; empty when the outcome says it all.
        witness_s: (n,) a configuration in contact, when refuted.
        proof: verified, as bytes: a :class:`certifier.proof.pair.PairProof` when certified, of :mod:`certifier.proof.negative` a
            WitnessProof when refuted, a DualProof when not certifiable.
        weakness: where it fails, when that is known.
        error: the CirisError document of an ``error``.
    """

    outcome: Outcome
    stage: Stage | None
    seconds: float = 0.0
    margin: float | None = None
    detail: str = ""
    witness_s: Array | None = None
    proof: bytes | None = None
    weakness: Weakness | None = None
    error: dict[str, Any] | None = None
