"""Growing a region as a pure state machine: seed, contract until certified, alternate (11) with (12).

Appendix B.4 and Algorithm 1 of C-IRIS. :func:`begin` and :func:`advance` decide what to do next and compute nothing heavy:
whoever drives them (the service's coordinator, or :mod:`certifier.local`) carries out the :class:`Action` and reports back.
State, actions and reports are JSON-able, so a job can be resumed from its rows alone.

Contraction. Trial sigma is {c_j s <= c_j s0 + sigma (d_j - c_j s0)}, the proposal shrunk about the seed s0: B.4 with delta_j in
proportion to the face's distance from the seed instead of one delta for all, which keeps the shape. The trials are nested, always contain
the seed, and end in a tiny polytope that is certifiable whenever the seed is free with some room.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

import numpy as np

from certifier.errors import CirisError, RegionError
from certifier.model import Array, Scene
from certifier.outcome import Outcome, combine

SMALLEST_SCALE = 1e-3
"""The last trial of the contraction, relative to the proposal."""


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
                raise RegionError(
                    "unknown_option", f"there is no option {name!r}", field=f"options.{name}", hint=f"options: {', '.join(sorted(known))}"
                )
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
        center: interior point, (n,); None for the Chebyshev centre.
        pairs: indices into ``scene.pairs`` to certify, most likely failures first.
        reuse: pair index -> earlier iteration whose proof, on a superset, serves here too.
        stop_at_first_failure: end early (B.3); pairs not reached are reported as absent.
    """

    iteration: int
    label: str
    C: list[list[float]]
    d: list[float]
    center: list[float] | None
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


Report = Proposed | Certification | Stepped | Failed


@dataclass(frozen=True)
class Accepted:
    """A polytope all of whose pairs are certified: store it as a region now.

    ``proofs`` maps every pair index to the iteration that holds its proof.
    """

    iteration: int
    C: list[list[float]]
    d: list[float]
    center: list[float] | None
    proofs: dict[int, int]


@dataclass(frozen=True)
class Transition:
    """The state to store, the action to carry out, and a region to store first if there is one."""

    state: dict[str, Any]
    action: Action
    accepted: Accepted | None = None


def begin(scene: Scene, options: GrowthOptions) -> Transition:
    """The first action of a job.

    Raises:
        RegionError: a ``certify`` job without C and d, or with the wrong number of columns.
    """
    state: dict[str, Any] = {"options": options.to_document(), "next": 0, "best": None}
    if options.kind == "grow":
        return Transition(state | {"phase": "propose"}, Propose(options.seed))
    if "C" not in options.seed or "d" not in options.seed:
        raise RegionError("polytope_missing", "a polytope needs C and d", field="polytope")
    C, d = given_rows(scene, options.seed["C"], options.seed["d"])
    limited = scene.polytope(C, d)
    return _certify(scene, state, "given", limited.C, limited.d, options.seed.get("center"), stop=False)


def given_rows(scene: Scene, C: Any, d: Any) -> tuple[Array, Array]:
    """A user's C, (m, n), and d, (m,), as arrays.

    Raises:
        RegionError: not numbers, wrong shape, or not finite.
    """
    try:
        rows, offsets = np.array(C, dtype=float), np.array(d, dtype=float)
    except (TypeError, ValueError) as error:
        raise RegionError("polytope_shape", f"C and d must be arrays of numbers: {error}", field="polytope") from None
    if rows.size == 0:
        rows = rows.reshape(0, scene.n)
    if rows.ndim != 2 or rows.shape[1] != scene.n or offsets.shape != (len(rows),):
        hint = f"C is m x {scene.n}, one column a joint in the scene's order, and d has m numbers"
        raise RegionError("polytope_shape", f"C is {rows.shape} and d is {offsets.shape}", field="polytope", hint=hint)
    if not (np.isfinite(rows).all() and np.isfinite(offsets).all()):
        raise RegionError("polytope_not_finite", "C and d must be finite numbers", field="polytope")
    return rows, offsets


def advance(scene: Scene, state: dict[str, Any], report: Report) -> Transition:
    """What follows a report; the state is the one of the last transition and is not changed."""
    state = dict(state)
    if isinstance(report, Certification):
        return _certified(scene, state, report)
    if isinstance(report, Proposed):
        return _proposed(scene, state, report)
    if isinstance(report, Stepped):
        base = {"C": report.base_C, "d": report.base_d, "center": state["best"]["center"]}
        target = {"C": report.C, "d": report.d, "center": report.center}
        state |= {"base": base, "target": target, "growth": report.growth, "halvings": 0}
        return _certify(scene, state, "round", np.array(report.C), np.array(report.d), report.center)
    error = CirisError.from_document(report.error)
    if state["best"] is not None:
        return Transition(state, Finish(Outcome.CERTIFIED, f"certified; growth ended early: {error}"))
    return Transition(state, Finish(Outcome.ERROR, str(error)))


