"""A scene with conditions over HTTP: how it is described and drawn, and what questions say where a condition is not kept."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api import drawing
from certifier.conditioned import with_conditions, without_conditions, zone_reach
from certifier.conditions import Cone, Inside
from certifier.model import WORLD, Scene
from db import scenes
from db.session import Database
from tests.certifier.scenes import box, planar_arm


@pytest.fixture
def upright(database: Database) -> Scene:
    """A planar arm whose second link points to within 60 degrees of x, and stays below a line."""
    arm = planar_arm(obstacle=box("world/post", WORLD, (0.1, 0.1, 0.1), (0.0, 1.9, 0.0)))
    cone = Cone("along-x", "arm/link2", (1.0, 0.0, 0.0), WORLD, (1.0, 0.0, 0.0), math.radians(60))
    scene = with_conditions(arm, [cone, Inside("below", ("arm/link2/bar",), WORLD, ((0.0, 1.0, 0.0, 1.2),))])
    with database.write() as session:
        scenes.add(session, scene)
    return scene


def test_a_scene_is_described_with_its_conditions_and_without_what_stands_for_them(client: TestClient, upright: Scene) -> None:
    told = client.get("/v1/scenes/planar").json()
    assert [(one["name"], one["kind"], one["statement"]) for one in told["conditions"]] == [
        (one.name, one.kind, str(one)) for one in upright.conditions
    ]
    assert (told["geometries"], told["pairs"], told["joints"], len(told["positions"])) == (3, 2, 2, 2)
    assert not any(body.startswith("conditions/") for body in told["bodies"])
    assert told["not_covered"]["pairs"] == 1, "the two links, which are neighbours"
    model = client.get("/v1/scenes/planar/model").json()
    drawn = [geometry["name"] for geometry in model["geometries"] if geometry["vertices"]]
    assert drawn == ["arm/link1/bar", "arm/link2/bar", "world/post"]
    assert len(model["pairs"]) == len(upright.pairs)


def test_a_model_has_the_zones_and_the_cones(client: TestClient, upright: Scene) -> None:
    model = client.get("/v1/scenes/planar/model").json()
    cone, below = upright.conditions
    assert isinstance(cone, Cone)
    assert isinstance(below, Inside)
    drawn = {"condition": "along-x", "body": "arm/link2", "axis": [1, 0, 0], "of": "world", "along": [1, 0, 0], "angle": cone.angle}
    assert model["cones"] == [drawn]
    (zone,) = model["zones"]
    assert (zone["condition"], zone["of"]) == ("below", "world")
    vertices, reach = np.array(zone["vertices"]), zone_reach(upright, below)
    # The half-space y <= 1.2 within the cube that the arm can reach.
    assert vertices.min(axis=0) == pytest.approx([-reach] * 3)
    assert vertices.max(axis=0) == pytest.approx([reach, 1.2, reach])
    volume = sum(np.linalg.det(vertices[t]) for t in zone["triangles"]) / 6
    assert volume == pytest.approx(4 * reach**2 * (reach + 1.2))


def test_a_zone_with_nothing_in_it_is_drawn_as_nothing(upright: Scene) -> None:
    empty = Inside("nowhere", ("arm/link2/bar",), WORLD, ((0.0, 1.0, 0.0, -0.2), (0.0, -1.0, 0.0, 0.1)))
    (zone,) = drawing.model("0", with_conditions(without_conditions(upright), [empty]), False).zones
    assert (zone.vertices, zone.triangles) == ([], [])


def test_a_scene_becomes_another_one_with_more_conditions(client: TestClient, upright: Scene) -> None:
    below = {"name": "low", "inside": {"what": ["arm/link2/bar"], "half_spaces": [[0, 1, 0, 1.5]]}}
    made = client.post("/v1/scenes/planar/constrain", json={"name": "lower", "conditions": [below]})
    assert made.status_code == 201, made.text
    told = made.json()
    assert made.headers["Location"] == f"/v1/scenes/{told['id']}"
    assert (told["name"], told["names"]) == ("lower", ["lower"])
    assert [one["name"] for one in told["conditions"]] == ["along-x", "below", "low"]
    expected = with_conditions(
        without_conditions(upright), [*upright.conditions, Inside("low", ("arm/link2/bar",), WORLD, ((0.0, 1.0, 0.0, 1.5),))]
    )
    assert told["hash"] == expected.hash
    assert client.get("/v1/scenes/planar").json()["hash"] == upright.hash
    assert client.get("/v1/scenes/lower").json()["id"] == told["id"]
    again = client.post("/v1/scenes/lower/constrain", json={"name": "lowest", "conditions": [below]})
    assert (again.status_code, again.json()["code"], again.json()["field"]) == (422, "scene_field", "conditions[0].name")
    for conditions, field in (
        ([{"name": "c", "cone": {"body": "arm/link2", "axis": [1, 0, 0], "along": [1, 0, 0], "degrees": 200}}], "conditions[0].cone"),
        ([{"name": "c", "cone": {"body": "arm/hand", "axis": [1, 0, 0], "along": [1, 0, 0], "degrees": 20}}], "conditions[0].cone.body"),
        ([{"name": "c"}], "conditions[0]"),
        ([], "conditions"),
    ):
        refused = client.post("/v1/scenes/planar/constrain", json={"name": "never", "conditions": conditions})
        assert (refused.status_code, refused.json()["field"]) == (422, field), refused.text
    assert client.get("/v1/scenes/never").status_code == 404


def test_a_motion_keeps_the_conditions_or_says_which_is_not_kept(client: TestClient, upright: Scene) -> None:
    asked = {"scene": "planar", "start": [0.0, 0.0], "seconds": 1.0}
    found = client.post("/v1/planning/plan", json={**asked, "goal": [0.5, -0.5]}).json()
    assert found["found"], found
    ends = np.array(found["q"]).sum(axis=1)
    assert np.abs(ends).max() < math.radians(60)
    refused = client.post("/v1/planning/plan", json={**asked, "goal": [-0.6, -0.6]}).json()
    assert (refused["found"], refused["reason"]) == (False, "goal_in_collision")
    assert refused["collision"]["condition"] == "the condition 'along-x' is not kept: the angle is 68.75 degrees, and 60 at most"
    contacts = client.post("/v1/planning/contacts", json={"scene": "planar", "q": [[-0.6, -0.6]]}).json()["contacts"]
    names = {name for pair in contacts[0]["pairs"] for name in (upright.pairs[pair].a, upright.pairs[pair].b)}
    assert "conditions/along-x/direction" in names
    assert "the condition 'along-x' is not kept: the angle is 68.75 degrees, and 60 at most" in contacts[0]["trouble"]
