"""What every project has, and its limits, on both databases."""

from __future__ import annotations

from datetime import timedelta
from threading import Thread

from db import audit, inventory, jobs, keys, projects, retention, workers
from db.inventory import Contents
from db.keys import Scope
from db.models import ApiKeyRow
from db.session import Database
from db.states import WorkerState
from db.types import utcnow
from db.workers import Alike, Made, WorkerKind
from tests.db.builders import a_job, a_running_job, add_region


def test_each_project_has_what_it_has(db: Database) -> None:
    with db.write() as session:
        for name in ("empty", "others"):
            projects.add(session, name)
    with db.of("others").write() as session:
        a_job(session)
        begun = a_running_job(session)
        jobs.claimed(begun)
        jobs.create(session, kind="grow", scene_id=begun.scene_id, options={}, parent_id=begun.id, number=1)
        region = add_region(session, begun)
    used = utcnow()
    with db.write() as session:
        for name in ("used", "revoked", "new"):
            keys.add(session, name, Scope.READ, "others")
        for row in session.query(ApiKeyRow):
            row.last_used_at = used - timedelta(days=1) if row.name == "used" else None
        keys.revoke(session, "revoked", "others")
    with db.read() as session:
        stored = retention.stored(session, "others")
    found = inventory.collect(db)
    assert list(found) == ["default", "empty", "others"]
    assert found["default"] == found["empty"] == Contents(0, 0, 0, 0, None, 0, 0, 0)
    assert found["others"] == Contents(stored, 1, 1, 2, used - timedelta(days=1), scenes=1, regions=1, maps=0)
    assert stored > 0
    assert region.project == "others"


def test_a_limit_is_noted_with_what_it_was_whoever_else_sets_it(db: Database) -> None:
    """Many set the limit of a project at the same time. The lines of the log follow on each other."""

    def raise_it() -> None:
        with db.write() as session:
            most = projects.limits(projects.get(session, "default"))["max_bytes"]
        with db.write() as session:
            projects.set_limits(session, "default", {"max_bytes": (most or 0) + 1})

    threads = [Thread(target=raise_it) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with db.read() as session:
        said = [row.what.removeprefix("max_bytes ").split(" -> ") for row in audit.page(session).rows][::-1]
        left = projects.get(session, "default").max_bytes
    assert said[0][0] == "none"
    assert said[-1][1] == str(left)
    assert [before for before, _ in said[1:]] == [after for _, after in said[:-1]]


def test_workers_alike_are_counted_together(db: Database) -> None:
    with db.write() as session:
        for number, version in enumerate(("1.1", "1.2", "1.2")):
            workers.tell(session, Made(f"host:{number}:1", WorkerKind.SOLVE, version, 2 + number, 8, 2**34), WorkerState.RUNNING)
        found = workers.alike(session)
    assert found == [Alike(WorkerKind.SOLVE, "1.1", WorkerState.RUNNING, 1, 2), Alike(WorkerKind.SOLVE, "1.2", WorkerState.RUNNING, 2, 7)]
