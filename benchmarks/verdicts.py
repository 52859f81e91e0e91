"""What two answers to the same question mean together."""

from __future__ import annotations

from enum import StrEnum

from certifier.outcome import Outcome


class Verdict(StrEnum):
    """Our outcome against Drake's."""

    AGREE = "agree"
    """Both certified the pair, or neither did and both said so."""
    UNDECIDED = "undecided"
    """One side, or both, could not tell."""
    PROGRAMS_DIFFER = "programs differ"
    """One side found a plane, the other shows that there is none in another frame or with another relaxation of balls."""
    CONTRADICTION = "contradiction"
    """One side certified what the other refutes, or what it proves infeasible as the very same program: one of them is wrong."""


def verdict(ours: Outcome, theirs: Outcome, same_program: bool) -> Verdict:
    """What the two outcomes mean together; ``same_program`` when frame and relaxation are the same."""
    undecided = (Outcome.INCONCLUSIVE, Outcome.ERROR)
    if ours in undecided or theirs in undecided:
        return Verdict.UNDECIDED
    if (ours is Outcome.CERTIFIED) == (theirs is Outcome.CERTIFIED):
        return Verdict.AGREE
    if Outcome.REFUTED in (ours, theirs) or same_program:
        return Verdict.CONTRADICTION
    return Verdict.PROGRAMS_DIFFER
