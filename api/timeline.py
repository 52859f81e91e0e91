"""This module tells what processes have done for a job over time, from the job's events.

An event of pairs comes when they are saved, and names what a process did one after the other. So the last of them ended then, and each
began when the one before it ended. A step ended when its event came. The notes of a map's leader say what processes did for it.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from sqlalchemy.orm import Session

from api.schemas.timeline import BINS, MOST_BARS, MOST_PROCESSES, Bar, Rate, TimeLeft, Timeline
from certifier.errors import CirisError
from db import clock, events, jobs, pairs
from db.models import JobRow
from db.session import Database
from db.states import IterationState

ENOUGH = 20
"""Until this many pieces of an iteration are settled, the time that is left is null."""
SHORTEST = 1e-6
"""A part of the time lasts at least this many seconds."""
PAIRS, LOST, SHARED = "pairs", "lost", "piece"


class Piece(NamedTuple):
    """A piece of work of a process, in seconds since the job's start. ``seconds`` is less than it lasted where the process also waited."""

    process: str
    begin: float
    end: float
    seconds: float
    work: str
    state: str
    iteration: int | None = None
    pair: int | None = None
    cells: int = 0
    """At how many cells a search looked."""


def of_job(db: Database, job_id: str, since: float, until: float | None) -> Timeline:
    """Returns what was done for a job from ``since`` to ``until``, in seconds since its start; None for its end, or for now.

    Raises:
        CirisError: job_not_found, ambiguous_id; invalid_request, when ``until`` is not after ``since``.
    """
    if until is not None and until <= since:
        raise CirisError("invalid_request", f"{until:g} is not after {since:g}", field="until", hint="give seconds since the job's start")
    with db.read() as session:
        job = jobs.get(session, job_id)
        now = clock.now(session)
        rows = events.work(session, job.id)
        left = None if job.finished_at is not None else _left(session, job, now)
    start = job.started_at or job.created_at
    whole = max(((job.finished_at or now) - start).total_seconds(), 0.0)
    since, end = min(since, whole), whole if until is None else min(until, whole)
    pieces = [piece for piece in _pieces(rows, start) if piece.end >= since and piece.begin <= end]
    busy: defaultdict[str, float] = defaultdict(float)
    for piece in pieces:
        busy[piece.process] += piece.seconds
    told = sorted(sorted(busy, key=lambda process: (-busy[process], process))[:MOST_PROCESSES])
    number = {process: i for i, process in enumerate(told)}
    shown = [piece for piece in pieces if piece.process in number]
    together = len(shown) > MOST_BARS
    bars = _binned(shown, number, since, end) if together else [_bar(piece, number) for piece in shown]
    return Timeline(
        seconds=whole,
        begin=since,
        end=end,
        processes=told,
        others=len(busy) - len(told),
        bars=sorted(bars, key=lambda bar: (bar.process, bar.begin)),
        together=together,
        rates=_rates(pieces, _looked(rows, start), since, end),
        left=left,
    )


def _pieces(rows: Sequence[Any], start: datetime) -> Iterator[Piece]:
    """Gives the pieces of work that events tell of."""
    noted = 0.0
    for kind, data, at in rows:
        end, process = (at - start).total_seconds(), data.get("worker") or ""
        if kind == PAIRS:
            begin = end - sum(pair["seconds"] for pair in data["pairs"])
            for pair in data["pairs"]:
                ended = begin + pair["seconds"]
                yield Piece(
                    process, begin, ended, pair["seconds"], PAIRS, pair["state"], data["iteration"], pair["index"], pair.get("cells", 0)
                )
                begin = ended
        elif kind == "step" and data.get("seconds") is not None:
            yield Piece(process, end - data["seconds"], end, data["seconds"], data["kind"], data["state"])
        elif kind == LOST:
            yield Piece(process, end, end, 0.0, LOST, LOST)
        elif kind == events.NOTE and "work" in data:
            for process, seconds in data["work"].items():
                yield Piece(process, max(noted, 0.0), end, min(seconds, end - noted), SHARED, "done")
            noted = end


