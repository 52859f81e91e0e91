"""A changed scene is staged, asked about and promoted over HTTP."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.scene.bundle import pack_bundle
from db import staging
from db.session import Database
from tests.api.conftest import PROBLEM
from tests.api.test_scenes import EXAMPLE, upload
from tests.scenes import slider


def test_a_bundle_is_staged_under_a_name_that_keeps_its_meaning(client: TestClient, region: str) -> None:
    present = client.get("/v1/scenes/slider").json()
    files = {"bundle": ("scene.zip", pack_bundle(EXAMPLE), "application/zip")}
    answer = client.post("/v1/scenes", params={"stage": "slider"}, files=files)
    assert answer.status_code == 201, answer.text
    staged = answer.json()
    assert answer.headers["Location"] == f"/v1/scenes/{staged['id']}"
    assert (staged["name"], staged["names"]) == ("slider@staged", ["slider@staged"]), "the file's own name does not count"
    assert staged["joints"] == 2
    assert client.get("/v1/scenes/slider").json() == present
    assert client.get("/v1/scenes/slider@staged").json() == staged
    unknown = client.post("/v1/scenes", params={"stage": "slidr"}, files=files)
    assert (unknown.status_code, unknown.json()["code"], unknown.json()["field"]) == (404, "scene_not_found", "stage")
    assert "slider@staged" in client.get("/scenes").text
    assert "slider@staged" in client.get("/scenes/slider@staged").text


@pytest.fixture
def staged(database: Database, region: str) -> str:
    """The id of a scene like the slider, with a third post, that is staged as its next version."""
    with database.write() as session:
        return staging.stage(session, "slider", slider(posts=3)).id


QUESTIONS: list[tuple[str, dict[str, Any]]] = [
    ("contains", {"q": [[0.1]]}),
    ("nearest", {"q": [[0.1]]}),
    ("segment", {"q": [[[0.0], [0.1]]]}),
    ("path", {"q": [[0.0], [0.1]]}),
    ("plan", {"start": [0.0], "goal": [0.1]}),
    ("contacts", {"q": [[0.1]]}),
]


def test_planners_get_the_present_scene_or_the_staged_one(client: TestClient, staged: str) -> None:
    present = client.get("/v1/scenes/slider").json()["id"]
    for scene, meant, number in (("slider", present, 1), ("slider@staged", staged, 0)):
        for question, body in QUESTIONS:
            answer = client.post(f"/v1/planning/{question}", json={"scene": scene, **body}).json()
            assert (answer["scene"], answer.get("regions", number)) == (meant, number), question
        graph = client.get("/v1/planning/graph", params={"scene": scene}).json()
        assert (graph["scene"], graph["regions"]) == (meant, number)
        motion = client.post("/v1/planning/certify-path", json={"scene": scene, "q": [[0.0], [0.1]]}).json()
        assert (motion["scene"]["hash"][:16], motion["outcome"]) == (meant, "certified")
        assert len(client.get("/v1/regions", params={"scene": scene}).json()["regions"]) == number


def test_a_scene_is_promoted_once_it_has_regions(client: TestClient, database: Database, staged: str, region: str) -> None:
    present = client.get("/v1/scenes/slider").json()["id"]
    refused = client.post("/v1/scenes/slider/promote")
    assert (refused.status_code, refused.headers["content-type"]) == (409, PROBLEM)
    assert (refused.json()["code"], refused.json()["field"]) == ("scene_without_regions", "without_regions")
    assert "ciris recertify" in refused.json()["hint"]
    assert client.get("/v1/scenes/slider").json()["id"] == present
    done = client.post("/v1/scenes/slider/promote", params={"without_regions": True})
    assert done.status_code == 200, done.text
    assert done.json() == {"scene": staged, "regions": 0, "before": present, "regions_before": 1}
    assert client.get("/v1/scenes/slider").json()["names"] == ["slider"]
    (line,) = client.get("/v1/audit").json()["lines"]
    assert (line["action"], line["what"], line["who"]) == ("scene_promoted", f"slider = {staged}", "anybody")
    again = client.post("/v1/scenes/slider/promote")
    assert (again.status_code, again.json()["code"]) == (404, "scene_not_found")
    assert again.json()["detail"] == "nothing is staged as the next version of 'slider'"


def test_a_deleted_scene_is_staged_no_more(client: TestClient, staged: str) -> None:
    assert client.delete("/v1/scenes/slider@staged").status_code == 404, "only a whole id will do"
    assert client.delete(f"/v1/scenes/{staged}").status_code == 204
    assert client.get("/v1/scenes/slider@staged").status_code == 404
    assert client.post("/v1/planning/contains", json={"scene": "slider", "q": [[0.1]]}).json()["regions"] == 1


def test_only_staging_gives_the_name_of_a_staged_scene(client: TestClient, staged: str, tmp_path) -> None:
    for file in EXAMPLE.parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    path = tmp_path / "scene.yaml"
    path.write_text(path.read_text().replace("name: planar-2dof", "name: slider@staged"))
    answer = upload(client, pack_bundle(path))
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (422, "scene_name", "name")
    assert client.get("/v1/scenes/slider@staged").json()["id"] == staged
