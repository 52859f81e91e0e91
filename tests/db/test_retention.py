"""What is deleted with scenes and jobs, what expires, and that nothing else goes."""

from __future__ import annotations

import json
import threading
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import func, select, text

from certifier.errors import CirisError
from db import jobs, pairs, projects, proofs, regions, retention, scenes, subtrees
from db.models import Base, JobRow, LibraryRow, ProofRow, RegionRow, SceneRow, WebhookRow
from db.session import Database, Session
from db.states import JobState, WebhookState, transition
from db.types import utcnow
from tests.db.builders import a_running_job, a_scene, add_region, all_pairs, certified

LEFT = {"projects", "libraries", "alembic_version"}
"""These rows stay when everything else is deleted."""


def an_ended_job(session: Session, *, with_region: bool, proof: bytes = b"of a pair") -> str:
    job = a_running_job(session, pair_count=1)
    claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=60)
    assert claim is not None
    pairs.save(session, claim, certified(0, proof))
    subtrees.keep(session, job.id, 0, {(0, 0): (b"cells", b"outline")})
    if with_region:
        add_region(session, job, proof=b"of a region")
    jobs.finish(session, job, JobState.SUCCEEDED, reason="done")
    return job.id


def counts(database: Database) -> dict[str, int]:
    with database.read() as session:
        every = {name: session.scalar(select(func.count()).select_from(table)) or 0 for name, table in Base.metadata.tables.items()}
    return {name: count for name, count in every.items() if count and name not in LEFT}


def test_a_scene_goes_with_all_that_depends_on_it_and_leaves_no_row(db: Database) -> None:
    with db.write() as session:
        scene_id = a_scene(session).id
        cover = a_running_job(session, pair_count=1)
        child, _ = jobs.create(session, kind="grow", scene_id=scene_id, options={}, parent_id=cover.id, number=1)
        for job in (child, cover):
            jobs.lock(session, job.id)
            jobs.start(session, job)
            jobs.finish(session, job, JobState.FAILED, reason="nothing found")
        again = jobs.retry(session, cover.id)
        jobs.cancel(session, again.id)
        an_ended_job(session, with_region=True)
        found = retention.of_scene(session, "slider")
        assert (found.jobs, found.unfinished, found.regions) == (4, 0, 1)
        assert found.bytes == len(b"of a pair") + len(b"of a region") + len(b"cells")
        with pytest.raises(CirisError, match=r"4 jobs, 1 region and 0\.0 MB") as refused:
            retention.delete_scene(session, scene_id, dependents=False)
        assert refused.value.code == "has_dependents"
    with db.write() as session:
        retention.delete_scene(session, scene_id, dependents=True)
    assert counts(db).keys() == {"solver_time"}, "deleting gives no time back"


def test_a_scene_that_nothing_depends_on_needs_no_more_words(db: Database) -> None:
    with db.write() as session:
        scene_id = a_scene(session).id
    with db.write() as session:
        with pytest.raises(CirisError, match="give all of its id"):
            retention.delete_scene(session, "slider", dependents=True)
        retention.delete_scene(session, scene_id, dependents=False)
    assert counts(db) == {}


def test_nothing_is_deleted_under_a_job_that_has_not_ended(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session)
        before = (job.id, job.scene_id)
    for delete, row_id in ((retention.delete_job, before[0]), (retention.delete_scene, before[1])):
        with db.write() as session, pytest.raises(CirisError) as refused:
            delete(session, row_id, dependents=True)
        assert refused.value.code == "not_ended"


def test_a_job_goes_alone_and_leaves_what_others_have(db: Database) -> None:
    with db.write() as session:
        gone, stays = (an_ended_job(session, with_region=False, proof=proof) for proof in (b"shared", b"shared"))
        other = an_ended_job(session, with_region=False, proof=b"its own")
    with db.write() as session:
        retention.delete_job(session, gone, dependents=False)
        retention.delete_job(session, other, dependents=False)
    with db.read() as session:
        assert [job.id for job in session.scalars(select(JobRow))] == [stays]
        assert proofs.get(session, proofs.digest(b"shared")) == b"shared"
        assert session.get(ProofRow, proofs.digest(b"its own")) is None


