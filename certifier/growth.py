"""Growing a region as a pure state machine: seed, contract until certified, push the faces out again, alternate (11) with (12).

Appendix B.4 and Algorithm 1 of C-IRIS. :func:`begin` and :func:`advance` decide what to do next and compute nothing heavy:
whoever drives them (the service's coordinator, or :mod:`certifier.local`) carries out the :class:`Action` and reports back.
State, actions and reports are JSON-able, so a job can be resumed from its rows alone.

Contraction, targeted: faces are added where pairs fail (:mod:`certifier.contraction`) until every pair is certified. What was certified
stays so, since the polytope only shrinks. Tried a few times with another balance between faces and shorter ranges; the largest counts.
Contraction, uniform (B.4): the largest {C s <= d - delta} that certifies, by bisection; it keeps its Chebyshev centre and shrinks to it.
Pushing: all faces of the certified polytope move out from its centre, within IRIS' proposal or the joint limits, and the result is
contracted by targeted faces; it counts when the ellipsoid has grown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

import numpy as np

from certifier.contraction import Failure, contract, measure
from certifier.ellipsoid import inscribed_ellipsoid
from certifier.errors import CirisError, RegionError
from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, combine
from certifier.polytope import chebyshev_center, drop_redundant
from certifier.seed_options import Method

EFFORT = (
    (4, {"contractions": 2, "pushes": 10, "max_rounds": 3}),
    (6, {"contractions": 2, "pushes": 2, "max_rounds": 0}),
    (math.inf, {"contractions": 1, "pushes": 0, "max_rounds": 0}),
)
"""Defaults, by the most joints that any pair has between its bodies: for seconds, a minute, or the first region, itself a minute."""
SMALLEST_SCALE = 1e-3
"""The last trial of the uniform contraction, relative to the proposal."""
NEAR = (1.0, 0.6, 0.3)
"""Of the contractions, one after the other: from how near on a pair's failure calls for a shorter range and not for a face."""
MAX_ATTEMPTS = 60
"""Faces added for one pair before the targeted contraction gives up."""
FAILURES = 2
"""Pairs for which faces are added at once, so that two workers can look for them."""
FAR, PUSH, SMALLEST_PUSH = 8.0, 1.5, 0.1
"""Factors by which faces are pushed out from the centre: at first around a given polytope, at first elsewhere; the least growth tried."""


@dataclass(frozen=True)
class GrowthOptions:
    """What a job asks for.

    Attributes:
        kind: ``grow`` a region from a seed, or ``certify`` a given polytope as it is.
        seed: the document of :class:`certifier.seeding.SeedOptions`; for ``certify`` its ``C``, ``d`` and optional ``center``.
        contraction: ``targeted`` or ``uniform``.
        contractions: how many targeted contractions of the proposal are tried; each is given up when it is smaller than the best so far.
            None, of this and the two that follow it, is what pays: see EFFORT.
        bisection_steps: certifications spent on uniform contraction after the two ends are known.
        pushes: how often the faces are pushed out after the contractions; each push that fails is followed by a shorter one.
        max_rounds: rounds of the polytope step (12) after the pushes.
        tolerance: relative growth of the ellipsoid's volume that is still worth a push or a round.
        backoff: how many times a stepped polytope that fails to certify is halved towards the last certified one.
        random_seed: seeds every random choice of the certification.
    """

    kind: Literal["grow", "certify"] = "grow"
    seed: dict[str, Any] = field(default_factory=dict)
    contraction: Literal["targeted", "uniform"] = "targeted"
    contractions: int | None = None
    bisection_steps: int = 6
    pushes: int | None = None
    max_rounds: int | None = None
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
        if options.contraction not in ("targeted", "uniform"):
            raise RegionError("option_value", "contraction is 'targeted' or 'uniform'", field="options.contraction")
        if options.contractions is not None and not (isinstance(options.contractions, int) and 1 <= options.contractions <= len(NEAR)):
            raise RegionError("option_value", f"contractions must be an integer from 1 to {len(NEAR)}", field="options.contractions")
        integers = (("bisection_steps", 60), ("pushes", 1000), ("max_rounds", 1000), ("backoff", 20), ("random_seed", 2**63 - 1))
        for name, upper in integers:
            value = getattr(options, name)
            if name in EFFORT[0][1] and value is None:
                continue
            if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= upper:
                raise RegionError("option_value", f"{name} must be an integer from 0 to {upper}", field=f"options.{name}")
        if options.contraction == "uniform" and options.seed.get("contain"):
            raise RegionError("option_value", "only targeted contraction keeps points inside", field="options.contraction")
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
    """A proposal: faces without the joint limits, the seed and what else the region has to contain, and what the seeding says of itself."""

    C: list[list[float]]
    d: list[float]
    center: list[float]
    contain: list[list[float]]
    info: dict[str, Any]


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


