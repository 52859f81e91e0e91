"""Work over time on the page of a job, in a real browser; what the page of a map says; and the words for a condition."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db.leases import this_worker
from db.session import Database
from tests.api.test_conditions import upright
from tests.dashboard.job_scenes import begin, certified, new_job, settle, too_close

__all__ = ["upright"]


def test_work_is_drawn_over_time_and_told_in_a_table(page: Any, url: str, database: Database, scene: Scene, barriers: Any) -> None:
    job_id = new_job(database, scene)
    begin(database, scene, job_id, cells=64)
    page.goto(f"{url}/jobs/{job_id}")
    section = page.get_by_role("region", name="Work over time", exact=True)
    section.scroll_into_view_if_needed()
    section.get_by_text("No process has finished any work for this job yet.").wait_for()
    settle(database, job_id, too_close(scene, 64), batch=0)
    settle(database, job_id, replace(certified(), looked=64), batch=0)
    bars = section.locator("svg.work rect")
    # The page waits ten times as long as an answer took before it asks again.
    section.locator("svg.work rect.too_close").wait_for(timeout=60_000)
    section.locator("svg.work rect.certified").wait_for(timeout=60_000)
    assert bars.count() == 2
    assert "post0 in iteration 0: too close" in bars.nth(0).text_content()
    section.get_by_text("As a table").click()
    cells = section.locator("tbody td").all_text_contents()
    assert cells[:3] == [":".join(this_worker().split(":")[:2]), "2", "2.1 s"]
    section.get_by_role("img", name="Pairs and parts of pairs settled per second").wait_for()
    section.get_by_role("img", name="Cells looked at per second").wait_for()
    assert barriers(page) == []
    section.get_by_role("button", name="Closer").click()
    section.get_by_role("button", name="Farther").wait_for()
    section.get_by_role("button", name="All of it").click()
    section.locator("svg.work rect.too_close").dispatch_event("click")
    page.wait_for_url("**#pair=0&iteration=0")


def test_processes_are_counted_in_words(page: Any, url: str, client: TestClient, database: Database, scene: Scene) -> None:
    job_id = new_job(database, scene)
    begin(database, scene, job_id, cells=64)
    settle(database, job_id, too_close(scene, 64), batch=0)
    told, answer = client.get(f"/v1/jobs/{job_id}/timeline").json(), {}
    page.route("**/timeline*", lambda route: route.fulfill(json=answer))
    one, many = "1 more process, which worked less, is left out.", "3 more processes, which worked less, are left out."
    for processes, others, said in ((1, 1, one), (2, 3, many)):
        answer.update(told | {"processes": told["processes"] * processes, "others": others})
        page.goto(f"{url}/jobs/{job_id}")
        page.get_by_role("region", name="Work over time", exact=True).scroll_into_view_if_needed()
        page.get_by_text(said).wait_for()
        page.get_by_role("img", name="What 1 process did" if processes == 1 else "What 2 processes did").wait_for()


@pytest.mark.usefixtures("worker")
def test_the_page_of_a_map_says_what_is_proved_of_each_path(page: Any, url: str, client: TestClient, planar: Scene) -> None:
    """Its shares are estimates, and look so; a configuration that it proves looks proved."""
    page.set_viewport_size({"width": 390, "height": 844})
    options = {"coverage": 0.3, "at": [[-0.3, 0.1]], "paths": [[[-0.3, 0.1], [-0.4, 0.2]], [[-0.2, 0.1], [-0.3, 0.1], [-0.3, 0.2]]]}
    job = client.post("/v1/jobs", json={"kind": "map", "scene": "planar", "options": options}).json()["id"]
    page.goto(f"{url}/jobs/{job}")
    page.locator(".title .badge.succeeded").wait_for(timeout=60_000)
    shares = client.get(f"/v1/jobs/{job}/map").json()["stored"]["paths"]
    rows = page.get_by_role("region", name="Motions wanted first").locator("tbody tr")
    assert rows.locator("td:nth-child(2)").all_text_contents() == ["2", "3"]
    shown = [float(text.removesuffix(" %")) for text in rows.locator("td:nth-child(3)").all_text_contents()]
    assert all(100 * share - 0.1 <= said <= 100 * share for said, share in zip(shown, shares, strict=True))
    page.get_by_role("cell", name="proved free of collision").locator(".proved").wait_for()
    page.get_by_text("of the free configurations are proved after").locator(".computed").wait_for()
    page.locator(".log").get_by_text("of the free configurations, as samples say").first.wait_for()
    offered = page.get_by_label("Show events").locator("option").all_text_contents()
    assert {"everything", "the job", "steps", "progress"} <= {*offered}
    assert {"iterations", "pairs", "regions", "the cover"}.isdisjoint(offered), "a map has none of these"
    whole = client.get(f"/v1/jobs/{job}/map").json() | {"curve": [[1, 0], [2, 1]]}
    page.route(f"**/v1/jobs/{job}/map", lambda route: route.fulfill(json=whole))
    page.reload()
    page.locator(".share svg text", has_text="100 %").wait_for()
    chart, label = page.locator(".share svg").bounding_box(), page.locator(".share svg text", has_text="100 %").bounding_box()
    assert label["x"] >= chart["x"]
    page.locator(".log").get_by_text("Putting the proof of the map together and verifying it: done").wait_for()
    assert page.get_by_text("the region's proof").count() == 0
    page.get_by_role("region", name="Work over time", exact=True).scroll_into_view_if_needed()
    page.locator("svg.work rect.step").first.wait_for()
    page.get_by_role("img", name="Cells looked at per second").wait_for()
    assert page.get_by_role("img", name="settled per second").count() == 0, "a map has no pairs"


def test_the_cells_of_a_condition_are_no_two_bodies(page: Any, url: str, client: TestClient, upright: Scene, database: Database) -> None:
    job_id = new_job(database, upright)
    index = next(i for i, pair in enumerate(upright.pairs) if "conditions/along-x" in pair.a + pair.b)
    answer = {
        "pair": {"index": index, "a": upright.pairs[index].a, "b": upright.pairs[index].b},
        "state": "certified",
        "certified": True,
        "iteration": 0,
        "kind": "program",
        "joints": [0],
        "lower": [-1, -1],
        "upper": [1, 1],
        "q_star": [0, 0],
        "revolute": [True, True],
        "nodes": [-1],
        "cuts": [],
        "choices": [0],
        "volumes": [["a", "b"]],
        "counts": {"plane": 1, "empty": 0, "open": 0},
        "folded": [],
    }
    page.route(f"**/v1/jobs/{job_id}/pairs/{index}/cells", lambda route: route.fulfill(json=answer))
    begin(database, upright, job_id)
    page.goto(f"{url}/jobs/{job_id}#pair={index}")
    page.get_by_text("A verified proof says that the condition 'along-x' holds with room in every cell").wait_for()
    assert page.get_by_text("two bodies are apart").count() == 0
