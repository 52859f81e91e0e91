"""Actions are what the growth of a region asks for, and reports are the answers that it receives.

:mod:`certifier.growth.machine` decides on the actions, and others carry them out. A report is a Proposal
(:mod:`certifier.seeding.proposal`), Outcomes, what a step has Stepped to (:mod:`certifier.step.stepped`), or that the action Failed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

from certifier.errors import CirisError
from certifier.growth.obstacles import Obstacle
from certifier.growth.state import GrowthState
from certifier.model import Array, Polytope
from certifier.outcome import Outcome, combine
from certifier.pair.result import Weakness
from certifier.polytopes.proved import ProvedBox
from certifier.seeding.proposal import Proposal
from certifier.step.stepped import Stepped


@dataclass(frozen=True)
class Propose:
    """Asks for :func:`certifier.seeding.propose.propose` with the options of this document; the report is a Proposal or Failed."""

    kind: ClassVar[str] = "propose"
    seed: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Certify:
    """Asks to certify these pairs on a polytope; the report is their Outcomes.

    Attributes:
        iteration: number of this certification within the job, from 0.
        label: what it is for: ``given``, ``box`` (a box about the seed) or ``cells``; for the papers' algorithm ``contract``, ``push``
            or ``round``.
        polytope: its rows include the joint limits.
        center: (n,) interior point; None for the Chebyshev centre.
        pairs: indices into ``scene.pairs`` to certify, those most likely to fail first.
        reuse: pair index -> earlier iteration whose proof, on a superset, serves here too.
        hard: pairs that failed on a larger polytope: nothing less than all faces is tried for them. Cell by cell: pairs whose open cells
            are going to be cut off where the bodies are near.
        failures: end after this many failures, in the order of ``pairs`` (B.3); pairs not reached are left out of the report. None to
            certify all pairs.
        cells: number of cells to look at for each pair; 1 for the program (11) of the papers on all of the polytope.
        box: the root cell of all partitions, proved around the polytope of the first of them; None for the polytope's smallest box.
        begun: pair index -> the iteration in which its partition was begun; pairs that are left out begin in this one.
        parts: pair index -> how many parts its open cells are divided among; 1 for a pair that is left out.
        ending: pairs whose open cells are going to be cut off where the volumes touch that are tried next in these cells; all open cells
            where the pair is hard as well.
        keep: (k, n) points that stay inside, where faces will be added to the polytope; None where it stays as it is.
        together: pair index -> the other pairs that share its certificate, and are not among ``pairs`` or in ``reuse``.
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
    cells: int = 1
    box: ProvedBox | None = None
    begun: dict[int, int] = field(default_factory=dict)
    parts: dict[int, int] = field(default_factory=dict)
    ending: list[int] = field(default_factory=list)
    keep: Array | None = None
    together: dict[int, tuple[int, ...]] = field(default_factory=dict)

    @property
    def work(self) -> list[tuple[int, int]]:
        """Returns the pairs with the numbers of their parts, in the order in which they are to be certified."""
        return [(index, part) for index in self.pairs for part in range(self.parts.get(index, 1))]


@dataclass(frozen=True, eq=False)
class Step:
    """Asks for the polytope step (12) on the best region's polytope with its proofs; the report is Stepped or Failed.

    Attributes:
        iteration: the one that completed the polytope.
        contain: (k, n) points that stay inside.
    """

    kind: ClassVar[str] = "step"
    iteration: int
    polytope: Polytope
    contain: Array


@dataclass(frozen=True)
class Finish:
    """Says that nothing is left to do.

    Attributes:
        outcome: about the polytope that was asked for.
        reason: a sentence.
    """

    kind: ClassVar[str] = "finish"
    outcome: Outcome
    reason: str


Action = Propose | Certify | Step | Finish


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Reports the outcome of each pair that a certification reached; reused pairs are left out.

    Attributes:
        weaknesses: pair index -> where it fails; pairs of which nothing is known are left out.
        open_cells: pair index -> how many cells of its partition are open, where it has one and is not certified.
        passed: the share of the time from the job's start to its deadline that has passed; 0 without a deadline.
    """

    action: Certify
    outcomes: dict[int, Outcome]
    weaknesses: dict[int, Weakness] = field(default_factory=dict)
    open_cells: dict[int, int] = field(default_factory=dict)
    passed: float = 0.0

    @classmethod
    def of_parts(cls, action: Certify, reached: Iterable[tuple[int, Outcome, Weakness | None, int | None]], passed: float = 0.0) -> Self:
        """Returns the report from the results of the parts of pairs, in their order: pair index, outcome, weakness, open cells."""
        found: dict[int, list[tuple[Outcome, Weakness | None, int | None]]] = {}
        for index, outcome, weakness, cells in reached:
            found.setdefault(index, []).append((outcome, weakness, cells))
        outcomes, weaknesses, open_cells = {}, {}, {}
        for index, results in found.items():
            outcomes[index] = combine([outcome for outcome, _, _ in results])
            known = [weakness for _, weakness, _ in results if weakness is not None]
            # A part in ERROR leaves nothing of its cells, so nobody can go on with the pair.
            if known and not any(outcome is Outcome.ERROR for outcome, _, _ in results):
                weaknesses[index] = Weakness.of_parts(known)
            if left := [cells for _, _, cells in results if cells is not None]:
                open_cells[index] = sum(left)
        return cls(action, outcomes, weaknesses, open_cells, passed)

    @property
    def failures(self) -> list[int]:
        """Returns the pairs that are not certified, in the order in which they were reached."""
        return [index for index, outcome in self.outcomes.items() if outcome is not Outcome.CERTIFIED]

    @property
    def complete(self) -> bool:
        """Returns whether every pair is certified."""
        return not self.failures and len(self.outcomes) == len(self.action.pairs)


@dataclass(frozen=True)
class Failed:
    """Reports that the action could not be carried out."""

    error: CirisError


Report = Proposal | Outcomes | Stepped | Failed


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate is a polytope all of whose pairs are certified; it is to be accepted as a region now.

    Attributes:
        iteration: the one that completed it.
        center: (n,) a point inside.
        seed: (n,) the point in s that the region was grown around; None for a given polytope.
        ellipsoid_volume: volume of the largest ellipsoid inside; None for a given polytope, which is not compared with any other.
        proofs: pair index -> iteration that holds its proof.
        together: pair index -> the other pairs that its proof is about, which are not in ``proofs``.
        obstacles: pair index -> what was cut off for it on the way.
    """

    iteration: int
    polytope: Polytope
    center: Array | None
    seed: Array | None
    ellipsoid_volume: float | None
    proofs: dict[int, int]
    together: dict[int, tuple[int, ...]] = field(default_factory=dict)
    obstacles: dict[int, Obstacle] = field(default_factory=dict)


@dataclass(frozen=True)
class Transition:
    """A transition holds the state to store, the action to carry out, and a region to accept first if there is one."""

    state: GrowthState
    action: Action
    candidate: Candidate | None = None
