"""What growing a region asks for and is told, between :mod:`certifier.growth.machine`, which decides, and whoever carries it out.

All of it is JSON-able, so a job can be resumed from its rows alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal

from certifier.outcome import Outcome
from certifier.seeding.proposal import Proposal


@dataclass(frozen=True)
class Propose:
    """Run :func:`certifier.seeding.propose` with these seed options; report Proposal or Failed."""

    seed: dict[str, Any]
    kind: Literal["propose"] = "propose"


@dataclass(frozen=True)
class Certify:
    """Certify these pairs on {C s <= d} (joint limits included in the rows); report Certification.

    Attributes:
        iteration: number of this certification within the job, from 0.
        label: what it is for: ``given``, ``contract``, ``push`` or ``round``.
        center: interior point, (n,); None for the Chebyshev centre.
        pairs: indices into ``scene.pairs`` to certify, most likely failures first.
        reuse: pair index -> earlier iteration whose proof, on a superset, serves here too.
        hard: pairs that failed on a larger polytope; nothing less than all faces is tried for them.
        failures: end after this many, in the order of ``pairs`` (B.3); pairs not reached are reported as absent. None for all pairs.
    """

    iteration: int
    label: str
    C: list[list[float]]
    d: list[float]
    center: list[float] | None
    pairs: list[int]
    reuse: dict[int, int]
    hard: list[int]
    failures: int | None
    kind: Literal["certify"] = "certify"


@dataclass(frozen=True)
class Step:
    """Run the polytope step (12) on the last accepted polytope with its proofs; report Stepped or Failed.

    Attributes:
        contain: (k, n) points that stay inside.
    """

    iteration: int
    C: list[list[float]]
    d: list[float]
    center: list[float]
    contain: list[list[float]]
    kind: Literal["step"] = "step"


@dataclass(frozen=True)
class Finish:
    """Nothing is left to do; the outcome is about the polytope asked for, the reason is a sentence."""

    outcome: Outcome
    reason: str
    kind: Literal["finish"] = "finish"


Action = Propose | Certify | Step | Finish


def action_to_document(action: Action) -> dict[str, Any]:
    """An action as JSON-able data (pair indices become strings as JSON keys)."""
    return {part.name: getattr(action, part.name) for part in fields(action)}


def action_from_document(document: dict[str, Any]) -> Action:
    """Inverse of :func:`action_to_document`, also after a trip through JSON."""
    kinds: dict[str, type[Action]] = {"propose": Propose, "certify": Certify, "step": Step, "finish": Finish}
    document = dict(document)
    if document["kind"] == "certify":
        document["reuse"] = {int(k): v for k, v in document["reuse"].items()}
    if document["kind"] == "finish":
        document["outcome"] = Outcome(document["outcome"])
    return kinds[document["kind"]](**document)


@dataclass(frozen=True)
class Certification:
    """Outcome of each pair that was reached; reused pairs are left out.

    Attributes:
        weak: pair index -> where it fails, ``points`` (w, n), ``pull`` (n,) and whether ``ranges_alone`` count; pairs of which nothing
            is known are left out.
    """

    iteration: int
    outcomes: dict[int, Outcome]
    weak: dict[int, dict[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Stepped:
    """The new polytope, joint limits included, and what the step has to say of itself.

    Attributes:
        base_C, base_d: the rows it came from, one for one; backing off moves between the two.
        growth: relative growth of the inscribed ellipsoid's volume.
    """

    C: list[list[float]]
    d: list[float]
    center: list[float]
    base_C: list[list[float]]
    base_d: list[float]
    growth: float
    info: dict[str, Any]


@dataclass(frozen=True)
class Failed:
    """The action could not be carried out; ``error`` is a :class:`certifier.errors.CirisError` document."""

    error: dict[str, str | None]


Report = Proposal | Certification | Stepped | Failed


@dataclass(frozen=True)
class Accepted:
    """A polytope all of whose pairs are certified: store it as a region now.

    Attributes:
        center: a point inside; seed: the one that the region was grown around, None for a given polytope.
        proofs: pair index -> iteration that holds its proof.
    """

    iteration: int
    C: list[list[float]]
    d: list[float]
    center: list[float] | None
    seed: list[float] | None
    proofs: dict[int, int]


@dataclass(frozen=True)
class Transition:
    """The state to store, the action to carry out, and a region to store first if there is one."""

    state: dict[str, Any]
    action: Action
    accepted: Accepted | None = None
