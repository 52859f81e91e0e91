"""The page of a scene with conditions, in a browser: which of them is not kept, by how much, and where zones and cones are."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi.testclient import TestClient

from certifier.model import Scene
from db.session import Database
from tests.api.conftest import certified_polytope, store_region
from tests.api.test_conditions import upright
from tests.certifier.scenes import cube
from tests.dashboard.test_job_page import orange

__all__ = ["upright"]


def test_a_condition_that_is_not_kept_is_said_and_painted(page: Any, url: str, upright: Any) -> None:
    page.goto(f"{url}/scenes/planar")
    robot = page.locator("figure.robot canvas")
    page.get_by_text("No collision (computed, not proved)").wait_for()
    assert orange(page.context.browser, robot.screenshot()) == 0
    page.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").fill("-40")
    page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").fill("-40")
    page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").press("Enter")
    page.get_by_text("Not free: the condition 'along-x' is not kept: the angle is 80 degrees, and 60 at most.").wait_for()
    assert orange(page.context.browser, robot.screenshot()) > 30, "the edge of the cone, and the arrow"


def test_what_stands_for_a_condition_has_no_distance(page: Any, url: str, client: TestClient, upright: Scene, database: Database) -> None:
    one, other = (
        store_region(database, certified_polytope(upright, cube(upright, [0.0, 0.0], width), np.zeros(2))) for width in (0.05, 0.1)
    )
    job = client.get(f"/v1/regions/{one}").json()["job"]
    pairs, cells = client.get("/v1/scenes/planar/pairs").json()["pairs"], client.get(f"/v1/jobs/{job}/pairs").json()["cells"]
    assert all(cell["state"] == "certified" for cell in cells)
    for cell in cells:
        assert (cell["proved_distance"] is None) == ("conditions/" in str(pairs[cell["pair"]])), pairs[cell["pair"]]
    page.goto(f"{url}/regions/{one}")
    assert page.locator(".claim dd").first.text_content() == "2 pairs of bodies, and 2 conditions"
    page.goto(f"{url}/compare?a={one}&b={other}")
    rows = page.get_by_role("region", name="Pairs").locator("tbody tr")
    told = [row.locator("td.number").all_text_contents() for row in rows.all()]
    assert told.count(["kept", "kept"]) == len(cells) - 2
    assert "not covered" not in str(told)
