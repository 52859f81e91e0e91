"""A verdict is the result of certifying a given polytope."""

from __future__ import annotations

from dataclasses import dataclass

from certifier.jobs.region import Region
from certifier.outcome import Guarantee, Outcome, combine
from certifier.pair.result import PairResult


@dataclass(frozen=True)
class Verdict:
    """A verdict holds the results of all pairs of a scene on one polytope.

    Attributes:
        results: pair index -> its result.
        worth: what it is worth that every pair is certified.
        seconds: how long the certification took altogether.
        region: the polytope as a region with its proof, where that was asked for and every pair is certified.
    """

    results: dict[int, PairResult]
    worth: Guarantee
    seconds: float
    region: Region | None = None

    @property
    def outcome(self) -> Outcome:
        """Returns the worst of the pairs' outcomes."""
        return combine([result.outcome for result in self.results.values()])

    @property
    def guarantee(self) -> Guarantee:
        """Returns the guarantee of the polytope, which is NONE unless every pair is certified."""
        return self.worth if self.outcome is Outcome.CERTIFIED else Guarantee.NONE
