"""Errors about projects, keys over HTTP, and what is deleted."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import update

from db import command_line, jobs, keys, projects, retention
from db.disk import Disk
from db.keys import Scope
from db.models import JobRow
from db.session import Database
from db.vault import Vault, kept_key
from tests.db.builders import a_running_job, add_region
from tests.errors.rows import Trial, rows
from tests.errors.service import GROW, database, post, queued, write

SET_IT = "set CIRIS_SECRET_KEY to what `openssl rand -base64 32` prints, the same for the API and the control worker"
SAY_SO = "say dependents=delete (--dependents) to delete them too"


def full(t: Trial) -> None:
    """Asks for a job in a project that has no room."""
    t.request.getfixturevalue("scene")
    with database(t).write() as session:
        projects.get(session, "default").max_bytes = 1
    post(t, GROW)


def without_room(t: Trial) -> None:
    """Asks for a job while the disk is nearly full."""
    patch: pytest.MonkeyPatch = t.request.getfixturevalue("monkeypatch")
    t.request.getfixturevalue("scene")
    patch.setattr("db.disk.RESERVE_BYTES", 2**80)
    patch.setattr("db.disk.LOOK_SECONDS", 0)
    database(t).disk = Disk(t.directory)
    post(t, GROW)


def a_region_of_a_job(t: Trial) -> str:
    db: Database = database(t)
    client: TestClient = t.request.getfixturevalue("client")
    with db.write() as session:
        job = a_running_job(session)
        add_region(session, job)
        job_id = job.id
    client.post(f"/v1/jobs/{job_id}/cancel")
    with db.write() as session:
        session.execute(update(JobRow).values(state="cancelled"))
    return job_id


def resent_too_soon(t: Trial) -> None:
    t.request.getfixturevalue("scene")
    client: TestClient = t.request.getfixturevalue("client")
    hook = {"url": "https://example.org/", "secret": "whsec_" + "A" * 32}
    job = client.post("/v1/jobs", json=GROW | {"webhook": hook}).json()["id"]
    t.ask("POST", f"/v1/jobs/{job}/webhook/resend")


def named_twice(session: Any) -> None:
    projects.add(session, "others")
    projects.add(session, "others")


def by_its_name(t: Trial) -> None:
    with database(t).write() as session:
        a_running_job(session)
        retention.delete_scene(session, "slider", dependents=True)


def by_a_few_characters(t: Trial) -> None:
    with database(t).write() as session:
        retention.delete_job(session, a_running_job(session).id[:8], dependents=True)


TEAMS = [
    *rows(
        "db/projects.py",
        (
            "project_name",
            "name",
            "{name} is no name for a project",
            "choose up to 64 letters, digits and . _ - @",
            lambda t: write(t, lambda session: projects.add(session, "a b")),
        ),
        ("project_name", "name", "there is a project {name} already", "choose another name", lambda t: write(t, named_twice)),
        (
            "project_not_found",
            "project",
            "there is no project {name}",
            "`ciris project add NAME` makes one",
            lambda t: write(t, lambda session: keys.add(session, "planner", Scope.READ, "nobody")),
        ),
    ),
    *rows(
        "db/command_line.py",
        (
            "no_database",
            "database",
            "there is none at {database}",
            "is it spelt so? `ciris up` and `python -m db.migrate` make one",
            lambda t: command_line.check_there(f"sqlite:///{t.directory}/misspelt.sqlite3"),
        ),
    ),
    *rows(
        "db/jobs.py",
        (
            "scene_not_found",
            "scene",
            "the scene {scene_id} was deleted",
            "add it again",
            lambda t: write(t, lambda session: jobs.create(session, kind="grow", scene_id="0" * 64, options={})),
        ),
    ),
    *rows(
        "db/retention.py",
        (
            "scene_not_found",
            "scene",
            "no scene has the id {scene_id}",
            "give all of its id to delete it",
            by_its_name,
        ),
        (
            "job_not_found",
            "job",
            "no job has the id {job_id}",
            "give all of its id to delete it",
            by_a_few_characters,
        ),
        (
            "not_ended",
            "job",
            "{what} has jobs that have not ended, {unfinished} in all",
            "cancel what you do not need, and wait for the end",
            lambda t: t.ask("DELETE", f"/v1/jobs/{queued(t)}"),
        ),
        ("has_dependents", "dependents", "with {what} go {found}", SAY_SO, lambda t: t.ask("DELETE", f"/v1/jobs/{a_region_of_a_job(t)}")),
    ),
    *rows(
        "db/vault.py",
        ("no_secret_key", "webhook.secret", "this service has no key to keep secrets with", SET_IT, lambda t: Vault("").seal("a", "b")),
        ("secret_key", "CIRIS_SECRET_KEY", "this is not the base64 of 32 bytes", SET_IT, lambda t: Vault("short")),
        (
            "secret_lost",
            "CIRIS_SECRET_KEY",
            "no key fits a secret",
            "add the key of before, after a comma",
            lambda t: Vault("").open("v1.AAAAAAAAAAAAAAAAAAAAAAAA", "b"),
        ),
        (
            "no_room",
            "--data",
            "the key of secrets, {path}, cannot be written: {strerror}",
            "free some room there",
            lambda t: kept_key(t.directory / "absent" / "secret.key"),
        ),
    ),
    *rows(
        "db/webhooks.py",
        (
            "webhook_waits",
            "job",
            "the job is {state}; its webhook is called when it has ended",
            "wait for the end of the job",
            resent_too_soon,
        ),
    ),
    *rows(
        "api/room.py",
        (
            "storage_quota",
            "",
            "the project {project} stores as many bytes as it may, {most}",
            "delete jobs, regions or scenes, or have the limit raised: `ciris project set`",
            full,
        ),
        ("no_room", "", "nothing new is stored now: {trouble}", "try again later, or delete what is not needed", without_room),
    ),
    *rows(
        "api/routers/project.py",
        (
            "first_key",
            "name",
            "the first key locks everybody else out",
            "make it at the service's machine: `ciris key add`",
            lambda t: t.ask("POST", "/v1/keys", json={"name": "mine", "scope": "admin"}),
        ),
    ),
    *rows(
        "client/inputs.py",
        ("bad_option", "--label", "must be NAME=VALUE, not {text}", "", lambda t: t.ciris("job", "ls", "--label", "team")),
    ),
    *rows(
        "client/keys.py",
        (
            "bad_option",
            "--{option}",
            "does not go with --url",
            "leave one of them out; the keys of a service are those of the project of your own key",
            lambda t: t.ciris("key", "ls", "--url", "http://127.0.0.1:9", "--data", "here"),
        ),
    ),
]
