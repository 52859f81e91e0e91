"""Questions of planners over HTTP, about really certified regions, which come and go."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api import graph
from api.app import create_app
from certifier.jobs.map import grow_map
from certifier.jobs.region import Region, certified_region
from certifier.map.free_set import as_file, free_set
from certifier.model import Scene
from certifier.pair.certification import Certification
from db import jobs, overlaps, regions
from db.models import StepRow
from db.session import Database
from db.states import ACCEPT, StepState
from planner import nearest, overlap
from tests.api.conftest import BASE_URL, store_region
from tests.certifier.scenes import accepted
from tests.db.builders import a_running_job, add_region
from tests.scenes import slider


@pytest.mark.parametrize("space", ["q", "s"])
def test_contains_says_which_region_holds_a_point_and_how_deep(client: TestClient, region: str, space: str) -> None:
    body = {"scene": "slider", space: [[0.1], [0.9], [-0.3]]}
    answer = client.post("/v1/planning/contains", json=body).json()
    inside, outside, edge = answer["points"]
    assert (answer["regions"], inside["inside"], inside["regions"][0]["region"]) == (1, True, region)
    assert inside["margin"] == inside["regions"][0]["margin"] == pytest.approx(0.1)
    assert inside["regions"][0]["guarantee"] == "exact"
    assert (outside["inside"], outside["regions"], outside["margin"]) == (False, [], None)
    assert (edge["inside"], edge["margin"]) == (True, 0.0)


def test_contains_without_any_region_is_no(client: TestClient, scene) -> None:
    answer = client.post("/v1/planning/contains", json={"scene": "slider", "q": [[0.1]]}).json()
    assert {name: answer[name] for name in ("scene", "version", "regions")} == {"scene": scene.hash[:16], "version": 0, "regions": 0}
    assert answer["points"] == [{"inside": False, "regions": [], "margin": None, "motions": [], "map": None}]


@pytest.mark.parametrize(
    ("body", "field"),
    [({"q": [[0.1, 0.2]]}, "q[0]"), ({"q": [[0.1]], "s": [[0.1]]}, "body"), ({}, "body"), ({"q": [["x"]]}, "q[0][0]"), ({"q": []}, "q")],
)
def test_contains_refuses_what_makes_no_sense(client: TestClient, scene, body: dict[str, object], field: str | None) -> None:
    answer = client.post("/v1/planning/contains", json={"scene": "slider"} | body)
    assert (answer.status_code, answer.json()["field"]) == (422, field)


def test_nearest_names_the_nearest_region_and_its_nearest_point(client: TestClient, region: str) -> None:
    answer = client.post("/v1/planning/nearest", json={"scene": "slider", "q": [[0.1], [0.9], [5.0]]}).json()
    inside, outside, beyond = (point["nearest"] for point in answer["points"])
    assert (answer["version"], answer["regions"]) == (1, 1)
    assert inside == {"region": region, "map": None, "guarantee": "exact", "distance": 0.0, "q": [0.1], "s": [0.1]}
    assert (outside["region"], outside["distance"]) == (region, pytest.approx(0.7))
    assert outside["q"] == outside["s"] == [pytest.approx(0.2)]
    assert client.post("/v1/planning/contains", json={"scene": "slider", "q": [outside["q"]]}).json()["points"][0]["inside"]
    assert beyond is None, "5 m is beyond the joint's limits"


def test_nearest_names_the_map_where_it_is_nearer_than_all_regions(
    client: TestClient, region: str, scene: Scene, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {"scene": "slider", "q": [[0.1], [0.45], [0.5], [0.9], [5.0]]}
    before = client.post("/v1/planning/nearest", json=asked).json()
    assert (before["map"], {point["complete"] for point in before["points"]}) == (None, {True})
    job = store_map(database, blocked(scene), region)
    after = client.post("/v1/planning/nearest", json=asked).json()
    assert (after["map"], {point["complete"] for point in after["points"]}) == (job, {True})
    in_region, before_post, at_post, in_map, beyond = (point["nearest"] for point in after["points"])
    assert (in_region["region"], in_region["map"], in_region["distance"], beyond) == (region, None, 0.0, None)
    assert in_map == {"region": None, "map": job, "guarantee": "exact", "distance": 0.0, "q": [0.9], "s": [0.9]}
    for q, near in ((0.45, before_post), (0.5, at_post)):
        assert (near["region"], near["map"]) == (None, job)
        assert near["distance"] == pytest.approx(abs(near["q"][0] - q))
        assert 0 < near["distance"] < q - 0.2, "the region ends at 0.2"
        for space in ("q", "s"):
            body = {"scene": "slider", space: [near[space]]}
            (point,) = client.post("/v1/planning/contains", json=body).json()["points"]
            assert (point["map"], point["regions"]) == (True, [])
    in_s = client.post("/v1/planning/nearest", json={"scene": "slider", "s": [[0.5], [3.0]]}).json()["points"]
    assert in_s[0]["nearest"] == at_post
    assert in_s[1]["nearest"]["distance"] == pytest.approx(2.0), "the joint ends at 1 m"

    monkeypatch.setattr(nearest, "TOGETHER", 1)
    first, second = client.post("/v1/planning/nearest", json=asked | {"q": [[0.5], [0.5]]}).json()["points"]
    assert (first["complete"], second["complete"]) == (False, False)
    assert second["nearest"]["region"] == region, "the regions are looked at nonetheless"


@pytest.mark.parametrize("space", ["q", "s"])
def test_a_segment_is_covered_or_it_is_said_where_it_is_not(client: TestClient, region: str, space: str) -> None:
    body = {"scene": "slider", "q": [[[-0.2], [0.15]], [[0.0], [0.4]], [[0.5], [0.6]]], "space": space}
    inside, leaving, outside = client.post("/v1/planning/segment", json=body).json()["segments"]
    piece = {"begin": 0.0, "end": 1.0, "region": region, "motion": None, "map": None, "guarantee": "exact"}
    assert inside == {"covered": True, "pieces": [piece], "uncovered": None}
    assert (leaving["covered"], leaving["pieces"][0]["end"]) == (False, pytest.approx(0.5))
    assert leaving["uncovered"] | {"next": None} == {
        "time": leaving["pieces"][0]["end"],
        "segment": 0,
        "q": [pytest.approx(0.2)],
        "s": [pytest.approx(0.2)],
        "next": None,
    }
    assert leaving["uncovered"]["next"] is None, "there is no other region"
    assert (outside["covered"], outside["pieces"], outside["uncovered"]["time"]) == (False, [], 0.0)
    assert (outside["uncovered"]["next"]["region"], outside["uncovered"]["next"]["distance"]) == (region, pytest.approx(0.3))


def test_a_path_with_times_is_answered_in_them(client: TestClient, region: str) -> None:
    body = {"scene": "slider", "q": [[0.0], [0.1], [0.5]], "times": [2.0, 3.0, 7.0]}
    answer = client.post("/v1/planning/path", json=body).json()
    (piece,) = answer["pieces"]
    assert (answer["covered"], piece["begin"], piece["end"]) == (False, 2.0, pytest.approx(4.0))
    assert (answer["uncovered"]["segment"], answer["uncovered"]["time"]) == (1, piece["end"])


@pytest.mark.parametrize("space", ["q", "s"])
def test_a_curve_is_answered_in_its_times(client: TestClient, region: str, space: str) -> None:
    """The slider goes out to 0.3, or to 0.1, and back; the region ends at 0.2. Its joint slides, so that s is q."""
    out: list[list[list[float]]] = [[[0.0], [0.1], [0.2]], [[0.2], [0.4], [0.2]]]
    body = {"scene": "slider", "space": space, "bezier": out}
    for times, begin, end in ((None, 0.0, 1.0), ([2.0, 3.0, 7.0], 2.0, 3.0)):
        answer = client.post("/v1/planning/path", json=body | ({} if times is None else {"times": times})).json()
        (piece,) = answer["pieces"]
        assert (answer["covered"], piece["begin"], piece["end"]) == (False, begin, pytest.approx(end, abs=1e-6))
    spline = {"scene": "slider", "space": space, "knots": [5, 5, 5, 6, 8, 8, 8], "control_points": [[0.0], [0.1], [-0.1], [0.1]]}
    answer = client.post("/v1/planning/path", json=spline).json()
    (piece,) = answer["pieces"]
    assert (answer["covered"], piece["begin"], piece["end"]) == (True, 5.0, 8.0)


@pytest.mark.parametrize(
    ("path", "body", "field"),
    [
        ("path", {"bezier": [[[0.1], [0.2]]], "q": [[0.1], [0.2]]}, "body"),
        ("path", {"bezier": [[[0.1], [0.2]]], "times": [1.0, 2.0, 3.0]}, "body"),
        ("path", {"bezier": [[[0.1], [0.2]], [[0.1], [0.2]]]}, "bezier[1][0]"),
        ("path", {"bezier": [[[0.1, 0.2], [0.2, 0.3]]]}, "bezier[0]"),
        ("path", {"bezier": [[[0.1]]]}, "bezier[0]"),
        ("path", {"knots": [0, 0, 1, 1], "control_points": [[0.1], [0.2]], "times": [0, 1]}, "body"),
        ("path", {"knots": [0, 0, 1, 0], "control_points": [[0.1], [0.2]]}, "knots[3]"),
        ("path", {"knots": [0, 0, 1, 1], "control_points": [[0.1, 0], [0.2, 0]]}, "control_points[0]"),
        ("path", {"knots": [0, 0, 1, 1]}, "body"),
        ("segment", {"q": [[[0.1, 0.2], [0.1, 0.2]]]}, "q[0][0]"),
        ("segment", {"q": [[[0.1]]]}, "q[0]"),
        ("segment", {"s": [[[0.1], [0.2]]]}, "body"),
        ("segment", {"q": [[[0.1], [5.0]]], "space": "s"}, "q[0][1]"),
        ("path", {"q": [[0.1]]}, "q"),
        ("path", {"q": [[0.1], [0.2]], "s": [[0.1], [0.2]]}, "body"),
        ("path", {"q": [[0.1], [0.2]], "times": [1.0]}, "times"),
        ("path", {"q": [[0.1], [0.2]], "times": [1.0, 2.0, 3.0]}, "body"),
        ("path", {"q": [[0.1], [0.2]], "times": [1.0, 1.0]}, "body"),
        ("nearest", {}, "body"),
    ],
)
def test_what_makes_no_sense_is_refused(client: TestClient, scene: Scene, path: str, body: dict[str, object], field: str | None) -> None:
    answer = client.post(f"/v1/planning/{path}", json={"scene": "slider"} | body)
    assert (answer.status_code, answer.json()["field"]) == (422, field)


def a_part(lower: float, upper: float) -> Region:
    """A certified region of the slider."""
    scene = slider(posts=2)
    polytope = scene.polytope([[1.0], [-1.0]], [upper, -lower])
    certification = Certification(scene, polytope, np.full(1, (lower + upper) / 2))
    proofs = {index: certification.certify(index).proof or b"" for index in range(2)}
    return certified_region(scene, accepted(polytope, np.full(1, (lower + upper) / 2)), proofs, {"seconds": 1.0})


def test_answers_follow_the_regions_that_come_and_go_by_whoever_changes_them(client: TestClient, region: str, database: Database) -> None:
    """Two API processes, and a worker that adds a region without either."""
    path = {"scene": "slider", "q": [[0.0], [0.6]], "space": "s"}
    with TestClient(create_app(database), base_url=BASE_URL) as other:
        for api in (client, other):
            assert (api.post("/v1/planning/path", json=path).json() | {"pieces": 0, "uncovered": 0})["covered"] is False
        more = store_region(database, a_part(0.1, 0.7))
        for api in (client, other):
            answer = api.post("/v1/planning/path", json=path).json()
            assert (answer["version"], answer["regions"], answer["covered"]) == (2, 2, True)
            assert [piece["region"] for piece in answer["pieces"]] == [region, more]
        assert other.delete(f"/v1/regions/{region}").status_code == 204
        for api in (client, other):
            answer = api.post("/v1/planning/path", json=path).json()
            assert (answer["version"], answer["regions"], answer["covered"]) == (3, 1, False)
            assert answer["uncovered"]["next"]["region"] == more


def test_the_graph_grows_with_the_regions_and_shows_gaps(client: TestClient, region: str, database: Database) -> None:
    alone = client.get("/v1/planning/graph?scene=slider").json()
    assert (alone["complete"], alone["edges"], alone["components"], alone["gaps"]) == (True, [], 1, [])
    beside, far = store_region(database, a_part(0.1, 0.4)), store_region(database, a_part(0.6, 0.9))
    found = client.get("/v1/planning/graph?scene=slider").json()
    (edge,) = found["edges"]
    assert (edge["a"], edge["b"], edge["depth"], edge["q"]) == (region, beside, pytest.approx(0.05), [pytest.approx(0.15)])
    assert (found["version"], found["components"]) == (3, 2)
    assert {node["region"]: node["component"] for node in found["nodes"]} == {region: 0, beside: 0, far: 1}
    (gap,) = found["gaps"]
    assert ({gap["a"], gap["b"]}, gap["distance"], gap["q"]) == ({beside, far}, pytest.approx(0.2), [pytest.approx(0.5)])
    assert client.delete(f"/v1/regions/{beside}").status_code == 204
    assert client.get("/v1/planning/graph?scene=slider").json()["edges"] == []


def test_a_gap_that_the_latest_map_proves_says_so(client: TestClient, region: str, scene: Scene, database: Database) -> None:
    far = store_region(database, a_part(0.6, 0.9))
    before = client.get("/v1/planning/graph?scene=slider").json()
    assert (before["map"], [gap["map"] for gap in before["gaps"]]) == (None, [False])
    for proves in (True, False):  # the second map, which is the latest then, is that of a scene with a post in the gap
        job = store_map(database, scene if proves else blocked(scene), far)
        found = client.get("/v1/planning/graph?scene=slider").json()
        (gap,) = found["gaps"]
        assert (found["map"], gap["map"]) == (job, proves)
        motion = {"scene": "slider", "q": [[gap["q_a"], gap["q_b"]]]}
        (covering,) = client.post("/v1/planning/segment", json=motion).json()["segments"]
        assert covering["covered"] == proves


def store_map(database: Database, mapped: Scene, region: str) -> str:
    """Stores the map of a scene as that of a region's scene, and returns the id of its job."""
    free = free_set(grow_map(mapped, 1.0, deadline_s=10.0).proof)
    with database.write() as session:
        job, _ = jobs.create(session, kind="map", scene_id=regions.get(session, region).scene_id, options={})
        session.add(StepRow(job_id=job.id, turn=1, input={}, kind=ACCEPT, state=StepState.DONE, report={}, data=as_file(free)))
        return job.id


