"""Errors about projects, keys over HTTP, and what is deleted."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from typing import Any

import pytest
from sqlalchemy import update

from db import command_line, grants, jobs, keys, migrate, projects, retention, solver_time
from db.disk import Disk
from db.grants import Kind
from db.keys import Scope
from db.models import JobRow
from db.session import Database
from db.settings import settings
from db.vault import Vault, kept_key
from tests.db.builders import a_running_job, add_region
from tests.errors.service import GROW, post, queued, write
from tests.errors.trial import Table, Trial


def full(t: Trial) -> None:
    """Asks for a job in a project that has no room."""
    t.need("scene")
    with t.need("database").write() as session:
        projects.get(session, "default").max_bytes = 1
    post(t, GROW)


def out_of_time(t: Trial) -> None:
    """Asks for a job in a project for which solvers have worked as long as they may."""
    t.need("scene")
    with t.need("database").write() as session:
        projects.get(session, "default").max_solver_seconds = 60.0
        solver_time.add(session, "default", 60.0)
    post(t, GROW)


def without_room(t: Trial) -> None:
    """Asks for a job while the disk is nearly full."""
    patch: pytest.MonkeyPatch = t.need("monkeypatch")
    t.need("scene")
    patch.setattr("db.disk.RESERVE_BYTES", 2**80)
    patch.setattr("db.disk.LOOK_SECONDS", 0)
    t.need("database").disk = Disk(t.directory)
    post(t, GROW)


def a_region_of_a_job(t: Trial) -> str:
    db, client = t.need("database"), t.need("client")
    with db.write() as session:
        job = a_running_job(session)
        add_region(session, job)
        job_id = job.id
    client.post(f"/v1/jobs/{job_id}/cancel")
    with db.write() as session:
        session.execute(update(JobRow).values(state="cancelled"))
    return job_id


def resent_too_soon(t: Trial) -> None:
    t.need("scene")
    hook = {"url": "https://example.org/", "secret": "whsec_" + "A" * 32}
    job = t.need("client").post("/v1/jobs", json=GROW | {"webhook": hook}).json()["id"]
    t.ask("POST", f"/v1/jobs/{job}/webhook/resend")


def named_twice(session: Any) -> None:
    projects.add(session, "others")
    projects.add(session, "others")


def by_its_name(t: Trial) -> None:
    with t.need("database").write() as session:
        a_running_job(session)
        retention.delete_scene(session, "slider", dependents=True)


def by_a_few_characters(t: Trial) -> None:
    with t.need("database").write() as session:
        retention.delete_job(session, a_running_job(session).id[:8], dependents=True)


def without_a_database(t: Trial) -> None:
    t.need("ciris")
    t.need("monkeypatch").delenv("CIRIS_DATA_DIR")
    t.ciris("key", "ls", CIRIS_URL="http://127.0.0.1:9")


def with_settings(t: Trial, **variables: str) -> None:
    """Reads the settings as the commands about the database do, with a data directory."""
    patch: pytest.MonkeyPatch = t.need("monkeypatch")
    for name, value in variables.items():
        patch.setenv(name, value)
    command_line.settings_with(t.directory)


def in_another_programs_database(t: Trial) -> None:
    with closing(sqlite3.connect(t.directory / "photos.sqlite3")) as file:
        file.execute("CREATE TABLE photos (name)")
    migrate.upgrade(f"sqlite:///{t.directory}/photos.sqlite3")


def one_key_too_many(t: Trial) -> None:
    t.need("environment").setenv("CIRIS_MAX_KEYS_PER_PROJECT", "1")
    settings.cache_clear()
    for name in ("planner", "another"):
        write(t, lambda session, name=name: keys.add(session, name, Scope.READ))


TEAMS: Table = {
    ("project_name", "name"): [lambda t: write(t, lambda session: projects.add(session, "a b")), lambda t: write(t, named_twice)],
    ("project_not_found", "project"): [lambda t: write(t, lambda session: keys.add(session, "planner", Scope.READ, "nobody"))],
    ("grant_not_found", "--person"): [lambda t: write(t, lambda session: grants.revoke(session, "default", Kind.PERSON, "nobody"))],
    ("setting", "CIRIS_OIDC_CLIENT_ID"): [lambda t: with_settings(t, CIRIS_OIDC_ISSUER="https://login.example.org")],
    ("setting", "CIRIS_OIDC_ISSUER"): [lambda t: with_settings(t, CIRIS_OIDC_ISSUER="login.example.org")],
    ("no_database", "database"): [lambda t: command_line.check_there(f"sqlite:///{t.directory}/misspelt.sqlite3")],
    ("scene_not_found", "scene"): [
        lambda t: write(t, lambda session: jobs.create(session, kind="grow", scene_id="0" * 64, options={})),
        by_its_name,
    ],
    ("job_not_found", "job"): [by_a_few_characters],
    ("not_ended", "job"): [lambda t: t.ask("DELETE", f"/v1/jobs/{queued(t)}")],
    ("has_dependents", "dependents"): [lambda t: t.ask("DELETE", f"/v1/jobs/{a_region_of_a_job(t)}")],
    ("no_secret_key", "webhook.secret"): [lambda t: Vault("").seal("a", "b")],
    ("secret_key", "CIRIS_SECRET_KEY"): [lambda t: Vault("short")],
    ("secret_lost", "CIRIS_SECRET_KEY"): [lambda t: Vault("").open("v1.AAAAAAAAAAAAAAAAAAAAAAAA", "b")],
    ("no_room", "--data"): [lambda t: kept_key(t.directory / "absent" / "secret.key")],
    ("webhook_waits", "job"): [resent_too_soon],
    ("storage_quota", ""): [full],
    ("time_quota", ""): [out_of_time],
    ("no_room", ""): [without_room],
    ("too_many_keys", "name"): [one_key_too_many],
    ("first_key", "name"): [lambda t: t.ask("POST", "/v1/keys", json={"name": "mine", "scope": "admin"})],
    ("bad_option", "--label"): [lambda t: t.ciris("job", "ls", "--label", "team")],
    ("option", "CIRIS_URL"): [without_a_database],
    ("setting", "CIRIS_PORT"): [lambda t: with_settings(t, CIRIS_PORT="many")],
    ("setting", "CIRIS_DATABASE_URL"): [lambda t: with_settings(t, CIRIS_DATABASE_URL="mysql://127.0.0.1/ciris")],
    ("data_directory", "CIRIS_DATABASE_URL"): [lambda t: Database(f"sqlite:///{t.write(file='')}/ciris.sqlite3")],
    ("not_empty", "CIRIS_DATABASE_URL"): [in_another_programs_database],
    ("bad_option", "--data"): [
        lambda t: with_settings(t, CIRIS_DATABASE_URL=f"sqlite:///{t.directory}/one.sqlite3"),
        lambda t: t.ciris("key", "ls", "--url", "http://127.0.0.1:9", "--data", "here"),
    ],
    ("bad_option", "--project"): [lambda t: t.ciris("key", "revoke", "planner", "--url", "http://127.0.0.1:9", "--project", "default")],
}
