"""Jobs by the dozen: labels and search, several at once, and one stream of what happens to all."""

from __future__ import annotations

import asyncio
import json
from itertools import pairwise
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from api.routers.events import LATE
from certifier.model import Scene
from db import events, keys, projects
from db.keys import Scope
from db.models import EventRow
from db.session import Database
from tests.api.test_jobs import GROW


def labelled(client: TestClient, **labels: str) -> str:
    answer = client.post("/v1/jobs", json=GROW | {"labels": labels})
    assert answer.status_code == 201, answer.text
    assert answer.json()["labels"] == labels
    return str(answer.json()["id"])


def listed(client: TestClient, **params: Any) -> list[str]:
    return [job["id"] for job in client.get("/v1/jobs", params=params).json()["jobs"]]


def test_jobs_are_found_by_their_labels(client: TestClient, scene: Scene) -> None:
    one, two = labelled(client, team="welding", cell="a=b"), labelled(client, team="welding")
    plain = client.post("/v1/jobs", json=GROW).json()["id"]
    assert listed(client) == [plain, two, one]
    assert listed(client, label="team=welding") == [two, one]
    assert listed(client, label=["team=welding", "cell=a=b"]) == [one]
    assert listed(client, label="team=weld") == []
    assert [job["labels"] for job in client.get("/v1/jobs").json()["jobs"]] == [{}, {"team": "welding"}, {"cell": "a=b", "team": "welding"}]
    client.post(f"/v1/jobs/{one}/cancel")
    again = client.post(f"/v1/jobs/{one}/retry").json()
    assert again["labels"] == {"cell": "a=b", "team": "welding"}


def test_jobs_are_found_by_what_they_mention(client: TestClient, scene: Scene) -> None:
    one, two = labelled(client, customer="Müller 100%"), labelled(client)
    client.post(f"/v1/jobs/{two}/cancel")
    assert listed(client, search="müller") in ([one], []), "SQLite folds the case of ASCII only"
    assert listed(client, search="ller 100%") == [one]
    assert listed(client, search="0_") == []
    assert listed(client, search=two[:8]) == [two]
    assert listed(client, search="before it started") == [two]
    assert listed(client, search="SLIDER") == [two, one]
    assert listed(client, search="nothing like it") == []


@pytest.mark.parametrize(
    "labels", [{"": "x"}, {"a b": "x"}, {"a": "x" * 201}, {"a" * 65: "x"}, {"a": "\0"}, {str(i): "x" for i in range(21)}, {"a": 1}]
)
def test_labels_that_cannot_be_are_refused(client: TestClient, scene: Scene, labels: dict[str, Any]) -> None:
    answer = client.post("/v1/jobs", json=GROW | {"labels": labels})
    assert (answer.status_code, answer.json()["field"].partition(".")[0]) == (422, "labels")


def test_the_same_key_with_other_labels_is_another_request(client: TestClient, scene: Scene) -> None:
    for labels, status in (({}, 201), ({}, 200), ({"a": "b"}, 409)):
        assert client.post("/v1/jobs", json=GROW | {"labels": labels}, headers={"Idempotency-Key": "k"}).status_code == status


def test_several_jobs_are_made_together_or_not_at_all(client: TestClient, scene: Scene) -> None:
    wrong = GROW | {"seed": {"q": [9.0]}}
    refused = client.post("/v1/jobs/batch", json={"jobs": [GROW, wrong]})
    assert (refused.status_code, refused.json()["field"]) == (422, "jobs[1].seed.q[0]")
    unknown = client.post("/v1/jobs/batch", json={"jobs": [GROW, GROW | {"scene": "nope"}]})
    assert (unknown.status_code, unknown.json()["field"]) == (404, "jobs[1].scene")
    assert listed(client) == []
    body = {"jobs": [GROW | {"labels": {"n": str(i)}} for i in range(3)]}
    made = [client.post("/v1/jobs/batch", json=body, headers={"Idempotency-Key": "k"}) for _ in range(2)]
    assert [answer.status_code for answer in made] == [201, 201]
    ids = [[job["id"] for job in answer.json()["jobs"]] for answer in made]
    assert ids[0] == ids[1]
    assert sorted(listed(client)) == sorted(ids[0])
    assert [job["labels"]["n"] for job in made[0].json()["jobs"]] == ["0", "1", "2"]
    assert client.post("/v1/jobs/batch", json={"jobs": []}).status_code == 422
    assert client.post("/v1/jobs/batch", json={"jobs": [GROW] * 101}).status_code == 422


def test_a_key_of_a_batch_stands_for_all_of_it_and_for_no_single_job(client: TestClient, scene: Scene) -> None:
    def post(*jobs: dict[str, Any], key: str = "k") -> tuple[int, str | None]:
        answer = client.post("/v1/jobs/batch", json={"jobs": list(jobs)}, headers={"Idempotency-Key": key})
        return answer.status_code, answer.json().get("code")

    one, two, three = (GROW | {"labels": {"n": str(i)}} for i in range(3))
    assert [post(one, two), post(one, two)] == [(201, None)] * 2
    others = [post(one), post(one, two, three), post(two, one), post(three, three), post(one, three)]
    assert others == [(409, "idempotency_conflict")] * 5
    assert len(listed(client)) == 2, "none of another batch was made"
    for key in ("k", "k:0", "batch:open:0:k"):
        assert client.post("/v1/jobs", json=three, headers={"Idempotency-Key": key}).status_code == 201
    assert post(three, key="open:k") == (201, None)