def _certify(
    scene: Scene,
    state: dict[str, Any],
    label: str,
    C: Array,
    d: Array,
    center: list[float] | None,
    reuse: dict[int, int] | None = None,
    stop: bool = True,
) -> Transition:
    """Certify {C s <= d}, the pairs that failed last first."""
    reuse = reuse or {}
    suspects = [i for i in state.get("suspects", []) if i not in reuse]
    pairs = suspects + [i for i in range(len(scene.pairs)) if i not in reuse and i not in set(suspects)]
    action = Certify(state["next"], label, C.tolist(), d.tolist(), center, pairs, reuse, stop)
    state = {**state, "phase": label, "next": action.iteration + 1, "current": action_to_document(action)}
    return Transition(state, action)


def _proposed(scene: Scene, state: dict[str, Any], report: Proposed) -> Transition:
    """Rows to contract: the proposal's faces and the joint limits, all scaled to |c| = 1."""
    limited = scene.polytope(report.C, report.d)
    norms = np.linalg.norm(limited.C, axis=1)
    state |= {
        "rows": {"C": (limited.C / norms[:, None]).tolist(), "d": (limited.d / norms).tolist(), "seed": report.center},
        "proposal": report.info,
        "holds": {},
        "steps": state["options"]["bisection_steps"],
    }
    return _contract(scene, state, 1.0)


def _contract(scene: Scene, state: dict[str, Any], scale: float) -> Transition:
    """Certify a trial; a pair certified on a larger trial is certified on this one."""
    C, d, seed = (np.array(state["rows"][name]) for name in ("C", "d", "seed"))
    limited = scene.polytope(C, C @ seed + scale * (d - C @ seed))
    reuse = {int(index): iteration for index, (iteration, held) in state["holds"].items() if held >= scale}
    return _certify(scene, {**state, "scale": scale}, "contract", limited.C, limited.d, state["rows"]["seed"], reuse)


def _certified(scene: Scene, state: dict[str, Any], report: Certification) -> Transition:
    action = action_from_document(state["current"])
    assert isinstance(action, Certify)
    failures = {index: outcome for index, outcome in report.outcomes.items() if outcome is not Outcome.CERTIFIED}
    state["suspects"] = [*failures, *(i for i in state.get("suspects", []) if i not in failures)]
    complete = not failures and len(report.outcomes) == len(action.pairs)
    accepted = None
    if complete:
        proofs = {**dict.fromkeys(action.pairs, action.iteration), **action.reuse}
        accepted = Accepted(action.iteration, action.C, action.d, action.center, proofs)
        state["best"] = {"iteration": action.iteration, "C": action.C, "d": action.d, "center": action.center}
    if action.label == "given":
        transition = Transition(state, Finish(combine(list(report.outcomes.values())), "the given polytope, every pair"))
    elif action.label == "contract":
        transition = _bisect(scene, state, action, report, complete)
    else:
        transition = _alternate(scene, state, complete)
    return Transition(transition.state, transition.action, accepted)


def _bisect(scene: Scene, state: dict[str, Any], action: Certify, report: Certification, complete: bool) -> Transition:
    """B.4: the largest trial that certifies, by bisection (of the logarithm) between one that did and one that did not."""
    scale = state["scale"]
    holds = dict(state["holds"])
    for index, outcome in report.outcomes.items():
        if outcome is Outcome.CERTIFIED and (str(index) not in holds or holds[str(index)][1] < scale):
            holds[str(index)] = [action.iteration, scale]
    state["holds"] = holds
    if complete:
        state["certified_scale"] = scale
        if scale == 1.0:
            return _step(state)
    else:
        state["failed_scale"] = scale
    if "certified_scale" not in state:
        if scale == SMALLEST_SCALE:
            pair = scene.pairs[next(i for i, outcome in report.outcomes.items() if outcome is not Outcome.CERTIFIED)]
            reason = f"not even the smallest region around the seed can be certified: {pair.a} and {pair.b} are too close there"
            return Transition(state, Finish(combine(list(report.outcomes.values())), reason))
        return _contract(scene, state, SMALLEST_SCALE)
    if state["steps"] == 0:
        return _step(state)
    state["steps"] -= 1
    return _contract(scene, state, math.sqrt(state["certified_scale"] * state["failed_scale"]))


def _step(state: dict[str, Any]) -> Transition:
    """The next round of (12) on the best region, or the end."""
    rounds = state.get("rounds", 0)
    if rounds >= state["options"]["max_rounds"]:
        return Transition(state, Finish(Outcome.CERTIFIED, "certified; the limit of rounds was reached" if rounds else "certified"))
    best = state["best"]
    return Transition({**state, "phase": "step", "rounds": rounds + 1}, Step(best["iteration"], best["C"], best["d"], best["center"]))


def _alternate(scene: Scene, state: dict[str, Any], complete: bool) -> Transition:
    """Algorithm 1: accept and go on, stop when the growth is small, or back off towards the last certified polytope."""
    if complete:
        if state["growth"] < state["options"]["tolerance"]:
            return Transition(state, Finish(Outcome.CERTIFIED, "certified; growth is under the tolerance"))
        return _step(state)
    if state["halvings"] == state["options"]["backoff"]:
        return Transition(state, Finish(Outcome.CERTIFIED, "certified; the last step could not be certified"))
    base, target = state["base"], state["target"]
    share = 0.5 ** (state["halvings"] + 1)
    C, d, center = ((1 - share) * np.array(base[name]) + share * np.array(target[name]) for name in ("C", "d", "center"))
    return _certify(scene, {**state, "halvings": state["halvings"] + 1}, "round", C, d, center.tolist())
