"""What the pieces of a map's round have found is kept, also where the job is stopped before the round is over."""

from __future__ import annotations

from sqlalchemy import select

from db import jobs, maps, projects, steps
from db.models import DEFAULT_PROJECT, StepRow
from db.session import Database
from db.states import ACCEPT, LEAD, StepState
from jobs.map import Map
from tests.db.builders import a_scene


def stopped(db: Database, kept: int, done: int) -> tuple[str, list[str]]:
    """A job that is stopped in a round of three pieces, of which this many are done, after this many rounds; and its steps."""
    with db.write() as session:
        job, _ = jobs.create(session, kind="map", scene_id=a_scene(session).id, options={})
        jobs.start(session, job)
        jobs.next_turn(job, {"kind": LEAD})
        for number in range(kept):
            maps.keep(session, job.id, number, {0: b"kept"})
        maps.post(session, job, [b"tasks"] * 3)
        for number in range(done):
            claim = steps.claim(session, job, accepts=False, lease_seconds=60, pieces=True)
            assert claim is not None
            steps.save(session, claim, StepState.DONE, {}, 1.0)
            maps.put(session, claim.step_id, b"found %d" % number)
        steps.skip(session, job.id)
        Map().stop(session, job, [])
        return job.id, list(session.scalars(select(StepRow.kind).where(StepRow.job_id == job.id)))


def test_what_pieces_have_found_is_kept_when_the_job_is_stopped(db: Database) -> None:
    job_id, left = stopped(db, kept=2, done=2)
    assert left == [ACCEPT]
    with db.read() as session:
        assert [maps.of_round(session, job_id, number) for number in range(4)] == [
            {0: b"kept"},
            {0: b"kept"},
            {0: b"found 0", 1: b"found 1"},
            {},
        ]


def test_a_job_that_is_stopped_in_its_first_round_has_a_map(db: Database) -> None:
    job_id, left = stopped(db, kept=0, done=1)
    assert left == [ACCEPT]
    with db.read() as session:
        assert maps.of_round(session, job_id, 0) == {0: b"found 0"}


def test_a_job_that_has_found_nothing_has_no_map(db: Database) -> None:
    assert stopped(db, kept=0, done=0)[1] == []


def test_the_map_of_the_project_that_proves_most_of_some_pairs_is_found(db: Database) -> None:
    jobs_of: dict[str, list[str]] = {}
    with db.write() as session:
        projects.add(session, "others")
    for project, maps_of in ((DEFAULT_PROJECT, [{"a": 5, "b": 1}, {"a": 1, "c": 7}]), ("others", [{"a": 50}])):
        with db.of(project).write() as session:
            scene = a_scene(session)
            made = [jobs.create(session, kind="map", scene_id=scene.id, options={})[0].id for _ in maps_of]
            for job_id, cells in zip(made, maps_of, strict=True):
                maps.keep_contents(session, job_id, cells)
            jobs_of[project] = made
    first, second = jobs_of[DEFAULT_PROJECT]
    with db.read() as session:
        found = {wanted: maps.knows_most(session, DEFAULT_PROJECT, list(wanted)) for wanted in ("a", "ab", "ac", "d", "")}
        assert found == {"a": first, "ab": first, "ac": second, "d": None, "": None}
        assert maps.knows_most(session, "others", ["a", "b"]) == jobs_of["others"][0]
        many = [f"{i:016x}" for i in range(3 * maps.MOST_CONTENTS)]
        assert maps.knows_most(session, DEFAULT_PROJECT, many) is None