Report = Proposed | Certification | Stepped | Failed


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
    return _certify(scene, state, "given", limited.C, limited.d, options.seed.get("center"), failures=None)


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
    hard: Sequence[int] = (),
    failures: int | None = 1,
) -> Transition:
    """Certify {C s <= d}: the pairs that failed last first, then those with few joints between them, which are cheap and fail early."""
    reuse = reuse or {}
    suspects = [i for i in state.get("suspects", []) if i not in reuse]
    others = [i for i in _by_joints(scene) if i not in reuse and i not in set(suspects)]
    action = Certify(state["next"], label, C.tolist(), d.tolist(), center, suspects + others, reuse, list(hard), failures)
    state = {**state, "phase": label, "next": action.iteration + 1, "current": action_to_document(action)}
    return Transition(state, action)


def _joints(scene: Scene, index: int) -> tuple[int, ...]:
    kinematics = Kinematics.of(scene)
    a, b = (scene.geometry(name).body for name in (scene.pairs[index].a, scene.pairs[index].b))
    return tuple(sorted(kinematics.chain(a, b)))


def _by_joints(scene: Scene) -> list[int]:
    return sorted(range(len(scene.pairs)), key=lambda i: len(_joints(scene, i)))


def _proposed(scene: Scene, state: dict[str, Any], report: Proposed) -> Transition:
    """Rows to contract: the proposal's faces and the joint limits, all scaled to |c| = 1."""
    limited = scene.polytope(report.C, report.d)
    norms = np.linalg.norm(limited.C, axis=1)
    rows = Polytope(limited.C / norms[:, None], limited.d / norms)
    state |= {"rows": {"C": rows.C.tolist(), "d": rows.d.tolist()}, "seed": report.center, "proposal": report.info}
    if state["options"]["contraction"] == "targeted":
        return _contract(scene, {**state, "keep": [report.center, *report.contain], "contractions": 0})
    center, radius = chebyshev_center(rows)
    state |= {"keep": [center.tolist()], "near": NEAR[0]}
    uniform = {"center": center.tolist(), "radius": radius, "holds": {}, "steps": state["options"]["bisection_steps"]}
    return _shrink(scene, {**state, "uniform": uniform}, 1.0)


def _contract(scene: Scene, state: dict[str, Any]) -> Transition:
    """The next targeted contraction of the proposal, or pushes from the largest when there were enough."""
    tried = state["contractions"]
    if tried == _most(scene, state, "contractions"):
        return _push(scene, state)
    rows = Polytope(np.array(state["rows"]["C"]), np.array(state["rows"]["d"]))
    return _trim(scene, {**state, "contractions": tried + 1, "near": NEAR[tried]}, "contract", rows)


def _is_worth_it(state: dict[str, Any], polytope: Polytope) -> bool:
    """Whether certifying the polytope would be progress."""
    return state["best"] is None or inscribed_ellipsoid(polytope).volume > state["best"]["volume"] * (1 + state["options"]["tolerance"])


def _trim(scene: Scene, state: dict[str, Any], label: str, polytope: Polytope, trim: dict[str, Any] | None = None) -> Transition:
    """Certify what the targeted contraction has come to; a pair certified on a larger polytope is certified on this one."""
    if not _is_worth_it(state, polytope):
        return _push_less(scene, state) if label == "push" else _contract(scene, state)
    trim = trim or {"holds": {}, "attempts": {}}
    center = measure(polytope, np.array(state["keep"][0])).center
    holds = {int(index): iteration for index, iteration in trim["holds"].items()}
    hard = sorted(int(index) for index in trim["attempts"] if index not in trim["holds"])
    return _certify(scene, {**state, "trim": trim}, label, polytope.C, polytope.d, center.tolist(), holds, hard, FAILURES)


