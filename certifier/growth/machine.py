"""Growing a region as a pure state machine: seed, contract until certified, push the faces out again, alternate (11) with (12).

Appendix B.4 and Algorithm 1 of C-IRIS. :func:`begin` and :func:`advance` decide what to do next and compute nothing heavy:
whoever drives them (the service's coordinator, or :mod:`certifier.jobs.local`) carries out the :class:`Action` and reports back.
Like actions and reports the state is JSON-able, so a job can be resumed from its rows alone.

Contraction, targeted: faces are added where pairs fail (:mod:`certifier.growth.faces`) until every pair is certified. What was certified
stays so, since the polytope only shrinks. Tried a few times with another balance between faces and shorter ranges; the largest counts.
Contraction, uniform (B.4): the largest {C s <= d - delta} that certifies, by bisection; it keeps its Chebyshev centre and shrinks to it.
Pushing: all faces of the certified polytope move out from its centre, within IRIS' proposal or the joint limits, and the result is
contracted by targeted faces; it counts when the ellipsoid has grown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from certifier.errors import CirisError, RegionError
from certifier.growth.actions import (
    Accepted,
    Certification,
    Certify,
    Finish,
    Propose,
    Report,
    Step,
    Stepped,
    Transition,
    action_from_document,
    action_to_document,
)
from certifier.growth.faces import Failure, contract, measure
from certifier.growth.options import EFFORT, NEAR, GrowthOptions
from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, combine
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume_bound
from certifier.polytopes.polytope import chebyshev_center, drop_redundant
from certifier.seeding.options import Method
from certifier.seeding.proposal import Proposal

SMALLEST_SCALE = 1e-3
"""The last trial of the uniform contraction, relative to the proposal."""
MAX_ATTEMPTS = 60
"""Faces added for one pair before the targeted contraction gives up."""
FAILURES = 2
"""Pairs for which faces are added at once, so that two workers can look for them."""
FAR, PUSH, SMALLEST_PUSH = 8.0, 1.5, 0.1
"""Factors by which faces are pushed out from the centre: those of a given polytope before anything is certified, at first those of a
certified one; the least growth tried."""


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
    if isinstance(report, Proposal):
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


def _proposed(scene: Scene, state: dict[str, Any], report: Proposal) -> Transition:
    """Rows to contract: the proposal's faces and the joint limits, all scaled to |c| = 1."""
    limited = scene.polytope(report.C, report.d)
    norms = np.linalg.norm(limited.C, axis=1)
    rows = Polytope(limited.C / norms[:, None], limited.d / norms)
    state |= {"rows": {"C": rows.C.tolist(), "d": rows.d.tolist()}, "seed": report.center.tolist(), "proposal": report.info}
    if state["options"]["contraction"] == "targeted":
        return _contract(scene, {**state, "keep": [report.center.tolist(), *report.contain.tolist()], "contractions": 0})
    center, radius = chebyshev_center(rows)
    state |= {"keep": [center.tolist()], "near": NEAR[0]}
    uniform = {"center": center.tolist(), "radius": radius, "holds": {}, "steps": state["options"]["bisection_steps"]}
    return _shrink(scene, {**state, "uniform": uniform}, 1.0)


def _contract(scene: Scene, state: dict[str, Any]) -> Transition:
    """The next targeted contraction of the proposal, or pushes from the largest when there were enough."""
    starts, tried = _starts(scene, state), state["contractions"]
    if tried == len(starts):
        return _push(scene, state)
    reach, near = starts[tried]
    rows = Polytope(np.array(state["rows"]["C"]), np.array(state["rows"]["d"]))
    polytope = rows if reach == 1.0 else _pushed(scene, rows, np.array(state["seed"]), reach, scene.polytope([], []))
    return _trim(scene, {**state, "contractions": tried + 1, "near": near, "reach": reach}, "contract", polytope)


def _starts(scene: Scene, state: dict[str, Any]) -> list[tuple[float, float]]:
    """Where targeted contractions start: how far the proposal's faces are pushed out first, and one of NEAR.

    What IRIS cut off collides, but beyond a given polytope nothing is known: the first contraction begins far outside of it.
    """
    starts = [(1.0, near) for near in NEAR[: _most(scene, state, "contractions")]]
    return [(FAR, NEAR[0]), *starts] if _is_given(state) and _most(scene, state, "pushes") else starts


def _is_given(state: dict[str, Any]) -> bool:
    return state["proposal"].get("method") in (Method.BOX, Method.POLYTOPE)


def _pushed(scene: Scene, polytope: Polytope, center: Array, reach: float, within: Polytope) -> Polytope:
    """The faces of a polytope with the joint limits farther from the centre by that factor, within another polytope with them."""
    limits = 2 * scene.n
    C, d = polytope.C[:-limits], polytope.d[:-limits]
    pushed = Polytope(np.concatenate([C, within.C]), np.concatenate([C @ center + reach * (d - C @ center), within.d]))
    kept = drop_redundant(pushed, fixed=limits)
    return Polytope(pushed.C[kept], pushed.d[kept])


def _is_worth_it(state: dict[str, Any], polytope: Polytope) -> bool:
    """Whether certifying the polytope would be progress."""
    if state["best"] is None:
        return True
    least = state["best"]["volume"] * (1 + state["options"]["tolerance"])
    return volume_bound(polytope) > least and inscribed_ellipsoid(polytope).volume > least


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
    elif action.label == "push" or (state.get("reach", 1.0) > 1 and not state["trim"]["attempts"]):
        transition = _push_on(scene, state)
    else:
        transition = _contract(scene, state)
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
    if state["best"] is not None or state["contractions"] < len(_starts(scene, state)):
        return _contract(scene, state)
    pair = scene.pairs[failures[0]]
    reason = f"not even a small region around the seed can be certified: {pair.a} and {pair.b} are too close there"
    return Transition(state, Finish(combine(outcomes), reason))


def _push(scene: Scene, state: dict[str, Any], reach: float | None = None) -> Transition:
    """The next push from the best region, or the alternation when there were enough."""
    pushes = state.get("pushes", 0)
    reach = reach or PUSH
    if pushes >= _most(scene, state, "pushes") or reach - 1 < SMALLEST_PUSH:
        return _step(scene, state)
    best = Polytope(np.array(state["best"]["C"]), np.array(state["best"]["d"]))
    rows = scene.polytope([], []) if _is_given(state) else Polytope(np.array(state["rows"]["C"]), np.array(state["rows"]["d"]))
    polytope = _pushed(scene, best, np.array(state["best"]["center"]), reach, rows)
    return _trim(scene, {**state, "pushes": pushes + 1, "reach": reach}, "push", polytope)


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
