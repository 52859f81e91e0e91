"""This module says in words what holds the region of a job back: pairs that are not certified, and pairs for which something was cut off.

What a verified proof says is called proved; what the search has found in floating point, or samples say, is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy.orm import Session

from certifier import stored
from certifier.conditions import called, condition_named, fails
from certifier.growth import obstacles as growth
from certifier.growth.whole import in_words
from certifier.model import Pair, Scene
from certifier.outcome import Outcome
from db import jobs, pairs
from db.models import JobRow, PairRow
from db.session import Database
from db.states import PairState
from jobs.kind import Held, Kind

WORST = (PairState.REFUTED, PairState.NOT_CERTIFIABLE, PairState.TOO_CLOSE, PairState.ERROR, PairState.INCONCLUSIVE)
"""How pairs fail, the worst first."""
SEEN = 1e-4
"""Of a smaller share of a polytope, samples say little."""


def of_job(database: Database, scene: Scene, kind: Kind, job: JobRow) -> list[Held]:
    """Returns what holds a job back, worst first. Of a job that has ended badly, it is at least the reason."""
    with database.read() as session:
        found = kind.held(session, scene, job)
    ended_badly = job.region_id is None and job.finished_at is not None and job.outcome != Outcome.CERTIFIED
    return found or ([Held(_said(job), _seed(job))] if ended_badly and _said(job) else [])


def of_growth(session: Session, scene: Scene, job: JobRow) -> list[Held]:
    """Returns what holds the region of a job back: pairs that are not certified, and pairs for which something was cut off."""
    cut, failed = _cut(jobs.growth(session, job.id) or {}), pairs.lately_failed(session, job.id)
    rated = [(_rank(job, cut.get(i), failed.get(i, [])), i) for i in cut.keys() | failed.keys()]
    return [_of_pair(scene, i, cut.get(i), failed.get(i, [])) for _, i in sorted(rated)]


def of_motion(scene: Scene, stop: dict[str, Any], how: str) -> Held:
    """Returns the first place on a motion that could not be certified; ``how`` says what the two bodies do there."""
    pair = Pair(stop["a"], stop["b"])
    at = in_words(scene, stop["q"])
    text = f"{fails(pair.a, pair.b, how)} at {at}, the first configuration on the motion that could not be certified."
    index = scene.pairs.index(pair) if pair in scene.pairs else None
    return Held(text, stop["q"], index, pair.a, pair.b, at=at)


def _cut(known: dict[str, Any]) -> dict[int, growth.Obstacle]:
    """Returns pair index -> what was cut off for it, from the state of a growth, which may be of an earlier version."""
    if "obstacles" in known:
        return {int(pair): stored.value(growth.Obstacle, one) for pair, one in known["obstacles"].items()}
    times = (known.get("whole") or {}).get("cuts") or (known.get("cuts") or {}).get("attempts") or {}
    return {int(pair): growth.Obstacle(stage=0, times=count) for pair, count in times.items()}


def _rank(job: JobRow, cut: growth.Obstacle | None, failed: Sequence[PairRow]) -> tuple[bool, int, float, int]:
    """Returns by what obstacles are ordered, the least first."""
    state, cells = _worst(failed), sum(row.open_cells or 0 for row in failed)
    fatal = job.region_id is None and job.finished_at is not None and state is not None
    severity = len(WORST) if state is None else WORST.index(state)
    lost = 0.0 if cut is None else cut.lost or 1e-6 * cut.times
    return (False, severity, -lost, -cells) if fatal else (True, 0, -lost, 1000 * severity - cells)


def _worst(failed: Sequence[PairRow]) -> PairState | None:
    return min((PairState(row.state) for row in failed), key=WORST.index, default=None)


def _of_pair(scene: Scene, index: int, cut: growth.Obstacle | None, failed: Sequence[PairRow]) -> Held:
    pair, state = scene.pairs[index], _worst(failed)
    row = next((row for row in failed if row.state == state), None)
    witness = None if row is None else row.witness_s
    s = witness or (None if cut is None else cut.s)
    q = None if s is None else scene.to_q(s).tolist()
    at = None if q is None else in_words(scene, q)
    sentences = [] if row is None or state is None else [_how_it_failed(pair, state, row, failed, at if witness else None)]
    if cut is not None:
        more, names = _what_was_cut(pair, cut, at if witness is None else None), called(pair.a, pair.b)
        # Nobody reads the two names twice.
        short = bool(sentences) and condition_named(pair.a, pair.b) is None
        sentences += [f"They{text.removeprefix(names)}" if short and text.startswith(names) else text for text in more]
    text = " ".join(sentences)
    return Held(
        pair=index,
        a=pair.a,
        b=pair.b,
        text=text,
        q=q,
        faces=None if cut is None else cut.faces,
        lost=None if cut is None else cut.lost,
        at=at if at and at in text else None,
    )


def _how_it_failed(pair: Pair, state: PairState, row: PairRow, failed: Sequence[PairRow], at: str | None) -> str:
    """Says how a pair failed, and where, if ``at`` names a configuration."""
    names, there = called(pair.a, pair.b), f" at {at}" if at else ""
    detail = f": {row.detail}" if row.detail else ""
    match state:
        case PairState.REFUTED:
            return f"{fails(pair.a, pair.b)}{there}, which is proved."
        case PairState.NOT_CERTIFIABLE:
            return f"It is proved that no certificate of the form of the program (11) exists for {names}; cells may certify them."
        case PairState.TOO_CLOSE:
            return f"{fails(pair.a, pair.b, 'come too close')}{there}{detail}, as floating point says."
        case PairState.ERROR:
            return f"{names} could not be certified{detail}."
        case _:
            cells = sum(part.open_cells or 0 for part in failed)
            some = (
                f": {'1 cell is' if cells == 1 else f'{cells} cells are'} open in {len(failed)} parts"
                if len(failed) > 1 and cells
                else detail
            )
            return f"{names} are not certified{some}."


def _what_was_cut(pair: Pair, cut: growth.Obstacle, at: str | None) -> list[str]:
    """Says what was cut off for a pair, and how the pair failed, if ``at`` names the configuration."""
    sentences = []
    if at and cut.contact:
        sentences.append(f"{fails(pair.a, pair.b)} at {at}, as floating point says.")
    elif at:
        apart = "" if condition_named(pair.a, pair.b) else " apart"
        sentences.append(f"{called(pair.a, pair.b)} could not be proved{apart} near {at}.")
    if cut.faces is None or cut.lost is None:
        return [*sentences, f"Something was cut off for {called(pair.a, pair.b)} {_times(cut.times)}."]
    faces = "1 face was" if cut.faces == 1 else f"{cut.faces} faces were"
    lost = f"{100 * cut.lost:.2g} %" if cut.lost >= SEEN else "less than 0.01 %"
    return [*sentences, f"{faces} added or moved in for this pair, and cut off {lost} of the polytope, as samples say."]


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _said(job: JobRow) -> str:
    """Returns why a job has ended."""
    return str((job.error or {}).get("message") or job.reason or "")


def _seed(job: JobRow) -> list[float] | None:
    """Returns the seed of a job that has ended because it collides, or is outside the limits."""
    is_seed = str((job.error or {}).get("field")) == "seed.q"
    q = job.options.get("seed", {}).get("q")
    return q if is_seed and q and isinstance(q[0], int | float) else None
