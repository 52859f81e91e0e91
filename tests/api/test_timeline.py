"""What processes did for a job over time: from its events, in bounded size, with an estimate of the time that is left."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import insert, select

from api.schemas.timeline import BINS, MOST_BARS, MOST_PROCESSES
from certifier.model import Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import events, jobs, pairs, scenes, steps, work
from db.leases import this_worker
from db.models import EventRow, IterationRow
from db.session import Database
from db.states import StepState
from tests.api.test_conditions import upright
from tests.db.builders import a_running_job, add_iteration

__all__ = ["upright"]


def result(outcome: Outcome = Outcome.CERTIFIED, seconds: float = 0.5) -> PairResult:
    proof = b"proof" if outcome is Outcome.CERTIFIED else None
    return PairResult(outcome, Stage.SOS, seconds=seconds, margin=0.01 if proof else None, proof=proof)


def begun(database: Database, job_id: str, seconds: float) -> None:
    """Sets when the job and its iteration began: this long before now."""
    with database.write() as session:
        job = jobs.lock(session, job_id)
        assert job.started_at is not None
        job.started_at -= timedelta(seconds=seconds)
        for row in session.scalars(select(IterationRow).where(IterationRow.job_id == job_id)):
            row.started_at -= timedelta(seconds=seconds)


def test_pairs_and_steps_are_told_with_their_process(client: TestClient, database: Database) -> None:
    with database.write() as session:
        job = a_running_job(session, 3, failures=None)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=2.0)
        assert claim is not None
        pairs.save(session, claim, {(0, 0): replace(result(), looked=30), (1, 0): replace(result(Outcome.INCONCLUSIVE, 1.5), looked=12)})
        steps.add(session, job, "propose", {})
        held = steps.claim(session, job, accepts=False, lease_seconds=60)
        assert held is not None
        steps.save(session, held, StepState.DONE, {}, 0.25)
    begun(database, job.id, 10.0)
    told = client.get(f"/v1/jobs/{job.id}/timeline").json()
    assert (told["processes"], told["others"], told["together"], told["left"]) == ([this_worker()], 0, False, None)
    first, second, step = sorted(told["bars"], key=lambda bar: (bar["work"], bar["begin"]))
    assert [(bar["work"], bar["pair"], bar["iteration"], bar["state"]) for bar in (first, second, step)] == [
        ("pairs", 0, 0, "certified"),
        ("pairs", 1, 0, "inconclusive"),
        ("propose", None, None, "done"),
    ]
    assert first["end"] == pytest.approx(second["begin"]), "a process does one after the other"
    assert [bar["end"] - bar["begin"] for bar in (first, second, step)] == pytest.approx([0.5, 1.5, 0.25])
    assert 10.0 < second["end"] <= told["seconds"]
    assert sum(rate["pieces"] * (rate["end"] - rate["begin"]) for rate in told["rates"]) == pytest.approx(2.0)
    assert sum(rate["cells"] * (rate["end"] - rate["begin"]) for rate in told["rates"]) == pytest.approx(42.0)
    part = client.get(f"/v1/jobs/{job.id}/timeline", params={"since": 0, "until": second["begin"] - 0.1}).json()
    assert [bar["pair"] for bar in part["bars"]] == [0]
    assert client.get(f"/v1/jobs/{job.id}/timeline", params={"since": 2, "until": 1}).json()["field"] == "until"


def test_much_work_of_many_processes_is_told_together(client: TestClient, database: Database) -> None:
    """100 000 pairs by 100 processes: the answer stays small, and no second of work is lost but of the processes left out."""
    processes, batches, batch = 100, 10, 100
    with database.write() as session:
        job = a_running_job(session, 1, failures=None)
        assert job.started_at is not None
        job.started_at -= timedelta(seconds=11)
        rows = [
            {
                "job_id": job.id,
                "seq": 100 + number,
                "kind": "pairs",
                "data": {
                    "iteration": 0,
                    "worker": f"host:{number % processes}:1",
                    "pairs": [{"index": i, "part": 0, "state": "certified", "seconds": 0.01} for i in range(batch)],
                },
                "created_at": job.started_at + timedelta(seconds=1.0 + number // processes),
            }
            for number in range(processes * batches)
        ]
        session.execute(insert(EventRow), rows)
    answer = client.get(f"/v1/jobs/{job.id}/timeline", params={"until": 10.0})
    told = answer.json()
    assert {rate["cells"] for rate in told["rates"]} == {None}, "nobody has said how many cells there were"
    assert (len(told["processes"]), told["others"], told["together"]) == (MOST_PROCESSES, processes - MOST_PROCESSES, True)
    assert len(told["bars"]) <= MOST_PROCESSES * BINS
    assert len(answer.content) < 2**21
    assert sum(bar["pieces"] for bar in told["bars"]) == MOST_PROCESSES * batches * batch
    assert sum(bar["seconds"] for bar in told["bars"]) == pytest.approx(MOST_PROCESSES * batches, rel=0.01)
    closer = client.get(f"/v1/jobs/{job.id}/timeline", params={"since": 1.0, "until": 1.1}).json()
    assert not closer["together"]
    assert len(closer["bars"]) <= MOST_BARS
    assert {bar["pieces"] for bar in closer["bars"]} == {1}


def test_time_left_has_an_error_and_waits_until_enough_is_known(client: TestClient, database: Database) -> None:
    with database.write() as session:
        job = a_running_job(session, 60, failures=None)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=40)
        assert claim is not None
        few = {(i, 0): result(seconds=2.0 + (-1) ** i) for i in range(10)}
        pairs.save(session, claim, few)
    begun(database, job.id, 20.0)
    assert client.get(f"/v1/jobs/{job.id}/timeline").json()["left"] is None
    with database.write() as session:
        pairs.save(session, claim, {(i, 0): result(seconds=2.0 + (-1) ** i) for i in range(10, 40)})
    left = client.get(f"/v1/jobs/{job.id}/timeline").json()["left"]
    assert (left["iteration"], left["settled"], left["left"]) == (0, 40, 20)
    # 80 s of work were done in 20 s; 20 pieces of 2 s each are left, and vary by 1 s each.
    assert left["seconds"] == pytest.approx(10.0, rel=0.1)
    assert left["error"] == pytest.approx((20 + 40 * 0.25) ** 0.5 / 4, rel=0.1)


def test_a_map_tells_cells_a_second_and_who_worked(client: TestClient, database: Database, planar: Scene) -> None:
    with database.write() as session:
        job, _ = jobs.create(session, kind="map", scene_id=scenes.get(session, "planar").id, options={})
        jobs.start(session, job)
        for cells in (100, 400):
            events.emit(session, job, events.NOTE, {"text": "far", "part": 0.1, "cells": cells, "work": {"host:1:1": 1.5}})
            at = job.started_at + timedelta(seconds=cells / 100)
            session.scalars(select(EventRow).where(EventRow.job_id == job.id).order_by(EventRow.seq.desc())).first().created_at = at
        jobs.finish(session, job, jobs.JobState.SUCCEEDED, reason="as asked", outcome="certified")
        job.finished_at = job.started_at + timedelta(seconds=5)
    told = client.get(f"/v1/jobs/{job.id}/timeline").json()
    assert [rate["cells"] for rate in told["rates"]] == pytest.approx([100.0, 100.0])
    assert [(bar["work"], bar["seconds"]) for bar in told["bars"]] == [("piece", 1.0), ("piece", 1.5)]


def test_what_a_process_lost_is_told(client: TestClient, database: Database) -> None:
    with database.write() as session:
        job = a_running_job(session, 1)
        events.emit(session, job, "lost", {"worker": "host:7:1", "reason": "its process died", "iteration": 0, "pairs": [0]})
    (bar,) = client.get(f"/v1/jobs/{job.id}/timeline").json()["bars"]
    assert (bar["work"], bar["state"], bar["seconds"]) == ("lost", "lost", 0.0)


def test_events_give_no_distance_for_a_condition(client: TestClient, database: Database, upright: Scene) -> None:
    """What stands for a condition is no body: the least slack of its planes is no distance in metres."""
    with database.write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=scenes.get(session, "planar").id, options={"seed": {"q": [0.0, 0.0]}})
        jobs.start(session, job)
        new = [pairs.NewPair(index, pair.a, pair.b, 0.1) for index, pair in enumerate(upright.pairs)]
        add_iteration(session, job, index=0, label="proposal", C=[[1.0, 0.0]], d=[1.0], center=[0.0, 0.0], pairs=new)
        claim = work.claim(session, job.id, lease_seconds=60, batch_seconds=60)
        assert isinstance(claim, pairs.Claim)
        pairs.save(session, claim, {(pair.index, 0): result() for pair in new})
    (event,) = (one for one in client.get(f"/v1/jobs/{job.id}/events").json()["events"] if one["kind"] == "pairs")
    for pair in event["data"]["pairs"]:
        of_condition = "conditions/" in str(upright.pairs[pair["index"]])
        assert (pair["proved_distance"] is None, pair["margin"] is None) == (of_condition, of_condition)


def test_an_iteration_counts_all_pairs_and_those_that_share_a_proof(client: TestClient, database: Database) -> None:
    with database.write() as session:
        job = a_running_job(session, 1)
        new = [pairs.NewPair(0, "a", "b", 1.0), pairs.NewPair(5, "c", "d", 1.0)]
        shared = {0: (1, 2, 3)}
        add_iteration(session, job, index=1, label="stage", C=[[1.0]], d=[1.0], pairs=new, together=shared)
    last = client.get(f"/v1/jobs/{job.id}/events").json()["events"][-1]["data"]
    assert (last["pairs"], last["together"], last["parts"]) == (5, 3, 2)
