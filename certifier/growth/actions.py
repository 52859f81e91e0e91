"""What growing a region asks for and is told, between :mod:`certifier.growth.machine`, which decides, and whoever carries it out.

What is reported is a Proposal (:mod:`certifier.seeding.proposal`), Outcomes, what a step has Stepped to (:mod:`certifier.step.stepped`),
or that the action Failed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from certifier.errors import CirisError
from certifier.growth.state import GrowthState
from certifier.model import Array, Polytope
from certifier.outcome import Outcome
from certifier.pair.result import Weakness
from certifier.seeding.proposal import Proposal
from certifier.step.stepped import Stepped


@dataclass(frozen=True)
class Propose:
    """Run :func:`certifier.seeding.propose.propose` with the options of this document; report a Proposal or Failed."""

    kind: ClassVar[str] = "propose"
    seed: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Certify:
    """Certify these pairs on a polytope; report their Outcomes.

    Attributes:
        iteration: number of this certification within the job, from 0.
        label: what it is for: ``given``, ``contract``, ``push`` or ``round``.
        polytope: joint limits included.
        center: interior point, (n,); None for the Chebyshev centre.
        pairs: indices into ``scene.pairs`` to certify, most likely failures first.
        reuse: pair index -> earlier iteration whose proof, on a superset, serves here too.
        hard: pairs that failed on a larger polytope; nothing less than all faces is tried for them.
        failures: end after this many, in the order of ``pairs`` (B.3); pairs not reached are reported as absent. None for all pairs.
    """

    kind: ClassVar[str] = "certify"
    iteration: int
    label: str
    polytope: Polytope
    center: Array | None
    pairs: list[int]
    reuse: dict[int, int]
    hard: list[int]
    failures: int | None


@dataclass(frozen=True, eq=False)
class Step:
    """Run the polytope step (12) on the best region's polytope with its proofs; report Stepped or Failed.

    Attributes:
        iteration: the one whose polytope it is.
        contain: (k, n) points that stay inside.
    """

    kind: ClassVar[str] = "step"
    iteration: int
    polytope: Polytope
    contain: Array


@dataclass(frozen=True)
class Finish:
    """Nothing is left to do; the outcome is about the polytope asked for, the reason is a sentence."""

    kind: ClassVar[str] = "finish"
    outcome: Outcome
    reason: str


Action = Propose | Certify | Step | Finish


@dataclass(frozen=True, eq=False)
class Outcomes:
    """The outcome of each pair of a certification that was reached; reused pairs are left out.

    Attributes:
        weaknesses: pair index -> where it fails; pairs of which nothing is known are left out.
    """

    action: Certify
    outcomes: dict[int, Outcome]
    weaknesses: dict[int, Weakness] = field(default_factory=dict)

    @property
    def failures(self) -> list[int]:
        """The pairs that are not certified, in the order in which they were reached."""
        return [index for index, outcome in self.outcomes.items() if outcome is not Outcome.CERTIFIED]

    @property
    def complete(self) -> bool:
        """Whether every pair is certified."""
        return not self.failures and len(self.outcomes) == len(self.action.pairs)


@dataclass(frozen=True)
class Failed:
    """The action could not be carried out."""

    error: CirisError


Report = Proposal | Outcomes | Stepped | Failed


@dataclass(frozen=True, eq=False)
class Candidate:
    """A polytope all of whose pairs are certified: to be accepted as a region now.

    Attributes:
        iteration: the one that completed it.
        center: a point inside; seed: the one that the region was grown around, None for a given polytope.
        ellipsoid_volume: of the largest ellipsoid inside; None for a given polytope, which is measured against nothing.
        proofs: pair index -> iteration that holds its proof.
    """

    iteration: int
    polytope: Polytope
    center: Array | None
    seed: Array | None
    ellipsoid_volume: float | None
    proofs: dict[int, int]


@dataclass(frozen=True)
class Transition:
    """The state to store, the action to carry out, and a region to accept first if there is one."""

    state: GrowthState
    action: Action
    candidate: Candidate | None = None
