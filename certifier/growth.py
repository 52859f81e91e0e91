"""Growing a region as a pure state machine: seed, contract until certified, alternate (11) with (12).

Appendix B.4 and Algorithm 1 of C-IRIS. :func:`begin` and :func:`advance` decide what to do next and compute nothing heavy:
whoever drives them (the service's coordinator, or :mod:`certifier.local`) carries out the :class:`Action` and reports back.
State, actions and reports are JSON-able, so a job can be resumed from its rows alone.

Contraction. With rows scaled to |c_j| = 1 and seed s0, trial delta is {c_j s <= max(d_j - delta, min(d_j, c_j s0 + r))}: the uniform
contraction of B.4, with every face stopped a radius r short of the seed, so that the trials are nested, always contain the
seed, and end in a tiny polytope that is certifiable whenever the seed is free.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np

from certifier.errors import RegionError
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, combine

SEED_RADIUS = 1e-3
"""Distance in s at which a contracting face stops short of the seed."""


@dataclass(frozen=True)
class GrowthOptions:
    """What a job asks for.

    Attributes:
        kind: ``grow`` a region from a seed, or ``certify`` a given polytope as it is.
        seed: the document of :class:`certifier.seeding.SeedOptions`; for ``certify`` its ``C``, ``d`` and optional ``center``.
        bisection_steps: certifications spent on contraction after the two ends are known.
        max_rounds: rounds of the polytope step (12); 0 ends after contraction.
        tolerance: relative growth of the inscribed ellipsoid's volume under which the alternation stops.
        backoff: how many times a stepped polytope that fails to certify is halved towards the last certified one.
        random_seed: seeds every random choice of the certification.
    """

    kind: Literal["grow", "certify"] = "grow"
    seed: dict[str, Any] = field(default_factory=dict)
    bisection_steps: int = 6
    max_rounds: int = 3
    tolerance: float = 0.02
    backoff: int = 2
    random_seed: int = 0

    def to_document(self) -> dict[str, Any]:
        """The options as JSON-able data."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> GrowthOptions:
        """Inverse of :meth:`to_document`.

        Raises:
            RegionError: an unknown or out-of-range option; the error names it.
        """
        known = {f.name for f in fields(cls)}
        for name in document:
            if name not in known:
                raise RegionError("unknown_option", f"there is no option {name!r}", field=f"options.{name}", hint=f"options: {', '.join(sorted(known))}")
        options = cls(**document)
        if options.kind not in ("grow", "certify"):
            raise RegionError("option_value", "kind is 'grow' or 'certify'", field="options.kind")
        for name, upper in (("bisection_steps", 60), ("max_rounds", 1000), ("backoff", 20), ("random_seed", 2**63 - 1)):
            value = getattr(options, name)
            if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= upper:
                raise RegionError("option_value", f"{name} must be an integer from 0 to {upper}", field=f"options.{name}")
        if not (isinstance(options.tolerance, (int, float)) and 0 < options.tolerance < 10):
            raise RegionError("option_value", "tolerance must be a number between 0 and 10", field="options.tolerance")
        return options


@dataclass(frozen=True)
class Propose:
    """Run :func:`certifier.seeding.propose` with these seed options; report Proposed or Failed."""

    seed: dict[str, Any]
    kind: Literal["propose"] = "propose"


@dataclass(frozen=True)
class Certify:
    """Certify these pairs on {C s <= d} (joint limits included in the rows); report Certification.

    Attributes:
        iteration: number of this certification within the job, from 0.
        label: what it is for: ``given``, ``contract`` or ``round``.
        pairs: indices into ``scene.pairs`` to certify, most likely failures first.
        reuse: pair index -> earlier iteration whose proof, on a superset, serves here too.
        stop_at_first_failure: end early (B.3); pairs not reached are reported as absent.
    """

    iteration: int
    label: str
    C: list[list[float]]
    d: list[float]
    center: list[float]
    pairs: list[int]
    reuse: dict[int, int]
    stop_at_first_failure: bool
    kind: Literal["certify"] = "certify"


@dataclass(frozen=True)
class Step:
    """Run the polytope step (12) on the last accepted polytope with its proofs; report Stepped or Failed."""

    iteration: int
    C: list[list[float]]
    d: list[float]
    center: list[float]
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
    return asdict(action)


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
class Proposed:
    """A proposal: its faces without the joint limits, a point inside, and what the seeding has to say of itself."""

    C: list[list[float]]
    d: list[float]
    center: list[float]
    info: dict[str, Any]


@dataclass(frozen=True)
class Certification:
    """Outcome of each pair that was reached; reused pairs are left out."""

    iteration: int
    outcomes: dict[int, Outcome]


@dataclass(frozen=True)
class Stepped:
    """The new polytope (faces and joint limits, the same number of rows) and what the step has to say of itself."""

    C: list[list[float]]
    d: list[float]
    center: list[float]
    info: dict[str, Any]


@dataclass(frozen=True)
class Failed:
    """The action could not be carried out; ``error`` is a :class:`certifier.errors.CirisError` document."""

    error: dict[str, str | None]


Report = Proposed | Certification | Stepped | Failed


@dataclass(frozen=True)
class Accepted:
    """A polytope all of whose pairs are certified: store it as a region now.

    ``proofs`` maps every pair index to the iteration that holds its proof.
    """

    iteration: int
    C: list[list[float]]
    d: list[float]
    center: list[float]
    proofs: dict[int, int]


@dataclass(frozen=True)
class Transition:
    """The state to store, the action to carry out, and a region to store first if there is one."""

    state: dict[str, Any]
    action: Action
    accepted: Accepted | None = None