def _shrink(scene: Scene, state: dict[str, Any], scale: float) -> Transition:
    """Certify the uniform trial delta = (1 - scale) times the largest ball's radius."""
    uniform = state["uniform"] | {"scale": scale}
    limited = scene.polytope(state["rows"]["C"], np.array(state["rows"]["d"]) - (1 - scale) * uniform["radius"])
    reuse = {int(index): iteration for index, (iteration, held) in uniform["holds"].items() if held >= scale}
    return _certify(scene, {**state, "uniform": uniform}, "contract", limited.C, limited.d, uniform["center"], reuse)


def _certified(scene: Scene, state: dict[str, Any], report: Certification) -> Transition:
    action = action_from_document(state["current"])
    assert isinstance(action, Certify)
    failures = [index for index, outcome in report.outcomes.items() if outcome is not Outcome.CERTIFIED]
    complete = not failures and len(report.outcomes) == len(action.pairs)
    accepted = None
    size = 0.0
    if complete and action.label != "given":
        size = inscribed_ellipsoid(Polytope(np.array(action.C), np.array(action.d))).volume
    if complete and (state["best"] is None or size > state["best"]["volume"]):
        proofs = {**dict.fromkeys(action.pairs, action.iteration), **action.reuse}
        accepted = Accepted(action.iteration, action.C, action.d, action.center, state.get("seed"), proofs)
        state["best"] = {"iteration": action.iteration, "C": action.C, "d": action.d, "center": action.center, "volume": size}
    if action.label == "given":
        transition = Transition(state, Finish(combine(list(report.outcomes.values())), "the given polytope, every pair"))
    elif action.label == "round":
        state["suspects"] = [*failures, *(i for i in state.get("suspects", []) if i not in failures)]
        transition = _alternate(scene, state, accepted is not None)
    elif state["options"]["contraction"] == "uniform" and action.label == "contract":
        state["suspects"] = [*failures, *(i for i in state.get("suspects", []) if i not in failures)]
        transition = _bisect(scene, state, action, report, complete)
    elif not complete:
        transition = _cut(scene, state, action, report, failures)
    else:
        transition = _push_on(scene, state) if action.label == "push" else _contract(scene, state)
    return Transition(transition.state, transition.action, accepted)


def _cut(scene: Scene, state: dict[str, Any], action: Certify, report: Certification, failures: list[int]) -> Transition:
    """Targeted contraction: faces for the pairs that failed."""
    trim = state["trim"]
    attempts = dict(trim["attempts"])
    holds = trim["holds"] | {str(i): action.iteration for i, outcome in report.outcomes.items() if outcome is Outcome.CERTIFIED}
    polytope, keep = Polytope(np.array(action.C), np.array(action.d)), np.array(state["keep"])
    found = []
    for index in failures:
        weak = report.weak.get(index, {"points": [], "pull": []})
        points, pull = np.array(weak["points"]).reshape(-1, scene.n), np.array(weak["pull"])
        ranges_alone = bool(weak.get("ranges_alone"))
        found.append(Failure(_joints(scene, index), points, pull, attempts.get(str(index), 0), ranges_alone))
        attempts[str(index)] = attempts.get(str(index), 0) + 1
    smaller = contract(scene, polytope, measure(polytope, keep[0]), keep, found, state["near"])
    if smaller is None or max(attempts.values()) > MAX_ATTEMPTS:
        return _no_smaller(scene, state, action.label, failures, list(report.outcomes.values()))
    return _trim(scene, state, action.label, smaller, {"holds": holds, "attempts": attempts})


def _no_smaller(scene: Scene, state: dict[str, Any], label: str, failures: list[int], outcomes: list[Outcome]) -> Transition:
    if label == "push":
        return _push_less(scene, state)
    if state["best"] is not None or state["contractions"] < _most(scene, state, "contractions"):
        return _contract(scene, state)
    pair = scene.pairs[failures[0]]
    reason = f"not even a small region around the seed can be certified: {pair.a} and {pair.b} are too close there"
    return Transition(state, Finish(combine(outcomes), reason))


