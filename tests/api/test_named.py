"""Names of configurations stand in every request in the place of joint positions, and mean what was added last."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import scenes, staging
from db.session import Database
from tests.scenes import slider

HOME, AWAY = -0.1, 0.15


@pytest.fixture
def named(database: Database, region: str, scene: Scene) -> Callable[..., None]:
    """Adds the scene of the region again, with configurations."""

    def add(**configurations: float) -> None:
        (joint,) = (joint.name for joint in scene.moving)
        with database.write() as session:
            scenes.add(session, replace(scene, configurations={name: {joint: value} for name, value in configurations.items()}))

    add(home=HOME, away=AWAY)
    return add


def ask(client: TestClient, path: str, **body: Any) -> Any:
    answer = client.post(path, json={"scene": "slider", **body})
    own = ("id", "seconds", "verify_seconds", "motion", "proof", "pieces")
    return {name: value for name, value in answer.json().items() if name not in own} | {"status": answer.status_code}


@pytest.mark.parametrize(
    ("path", "with_names", "with_numbers"),
    [
        ("contains", {"q": ["home", [0.0], "away"]}, {"q": [[HOME], [0.0], [AWAY]]}),
        ("nearest", {"q": ["home"]}, {"q": [[HOME]]}),
        ("segment", {"q": [["home", "away"], ["away", [0.1]]]}, {"q": [[[HOME], [AWAY]], [[AWAY], [0.1]]]}),
        ("path", {"q": ["home", [0.0], "away"]}, {"q": [[HOME], [0.0], [AWAY]]}),
        ("contacts", {"q": ["home", "away"]}, {"q": [[HOME], [AWAY]]}),
        ("plan", {"start": "home", "goal": "away", "regions_only": True}, {"start": [HOME], "goal": [AWAY], "regions_only": True}),
        ("plan", {"start": "home", "goals": ["home"], "via": ["away"]}, {"start": [HOME], "goals": [[HOME]], "via": [[AWAY]]}),
        ("certify-path", {"q": ["home", "away"]}, {"q": [[HOME], [AWAY]]}),
    ],
)
def test_a_name_means_its_positions(
    client: TestClient, named: object, path: str, with_names: dict[str, Any], with_numbers: dict[str, Any]
) -> None:
    answer = ask(client, f"/v1/planning/{path}", **with_names)
    assert answer["status"] == 200
    assert answer == ask(client, f"/v1/planning/{path}", **with_numbers)
    other = {name: [*value] if isinstance(value, list) else value for name, value in with_names.items()}
    first = next(name for name in ("q", "start") if name in other)
    other[first] = "nowhere" if first == "start" else ["nowhere", *other[first][1:]] if path != "segment" else [["nowhere", "home"]]
    refused = ask(client, f"/v1/planning/{path}", **other)
    assert (refused["status"], refused["code"]) == (422, "unknown_configuration")
    assert refused["field"] == {"start": "start", "q": "q[0][0]" if path == "segment" else "q[0]"}[first]


@pytest.mark.parametrize(
    ("body", "place", "expected"),
    [
        ({"kind": "grow", "seed": {"q": "home", "contain": ["away", [0.0]]}}, ("seed", "q"), [HOME]),
        ({"kind": "grow", "seed": {"q": [0.0], "contain": ["away", [0.0]]}}, ("seed", "contain"), [[AWAY], [0.0]]),
        ({"kind": "cover", "options": {"seeds": ["away"]}}, ("seeds",), [[AWAY]]),
        ({"kind": "cover", "options": {"connect": ["home", "away"]}}, ("connect",), [[HOME], [AWAY]]),
        ({"kind": "cover", "options": {"paths": [["home", "away"]]}}, ("paths",), [[[HOME], [AWAY]]]),
        ({"kind": "certify-path", "q": ["home", "away"]}, ("q",), [[HOME], [AWAY]]),
    ],
)
def test_jobs_keep_the_positions_that_a_name_meant(
    client: TestClient, named: Callable[..., None], body: dict[str, Any], place: tuple[str, ...], expected: object
) -> None:
    def asked(job: dict[str, Any]) -> object:
        found: Any = job["options"]
        for name in place:
            found = found[name]
        return found

    job = client.post("/v1/jobs", json={"scene": "slider", **body}).json()
    assert asked(job) == expected
    named(home=0.05, away=0.06)
    assert asked(client.get(f"/v1/jobs/{job['id']}").json()) == expected
    assert asked(client.post("/v1/jobs", json={"scene": "slider", **body}).json()) != expected


def test_a_region_may_still_be_named_and_a_configuration_comes_first(client: TestClient, named: Callable[..., None], region: str) -> None:
    def goal(text: str) -> Any:
        return ask(client, "/v1/planning/plan", start="home", goal=text, regions_only=True)

    assert goal(region)["found"]
    assert goal(region[:8])["q"][-1] != [AWAY]
    assert goal("0123abcd")["code"] == "region_not_found"
    named(home=HOME, **{region[:8]: AWAY})
    assert goal(region[:8])["q"][-1] == pytest.approx([AWAY], abs=1e-9)


@pytest.mark.parametrize("wrong", ["", "x" * 2001, 3, None, {"home": 1}])
def test_what_is_neither_positions_nor_a_name_is_refused_at_its_place(client: TestClient, named: object, wrong: object) -> None:
    refused = ask(client, "/v1/planning/contains", q=[[0.0], wrong])
    assert (refused["status"], refused["code"]) == (422, "invalid_request")
    assert [error["field"] for error in refused["errors"]] == ["q[1]"]
    assert ask(client, "/v1/planning/contains", s=["home"])["status"] == 422, "s has no names"


def test_the_scene_lists_its_configurations_and_the_last_ones_hold(client: TestClient, named: Callable[..., None]) -> None:
    def listed() -> Any:
        return client.get("/v1/scenes/slider").json()["configurations"]

    (joint,) = (position["name"] for position in client.get("/v1/scenes/slider").json()["positions"])
    assert listed() == {"home": {joint: HOME}, "away": {joint: AWAY}}
    before = client.get("/v1/scenes/slider").json()["id"]
    named(rest=0.0)
    assert listed() == {"rest": {joint: 0.0}}
    assert client.get("/v1/scenes/slider").json()["id"] == before
    assert ask(client, "/v1/planning/contains", q=["home"])["code"] == "unknown_configuration"
    named()
    assert listed() == {}


@pytest.fixture
def other(database: Database, named: object, scene: Scene) -> str:
    """Adds the scene of the region under another name, where home is elsewhere and away is not known. Returns its id."""
    (joint,) = (joint.name for joint in scene.moving)
    with database.write() as session:
        return scenes.add(session, replace(scene, name="other", configurations={"home": {joint: 0.1}, "rest": {joint: 0.0}})).id


def test_each_name_of_a_scene_has_its_own_configurations(client: TestClient, other: str) -> None:
    assert [client.get(f"/v1/scenes/{name}").json()["id"] for name in ("slider", "other")] == [other, other]
    homes = {name: client.get(f"/v1/scenes/{name}").json()["configurations"] for name in ("slider", "other", other)}
    assert [sorted(found) for found in homes.values()] == [["away", "home"], ["home", "rest"], ["away", "rest"]]
    for name in ("slider", f"slider@{other}"):
        assert ask(client, "/v1/planning/contains", scene=name, q=["home"]) == ask(client, "/v1/planning/contains", q=[[HOME]])
        assert ask(client, "/v1/planning/contains", scene=name, q=["rest"])["code"] == "unknown_configuration"
    for name in ("other", f"other@{other}"):
        assert ask(client, "/v1/planning/contains", scene=name, q=["home"]) == ask(client, "/v1/planning/contains", q=[[0.1]])
    refused = ask(client, "/v1/planning/contains", scene=other, q=["rest", "home"])
    assert (refused["code"], refused["field"]) == ("configuration", "q[1]")
    assert all(name in refused["detail"] for name in ("'home'", "'slider'", "'other'")), refused
    assert ask(client, "/v1/planning/contains", scene=other[:8], q=["rest", "away"])["status"] == 200
    assert ask(client, "/v1/planning/contains", scene=f"third@{other}", q=["rest"])["code"] == "scene_not_found"


def test_the_last_part_of_a_name_counts_as_under_each_name(
    client: TestClient, database: Database, named: Callable[..., None], scene: Scene
) -> None:
    """home is a configuration under one name, and the last part of arm/home under another one."""
    (joint,) = (joint.name for joint in scene.moving)
    with database.write() as session:
        scene_id = scenes.add(session, replace(scene, name="long", configurations={"arm/home": {joint: 0.1}})).id
    refused = ask(client, "/v1/planning/contains", scene=scene_id, q=["home"])
    assert (refused["code"], refused["field"]) == ("configuration", "q[0]")
    assert ask(client, "/v1/planning/contains", scene="long", q=["home"]) == ask(client, "/v1/planning/contains", q=[[0.1]])
    assert ask(client, "/v1/planning/contains", scene=scene_id, q=["arm/home"])["status"] == 200


def test_a_staged_scene_is_found_by_its_id_for_as_long_as_it_is_stored(client: TestClient, database: Database, other: str) -> None:
    (joint,) = (position["name"] for position in client.get("/v1/scenes/slider").json()["positions"])
    with database.write() as session:
        new = staging.stage(session, "slider", replace(slider(posts=1), configurations={"home": {joint: 0.02}})).id
    given = f"slider@staged@{new}"
    assert client.get(f"/v1/scenes/{given}").json()["configurations"] == {"home": {joint: 0.02}}
    with database.write() as session:
        staging.promote(session, "slider", without_regions=True)
    assert client.get(f"/v1/scenes/{given}").json()["id"] == new
    assert client.get("/v1/scenes/slider").json()["configurations"] == {"home": {joint: 0.02}}
    assert client.get(f"/v1/scenes/slider@{other}").json()["configurations"].keys() == {"home", "away"}, "what the name meant before"


def test_a_constrained_scene_keeps_the_configurations(client: TestClient, other: str) -> None:
    (joint,) = (position["name"] for position in client.get("/v1/scenes/slider").json()["positions"])
    low = {"name": "low", "inside": {"what": [client.get("/v1/scenes/slider").json()["bodies"][-1]], "half_spaces": [[0, 0, 1, 9]]}}
    for name, expected in (("slider", {"home": HOME, "away": AWAY}), ("other", {"home": 0.1, "rest": 0.0})):
        made = client.post(f"/v1/scenes/{name}/constrain", json={"name": f"low-{name}", "conditions": [low]})
        assert made.status_code == 201, made.text
        assert made.json()["configurations"] == {one: {joint: value} for one, value in expected.items()}
    refused = client.post("/v1/scenes/slider/constrain", json={"name": "other", "conditions": [low]})
    assert (refused.status_code, refused.json()["code"], refused.json()["field"]) == (422, "scene_name", "name")


@pytest.mark.parametrize("name", ["a\x1b[2Jb", "", " a", "../x", "a/..", "0123456789abcdef", "0f" * 32, "é", "a" * 201])
def test_a_scene_has_a_name_that_harms_nobody(client: TestClient, region: str, name: str) -> None:
    low = {"name": "low", "inside": {"what": [client.get("/v1/scenes/slider").json()["bodies"][-1]], "half_spaces": [[0, 0, 1, 9]]}}
    refused = client.post("/v1/scenes/slider/constrain", json={"name": name, "conditions": [low]})
    assert (refused.status_code, refused.json()["field"]) == (422, "name"), refused.text
    assert "\x1b" not in refused.json()["detail"]


def test_what_a_name_may_be_is_said_with_the_refusal(client: TestClient, region: str) -> None:
    low = {"inside": {"what": [client.get("/v1/scenes/slider").json()["bodies"][-1]], "half_spaces": [[0, 0, 1, 9]]}}
    for name, condition, field in (("low!", "low", "name"), ("low", "low!", "conditions[0].name")):
        body = {"name": name, "conditions": [{"name": condition, **low}]}
        problem = client.post("/v1/scenes/slider/constrain", json=body).json()
        assert (problem["status"], problem["field"]) == (422, field)
        assert problem["hint"].startswith("names have at most 200 ASCII letters, digits, ")