def _bar(piece: Piece, number: dict[str, int]) -> Bar:
    told = {key: value for key, value in piece._asdict().items() if key in Bar.model_fields}
    return Bar(**{**told, "process": number[piece.process]}, pieces=1)


def _binned(pieces: Sequence[Piece], number: dict[str, int], since: float, until: float) -> list[Bar]:
    """Returns bars of several pieces each: of each process, one for each part of the time in which it worked."""
    width = max(until - since, SHORTEST) / BINS
    spent: defaultdict[tuple[int, int], defaultdict[tuple[str, str], float]] = defaultdict(lambda: defaultdict(float))
    counts: Counter[tuple[int, int]] = Counter()
    for piece in pieces:
        first, last = (min(max(int((at - since) / width), 0), BINS - 1) for at in (piece.begin, piece.end))
        lasted = piece.end - piece.begin
        for place in range(first, last + 1):
            within = min(piece.end, since + (place + 1) * width) - max(piece.begin, since + place * width)
            part = max(within, 0.0) / lasted if lasted > 0.0 else 1.0
            spent[number[piece.process], place][piece.work, piece.state] += part * piece.seconds
        counts[number[piece.process], last] += 1
    return [
        Bar(
            process=process,
            begin=since + place * width,
            end=since + (place + 1) * width,
            seconds=min(sum(kinds.values()), width),
            work=max(kinds, key=lambda kind: kinds[kind])[0],
            state=max(kinds, key=lambda kind: kinds[kind])[1],
            pieces=counts[process, place],
            iteration=None,
            pair=None,
        )
        for (process, place), kinds in spent.items()
    ]


def _looked(rows: Sequence[Any], start: datetime) -> list[tuple[float, int]]:
    """Returns (seconds, how many cells of the map were looked at until then), as the notes of a map tell it."""
    return [((at - start).total_seconds(), data["cells"]) for kind, data, at in rows if kind == events.NOTE and "cells" in data]


def _rates(pieces: Sequence[Piece], looked: Sequence[tuple[float, int]], since: float, until: float) -> list[Rate]:
    """Returns how fast pairs were settled and cells looked at, in parts of the time; of a map how fast cells were, from note to note."""
    settled = [piece for piece in pieces if piece.work == PAIRS and since <= piece.end <= until]
    if looked:
        steps = zip([(0.0, 0), *looked], looked, strict=False)
        known = [(a, b, (after - before) / (b - a)) for (a, before), (b, after) in steps if b > a and b >= since and a <= until]
        many = max(len(known) // BINS, 1)
        groups = [known[i : i + many] for i in range(0, len(known), many)]
        return [
            Rate(
                begin=some[0][0], end=some[-1][1], pieces=0.0, cells=sum((b - a) * rate for a, b, rate in some) / (some[-1][1] - some[0][0])
            )
            for some in groups
        ]
    width = max(until - since, SHORTEST) / BINS
    if not settled:
        return []
    counts, cells = Counter[int](), Counter[int]()
    for piece in settled:
        place = min(int((piece.end - since) / width), BINS - 1)
        counts[place] += 1
        cells[place] += piece.cells
    searched = any(piece.cells for piece in settled)
    return [
        Rate(
            begin=since + place * width,
            end=since + (place + 1) * width,
            pieces=counts[place] / width,
            cells=cells[place] / width if searched else None,
        )
        for place in range(BINS)
    ]


def _left(session: Session, job: JobRow, now: datetime) -> TimeLeft | None:
    """Estimates how long the job's iteration will last; None where none runs, or too little is known."""
    known = pairs.iterations(session, job.id)
    if not known or known[-1].state != IterationState.RUNNING:
        return None
    iteration = known[-1]
    pace = pairs.pace(session, job.id, iteration.index)
    lasted = (now - iteration.started_at) / timedelta(seconds=1)
    if pace is None or pace.settled < ENOUGH or pace.left == 0 or pace.spent <= 0.0 or lasted <= 0.0:
        return None
    a_second = lasted / pace.spent
    return TimeLeft(
        iteration=iteration.index, seconds=pace.expected * a_second, error=pace.error * a_second, settled=pace.settled, left=pace.left
    )
