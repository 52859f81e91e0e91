"""This pure state machine decides what happens next in a cover. It takes reports of what was seen, and returns which regions to grow.

A cover looks at the scene, grows a few regions at a time, and looks again whenever one of them has ended. It ends when its goals are
reached, when its number of regions is, when it is late, or when it cannot go on: then the last look says why. Before it ends, it searches
for motions between configurations that regions do not connect. The goals that were not reached are named in its last words.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from planner.cover.options import CoverOptions
from planner.cover.state import CoverState, Ended, Finish, Late, Move, Moved, Purpose, Report, Scout, Scouted, Task, Transition, Watch

LATE = "the deadline was reached"
TRIES = 4
"""Nothing is tried more often in a row about the same thing without a region."""
IDLE = 20
"""A cover ends when this many regions in a row changed nothing."""
LOOKS = 3
"""A cover ends when this many looks in a row, each with other samples, found nothing to grow."""


def begin(options: CoverOptions) -> Transition:
    """Looks at the scene first: regions that it has already count."""
    return Transition(CoverState(options, looks=1), Scout())


def advance(state: CoverState, report: Report) -> Transition:
    """Returns what is next after a report."""
    match report:
        case Scouted():
            return _after_look(state, report)
        case Ended():
            return _after_regions(state, report)
        case Moved(pairs):
            assert state.last is not None, "motions are searched for after a look"
            return _finish(replace(state, moved=pairs), state.last, state.closing or "")
        case Late():
            return _close(state, LATE)


def unreached(options: CoverOptions, seen: Scouted, moved: Sequence[tuple[int, int]] = ()) -> list[str]:
    """Returns in words which goals are not reached. ``moved`` are pairs of configurations that proved motions connect."""
    missing = []
    if options.enough is not None and seen.coverage < options.enough:
        missing.append(f"{_percent(seen.coverage)} of the free configurations are covered, not {_percent(options.enough)}")
    if not all(seen.seeds):
        missing.append(f"no region contains {_listed('seed', [i for i, there in enumerate(seen.seeds) if not there])}")
    if not seen.joined(moved):
        alone = [i for i, part in enumerate(seen.connect) if part is None]
        if alone:
            missing.append(f"no region contains {_listed('connect', alone)}")
        apart = sorted({part for part in seen.connect if part is not None})
        if len(apart) > 1:
            missing.append(f"the configurations to connect are in {len(apart)} components")
    if options.connected and len(seen.components) != 1:
        missing.append(f"the regions are in {len(seen.components)} components")
    short = [i for i, part in enumerate(seen.paths) if part < 1]
    if short:
        missing.append(f"{_listed('path', short)} {'is' if len(short) == 1 else 'are'} not covered to the end")
    return missing


def _after_look(state: CoverState, seen: Scouted) -> Transition:
    """Begins what the look proposes, as much as may grow at once; or ends."""
    before = state.last
    idle = 0 if before is None or _is_progress(before, seen) else state.idle
    state = replace(state, last=seen, idle=idle)
    if state.closing is not None:
        return _finish(state, seen, state.closing)
    if not unreached(state.options, seen):
        return _close(state, "the goals are reached")
    if state.idle >= IDLE:
        return _close(state, f"the last {IDLE} regions changed nothing")
    left = state.options.regions - state.begun
    if left <= 0 and not state.growing:
        return _finish(state, seen, f"as many regions were grown as are asked for: {state.begun}")
    free = min(state.options.at_once - len(state.growing), left)
    chosen = _worth_it(state, (*_given(state, seen), *seen.proposals))[: max(free, 0)]
    begun, tried = dict(enumerate(chosen, state.begun)), (*state.tried, *(task.request for task in chosen))
    state = replace(state, begun=state.begun + len(begun), growing={**state.growing, **begun}, tried=tried)
    if state.growing:
        return Transition(replace(state, fruitless=0), Watch(begun))
    if state.fruitless + 1 < LOOKS:
        return Transition(replace(state, fruitless=state.fruitless + 1, looks=state.looks + 1), Scout())
    return _finish(state, seen, "nothing is left that could be tried")


def _after_regions(state: CoverState, report: Ended) -> Transition:
    """Notes the results of the regions, and looks again."""
    failed, why = dict(state.failed), dict(state.why)
    ended = {number: state.growing[number] for number in report.regions if number in state.growing}
    for number, task in ended.items():
        reason = report.regions[number]
        if reason is None:
            failed.pop(task.key, None)
        else:
            failed[task.key], why[task.key] = failed.get(task.key, 0) + 1, reason
    growing = {number: task for number, task in state.growing.items() if number not in ended}
    state = replace(state, growing=growing, failed=failed, why=why, idle=state.idle + len(ended))
    if state.closing is not None and growing:
        return Transition(state, Watch(stop=True))
    return Transition(replace(state, looks=state.looks + 1), Scout())


def _close(state: CoverState, reason: str) -> Transition:
    """Ends what grows, and looks a last time when that has ended. A cover that is ending already goes on with that."""
    state = replace(state, closing=state.closing or reason)
    if state.growing:
        return Transition(state, Watch(stop=True))
    if state.last is not None and reason != LATE:
        return _finish(state, state.last, reason)
    if state.last is None and reason == LATE:
        return Transition(state, Finish(False, f"{LATE} before the cover had looked at the scene", fruitless=True))
    return Transition(replace(state, looks=state.looks + 1), Scout())


def _finish(state: CoverState, seen: Scouted, reason: str) -> Transition:
    if state.moved is None and not seen.joined():
        return Transition(replace(state, closing=state.closing or reason), Move())
    missing = unreached(state.options, seen, state.moved or ())
    if not missing:
        by = ", by motions where regions do not lead" if state.moved else ""
        return Transition(state, Finish(True, f"the goals are reached{by}"))
    troubles = [*seen.obstacles, *(f"{key}: {said}" for key, said in state.why.items() if _is_given(key))]
    by_limit = state.closing == LATE or state.begun >= state.options.regions
    return Transition(state, Finish(False, "; ".join([reason, *missing, *troubles]), fruitless=not seen.regions or not by_limit))


def _given(state: CoverState, seen: Scouted) -> list[Task]:
    """Returns the given configurations that are in no region and that nothing grows around. After a failure the random seed is another."""
    options, growing = state.options, {task.key for task in state.growing.values()}
    connect = [Task(q, Purpose.CONNECT, i) for i, q in enumerate(options.connect) if seen.connect[i] is None]
    seeds = [Task(q, Purpose.SEED, i) for i, q in enumerate(options.seeds) if not seen.seeds[i]]
    return [replace(task, turn=state.failed.get(task.key, 0)) for task in (*seeds, *connect) if task.key not in growing]


def _worth_it(state: CoverState, tasks: Iterable[Task]) -> list[Task]:
    """Returns those of the tasks that did not fail too often, none of which asks for what was asked for before."""
    new: dict[str, Task] = {}
    for task in tasks:
        if state.failed.get(task.key, 0) < TRIES or task.purpose is Purpose.COVER:
            new.setdefault(task.request, task)
    return [task for request, task in new.items() if request not in state.tried]


def _is_given(key: str) -> bool:
    return key.startswith((Purpose.SEED, Purpose.CONNECT, Purpose.PATH, Purpose.JOIN, Purpose.LINK))


def _is_progress(before: Scouted, seen: Scouted) -> bool:
    """Returns whether more is covered, or less is apart, than before."""

    def apart(look: Scouted) -> int:
        return len({part for part in look.connect if part is not None}) + 2 * sum(part is None for part in look.connect)

    return (
        seen.covered > before.covered
        or len(seen.components) < len(before.components)
        or apart(seen) < apart(before)
        or sum(seen.seeds) > sum(before.seeds)
        or sum(seen.paths) > sum(before.paths)
    )


def _listed(name: str, numbers: list[int]) -> str:
    return ", ".join(f"{name}[{i}]" for i in numbers)


def _percent(share: float) -> str:
    return f"{100 * share:.4g} %"
