"""What searches have left of a pair is kept for later iterations, apart from the proofs, until the pair is certified or the job ends."""

from __future__ import annotations

import numpy as np
import pytest
from sqlalchemy import func, select

from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from certifier.polytopes.proved import ProvedBox
from db import jobs, leases, pairs, subtrees
from db.models import ProofRow, SubtreesRow
from db.session import Database
from tests.db.builders import a_running_job, add_iteration, all_pairs

CERTIFIED = PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=0.01, proof=b"proof")


BOX = ProvedBox(np.zeros(1), np.ones(1), np.array([[0.0, 0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0, 0.0]]))
"""The root cell of all partitions, with multipliers of the faces and the limits."""


def left(data: bytes, outcome: Outcome = Outcome.INCONCLUSIVE, outline: bytes | None = None) -> PairResult:
    return PairResult(outcome, Stage.CELLS, subtrees=data, outline=outline, open_cells=3)


def begin(db: Database, pair_count: int = 1) -> str:
    with db.write() as session:
        return a_running_job(session, pair_count, failures=None).id


def claim(db: Database, job_id: str) -> pairs.Claim:
    with db.write() as session:
        found = pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=1e9)
    assert found is not None
    return found


def save(db: Database, held: pairs.Claim, *results: PairResult) -> None:
    """Saves results of the claim's parts, in their order."""
    with db.write() as session:
        pairs.save(session, held, {(pair.index, pair.part): result for pair, result in zip(held.pairs, results, strict=True)})


def next_round(db: Database, job_id: str, index: int, parts: tuple[int, ...] = (1,)) -> pairs.Claim:
    """Claims all of a further iteration, in which the pairs have this many parts."""
    with db.write() as session:
        job = jobs.lock(session, job_id)
        new = [pairs.NewPair(i, f"a{i}", f"b{i}", 0.01, part) for i, count in enumerate(parts) for part in range(count)]
        box, polytope = BOX, {"C": [[1.0], [-1.0]], "d": [1.0, 1.0], "center": None}
        more = {"box": box, "begun": dict.fromkeys(range(len(parts)), 0), "parts": dict(enumerate(parts))}
        add_iteration(session, job, index=index, label="cells", **polytope, pairs=new, reuse={}, hard=[], failures=None, **more)
    return claim(db, job_id)


def read(db: Database, job_id: str, pair: int, iteration: int) -> list[bytes]:
    with db.read() as session:
        return subtrees.left_of(session, job_id, pair, iteration)


def stored(db: Database) -> tuple[int, int]:
    """How many subtrees and how many proofs there are."""
    with db.read() as session:
        return tuple(session.scalar(select(func.count()).select_from(model)) or 0 for model in (SubtreesRow, ProofRow))  # type: ignore[return-value]


@pytest.mark.parametrize("outcome", [Outcome.REFUTED, Outcome.TOO_CLOSE, Outcome.INCONCLUSIVE])
def test_what_is_left_is_kept_and_is_no_proof(db: Database, outcome: Outcome) -> None:
    job_id = begin(db, 2)
    save(db, claim(db, job_id), left(b"part", outcome), CERTIFIED)
    assert read(db, job_id, 0, 0) == [b"part"]
    assert stored(db) == (1, 1)
    with db.read() as session:
        rows = all_pairs(session, job_id)
        assert [(row.state, row.proof_digest is None, row.open_cells) for row in rows] == [(outcome, True, 3), ("certified", False, None)]
    assert read(db, job_id, 1, 0) == []


def test_what_the_parts_of_a_round_leave_is_read_in_their_order_whoever_was_faster(db: Database) -> None:
    job_id = begin(db, 2)
    save(db, claim(db, job_id), left(b"first"), CERTIFIED)
    held = next_round(db, job_id, 1, (3, 1))
    assert [(pair.index, pair.part) for pair in held.pairs] == [(0, 0), (0, 1), (0, 2), (1, 0)]
    with db.write() as session:
        pairs.save(session, held, {(0, 2): left(b"c"), (1, 0): CERTIFIED})
    with db.write() as session:
        pairs.save(session, held, {(0, 1): left(b"b"), (0, 0): left(b"a")})
    assert read(db, job_id, 0, 1) == [b"a", b"b", b"c"]
    assert read(db, job_id, 0, 0) == [b"first"], "rounds are put together in the end"