def blocked(scene: Scene) -> Scene:
    """The scene with a post in the way of the slider, at x = 0.5."""
    cart, post, *others = scene.geometries
    return replace(scene, geometries=(cart, replace(post, vertices=np.array([[0.5, 0.0, 0.0]])), *others))


def test_regions_are_compared_once_and_for_a_few_seconds_at_a_time(
    client: TestClient, scene: Scene, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    with database.write() as session:
        job = a_running_job(session)
        made = [add_region(session, job, -0.1 * i, 0.5).id for i in range(4)]
        scene_id = job.scene_id
    monkeypatch.setattr(graph, "COMPARE_SECONDS", -1.0)
    unfinished = client.get("/v1/planning/graph?scene=slider").json()
    assert (unfinished["complete"], unfinished["edges"], unfinished["gaps"]) == (False, [], [])
    monkeypatch.setattr(graph, "COMPARE_SECONDS", 60.0)
    assert len(client.get("/v1/planning/graph?scene=slider").json()["edges"]) == 6
    with database.read() as session:
        assert overlaps.numbers(session, scene_id) == {region: (i + 1, i) for i, region in enumerate(made)}

    def again(*_: object) -> None:
        raise AssertionError("this pair was compared before")

    monkeypatch.setattr("planner.overlap.overlap", again)
    assert len(client.get("/v1/planning/graph?scene=slider").json()["edges"]) == 6


def test_comparing_goes_on_where_it_stopped(client: TestClient, scene: Scene, database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    with database.write() as session:
        job = a_running_job(session)
        for i in range(4):
            add_region(session, job, -0.1 * i, 0.5)
    seconds = iter(range(1000))
    for module in (graph, overlap):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: next(seconds)))
    monkeypatch.setattr(graph, "COMPARE_SECONDS", 1.0)
    counts = []
    for _ in range(20):
        answer = client.get("/v1/planning/graph?scene=slider").json()
        counts.append(len(answer["edges"]))
        if answer["complete"]:
            break
    assert counts[-1] == 6
    assert len(counts) > 3
    assert counts == sorted(counts)
