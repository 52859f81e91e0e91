"""This module measures how many pieces of work a fleet of workers gets from one database.

The workers are threads of a few processes. They do what solvers do, with the calls of solvers, but hold each piece for the seconds that
it is expected to take instead of certifying it. No messages are sent: a worker that finds nothing looks again.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import sys
import tempfile
import threading
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from benchmarks import measure
from benchmarks.measure import Progress
from benchmarks.store import PROOF_BYTES, begin
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, migrate, pairs
from db.session import Database, database

WARM_SECONDS = 5.0
"""The fleet is not measured before everybody has work."""
IDLE_SECONDS = 0.05


def fleet(
    postgresql: str | None, workers: int, pieces: int, seconds: float, limit: float, processes: int, progress: Progress
) -> dict[str, Any]:
    """Measures a fleet on SQLite, or on an empty PostgreSQL database if its URL is given. Returns the document of ``ciris bench fleet``.

    Args:
        workers: how many workers hold one piece each.
        pieces: how many undecided pieces one job has at the beginning.
        seconds: how long a worker holds a piece.
        limit: seconds after which measuring ends, unless the pieces are done before.
        processes: how many processes run the workers, as threads.
    """
    with ExitStack() as stack:
        url = postgresql or f"sqlite:///{Path(stack.enter_context(tempfile.TemporaryDirectory())) / 'fleet.sqlite3'}"
        migrate.upgrade(url)
        served = stack.enter_context(closing(Database(url)))
        job_id, _ = begin(served, pieces, seconds)
        context = multiprocessing.get_context("spawn")
        over, spent = context.Event(), context.Queue()
        shares = [workers // processes + (number < workers % processes) for number in range(processes)]
        children = [context.Process(target=_workers, args=(url, share, seconds, over, spent)) for share in shares]
        for child in children:
            child.start()
        while _open(served, job_id) > pieces - workers:  # processes begin, and load what they need
            time.sleep(0.1)
        time.sleep(WARM_SECONDS)
        start, left = time.monotonic(), _open(served, job_id)
        until, now = start + limit, left
        while time.monotonic() < until and now > workers:
            time.sleep(min(1.0, limit / 4))
            now = _open(served, job_id)
        took = time.monotonic() - start
        over.set()
        processor = sum(spent.get() for _ in children)
        for child in children:
            child.join()
    rate = (left - now) / took
    row = {
        "database": "PostgreSQL" if postgresql else "SQLite",
        "workers": workers,
        "pieces": pieces,
        "piece_seconds": seconds,
        "measured_seconds": took,
        "pieces_per_second": rate,
        "efficiency": rate * seconds / workers,
        "worker_cpu_ms_per_piece": 1e3 * processor / max(pieces - now, 1),
    }
    progress(
        f"{row['database']}, {workers} workers, {pieces} pieces of {seconds:g} s: {rate:.1f} pieces a second, "
        f"efficiency {row['efficiency']:.3f}, {row['worker_cpu_ms_per_piece']:.1f} ms of processor time a piece"
    )
    return {"benchmark": "fleet", "machine": measure.machine(), **row}


def _open(served: Database, job_id: str) -> int:
    """Returns how many pieces nobody has begun."""
    with served.read() as session:
        return jobs.get(session, job_id).open_pairs


def _workers(url: str, count: int, seconds: float, over: Any, spent: Any) -> None:
    """Runs ``count`` workers in this process until it is over. Puts the seconds of processor time that they took."""
    os.environ["CIRIS_DATABASE_URL"] = url
    sys.setswitchinterval(1e-4)  # who holds a lock of the database must not wait long for the interpreter
    database()  # before the workers, which share it
    threads = [threading.Thread(target=_work, args=(seconds, over), daemon=True) for _ in range(count)]
    for thread in threads:
        thread.start()
    over.wait()
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent.put(used.ru_utime + used.ru_stime)
    spent.close()
    spent.join_thread()
    os._exit(0)  # what the threads hold does not matter any more


def _work(seconds: float, over: Any) -> None:
    from workers.pairs import settle
    from workers.solver import claim_piece

    def held(claim: pairs.Claim, pair: pairs.Claimed) -> PairResult:
        time.sleep(seconds)
        return PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=seconds, margin=0.01, proof=pair.index.to_bytes(PROOF_BYTES))

    while not over.is_set():
        claim, _ = claim_piece()
        if isinstance(claim, pairs.Claim):
            settle(claim, held)
        else:
            time.sleep(IDLE_SECONDS)
