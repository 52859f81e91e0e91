"""The meshes of a scene's models over HTTP: what is kept of an upload, for whom, how much it counts, and when it goes."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from scipy.spatial import ConvexHull

from certifier.scene import drawn
from db import retention
from db.session import Database
from tests.certifier.scene.test_drawn import ball

_LONG, _WIDE, _HIGH = 0.3, 0.1, 0.05
_OUTLINE = ((0, 0), (_LONG, 0), (_LONG, _WIDE), (_WIDE, _WIDE), (_WIDE, _LONG), (0, _LONG))
CORNER = (
    "".join(f"v {x} {y} {z}\n" for z in (0, _HIGH) for x, y in _OUTLINE)
    + "".join(f"f {a} {c} {b}\n" for a, b, c in ((1, 2, 3), (1, 3, 4), (1, 4, 5), (1, 5, 6)))
    + "".join(f"f {a + 6} {b + 6} {c + 6}\n" for a, b, c in ((1, 2, 3), (1, 3, 4), (1, 4, 5), (1, 5, 6)))
    + "".join(f"f {a} {a % 6 + 1} {a + 6}\nf {a % 6 + 1} {a % 6 + 7} {a + 6}\n" for a in range(1, 7))
)
"""A solid like an L, of 20 triangles. Its hull closes the corner."""
MODEL = """<robot name="arm"><link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="tip"><collision><origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/>
<geometry><mesh filename="link.obj" scale="2 1 1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def zipped(**files: str) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name, text in files.items():
            archive.writestr(name.replace("_", "."), text)
    return data.getvalue()


def added(client: TestClient, data: bytes, **query: str) -> Any:
    answer = client.post("/v1/scenes", files={"bundle": ("arm.zip", data)}, params=query)
    assert answer.status_code == 201, answer.text
    return answer.json()


def test_the_meshes_of_a_draft_are_kept_where_the_model_places_them(client: TestClient) -> None:
    scene = added(client, zipped(arm_urdf=MODEL, link_obj=CORNER))
    model = client.get(f"/v1/scenes/{scene['id']}/model").json()
    assert model["has_meshes"]
    answer = client.get(f"/v1/scenes/{scene['id']}/meshes")
    found = answer.json()
    assert (found["scene"], found["triangles"], found["moved"]) == (scene["id"], 20, 0.0)
    (mesh,) = found["meshes"]
    assert (mesh["geometry"], mesh["body"], len(mesh["triangles"])) == ("arm/tip/Mesh", "arm/tip", 20)
    points = np.array(mesh["vertices"])
    assert points.min(axis=0) == pytest.approx([0.5 - _LONG, 0, 0])
    assert points.max(axis=0) == pytest.approx([0.5, 2 * _LONG, _HIGH])
    (certified,) = [np.array(one["vertices"]) for one in model["geometries"] if one["body"] == "arm/tip"]
    faces = ConvexHull(certified).equations
    assert (points @ faces[:, :3].T + faces[:, 3]).max() < 1e-6, "the certified body contains the mesh"
    again = client.get(f"/v1/scenes/{scene['id']}/meshes", headers={"If-None-Match": answer.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_scenes_without_meshes_have_none(client: TestClient, planar: Any) -> None:
    assert not client.get("/v1/scenes/planar/model").json()["has_meshes"]
    assert client.get("/v1/scenes/planar/meshes").json() == {"scene": planar.hash[:16], "meshes": [], "triangles": 0, "moved": 0.0}
    assert client.get("/v1/scenes/nothing/meshes").json()["code"] == "scene_not_found"


def test_a_scene_with_more_conditions_has_the_meshes_of_its_models(client: TestClient) -> None:
    scene = added(client, zipped(arm_urdf=MODEL, link_obj=CORNER))
    ahead = {"name": "ahead", "cone": {"body": "arm/tip", "axis": [1, 0, 0], "along": [1, 0, 0], "degrees": 60}}
    answer = client.post(f"/v1/scenes/{scene['id']}/constrain", json={"name": "low-arm", "conditions": [ahead]})
    assert answer.status_code == 201, answer.text
    of_both = [client.get(f"/v1/scenes/{name}/meshes").json()["meshes"] for name in (scene["id"], "low-arm")]
    assert of_both[0] == of_both[1] != []


def test_a_mesh_that_was_mended_inside_of_its_hull_takes_the_place_of_the_former_one(client: TestClient) -> None:
    """The certified bodies are the same, so it is the same scene."""
    scene = added(client, zipped(arm_urdf=MODEL, link_obj=CORNER))
    mended = added(client, zipped(arm_urdf=MODEL, link_obj=CORNER.replace("f 1 3 2\n", "")))
    assert mended["id"] == scene["id"]
    assert client.get(f"/v1/scenes/{scene['id']}/meshes").json()["triangles"] == 19


def test_meshes_count_as_stored_and_go_with_their_scene(client: TestClient, database: Database) -> None:
    scene = added(client, zipped(arm_urdf=MODEL, link_obj=CORNER))
    with database.read() as session:
        before = retention.stored(session, "default")
    fine = CORNER + "f 1 2 7\nf 1 2 8\nf 1 2 9\n" * 2000
    added(client, zipped(arm_urdf=MODEL, link_obj=fine))
    with database.read() as session:
        assert retention.stored(session, "default") > before
    assert client.delete(f"/v1/scenes/{scene['id']}").status_code == 204
    with database.read() as session:
        assert retention.stored(session, "default") == 0


def test_many_triangles_are_drawn_coarser_and_it_says_how_much(client: TestClient) -> None:
    mesh = ball(140)
    add = "directives:\n- add_model: {name: arm, file: arm.urdf}\n- add_weld: {parent: world, child: arm::base}\n"
    scene = added(client, zipped(scene_yaml=add, arm_urdf=MODEL, link_obj=mesh.obj()))
    found = client.get(f"/v1/scenes/{scene['id']}/meshes").json()
    assert found["triangles"] == len(mesh.triangles) > drawn.MOST_DRAWN >= len(found["meshes"][0]["triangles"])
    assert 0 < found["moved"] < 0.02
