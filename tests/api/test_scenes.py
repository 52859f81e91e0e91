"""Scenes over HTTP: a real bundle through the real parser, and what is refused."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api import guard
from certifier.model import Scene
from certifier.scene.bundle import pack_bundle
from db import scenes
from db.session import Database
from tests.api.conftest import PROBLEM
from tests.scenes import slider

EXAMPLE = Path(__file__).parents[2] / "examples" / "planar_2dof" / "scene.yaml"


def upload(client: TestClient, data: bytes):
    return client.post("/v1/scenes", files={"bundle": ("scene.zip", data, "application/zip")})


def test_a_scene_is_uploaded_once_whatever_how_often(client: TestClient) -> None:
    bundle = pack_bundle(EXAMPLE)
    first = upload(client, bundle)
    assert first.status_code == 201, first.text
    scene = first.json()
    assert first.headers["Location"] == f"/v1/scenes/{scene['id']}"
    assert (scene["name"], scene["joints"]) == ("planar-2dof", 2)
    assert [joint["name"] for joint in scene["positions"]] == ["arm/shoulder", "arm/elbow"]
    assert upload(client, bundle).json()["id"] == scene["id"]
    assert [s["id"] for s in client.get("/v1/scenes").json()["scenes"]] == [scene["id"]]
    assert client.get("/v1/scenes/planar-2dof").json() == scene

    pairs = client.get(f"/v1/scenes/{scene['id']}/pairs").json()["pairs"]
    assert len(pairs) == scene["pairs"]
    assert all(pair["padding"] == scene["padding"] for pair in pairs)
    assert all(pair["gram_a"] == 2 ** len(pair["chain_a"]) for pair in pairs)
    lint = client.get(f"/v1/scenes/{scene['id']}/lint").json()
    assert set(lint) == {"warnings", "substitutions", "ignored"}


def test_equal_bundles_are_read_once(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """A command sends the bundle of its scene file every time, and starting a process for it takes longer than the question."""
    first = upload(client, pack_bundle(EXAMPLE)).json()
    monkeypatch.setattr("api.routers.scenes.load_bundle", pytest.fail)
    assert upload(client, pack_bundle(EXAMPLE)).json() == first


def test_a_name_means_the_scene_that_was_last_added_under_it(client: TestClient, database: Database) -> None:
    """Whoever adds a scene again makes its name mean it again; the same content has every name that it was added under."""
    first, other = slider(posts=1), slider(posts=2)

    def added(scene: Scene, name: str) -> str:
        with database.write() as session:
            return scenes.add(session, replace(scene, name=name)).id

    def meant(name: str) -> Any:
        return client.get(f"/v1/scenes/{name}").json()

    a, b = added(first, "cell"), added(other, "cell")
    assert meant("cell")["id"] == b
    assert added(first, "cell") == a
    assert meant("cell")["id"] == a
    assert added(first, "copy") == a
    assert (meant("copy")["id"], meant("copy")["name"]) == (a, "copy")
    assert sorted(meant("cell")["names"]) == ["cell", "copy"]
    assert meant(b)["names"] == []
    assert meant(b)["name"] == "cell"
    assert {scene["id"]: len(scene["names"]) for scene in client.get("/v1/scenes").json()["scenes"]} == {a: 2, b: 0}
    for path in ("jobs", "regions"):
        assert client.get(f"/v1/{path}", params={"scene": "copy"}).status_code == 200
    plane = {"kind": "certify", "polytope": {"C": [[1.0]], "d": [0.1]}}
    assert [client.post("/v1/jobs", json={"scene": name, **plane}).json()["scene"] for name in ("copy", "cell", b)] == [a, a, b]


def test_a_broken_robot_file_is_a_problem_and_nothing_is_stored(client: TestClient) -> None:
    source = zipfile.ZipFile(io.BytesIO(pack_bundle(EXAMPLE)))
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as broken:
        for name in source.namelist():
            broken.writestr(name, b"<robot name='arm'><link" if name.endswith(".urdf") else source.read(name))
    answer = upload(client, data.getvalue())
    assert (answer.status_code, answer.headers["content-type"]) == (422, PROBLEM)
    assert "arm.urdf" in answer.json()["detail"]
    assert client.get("/v1/scenes").json()["scenes"] == []


@pytest.mark.parametrize(("data", "code"), [(b"not a zip", "bundle_zip"), (b"", "bundle_zip")])
def test_what_is_no_bundle_is_a_problem(client: TestClient, data: bytes, code: str) -> None:
    answer = upload(client, data)
    assert (answer.status_code, answer.json()["code"]) == (422, code)


def test_a_bundle_that_leads_outside_is_a_problem(client: TestClient) -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as evil:
        evil.writestr("bundle.json", json.dumps({"scene": "scene.yaml"}))
        evil.writestr("../scene.yaml", "directives: []")
    assert upload(client, data.getvalue()).json()["code"] == "bundle_path"


def test_a_missing_bundle_names_the_field(client: TestClient) -> None:
    answer = client.post("/v1/scenes")
    assert (answer.status_code, answer.json()["field"]) == (422, "bundle")


def test_too_much_is_refused_by_its_announced_and_by_its_real_length(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "UPLOAD_BYTES", 1000)
    monkeypatch.setattr(guard, "BODY_BYTES", 1000)
    announced = upload(client, b"x" * 2000)
    streamed = client.post("/v1/jobs", content=(b"x" * 100 for _ in range(50)), headers={"Content-Type": "application/json"})
    for answer in (announced, streamed):
        assert (answer.status_code, answer.json()["code"], answer.headers["content-type"]) == (413, "too_large", PROBLEM)


def test_an_unknown_scene_is_not_found(client: TestClient, scene: Scene) -> None:
    for path in ("/v1/scenes/nope", "/v1/scenes/nope/pairs", "/v1/scenes/nope/lint"):
        answer = client.get(path)
        assert (answer.status_code, answer.json()["code"], answer.headers["content-type"]) == (404, "scene_not_found", PROBLEM)
