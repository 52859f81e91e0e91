"""A pair result says what is known about one pair on one polytope, in the one shape that travels from the certifier to the database."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.model import Array
from certifier.outcome import Outcome, Stage


@dataclass(frozen=True)
class Weakness:
    """A weakness says where a pair's certification fails and what would help.

    Attributes:
        points: (w, n) configurations in s near which no plane of those tried works, or the one that is in contact.
        pull: (n,) how much it would help to shorten each joint's range; only the proportions matter. 0 where the bodies are in contact.
        ranges_alone: only planes at rest were tried; for them nothing of the polytope counts but the joints' ranges.
        contacts: number of the first points at which the bodies touch, as far as a search over partitions knows.
        joints: position indices of the joints that matter at the points after these; empty for those between the bodies.
    """

    points: Array
    pull: Array
    ranges_alone: bool = False
    contacts: int = 0
    joints: tuple[int, ...] = ()

    @classmethod
    def of_contact(cls, s: Array) -> Weakness:
        """Returns the weakness of bodies that touch at s, (n,)."""
        return cls(s[None], np.zeros(len(s)))

    @classmethod
    def unknown(cls, n: int) -> Weakness:
        """Returns the weakness of which nothing is known but that the certification fails."""
        return cls(np.zeros((0, n)), np.zeros(n))

    @classmethod
    def of_parts(cls, parts: Sequence[Weakness]) -> Weakness:
        """Returns the weakness of a pair from those of its parts."""
        if len(parts) == 1:
            return parts[0]
        points = [part.points[: part.contacts] for part in parts] + [part.points[part.contacts :] for part in parts]
        others = [part.joints for part in parts if len(part.points) > part.contacts]
        joints = () if () in others else tuple(sorted({joint for some in others for joint in some}))
        return cls(np.concatenate(points), parts[0].pull, parts[0].ranges_alone, sum(part.contacts for part in parts), joints)


@dataclass(frozen=True)
class PairResult:
    """A pair result says what is known about one pair on the polytope.

    Attributes:
        stage: which part of the certifier settled the pair; None where the program could not be run.
        seconds: how long it took.
        looked: at how many cells a search over partitions looked; 0 without one.
        margin: certified lower bound in metres of the distance between the padded bodies; None unless certified.
        detail: a sentence for people; empty when the outcome says it all.
        witness_s: (n,) a configuration in s: in contact when refuted, or at which the bodies are too close.
        proof: the verified proof as bytes. When certified it is a :class:`certifier.proof.pair.PairProof` or a
            :class:`certifier.proof.partition.PartitionProof`; from :mod:`certifier.proof.negative`, a WitnessProof when refuted by the
            program's contacts and a DualProof when not certifiable.
        subtrees: what a search over partitions has left of the cells that it was given, when it has not certified the pair
            (:mod:`certifier.partition.subtrees`). It is no proof of anything. Later searches go on with it.
        outline: shows people these cells and the state of each (certifier.proof.outline).
        open_cells: how many cells of these are open.
        weakness: where the certification fails, when that is known.
        error: the CirisError document of an ``error``.
    """

    outcome: Outcome
    stage: Stage | None
    seconds: float = 0.0
    looked: int = 0
    margin: float | None = None
    detail: str = ""
    witness_s: Array | None = None
    proof: bytes | None = None
    subtrees: bytes | None = None
    outline: bytes | None = None
    open_cells: int | None = None
    weakness: Weakness | None = None
    error: dict[str, Any] | None = None
