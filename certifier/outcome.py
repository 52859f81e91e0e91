"""Outcomes and guarantees are defined here, and every member says what it means. "Almost solved" is never "solved"."""

from enum import StrEnum

DEADLINE = "the deadline was reached"
"""The reason for the end of a job begins with this where it was the deadline."""


class Outcome(StrEnum):
    """An outcome says what a certification found out about one pair of bodies, or about a whole polytope or motion."""

    CERTIFIED = "certified"
    """A proof of separation on the whole polytope, or all along the motion, exists and has passed the verifier."""
    REFUTED = "refuted"
    """A configuration inside the polytope, or of the motion, is in collision, and the result names it."""
    NOT_CERTIFIABLE = "not_certifiable"
    """No certificate of the form of the program (11) exists, by a dual proof; a plane may still separate the pair."""
    TOO_CLOSE = "too_close"
    """The bodies come so close to each other that no plane is found in a narrow cell, or for a short part of a motion; the result names a
    configuration and the distance."""
    INCONCLUSIVE = "inconclusive"
    """A limit or numerical trouble stopped the search before either answer was found; the detail says which."""
    ERROR = "error"
    """The program could not be run; the detail says why."""


class Stage(StrEnum):
    """The stage says which part of the certifier settled a pair."""

    SCREEN = "screen"
    """A look at sampled configurations settled it, before any program was solved."""
    SOS = "sos"
    """The sums-of-squares program (11) settled it, or a contact that was looked for after it."""
    CELLS = "cells"
    """The search for a partition of the polytope settled it."""
    CARRIED = "carried"
    """Its proof was taken over from a region of the scene before it changed. It is checked again with the region's proof as a whole."""


class Guarantee(StrEnum):
    """A guarantee says how much a statement about a region is worth (docs/algorithm.md)."""

    EXACT = "exact"
    """The verifier has checked every pair's proof in exact rational arithmetic."""
    NUMERIC = "numeric"
    """The residuals, in floating point, are under a stated tolerance."""
    SAMPLED = "sampled"
    """Sampling says that the region is free of collisions with the stated probability."""
    NONE = "none"
    """Nothing is claimed."""


def combine(outcomes: "list[Outcome]") -> Outcome:
    """Returns the outcome of a polytope from the outcomes of its pairs: the worst of them."""
    for outcome in (Outcome.REFUTED, Outcome.NOT_CERTIFIABLE, Outcome.TOO_CLOSE, Outcome.ERROR, Outcome.INCONCLUSIVE):
        if outcome in outcomes:
            return outcome
    return Outcome.CERTIFIED
