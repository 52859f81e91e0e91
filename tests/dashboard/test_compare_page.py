"""Two regions side by side: the figures of each, by the names of joints and pairs."""

from __future__ import annotations

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.jobs.region import Region
from certifier.verify.decimals import at_least_mm
from db.session import Database
from tests.api.conftest import cut_corner, store_region


@pytest.fixture
def two(database: Database, region: str, certified: Region) -> tuple[str, str]:
    return region, store_region(database, certified)


def test_regions_are_compared_from_the_page_of_one(page: Any, url: str, client: TestClient, two: tuple[str, str], barriers: Any) -> None:
    one, other = two
    page.goto(f"{url}/regions/{one}")
    page.get_by_label("Compare with").select_option(other)
    page.wait_for_url(f"**/compare?a={one}&b={other}")
    assert [link.get_attribute("href") for link in page.locator("thead a").all()] == [f"/regions/{one}", f"/regions/{other}"]
    manifest = client.get(f"/v1/regions/{one}").json()["manifest"]
    margins = [pair["margin"] for pair in manifest["pairs"]]
    least = page.get_by_role("row").filter(has_text="Smallest proved distance").locator("td").all_text_contents()
    assert least == 2 * [f"at least {at_least_mm(min(margins))}"]
    for pair in manifest["pairs"]:
        row = page.get_by_role("region", name="Pairs").get_by_role("row").filter(has_text=pair["b"].rpartition("/")[2])
        assert row.locator("td.number").all_text_contents() == 2 * [at_least_mm(pair["margin"])]
    assert barriers(page) == []


def test_slices_of_both_are_along_the_same_joints(page: Any, url: str, database: Database, planar_region: str, barriers: Any) -> None:
    """Whoever chooses joints, or moves the point in one slice, does so in both."""
    other = store_region(database, cut_corner())
    asked: list[dict[str, Any]] = []
    page.on("request", lambda request: asked.append(request.post_data_json) if request.url.endswith("/planning/slice") else None)
    page.goto(f"{url}/compare?a={planar_region}&b={other}")
    slices = page.get_by_role("region", name="Slices", exact=True)
    drawn = [page.get_by_role("region", name=f"Slice of {region[:8]}") for region in (planar_region, other)]
    for one in drawn:
        one.get_by_text("1 region is in it").wait_for()
    assert [body["regions"] for body in asked] == [[planar_region], [other]]
    across, up = (body[name] for body in asked[:1] for name in ("x", "y"))
    slices.locator("select").first.select_option(label=up.rpartition("/")[2])
    for one in drawn:
        one.locator("canvas:not(.stale)").wait_for()
        one.get_by_text("1 region is in it").wait_for()
    assert [(body["x"], body["y"]) for body in asked[2:]] == 2 * [(up, across)]
    drawn[0].locator("canvas").press("ArrowRight")
    places = [one.locator("canvas").get_attribute("aria-label").partition(" up.")[0] for one in drawn]
    assert places[0] == places[1]
    slices.locator("select").last.select_option(label=f"the seed of {other[:8]}")
    drawn[0].get_by_text("1 region is in it").wait_for()
    assert barriers(page) == []


def test_slices_need_two_joints_in_common(page: Any, url: str, region: str, planar_region: str) -> None:
    page.goto(f"{url}/compare?a={region}&b={planar_region}")
    page.get_by_text("A slice of both needs two joints of the same names.").wait_for()


def test_regions_of_different_robots_are_matched_by_name(client: TestClient, region: str, planar_region: str) -> None:
    text = client.get("/compare", params={"a": region, "b": planar_region}).text
    joints = re.search(r'aria-label="Joints">(.*?)</table>', text, re.DOTALL)
    assert joints is not None
    assert joints[1].count("<tr><td>") == 3, "one joint of the one, two of the other"
    assert joints[1].count(">\N{EN DASH}<") == 3
    assert text.count("not covered") >= 2


@pytest.mark.parametrize("query", ["", "?a=1", "?a=nothing&b=nothing"])
def test_what_is_no_region_is_refused(client: TestClient, query: str) -> None:
    assert client.get(f"/compare{query}", headers={"Accept": "text/html"}).status_code in (404, 422)