def test_the_first_part_of_a_certified_pair_has_its_proof(db: Database) -> None:
    job_id = begin(db)
    save(db, claim(db, job_id), left(b"first"))
    others = PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=None)
    save(db, next_round(db, job_id, 1, (3,)), CERTIFIED, others, others)
    with db.read() as session:
        proving = pairs.proving(session, job_id, {0: 1})
        assert {pair: (row.part, row.proof_digest is None) for pair, row in proving.items()} == {0: (0, False)}


def test_who_has_lost_the_pair_keeps_nothing(db: Database) -> None:
    job_id = begin(db)
    save(db, claim(db, job_id), left(b"first"))
    lost = next_round(db, job_id, 1)
    with db.write() as session:
        lease = leases.Lost(job_id, lost.token, "", "its process died", alone=False)
        pairs.release(session, jobs.lock(session, job_id), lease)
    save(db, lost, left(b"late"))
    assert read(db, job_id, 0, 1) == []
    save(db, claim(db, job_id), left(b"second"))
    assert (read(db, job_id, 0, 0), read(db, job_id, 0, 1)) == ([b"first"], [b"second"])


def test_dropping_leaves_the_pairs_named_and_other_jobs(db: Database) -> None:
    one, two = begin(db, 2), begin(db)
    save(db, claim(db, one), left(b"one"), left(b"other"))
    save(db, claim(db, two), left(b"two"))
    with db.write() as session:
        subtrees.drop(session, one, but=[1])
    assert (read(db, one, 0, 0), read(db, one, 1, 0), read(db, two, 0, 0)) == ([], [b"other"], [b"two"])
    with db.write() as session:
        subtrees.drop(session, one)
    assert read(db, two, 0, 0) == [b"two"]
    assert stored(db) == (1, 0)


def test_a_job_that_has_ended_keeps_the_outlines_of_what_it_has_not_certified(db: Database) -> None:
    job_id, other = begin(db, 3), begin(db)
    save(db, claim(db, other), left(b"other", outline=b"outline"))
    save(db, claim(db, job_id), left(b"zero", outline=b"o0"), left(b"one", outline=b"o1"), left(b"old"))
    save(db, next_round(db, job_id, 1, (2, 1, 1)), left(b"more", outline=b"p0"), left(b"rest", outline=b"p1"), CERTIFIED, left(b"older"))
    with db.write() as session:
        jobs.lock(session, job_id)
        subtrees.end(session, job_id)
    with db.read() as session:
        rows = session.execute(select(SubtreesRow.pair_index, SubtreesRow.data).where(SubtreesRow.job_id == job_id)).all()
        assert {*map(tuple, rows)} == {(0, b"")}
        assert subtrees.outlines(session, job_id, 0, 0, 1) == {0: {0: b"o0"}, 1: {0: b"p0", 1: b"p1"}}
        assert subtrees.outlines(session, job_id, 0, 1, 1) == {1: {0: b"p0", 1: b"p1"}}
        assert subtrees.outlines(session, job_id, 1, 0, 1) == {}
        assert pairs.parts_of(session, job_id, 0, [0, 1]) == {0: 1, 1: 2}
    assert read(db, other, 0, 0) == [b"other"]


def test_an_error_leaves_what_was_left_before(db: Database) -> None:
    job_id = begin(db)
    save(db, claim(db, job_id), left(b"first"))
    save(db, next_round(db, job_id, 1), PairResult(Outcome.ERROR, None, detail="lost"))
    assert read(db, job_id, 0, 0) == [b"first"]
