"""What a search has left of a pair is kept for the next iteration, apart from the proofs, and replaced by the pair's next result."""

from __future__ import annotations

import pytest
from sqlalchemy import func, select
from sqlalchemy.exc import NoResultFound

from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, leases, pairs, partitions
from db.models import PartitionRow, ProofRow
from db.session import Database
from tests.db.builders import a_running_job

CERTIFIED = PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=0.01, proof=b"proof")


def left(data: bytes, outcome: Outcome = Outcome.INCONCLUSIVE) -> PairResult:
    return PairResult(outcome, Stage.CELLS, partition=data, open_cells=3)


def begin(db: Database, pair_count: int = 1) -> str:
    with db.write() as session:
        return a_running_job(session, pair_count, failures=None).id


def claim(db: Database, job_id: str) -> pairs.Claim:
    with db.write() as session:
        found = pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=1e9)
    assert found is not None
    return found


def save(db: Database, held: pairs.Claim, *results: PairResult) -> None:
    with db.write() as session:
        pairs.save(session, held, dict(enumerate(results)))


def next_round(db: Database, job_id: str, index: int, pair_count: int = 1) -> pairs.Claim:
    with db.write() as session:
        job, new = jobs.lock(session, job_id), [pairs.NewPair(i, f"a{i}", f"b{i}", 1.0) for i in range(pair_count)]
        begun = dict.fromkeys(range(pair_count), index - 1)
        box, polytope = ([0.0], [1.0]), {"C": [[1.0], [-1.0]], "d": [1.0, 1.0], "center": None}
        pairs.add_iteration(
            session, job, index=index, label="cells", **polytope, pairs=new, reuse={}, hard=[], failures=None, box=box, begun=begun
        )
    return claim(db, job_id)


def read(db: Database, job_id: str, pair: int, iteration: int) -> bytes:
    with db.read() as session:
        return partitions.left_by(session, job_id, pair, iteration)


def stored(db: Database) -> tuple[int, int]:
    """How many partitions and how many proofs there are."""
    with db.read() as session:
        return tuple(session.scalar(select(func.count()).select_from(model)) or 0 for model in (PartitionRow, ProofRow))  # type: ignore[return-value]


@pytest.mark.parametrize("outcome", [Outcome.REFUTED, Outcome.TOO_CLOSE, Outcome.INCONCLUSIVE])
def test_what_is_left_is_kept_and_is_no_proof(db: Database, outcome: Outcome) -> None:
    job_id = begin(db, 2)
    save(db, claim(db, job_id), left(b"part", outcome), CERTIFIED)
    assert read(db, job_id, 0, 0) == b"part"
    assert stored(db) == (1, 1)
    with db.read() as session:
        rows = pairs.of_job(session, job_id)
        assert [(row.state, row.proof_digest is None, row.open_cells) for row in rows] == [(outcome, True, 3), ("certified", False, None)]
    with pytest.raises(NoResultFound):
        read(db, job_id, 1, 0)


def test_the_next_result_of_a_pair_replaces_what_the_last_one_left(db: Database) -> None:
    job_id = begin(db)
    save(db, claim(db, job_id), left(b"first"))
    save(db, next_round(db, job_id, 1), left(b"second"))
    assert read(db, job_id, 0, 1) == b"second"
    with pytest.raises(NoResultFound):
        read(db, job_id, 0, 0)
    assert stored(db) == (1, 0)
    save(db, next_round(db, job_id, 2), CERTIFIED)
    assert stored(db) == (0, 1)


def test_who_has_lost_the_pair_replaces_nothing(db: Database) -> None:
    job_id = begin(db)
    save(db, claim(db, job_id), left(b"first"))
    lost = next_round(db, job_id, 1)
    with db.write() as session:
        lease = leases.Lost(job_id, lost.token, "", "its process died", alone=False)
        pairs.release(session, jobs.lock(session, job_id), lease)
    save(db, lost, left(b"late"))
    assert read(db, job_id, 0, 0) == b"first"
    save(db, claim(db, job_id), left(b"second"))
    assert read(db, job_id, 0, 1) == b"second"


def test_other_jobs_and_pairs_keep_theirs(db: Database) -> None:
    one, two = begin(db, 2), begin(db)
    save(db, claim(db, one), left(b"one"), left(b"other"))
    save(db, claim(db, two), left(b"one"))
    with db.write() as session:
        partitions.keep(session, one, 1, {0: None})
    assert (read(db, one, 1, 0), read(db, two, 0, 0)) == (b"other", b"one")
    with db.write() as session:
        partitions.drop(session, one)
    assert read(db, two, 0, 0) == b"one"
    assert stored(db) == (1, 0)


def test_an_error_leaves_what_was_left_before(db: Database) -> None:
    job_id = begin(db)
    save(db, claim(db, job_id), left(b"first"))
    save(db, next_round(db, job_id, 1), PairResult(Outcome.ERROR, None, detail="lost"))
    assert read(db, job_id, 0, 0) == b"first"