def test_a_version_of_a_library_never_comes_twice(db: Database) -> None:
    """An API process that has kept the regions of a deleted scene must not take them for those of the same scene added again."""
    with db.write() as session:
        an_ended_job(session, with_region=True)
        scene_id = a_scene(session).id
        before = regions.version(session, scene_id)
    with db.write() as session:
        retention.delete_scene(session, scene_id, dependents=True)
    with db.write() as session:
        assert a_scene(session).id == scene_id
        assert regions.roll(session, scene_id) == (before + 1, [])
        an_ended_job(session, with_region=True)
    with db.read() as session:
        version, ids = regions.roll(session, scene_id)
        assert (version, len(ids)) == (before + 2, 1)
        assert session.scalars(select(RegionRow.number)).all() == [version]
        assert session.scalar(select(func.count()).select_from(LibraryRow)) == 1


def test_what_is_old_expires_where_the_project_says_so(db: Database) -> None:
    later = utcnow() + timedelta(days=8)
    with db.write() as session:
        without, kept, running = (
            an_ended_job(session, with_region=False),
            an_ended_job(session, with_region=True),
            a_running_job(session).id,
        )
        assert not projects.some_expires(session)
        assert retention.expire(session, later) == 0
        projects.get(session, "default").keep_days = 7.0
        assert projects.some_expires(session)
        assert retention.expire(session, utcnow() + timedelta(days=6)) == 0
        assert retention.expire(session, later) == 2
        assert retention.expire(session, later) == 0
    with db.read() as session:
        assert set(session.scalars(select(JobRow.id))) == {kept, running}
        assert session.get(JobRow, without) is None
        assert len(regions.of_job(session, kept)) == 1
        assert len(all_pairs(session, kept)) == 0
        assert len(all_pairs(session, running)) == 4
        assert set(session.scalars(select(ProofRow.digest))) == {proofs.digest(b"of a region")}


@pytest.mark.parametrize("days", [projects.MOST_DAYS + 1, 1e6, 2.0**62])
def test_a_project_that_keeps_things_for_ever_stops_nobody(db: Database, days: float) -> None:
    """An earlier version took such numbers, and no date is as early."""
    with db.write() as session:
        an_ended_job(session, with_region=False)
        projects.add(session, "others").keep_days = days
        session.flush()
        assert not projects.some_expires(session)
        projects.get(session, "default").keep_days = 7.0
        assert retention.expire(session, utcnow() + timedelta(days=8)) == 1


def test_a_webhook_that_waits_is_not_dropped_without_a_word(db: Database) -> None:
    with db.write() as session:
        projects.get(session, "default").keep_days = 7.0
        job_id = an_ended_job(session, with_region=False)
        session.add(WebhookRow(id="w", job_id=job_id, url="https://example.org/", secret="sealed"))
        session.flush()
        assert (retention.of_job(session, job_id).webhooks, retention.of_scene(session, "slider").webhooks) == (1, 1)
        with pytest.raises(CirisError, match=rf"with job {job_id} go 1 waiting webhook and 0\.0 MB") as refused:
            retention.delete_job(session, job_id, dependents=False)
        assert refused.value.code == "has_dependents"
        assert retention.expire(session, utcnow() + timedelta(days=8)) == 0
        transition(session, WebhookRow, WebhookState.FAILED, WebhookRow.id == "w")
        assert retention.of_job(session, job_id).webhooks == 0
        assert retention.expire(session, utcnow() + timedelta(days=8)) == 1
    assert counts(db).keys() == {"scenes", "scene_names", "solver_time"}


def test_a_job_is_not_said_to_go_with_itself(db: Database) -> None:
    with db.write() as session:
        job_id = an_ended_job(session, with_region=True)
        with pytest.raises(CirisError, match=rf"with job {job_id} go 1 region and 0\.0 MB"):
            retention.delete_job(session, job_id, dependents=False)


def test_a_cover_expires_after_its_jobs(db: Database) -> None:
    with db.write() as session:
        projects.get(session, "default").keep_days = 7.0
        cover = a_running_job(session, pair_count=1)
        child, _ = jobs.create(session, kind="grow", scene_id=cover.scene_id, options={}, parent_id=cover.id, number=1)
        for job in (cover, child):
            jobs.lock(session, job.id)
            jobs.start(session, job)
            jobs.finish(session, job, JobState.FAILED, reason="nothing found")
        cover.finished_at = utcnow() - timedelta(days=9)
        assert retention.expire(session, utcnow()) == 0, "its region's job is not old enough"
        child.finished_at = utcnow() - timedelta(days=8)
        session.flush()
        assert [retention.expire(session, utcnow()) for _ in range(3)] == [1, 1, 0]
    with db.read() as session:
        assert session.scalar(select(func.count()).select_from(JobRow)) == 0
        assert session.scalar(select(func.count()).select_from(SceneRow)) == 1


