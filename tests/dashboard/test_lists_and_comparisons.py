"""The list of regions, and two jobs or two versions of a scene side by side."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.jobs.region import Region
from certifier.model import Scene
from db import events, jobs, scenes
from db.session import Database
from jobs.cover import COVERED
from planner.cover.options import CoverOptions
from tests.api.conftest import store_region
from tests.api.test_conditions import upright
from tests.certifier.scenes import planar_arm

__all__ = ["upright"]


def shown(text: str) -> list[str]:
    return re.findall(r'<td><a href="/regions/([^"]+)"', text)


def test_regions_are_listed_filtered_and_paged(
    client: TestClient, database: Database, planar_region: str, certified: Region, scene: Scene
) -> None:
    made = [store_region(database, certified) for _ in range(60)]
    first = client.get("/regions?scene=slider").text
    assert "60 regions like that" in first
    older = re.search(r'href="/regions\?(scene=slider&amp;after=[^"]+)"', first)
    assert older is not None
    second = client.get(f"/regions?{older[1].replace('&amp;', '&')}").text
    assert [len(shown(first)), len(shown(second))] == [50, 10]
    assert {*shown(first), *shown(second)} == set(made)
    newer = re.search(r'href="/regions\?(scene=slider&amp;before=[^"]+)"', second)
    assert newer is not None
    assert shown(client.get(f"/regions?{newer[1].replace('&amp;', '&')}").text) == shown(first)
    assert shown(client.get("/regions?scene=planar").text) == [planar_region]
    assert shown(client.get(f"/regions?search={planar_region[:8]}").text) == [planar_region]
    for address in ("/regions?guarantee=exact", "/regions"):
        assert re.search(r"\b61 regions\b", client.get(address).text), address
    assert "No region is like that." in client.get("/regions?guarantee=sampled").text


@pytest.mark.parametrize("query", ["scene=gone", "guarantee=gone", "after=gone", "kind=grow"])
def test_a_wrong_filter_of_regions_is_refused(client: TestClient, region: str, query: str) -> None:
    answer = client.get(f"/regions?{query}", headers={"Accept": "text/html"})
    assert answer.status_code in (404, 422)
    assert shown(answer.text) == []


def test_two_jobs_are_compared(page: Any, url: str, client: TestClient, database: Database, region: str, barriers: Any) -> None:
    one = client.get(f"/v1/regions/{region}").json()["job"]
    with database.write() as session:
        options = {"kind": "grow", "seed": {"q": [0.1]}, "random_seed": 0}
        other, _ = jobs.create(session, kind="grow", scene_id=scenes.get(session, "slider").id, options=options)
    page.goto(f"{url}/jobs/{one}")
    page.get_by_label("Compare with").select_option(other.id)
    page.wait_for_url(f"**/compare/jobs?a={one}&b={other.id}")
    rows = page.get_by_role("region", name="Options that differ").locator("tbody tr")
    assert rows.locator("td").all_text_contents() == ["seed.q", "[0.0]", "[0.1]"]
    page.get_by_text("2 options are the same in both.").wait_for()
    row = page.get_by_role("row").filter(has_text="Pairs settled in the last iteration").locator("td")
    assert row.all_text_contents() == ["2 of 2", "\N{EN DASH}"]
    page.get_by_text("They are as the API has them: in radians and metres.").wait_for()
    volume = client.get(f"/v1/regions/{region}").json()["q_volume"]
    row = page.get_by_role("row").filter(has_text="Average width of it").locator("td")
    assert row.all_text_contents() == [f"volume {volume['value']:.3g} m", "\N{EN DASH}"], "a joint that slides has no width in degrees"
    page.get_by_text("Each share is of the job's own starting region.").wait_for()
    kept = page.get_by_role("region", name="Kept of the starting region, over time", exact=True)
    kept.get_by_text("nothing yet").wait_for()
    assert kept.locator(f'.halves a[href="/regions/{region}"]').count() == 1
    assert barriers(page) == []


def covering(database: Database, *looks: tuple[float, int]) -> str:
    """A cover that ran. At each look, this share was covered, by this number of regions."""
    with database.write() as session:
        job, _ = jobs.create(
            session, kind="cover", scene_id=scenes.get(session, "slider").id, options=CoverOptions.from_document({}).to_document()
        )
        jobs.start(session, job)
        for share, regions in looks:
            events.emit(session, job, COVERED, {"coverage": {"value": share, "stderr": 0.01, "samples": 100}, "regions": regions})
        return job.id


def test_what_two_covers_have_reached_is_one_picture(page: Any, url: str, database: Database, scene: Scene, barriers: Any) -> None:
    one, other = covering(database, (0.0, 0), (0.4, 2), (0.7, 3)), covering(database, (0.2, 1), (0.5, 2))
    page.goto(f"{url}/compare/jobs?a={one}&b={other}")
    covered = page.get_by_role("region", name="Covered, over time", exact=True)
    drawn = covered.get_by_role("img", name="Covered, over time")
    drawn.wait_for()
    assert [drawn.locator(mark).count() for mark in ("path.of-0", "path.of-1", "circle", "rect")] == [1, 1, 3, 2]
    assert covered.locator("figcaption code").all_text_contents() == [one[:8], other[:8]]
    rows = page.get_by_role("region", name=f"Covered, over time, by job {other[:8]}").locator("tbody tr")
    assert [row.locator("td").all_text_contents()[::2] for row in rows.all()] == [["1", "20 %"], ["2", "50 %"]]
    assert page.get_by_text("Kept of the starting region").count() == 0
    assert barriers(page) == []


def test_what_jobs_are_measured_by_differs(page: Any, url: str, client: TestClient, database: Database, region: str) -> None:
    """The share of a starting region and that of all free configurations are not drawn over each other."""
    grown, cover = client.get(f"/v1/regions/{region}").json()["job"], covering(database, (0.2, 1), (0.5, 2))
    page.goto(f"{url}/compare/jobs?a={grown}&b={cover}")
    for name, drawn in (("Kept of the starting region, over time", 1), ("Covered, over time", 2)):
        one = page.get_by_role("region", name=name, exact=True)
        one.get_by_role("img").wait_for()
        assert one.get_by_role("img").locator("circle").count() == drawn
        assert one.locator("path.of-1").count() == 0


def test_the_page_of_a_cover_shows_what_is_covered_over_time(
    page: Any, url: str, client: TestClient, database: Database, scene: Scene
) -> None:
    cover = covering(database, (0.0, 0), (0.4, 2), (0.7, 3))
    assert [point[1:] for point in client.get(f"/v1/jobs/{cover}/cover").json()["curve"]] == [[0.0, 0], [0.4, 2], [0.7, 3]]
    page.goto(f"{url}/jobs/{cover}")
    covered = page.get_by_role("region", name="Covered, over time").first
    covered.get_by_text("70 % of the free configurations are in regions of the scene after").wait_for()
    assert covered.get_by_role("img").locator("circle").count() == 3
    # The page follows the job.
    with database.write() as session:
        events.emit(session, jobs.lock(session, cover), COVERED, {"coverage": {"value": 0.8, "stderr": 0.01, "samples": 100}, "regions": 4})
    covered.get_by_text("80 % of the free configurations").wait_for()


def test_two_versions_of_a_scene_are_compared(page: Any, url: str, database: Database, upright: Scene, barriers: Any) -> None:
    """The other version has wider limits and another obstacle, and no conditions."""
    changed = replace(planar_arm(limit=1.1), name="planar")
    with database.write() as session:
        before, after = scenes.get(session, "planar").id, scenes.add(session, changed).id
    page.goto(f"{url}/scenes/{before}")
    page.get_by_label("Compare with").select_option(after)
    page.wait_for_url(f"**/compare/scenes?a={before}&b={after}")

    def told(kind: str) -> list[str]:
        return page.get_by_role("region", name=kind, exact=True).locator("tbody td:nth-child(-n+2)").all_text_contents()

    assert told("Conditions") == ["along-x", "gone", "below", "gone"]
    assert told("Joint limits")[1::2] == ["changed", "changed"]
    assert "conditions/" not in page.locator("main").text_content()
    assert barriers(page) == []


def test_a_scene_compared_with_itself_has_not_changed(client: TestClient, planar: Scene) -> None:
    text = client.get("/compare/scenes?a=planar&b=planar").text
    assert text.count("0 added, 0 gone, 0 changed") == 5


@pytest.mark.parametrize("path", ["jobs", "scenes"])
@pytest.mark.parametrize("query", ["", "?a=1", "?a=nothing&b=nothing"])
def test_what_is_not_there_is_refused(client: TestClient, path: str, query: str) -> None:
    assert client.get(f"/compare/{path}{query}", headers={"Accept": "text/html"}).status_code in (404, 422)
