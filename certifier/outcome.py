"""Verdicts. Every member says what it means; "almost solved" is never "solved"."""

from enum import StrEnum


class Outcome(StrEnum):
    """What is known about one pair of bodies, or about a whole polytope, after a certification."""

    CERTIFIED = "certified"
    """A proof of separation on the whole polytope exists and has passed the verifier."""
    REFUTED = "refuted"
    """A configuration inside the polytope is in collision; it is returned."""
    NOT_CERTIFIABLE = "not_certifiable"
    """No certificate of the form of the program (11) exists, by a dual proof; a plane may separate the pair all the same."""
    INCONCLUSIVE = "inconclusive"
    """A limit or numerical trouble stopped the search before either answer; the detail says which."""
    ERROR = "error"
    """The program failed to run; the detail says why."""


class Stage(StrEnum):
    """Which part of the certifier settled a pair."""

    SCREEN = "screen"
    SOS = "sos"


class Guarantee(StrEnum):
    """How much a statement about a region is worth (docs/algorithm.md)."""

    EXACT = "exact"
    """Every pair's proof was verified in exact rational arithmetic."""
    NUMERIC = "numeric"
    """Floating-point residuals are under a stated tolerance."""
    SAMPLED = "sampled"
    """Collision-free with the stated probability, by sampling."""
    NONE = "none"
    """Nothing is claimed."""


def combine(outcomes: "list[Outcome]") -> Outcome:
    """The outcome of a polytope from the outcomes of its pairs: the worst news wins."""
    for outcome in (Outcome.REFUTED, Outcome.NOT_CERTIFIABLE, Outcome.ERROR, Outcome.INCONCLUSIVE):
        if outcome in outcomes:
            return outcome
    return Outcome.CERTIFIED
