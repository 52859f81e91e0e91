"""Jobs on the command line: lists, short ids, following, cancelling, retrying; and what is said of what is unknown."""

from __future__ import annotations

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import jobs, scenes, webhooks
from db.session import Database
from db.types import utcnow
from tests.client.conftest import Ciris

SEED = {"kind": "grow", "seed": {"q": [0.0]}, "random_seed": 0}


def queued(database: Database, scene: Scene) -> str:
    """The id of a job that nobody works on."""
    with database.write() as session:
        row = scenes.add(session, scene)
        return jobs.create(session, kind="grow", scene_id=row.id, options=SEED)[0].id


def test_jobs_are_listed_shown_and_followed_by_the_first_characters_of_their_ids(
    ciris: Ciris, url: str, database: Database, region: str, scene: Scene
) -> None:
    done = ciris("job", "ls", CIRIS_URL=url)
    assert done.status == 0
    (_, row) = done.stdout.splitlines()
    short, kind, state, name, *_ = row.split()
    assert (kind, state, name, len(short)) == ("grow", "succeeded", scene.name, 8)
    waiting = queued(database, scene)
    for said in (ciris("job", "ls").stdout, ciris("job", "show", waiting[:8]).stdout):
        assert "queued: no worker" in said
    assert [job["id"] for job in ciris("job", "ls", "--state", "queued", "--json").json] == [waiting]
    assert len(ciris("job", "ls", "--most", "1", "--json").json) == 1
    shown = ciris("job", "show", short)
    assert shown.status == 0
    assert f"region {region[:8]}" in shown.stdout
    assert ciris("job", "show", short, "--json").json["obstacles"] == []
    growth = {"obstacles": {"1": {"stage": 1, "times": 1, "faces": 1, "lost": 0.125, "s": [0.25], "contact": True}}}
    with database.write() as session:
        jobs.keep_growth(session, jobs.get(session, short), growth)
    told, copied = (line.strip() for line in ciris("job", "show", short).stdout.splitlines()[-2:])
    assert told.startswith("model/cart/ball and world/post1 touch at q = (0.250) m, as floating point says. 1 face was added or ")
    assert told.endswith("cut off 12 % of the polytope, as samples say.")
    assert copied == "in m: --q=0.25"
    followed = ciris("job", "follow", short)
    assert (followed.status, "succeeded" in followed.stdout) == (0, True)
    assert ciris("region", "show", region[:8], "--json").json["guarantee"] == "exact"


def test_a_job_is_cancelled_and_retried(ciris: Ciris, url: str, database: Database, scene: Scene) -> None:
    waiting = queued(database, scene)
    done = ciris("job", "cancel", waiting[:8], CIRIS_URL=url)
    assert (done.status, "cancelled before it started" in done.stdout, done.stderr) == (0, True, "")
    late = ciris("job", "cancel", waiting[:8])
    assert (late.status, late.stderr) == (0, "the job had ended before, cancelled; nothing was cancelled\n")
    again = ciris("job", "retry", waiting[:8], "--json").json
    assert (again["state"], again["id"] == waiting) == ("queued", False)
    refused = ciris("job", "retry", again["id"][:8])
    assert refused.status == 2
    assert "only a failed or cancelled one can be retried" in refused.error
    assert ciris("job", "follow", waiting).status == 1


def test_what_is_unknown_or_ambiguous_is_said(
    ciris: Ciris, url: str, database: Database, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting = queued(database, scene)
    monkeypatch.setattr("db.jobs.uuid4", lambda: waiting[:-1] + ("0" if waiting[-1] != "0" else "1"))
    queued(database, scene)
    cases = [
        (("job", "show", "00000000-nothing"), "`ciris job ls`, or `jobs()` in Python, lists them"),
        (("job", "show", waiting[:3]), "there is no job"),
        (("job", "show", waiting[:4]), "give more of it"),
        (("region", "show", "00000000-nothing"), "`ciris region ls`, or `regions()` in Python, lists them"),
        (("scene", "show", scene.name[:-1] + "x"), f"did you mean {scene.name}"),
        (("scene", "show", "nothing like it"), "`ciris scene ls`, or `scenes()` in Python, lists them"),
    ]
    for words, said in cases:
        done = ciris(*words, CIRIS_URL=url)
        assert done.status == 2
        assert said in done.error
    assert ciris("job", "show", waiting, "--json").json["id"] == waiting
    assert ciris("scene", "show", scene.hash[:8], "--json").json["name"] == scene.name


def test_a_jobs_webhook_is_shown_and_called_again(ciris: Ciris, url: str, database: Database, scene: Scene, client: TestClient) -> None:
    hook = {"url": "https://planner.example.org/done", "secret": "whsec_" + "A" * 32}
    job = client.post("/v1/jobs", json={"kind": "grow", "scene": scene.name, "seed": {"q": [0.1]}, "webhook": hook}).json()["id"]
    assert ciris("job", "webhook", job[:8], "--json", CIRIS_URL=url).json["state"] == "waiting"
    assert "has ended" in ciris("job", "webhook", job[:8], "--resend").error
    client.post(f"/v1/jobs/{job}/cancel")
    with database.write() as session:
        row = webhooks.of_job(session, job)
        webhooks.settle(session, row.id, webhooks.Answered(utcnow(), 0.25, 204, "", ""))
    assert [one["job"] for one in ciris("job", "webhooks", "--state", "delivered", "--json").json] == [job]
    assert ciris("job", "webhooks", "--state", "failed", "--json").json == []
    assert "https://planner.example.org/done" in ciris("job", "webhooks").stdout
    told = ciris("job", "webhook", job[:8]).stdout
    assert "delivered" in told
    assert "204" in told
    assert ciris("job", "webhook", job[:8], "--resend", "--json").json["state"] == "waiting"
