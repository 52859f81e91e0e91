"""How many pairs are settled, out of all: with pairs that are reused, groups of pairs, and parts of pairs. On both databases."""

from __future__ import annotations

import random

import pytest
from sqlalchemy.orm import Session

from db import jobs, pairs, progress
from db.models import JobRow
from db.pairs import NewPair
from db.session import Database
from tests.db.builders import a_job, a_running_job, add_iteration, certified


def settled(session: Session, job: JobRow) -> tuple[int, int] | None:
    return progress.of_jobs(session, [job]).get(progress.version(job))


def test_a_job_without_iterations_has_none(db: Database) -> None:
    with db.write() as session:
        job = a_job(session)
        assert settled(session, job) is None


def test_reused_and_grouped_pairs_count_and_parts_are_one_pair(db: Database) -> None:
    new = [NewPair(0, "a", "b", 1.0), *(NewPair(1, "a", "c", 1.0, part) for part in range(3)), NewPair(4, "a", "d", 1.0)]
    asked = {"reuse": {7: 0, 8: 0}, "together": {0: (2, 3), 7: (9,)}, "parts": {1: 3}}
    with db.write() as session:
        job = a_running_job(session)
        add_iteration(session, job, index=1, label="contract", C=[[1.0]], d=[1.0], center=[0.0], pairs=new, **asked)
        session.flush()
        assert settled(session, job) == (3, 8), "pairs 7, 8 and 9 are reused; 0, 2, 3, 1 and 4 are open"


def test_settled_and_skipped_pairs(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session, pair_count=3)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=0.5)
        assert claim is not None
        assert settled(session, job) == (0, 3)
        pairs.save(session, claim, certified(0))
        assert settled(session, job) == (1, 3)
        pairs.skip(session, job)
        assert settled(session, job) == (1, 3), "what was skipped was not settled"


@pytest.mark.parametrize("random_seed", range(5))
def test_what_is_remembered_by_a_jobs_version_is_its_progress(db: Database, random_seed: int) -> None:
    """Whatever pairs, parts and iterations a job had, two states of it with one version have one progress."""
    choice, known, held = random.Random(random_seed), dict[progress.Version, tuple[int, int] | None](), list[pairs.Claim]()
    with db.write() as session:
        job = a_running_job(session)
    for index in range(60):
        with db.write() as session:
            job = jobs.get(session, job.id)
            match choice.choice(("claim", "claim", "save", "save", "give up", "skip", "iteration")):
                case "claim":
                    claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=choice.choice((0.5, 5.0)))
                    held += [] if claim is None else [claim]
                case "save" if held:
                    claim = held.pop(choice.randrange(len(held)))
                    pairs.save(session, claim, {(one.index, one.part): result for one in claim.pairs for result in certified(0).values()})
                case "give up" if held:
                    pairs.give_back(session, held.pop())
                case "skip":
                    pairs.skip(session, job)
                case "iteration" if job.open_pairs == job.running_pairs == 0:
                    many = choice.randrange(1, 5)
                    new = [NewPair(i, "a", str(i), 1.0, part) for i in range(many) for part in range(1 + i % 2)]
                    asked = {"parts": dict.fromkeys(range(1, many, 2), 2)}
                    job.turn += 1  # as whoever saves a transition of the growth does
                    add_iteration(session, job, index=index, label="push", C=[[1.0]], d=[1.0], center=[0.0], pairs=new, **asked)
        with db.read() as session:
            job = jobs.get(session, job.id)
            assert known.setdefault(progress.version(job), settled(session, job)) == settled(session, job)
    assert len(set(known.values())) > 2
