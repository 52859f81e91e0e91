"""This module measures what the database takes for one pair of work, in jobs with few pairs and with many.

It makes the calls of a solver, without what a solver does between them, on SQLite and on any PostgreSQL that is named.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import select

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier import stored
from certifier.growth.actions import Certify
from certifier.model import Polytope
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, leases, migrate, pairs, scenes, work
from db.models import PairRow
from db.session import Database

COUNTS = (1_000, 100_000)
REPEAT = 25
"""Each figure is the median of this many pairs, one after the other."""
PROOF_BYTES = 2_000


@dataclass(frozen=True)
class _Piece:
    """Says how many pairs were claimed together, and the seconds to claim them, to look whether they are wanted, and to save them."""

    pairs: int
    claim: float
    look: float
    save: float


def store(postgresql: str | None, counts: Sequence[int], progress: Progress) -> dict[str, Any]:
    """Measures SQLite and, if its URL is given, an empty PostgreSQL database. Returns the document of ``ciris bench store``.

    The times are by the clock, because a server works in another process.
    """
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as directory:
        urls = {"SQLite": f"sqlite:///{Path(directory) / 'store.sqlite3'}"} | ({"PostgreSQL": postgresql} if postgresql else {})
        for name, url in urls.items():
            migrate.upgrade(url)
            with closing(Database(url)) as database:
                for count in counts:
                    for row in _measured(database, count):
                        rows.append({"database": name, "pairs": count, **row})
                        progress(_line(rows[-1]))
    return {"benchmark": "store", "machine": measure.machine(), "repeat": REPEAT, "rows": rows}


def _measured(database: Database, count: int) -> Iterator[dict[str, Any]]:
    """Measures a job with ``count`` pairs: first none of them is settled, then half."""
    job_id, insert_seconds = begin(database, count, 1.0)
    yield {"settled": 0, "insert_seconds": insert_seconds, **_milliseconds(database)}
    settled = REPEAT
    while settled < count // 2:
        settled += _settle(database, seconds=min(10_000, count // 2 - settled)).pairs
    yield {"settled": settled, "insert_seconds": insert_seconds, **_milliseconds(database)}
    with database.write() as session:
        jobs.cancel(session, job_id)


def begin(database: Database, count: int, seconds: float) -> tuple[str, float]:
    """Makes a running job with ``count`` pairs that take ``seconds`` each. Returns its id and the seconds to insert the pairs.

    The state of its growth names every pair, as it does when proofs of earlier iterations hold.
    """
    with database.write() as session:
        scene_id = scenes.add(session, catalogue.scene("planar_2dof")).id
        job, _ = jobs.create(session, kind="grow", scene_id=scene_id, options={})
        jobs.start(session, job)
        jobs.keep_growth(session, job, {"cuts": {"holds": {str(index): 0 for index in range(count)}}})
        job_id = job.id
    start = time.perf_counter()
    with database.write() as session:
        action = Certify(0, "store", Polytope(np.array([[1.0], [-1.0]]), np.ones(2)), None, [*range(count)], {}, [], failures=1)
        new = [pairs.NewPair(index, f"a{index}", f"b{index}", seconds) for index in range(count)]
        pairs.add_iteration(session, jobs.lock(session, job_id), stored.document(action), new)
    return job_id, time.perf_counter() - start


def _milliseconds(database: Database) -> dict[str, float]:
    """Returns the milliseconds of each call of a solver that certifies one pair after the other."""
    pieces = [_settle(database, seconds=0.5) for _ in range(REPEAT)]
    return {f"{call}_ms": 1e3 * statistics.median(getattr(piece, call) for piece in pieces) for call in ("claim", "look", "save")}


def _settle(database: Database, seconds: float) -> _Piece:
    """Claims pairs that are expected to take this many seconds together, looks after them once, and saves them as certified."""
    start = time.perf_counter()
    with database.read() as session:
        job_id = work.next_job(session)
    assert job_id is not None, "the job has open pairs"
    with database.write() as session:
        claim = work.claim(session, job_id, lease_seconds=60.0, batch_seconds=seconds)
        work.next_job(session)
    assert isinstance(claim, pairs.Claim), "the job waits for pairs only"
    claimed = time.perf_counter()
    with database.read() as session:
        assert session.scalar(select(PairRow.id).where(leases.held(PairRow, claim.token)).limit(1)) is not None
    looked = time.perf_counter()
    proofs = {(pair.index, pair.part): pair.index.to_bytes(PROOF_BYTES) for pair in claim.pairs}
    results = {work: PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=1.0, margin=0.01, proof=proof) for work, proof in proofs.items()}
    before = time.perf_counter()
    with database.write() as session:
        pairs.save(session, claim, results)
    return _Piece(len(claim.pairs), claimed - start, looked - claimed, time.perf_counter() - before)


def _line(row: dict[str, Any]) -> str:
    return (
        f"{row['database']}, {row['pairs']} pairs, {row['settled']} of them settled: "
        f"claim {row['claim_ms']:.1f} ms, look {row['look_ms']:.1f} ms, save {row['save_ms']:.1f} ms; "
        f"inserted in {row['insert_seconds']:.1f} s"
    )
