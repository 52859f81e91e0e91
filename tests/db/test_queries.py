"""Scenes, jobs, regions, proofs and events, on both databases."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import numpy as np
import pytest

from certifier.errors import CirisError, SceneError
from db import events, jobs, proofs, regions, scenes, steps
from db.models import JobRow, ProofRow, SceneRow
from db.session import Database
from db.states import JobState, StepState
from db.types import utcnow
from tests.db.builders import a_job, a_running_job, a_scene
from tests.scenes import slider

SIZE = {"value": 0.4, "stderr": 0.01, "unit": "m", "box_side": None}
SHARE = {"value": 0.25, "stderr": 0.01, "collision_free": 0.5, "samples": 100}
MANIFEST = {
    "volume": {"ellipsoid": 0.5},
    "q_volume": SIZE,
    "guarantee": "exact",
    "halfspace_normals": [[1.0], [-1.0]],
    "halfspace_offsets": [1.0, 1.0],
    "bounding_box": {"lower": [-1.0], "upper": [1.0]},
    "share": SHARE,
}
SUMMARY = {"q_volume": SIZE, "share": SHARE}


def test_a_scene_is_stored_once_and_comes_back_equal(db: Database) -> None:
    with db.write() as session:
        first = scenes.add(session, slider("one"))
    with db.write() as session:
        again = scenes.add(session, slider("two"))
    assert (again.id, again.name) == (first.id, "two") == (slider().hash[:16], "two")
    with db.read() as session:
        assert {scenes.find(session, name) for name in ("one", "two")} == {first.id}
        assert type(slider()).from_document(scenes.get(session, "one").document).hash == slider().hash
        assert [row.id for row in scenes.page(session).rows] == [first.id]


def test_scenes_whose_short_ids_collide_are_both_stored(db: Database) -> None:
    scene = slider()
    with db.write() as session:
        session.add(SceneRow(id=scene.hash[:16], name="other", hash="f" * 64, document={}))
    with db.write() as session:
        assert scenes.add(session, scene).id == scene.hash
    with db.write() as session:
        assert scenes.add(session, scene).id == scene.hash


def test_unknown_names_are_told(db: Database) -> None:
    with db.read() as session:
        with pytest.raises(SceneError, match="no scene 'x'"):
            scenes.get(session, "x")
        for get in (jobs.get, regions.get, proofs.get):
            with pytest.raises(CirisError, match="there is no"):
                get(session, "x")


def test_the_same_request_under_the_same_key_is_one_job_even_at_once(db: Database) -> None:
    with db.write() as session:
        scene_id = a_scene(session).id

    def create(_: int) -> tuple[str, bool]:
        with db.write() as session:
            job, made = jobs.create(session, kind="grow", scene_id=scene_id, options={}, idempotency_key="k", request_digest="d")
            return job.id, made

    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(create, range(16)))
    assert len({job_id for job_id, _ in made}) == 1
    assert sum(new for _, new in made) == 1
    with db.write() as session, pytest.raises(CirisError) as conflict:
        jobs.create(session, kind="grow", scene_id=scene_id, options={}, idempotency_key="k", request_digest="other")
    assert conflict.value.code == "idempotency_conflict"


def test_pages_hold_every_job_once_newest_first(db: Database) -> None:
    with db.write() as session:
        made = [a_job(session).id for _ in range(7)]
        same_time = utcnow()
        for job_id in made[2:5]:
            jobs.get(session, job_id).created_at = same_time
    found: list[str] = []
    after: str | None = None
    with db.read() as session:
        while True:
            page = jobs.page(session, state="queued", kind="grow", after=after, limit=2)
            found += [job.id for job in page.rows]
            after = page.next
            if after is None:
                break
        assert len(found) == len(set(found)) == 7
        times = [jobs.get(session, job_id).created_at for job_id in found]
        assert times == sorted(times, reverse=True)
        assert not jobs.page(session, state="failed").rows


def test_cancel_ends_a_queued_job_and_asks_a_running_one_to_end(db: Database) -> None:
    with db.write() as session:
        queued, running = a_job(session).id, a_running_job(session).id
    for _ in range(2):
        with db.write() as session:
            assert jobs.cancel(session, queued).state == JobState.CANCELLED
            assert jobs.cancel(session, running).state == JobState.CANCELLING
    with db.read() as session:
        assert [(e.seq, e.kind, e.data.get("state")) for e in events.since(session, queued)] == [
            (1, "job", "queued"),
            (2, "job", "cancelled"),
        ]
        assert [e.seq for e in events.since(session, running, seq=2)] == [3, 4]


def test_a_job_is_retried_once_and_only_when_it_has_failed(db: Database) -> None:
    with db.write() as session:
        job = a_job(session, deadline_seconds=100)
        with pytest.raises(CirisError, match="only a failed or cancelled"):
            jobs.retry(session, job.id)
        jobs.start(session, job)
        jobs.finish(session, job, JobState.FAILED, reason="no")
        again = jobs.retry(session, job.id)
        assert (again.retry_of, again.attempt, again.state) == (job.id, 2, "queued")
        assert again.deadline_at == again.created_at + timedelta(seconds=100)
        assert jobs.retry(session, job.id).id == again.id


def test_the_events_of_many_writers_are_numbered_without_gaps(db: Database) -> None:
    with db.write() as session:
        job_id = a_job(session).id

    def emit(i: int) -> None:
        with db.write() as session:
            events.emit(session, jobs.lock(session, job_id), "pairs", {"i": i})

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(emit, range(40)))
    with db.read() as session:
        rows = events.since(session, job_id)
        assert [row.seq for row in rows] == list(range(1, 42))
        assert {row.data["i"] for row in rows[1:]} == set(range(40))
        assert [row.seq for row in events.since(session, job_id, seq=5, limit=3)] == [6, 7, 8]


def test_a_region_is_its_jobs_latest_until_it_is_deleted(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session)
        earlier = regions.add(session, job, 0, MANIFEST, SUMMARY, b"first")
        assert (job.region_id, earlier.summary) == (earlier.id, SUMMARY)
        assert events.since(session, job.id)[-1].data["share"] == SHARE
        job_id, scene_id, region_id, digest = job.id, job.scene_id, earlier.id, earlier.proof_digest
    with db.read() as session:
        assert regions.roll(session, scene_id) == (1, [region_id])
        (stored,) = regions.polytopes(session, [region_id])
        np.testing.assert_array_equal(stored.C, [[1.0], [-1.0]])
        np.testing.assert_array_equal([stored.lower, stored.upper], [[-1.0], [1.0]])
        assert proofs.get(session, digest) == b"first"
        assert [row.id for row in regions.page(session, job_id=job_id).rows] == [region_id]
        assert not regions.page(session, scene_id="other").rows
    with db.write() as session:
        regions.delete(session, region_id)
    with db.read() as session:
        assert jobs.get(session, job_id).region_id is None
        assert session.get(ProofRow, digest) is None
        assert regions.roll(session, scene_id) == (2, [])
        assert regions.version(session, scene_id) == 2


def test_times_keep_their_zone_and_numbers_that_json_lacks_are_refused(db: Database) -> None:
    with db.write() as session:
        job_id = a_job(session).id
    with db.read() as session:
        created = jobs.get(session, job_id).created_at
        assert created.utcoffset() == timedelta(0)
        assert abs(created - utcnow()) < timedelta(minutes=1)
    with pytest.raises(Exception, match="JSON compliant"), db.write() as session:
        jobs.get(session, job_id).options = {"x": float("nan")}


def test_a_job_that_awaits_coordination_is_found(db: Database) -> None:
    now = utcnow()
    with db.write() as session:
        queued, busy, idle, cancelling = (
            a_job(session),
            a_running_job(session),
            a_running_job(session, pair_count=0),
            a_running_job(session),
        )
        jobs.cancel(session, cancelling.id)
        overdue = a_running_job(session)
        overdue.deadline_at = now - timedelta(seconds=1)
        held = a_job(session)
        held.coordinator, held.coordinator_until = "elsewhere:1:1", now + timedelta(seconds=60)
        ending, accepted, late = (a_running_job(session, pair_count=0) for _ in range(3))
        for job in (ending, accepted, late):
            step, job.accept_after = steps.add(session, job, "accept", {}), now
            jobs.next_turn(job, jobs.finishing("certified", "done"))
            if job is accepted:
                step.state = StepState.DONE
        late.accept_after = now + timedelta(seconds=60)  # its end has to be told not to wait for the next region
        goes_on = a_running_job(session, pair_count=0)
        steps.add(session, goes_on, "accept", {})
        due = {queued.id, idle.id, cancelling.id, overdue.id, accepted.id, late.id, goes_on.id}
        assert busy.state == JobState.RUNNING
    with db.read() as session:
        assert set(jobs.awaiting_coordination(session, now)) == due
        assert isinstance(jobs.get(session, queued.id), JobRow)
