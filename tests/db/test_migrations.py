"""The migrations lead to the tables of the models, and back, on SQLite and on PostgreSQL."""

from __future__ import annotations

from sqlalchemy import inspect

from db import jobs, migrate, pairs, scenes
from db.session import Database
from tests.db.builders import a_running_job
from tests.scenes import slider


def tables(url: str) -> set[str]:
    database = Database(url)
    try:
        return set(inspect(database.reader).get_table_names())
    finally:
        database.close()


def test_an_empty_database_drifts(empty_database_url: str) -> None:
    assert migrate.drift(empty_database_url)


def test_upgrade_makes_the_models_tables_and_may_be_repeated(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []


def test_downgrade_leaves_nothing_and_upgrade_comes_back(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    migrate.downgrade(empty_database_url, "base")
    assert tables(empty_database_url) == {"alembic_version"}
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []


def test_rows_survive_a_second_upgrade(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        scene_id = scenes.add(session, slider()).id
    migrate.upgrade(empty_database_url)
    with database.read() as session:
        assert scenes.get(session, scene_id).hash == slider().hash
    database.close()


def test_jobs_and_their_pairs_survive_the_way_down_and_up(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job = a_running_job(session, pair_count=3)
        certify = {"kind": "certify", "iteration": 0}
        job.action, job.growth, job_id = certify, {"next": 1}, job.id
    migrate.downgrade(empty_database_url, "0001")
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []
    with database.read() as session:
        job = jobs.get(session, job_id)
        assert (job.state, len(pairs.of_job(session, job_id))) == ("running", 3)
        assert (job.action, job.growth) == (certify, {"next": 1})
        assert [(row.hard, row.failures, row.faces) for row in pairs.iterations(session, job_id)] == [([], 1, 2)]
    database.close()