def test_several_jobs_are_cancelled_together(client: TestClient, scene: Scene) -> None:
    a, b, c = labelled(client, batch="1"), labelled(client, batch="1"), labelled(client, batch="2")
    by_label = client.post("/v1/jobs/cancel", json={"labels": {"batch": "1"}})
    assert by_label.status_code == 202
    assert {job["id"]: job["state"] for job in by_label.json()["jobs"]} == {a: "cancelled", b: "cancelled"}
    assert client.post("/v1/jobs/cancel", json={"labels": {"batch": "1"}}).json()["jobs"] == []
    by_id = client.post("/v1/jobs/cancel", json={"jobs": [c[:8], a]})
    assert [job["state"] for job in by_id.json()["jobs"]] == ["cancelled", "cancelled"]
    for wrong in ({}, {"labels": {}}, {"jobs": []}, {"jobs": [a], "labels": {"batch": "1"}}):
        assert client.post("/v1/jobs/cancel", json=wrong).status_code == 422
    assert client.post("/v1/jobs/cancel", json={"jobs": [a, "nope"]}).json()["code"] == "job_not_found"


def test_events_of_all_jobs_of_the_project_are_listed(client: TestClient, database: Database, scene: Scene) -> None:
    one, two = labelled(client), labelled(client)
    client.post(f"/v1/jobs/{one}/cancel")
    found = client.get("/v1/events").json()["events"]
    assert [(event["job"], event["seq"], event["data"]["state"]) for event in found] == [
        (one, 1, "queued"),
        (two, 1, "queued"),
        (one, 2, "cancelled"),
    ]
    assert client.get("/v1/events", params={"after": found[1]["id"]}).json()["events"] == found[2:]
    with database.write() as session:
        projects.add(session, "others")
        key = keys.add(session, "stranger", Scope.ADMIN, "others")
    answer = client.get("/v1/events", headers={"Authorization": f"Bearer {key}"})
    assert answer.json() == {"events": []}


def test_ids_of_events_do_not_say_how_many_events_others_have(client: TestClient, database: Database, scene: Scene) -> None:
    for _ in range(3):
        labelled(client)
    seen = [event["id"] for event in client.get("/v1/events").json()["events"]]
    with database.read() as session:
        ids = [row.id for row in events.of_all(session, 0, 10)]
    assert not set(seen) & set(ids)
    assert {b - a for a, b in pairwise(seen)}.isdisjoint(b - a for a, b in pairwise(ids))
    assert client.get("/v1/events", params={"after": ids[0]}).json() == {"events": []}, "nobody was shown this number"


def test_no_event_is_lost_after_a_job_was_deleted(client: TestClient, database: Database, scene: Scene) -> None:
    def made() -> str:
        return str(client.post("/v1/jobs", json=GROW).json()["id"])

    gone = made()
    client.post(f"/v1/jobs/{gone}/cancel")
    last = client.get("/v1/events").json()["events"][-1]["id"]
    assert client.delete(f"/v1/jobs/{gone}").status_code == 204
    job = made()
    assert [event["job"] for event in client.get("/v1/events", params={"after": last}).json()["events"]] == [job]


def test_one_stream_tells_of_all_jobs_also_of_late_ones(url: str, client: TestClient, database: Database, scene: Scene) -> None:
    before = labelled(client)

    async def follow() -> list[dict[str, Any]]:
        heard: list[dict[str, Any]] = []
        async with httpx2.AsyncClient(base_url=url, timeout=20.0) as http, http.stream("GET", "/v1/events/stream") as answer:
            lines = answer.aiter_lines()
            await asyncio.sleep(1.0)
            wanted = {(await asyncio.to_thread(labelled, client), 1) for _ in range(2)}
            for seq, number in ((99, 1000), (98, 1000 - LATE // 2)):  # the second has its id from earlier, and commits now
                with database.write() as session:
                    session.add(EventRow(id=number, job_id=before, seq=seq, kind="job", data={}))
                await asyncio.sleep(1.0)
                wanted |= {(before, seq)}
            async for line in lines:
                if line.startswith("data: "):
                    heard.append(json.loads(line.removeprefix("data: ")))
                if wanted <= {(event["job"], event["seq"]) for event in heard}:
                    return heard
        raise AssertionError("the stream ended")

    heard = asyncio.run(asyncio.wait_for(follow(), 30))
    names = [(event["job"], event["seq"]) for event in heard]
    assert len(names) == len(set(names)), "on one connection no event comes twice"
    assert (before, 1) not in names, "what was before is not told"