def test_bytes_are_counted_by_project(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "others")
    with db.of("others").write() as session:
        an_ended_job(session, with_region=True)
    with db.read() as session:
        assert retention.stored(session, "default") == 0
        assert retention.stored(session, "others") > len(b"of a pair" + b"of a region" + b"cells") + 500, "the scene counts, too"


def test_what_jobs_were_asked_for_counts(db: Database) -> None:
    options = {"seed": {"contain": [[0.125] * 7] * 2000}}
    labels = {f"name{number}": "v" * 200 for number in range(20)}
    with db.write() as session:
        scene = a_scene(session)
        before = retention.stored(session, "default")
        job, _ = jobs.create(session, kind="grow", scene_id=scene.id, options=options, given_labels=labels)
        counted = retention.stored(session, "default") - before
        assert 0 < counted - len(json.dumps(options)) - len(json.dumps(labels)) <= jobs.ROW_BYTES + 10
        jobs.cancel(session, job.id)
        retention.delete_job(session, job.id, dependents=False)
        assert retention.stored(session, "default") == before


def test_counting_jobs_reads_no_row_of_them(db: Database) -> None:
    """Their options may be long."""
    counting = "SELECT sum(bytes) FROM jobs WHERE project = 'default'"
    with db.read() as session:
        if db.sqlite:
            (step,) = session.execute(text(f"EXPLAIN QUERY PLAN {counting}")).all()
            assert "COVERING INDEX ix_jobs_project_bytes" in step[-1]
        else:
            session.execute(text("SET enable_seqscan = off"))
            plan = session.scalars(text(f"EXPLAIN {counting}")).all()
            assert any("Index Only Scan using ix_jobs_project_bytes" in line for line in plan)


def test_the_file_of_an_sqlite_database_shrinks(tmp_path: Path, migrated_sqlite: Path) -> None:
    path = tmp_path / "shrinks.sqlite3"
    path.write_bytes(migrated_sqlite.read_bytes())
    database = Database(f"sqlite:///{path}")
    with database.write() as session:
        for i in range(40):
            proofs.put(session, [bytes([i]) * 2**20])
    with database.reader.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)").all()
    full = path.stat().st_size
    with database.write() as session:
        proofs.drop_unused(session, list(session.scalars(select(ProofRow.digest))))
    for _ in range(10):
        database.shrink()
    with database.reader.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)").all()
    assert full > 40 * 2**20
    assert path.stat().st_size < full / 4
    database.close()


def test_scenes_of_the_same_name_keep_their_names(db: Database) -> None:
    """A name means the scene of the version before when the scene of the last one is deleted."""
    with db.write() as session:
        first, second = a_scene(session, posts=1).id, a_scene(session, posts=2).id
        assert scenes.find(session, "slider") == second
        retention.delete_scene(session, second, dependents=False)
        assert scenes.find(session, "slider") == first


@pytest.mark.parametrize("first", ["create", "delete"])
def test_a_job_is_created_before_its_scene_is_deleted_or_not_at_all(db: Database, first: str) -> None:
    """Two transactions at once: the second one waits for the first."""
    with db.write() as session:
        scene_id = a_scene(session).id
    done: dict[str, str] = {}
    entered, others = threading.Event(), threading.Event()

    def create(session: Session) -> None:
        jobs.create(session, kind="grow", scene_id=scene_id, options={})

    def delete(session: Session) -> None:
        retention.delete_scene(session, scene_id, dependents=False)

    def act(name: str) -> None:
        try:
            with db.write() as session:
                {"create": create, "delete": delete}[name](session)
                if name == first:
                    entered.set()
                    others.wait(1.0)
            done[name] = "ok"
        except CirisError as error:
            done[name] = error.code
        others.set()

    one, other = threading.Thread(target=act, args=(first,)), threading.Thread(target=act, args=(({"create", "delete"} - {first}).pop(),))
    one.start()
    entered.wait()
    other.start()
    one.join()
    other.join()
    assert done == ({"create": "ok", "delete": "not_ended"} if first == "create" else {"delete": "ok", "create": "scene_not_found"})