def _push(scene: Scene, state: dict[str, Any], reach: float | None = None) -> Transition:
    """The next push from the best region, or the alternation when there were enough."""
    pushes = state.get("pushes", 0)
    # What IRIS cut off collides; around a given polytope nothing is known.
    given = state["proposal"].get("method") in (Method.BOX, Method.POLYTOPE)
    reach = reach or (FAR if given and not pushes else PUSH)
    if pushes >= _most(scene, state, "pushes") or reach - 1 < SMALLEST_PUSH:
        return _step(scene, state)
    best, limits = state["best"], 2 * scene.n
    C, d, center = np.array(best["C"])[:-limits], np.array(best["d"])[:-limits], np.array(best["center"])
    rows = scene.polytope([], []) if given else Polytope(np.array(state["rows"]["C"]), np.array(state["rows"]["d"]))
    pushed = Polytope(np.concatenate([C, rows.C]), np.concatenate([C @ center + reach * (d - C @ center), rows.d]))
    kept = drop_redundant(pushed, fixed=limits)
    return _trim(scene, {**state, "pushes": pushes + 1, "reach": reach}, "push", Polytope(pushed.C[kept], pushed.d[kept]))


def _push_on(scene: Scene, state: dict[str, Any]) -> Transition:
    """After a push that came through: twice as far when nothing had to be cut."""
    return _push(scene, state, PUSH if state["trim"]["attempts"] else 1 + 2 * (state["reach"] - 1))


def _push_less(scene: Scene, state: dict[str, Any]) -> Transition:
    return _push(scene, state, 1 + (state["reach"] - 1) / 2)


def _bisect(scene: Scene, state: dict[str, Any], action: Certify, report: Certification, complete: bool) -> Transition:
    """B.4: the largest trial that certifies, by bisection (of the logarithm) between one that did and one that did not."""
    uniform = dict(state["uniform"])
    scale, holds = uniform["scale"], dict(uniform["holds"])
    for index, outcome in report.outcomes.items():
        if outcome is Outcome.CERTIFIED and (str(index) not in holds or holds[str(index)][1] < scale):
            holds[str(index)] = [action.iteration, scale]
    uniform["holds"] = holds
    uniform["certified" if complete else "failed"] = scale
    state = {**state, "uniform": uniform}
    if complete and scale == 1.0:
        return _push(scene, state)
    if "certified" not in uniform:
        if scale == SMALLEST_SCALE:
            pair = scene.pairs[next(i for i, outcome in report.outcomes.items() if outcome is not Outcome.CERTIFIED)]
            reason = f"not even the smallest of the uniform contractions can be certified: {pair.a} and {pair.b} are too close there"
            return Transition(state, Finish(combine(list(report.outcomes.values())), reason))
        return _shrink(scene, state, SMALLEST_SCALE)
    if uniform["steps"] == 0:
        return _push(scene, state)
    uniform["steps"] -= 1
    return _shrink(scene, state, math.sqrt(uniform["certified"] * uniform["failed"]))


def _most(scene: Scene, state: dict[str, Any], option: str) -> int:
    given = state["options"][option]
    if given is not None:
        return int(given)
    joints = max((len(_joints(scene, index)) for index in range(len(scene.pairs))), default=0)
    return next(effort for most, effort in EFFORT if joints <= most)[option]


def _step(scene: Scene, state: dict[str, Any]) -> Transition:
    """The next round of (12) on the best region, or the end."""
    rounds = state.get("rounds", 0)
    if rounds >= _most(scene, state, "max_rounds"):
        return Transition(state, Finish(Outcome.CERTIFIED, "certified; the limit of rounds was reached" if rounds else "certified"))
    best = state["best"]
    action = Step(best["iteration"], best["C"], best["d"], best["center"], state["keep"])
    return Transition({**state, "phase": "step", "rounds": rounds + 1}, action)


def _alternate(scene: Scene, state: dict[str, Any], accepted: bool) -> Transition:
    """Algorithm 1: accept and go on, stop when the growth is small, or back off towards the last certified polytope."""
    if accepted:
        if state["growth"] < state["options"]["tolerance"]:
            return Transition(state, Finish(Outcome.CERTIFIED, "certified; growth is under the tolerance"))
        return _step(scene, state)
    if state["halvings"] == state["options"]["backoff"]:
        return Transition(state, Finish(Outcome.CERTIFIED, "certified; the last step could not be certified"))
    base, target = state["base"], state["target"]
    share = 0.5 ** (state["halvings"] + 1)
    C, d, center = ((1 - share) * np.array(base[name]) + share * np.array(target[name]) for name in ("C", "d", "center"))
    return _certify(scene, {**state, "halvings": state["halvings"] + 1}, "round", C, d, center.tolist())
