"""Two regions side by side: the figures of each, by the names of joints and pairs."""

from __future__ import annotations

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.jobs.region import Region
from certifier.verify.decimals import at_least_mm
from db.session import Database
from tests.api.conftest import store_region


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
