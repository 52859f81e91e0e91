"""What people look at, over HTTP: the robot's bodies, contacts, slices, and configurations of a region."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api import drawing
from certifier.kinematics import Kinematics
from certifier.model import Array, Scene
from certifier.pair.collisions import in_collision
from tests.certifier.scenes import ball


def slice_of(client: TestClient, planar: Scene, **parts: Any) -> Any:
    body = {"scene": "planar", "q": [0.0, 0.0], "x": "arm/joint1", "y": "arm/joint2", "size": 40}
    return client.post("/v1/planning/slice", json=body | parts).json()


def faces_of(client: TestClient, region: str) -> tuple[Array, Array]:
    manifest = client.get(f"/v1/regions/{region}").json()["manifest"]
    return np.array(manifest["halfspace_normals"]), np.array(manifest["halfspace_offsets"])


def test_a_model_is_the_scene_with_closed_hulls(client: TestClient, planar: Scene) -> None:
    model = client.get("/v1/scenes/planar/model").json()
    assert model["scene"] == planar.hash[:16]
    assert model["units"] == ["rad", "rad"]
    assert [model["geometries"][i]["name"] for i in model["pairs"][0]] == [planar.pairs[0].a, planar.pairs[0].b]
    for drawn, geometry in zip(model["geometries"], planar.geometries, strict=True):
        vertices = np.array(drawn["vertices"])
        assert np.array_equal(vertices, geometry.vertices)
        edges = Counter((a, b) for t in drawn["triangles"] for a, b in zip(t, [*t[1:], t[0]], strict=True))
        assert set(edges.values()) == {1}
        assert all((b, a) in edges for a, b in edges), "closed, and every triangle is turned the same way"
        volume = sum(np.linalg.det(vertices[t]) for t in drawn["triangles"]) / 6
        assert volume == pytest.approx(np.prod(np.ptp(vertices, axis=0))), "outwards"


def test_flat_bodies_and_balls_have_what_can_be_drawn_of_them() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert len(drawing.triangles(square)) >= 4
    assert drawing.triangles(ball("a/b/c", "a/b", 0.1).vertices).shape == (0, 3)


def test_contacts_are_those_of_the_pairs_one_at_a_time(client: TestClient, planar: Scene) -> None:
    q = np.random.default_rng(0).uniform(-1.2, 1.2, (100, 2))
    found = client.post("/v1/planning/contacts", json={"scene": "planar", "q": q.tolist()}).json()["contacts"]
    alone = [in_collision(replace(planar, pairs=(pair,)), planar.to_s(q)) for pair in planar.pairs]
    assert [contact["pairs"] for contact in found] == [[i for i, touches in enumerate(alone) if touches[k]] for k in range(100)]
    assert 0 < sum(bool(contact["pairs"]) for contact in found) < 100
    named = [[planar.pairs[i] for i in contact["pairs"]] for contact in found]
    assert [contact["trouble"] for contact in found] == [[f"{pair.a} and {pair.b} touch" for pair in pairs] for pairs in named]
    assert not any(contact["outside"] for contact in found)


def test_contacts_say_which_joint_is_outside_of_its_limits(client: TestClient, planar: Scene) -> None:
    body = {"scene": "planar", "q": [[1.3, 0.0], [0.0, 4.0]]}
    near, far = client.post("/v1/planning/contacts", json=body).json()["contacts"]
    assert (near["outside"], near["pairs"] is None) == (["arm/joint1"], False)
    assert (far["outside"], far["pairs"]) == (["arm/joint2"], None)
    assert "the joint arm/joint1 is beyond its limits" in near["trouble"]
    assert far["trouble"] == ["the joint arm/joint2 is beyond its limits"]


def test_a_slice_is_free_and_in_collision_where_the_arm_is(client: TestClient, planar: Scene, planar_region: str) -> None:
    answer = slice_of(client, planar)
    assert (answer["x"]["lower"], answer["x"]["upper"], answer["x"]["unit"]) == (-1.2, 1.2, "rad")
    middles = -1.2 + 2.4 * (np.arange(40) + 0.5) / 40
    q = np.array([[x, y] for y in middles for x in middles])
    collides = in_collision(planar, planar.to_s(q)).reshape(40, 40)
    C, d = faces_of(client, planar_region)
    within = (planar.to_s(q) @ C.T <= d).all(axis=1).reshape(40, 40)
    assert within.any()
    assert not (within & collides).any()
    expected = np.where(collides, "#", np.where(within, "o", "."))
    assert answer["rows"] == ["".join(row) for row in expected]


def test_the_outlines_of_a_slice_are_the_regions_in_q(client: TestClient, planar: Scene, planar_region: str) -> None:
    found = slice_of(client, planar)["regions"]
    assert [region["region"] for region in found] == [planar_region]
    outline = planar.to_s(np.array(found[0]["polygon"]))
    assert outline.min(axis=0) == pytest.approx([-0.3, -0.2])
    assert (outline.sum(axis=1) <= -0.2 + 1e-12).all()
    assert slice_of(client, planar, regions=[])["regions"] == []
    assert slice_of(client, planar, x_range=[0.5, 9.0])["regions"] == []
    assert slice_of(client, planar, x_range=[0.5, 9.0])["x"]["upper"] == 1.2


@pytest.mark.parametrize(
    ("parts", "field", "code"),
    [
        ({"x": "arm/joint9"}, "x", "unknown_joint"),
        ({"y": "arm/joint1"}, "y", "same_joint"),
        ({"x_range": [2.0, 3.0]}, "x_range", "slice_outside_limits"),
        ({"x_range": [1.0, 1.0]}, "body", "invalid_request"),
        ({"regions": ["none"]}, "regions[0]", "region_elsewhere"),
        ({"q": [0.0]}, "q", "wrong_length"),
        ({"q": [0.0, 2.0]}, "q[0]", "waypoint_outside_limits"),
        ({"size": 5000}, "size", "invalid_request"),
    ],
)
def test_a_slice_refuses_what_makes_no_sense(client: TestClient, planar: Scene, parts: Any, field: str, code: str) -> None:
    problem = slice_of(client, planar, **parts)
    assert (problem["field"], problem["code"]) == (field, code)


def test_a_map_is_computed_once(client: TestClient, planar: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    first = slice_of(client, planar)
    monkeypatch.setattr(drawing, "run_in_child", None)
    assert slice_of(client, planar)["rows"] == first["rows"]


def test_configurations_of_a_region_are_in_it_and_reach_its_ends(client: TestClient, planar: Scene, planar_region: str) -> None:
    answer = client.get(f"/v1/regions/{planar_region}/configurations?samples=60").json()
    manifest = client.get(f"/v1/regions/{planar_region}").json()["manifest"]
    C, d = faces_of(client, planar_region)
    assert len(answer["samples"]) == 60
    for q in [answer["center"], *answer["samples"]]:
        assert (C @ planar.to_s(q) <= d + 1e-9).all()
    for joint, extreme in enumerate(answer["extremes"]):
        known = manifest["joint_ranges"][extreme["joint"]]
        for end in ("lower", "upper"):
            assert (C @ planar.to_s(extreme[end]) <= d + 1e-9).all()
            assert np.rad2deg(extreme[end][joint]) == pytest.approx(known[end], abs=1e-6)
    assert client.get(f"/v1/regions/{planar_region}/configurations?samples=60").json() == answer
    assert client.get(f"/v1/regions/{planar_region}/configurations?samples=0").json()["samples"] == []


def test_the_tree_of_a_model_is_enough_to_place_the_bodies(client: TestClient, planar: Scene) -> None:
    """The pose that a reader computes from the model is the certifier's."""
    model, q = client.get("/v1/scenes/planar/model").json(), np.array([0.3, -0.7])
    X = {"world": np.eye(4)}
    for joint in model["joints"]:
        angle = q[joint["index"]]
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        X[joint["child"]] = X[joint["parent"]] @ joint["X_PF"] @ turn @ np.linalg.inv(joint["X_BM"])
    expected = Kinematics.of(planar).numerators("world", "arm/link2", planar.to_s(q)[None])[0]
    assert X["arm/link2"] == pytest.approx(expected / expected[3, 3])
