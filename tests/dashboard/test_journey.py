"""A whole visit in a real browser: a job from the form to its region, a pair, a cell, a slice, a plan, and another job, cancelled."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from tests.dashboard.test_library_page import plan
from tests.dashboard.test_new_page import set_joint
from tests.scenes import box_seed


def submit(page: Any, url: str) -> str:
    """Starts a job in the form, around the configuration (-20, -12) degrees, and returns its id."""
    page.goto(url)
    page.get_by_role("link", name="Start a job").first.click()
    page.locator(".said", has_text=re.compile(r"No collision \(computed|as proved")).wait_for()
    set_joint(page, "arm/joint1", -20)
    set_joint(page, "arm/joint2", -12)
    page.locator("summary", has_text="More options").click()
    page.get_by_label("Cells").fill("64")
    page.get_by_role("button", name="Start the job").click()
    page.wait_for_url(f"{url}/jobs/*")
    return str(page.url).rpartition("/")[2]


@pytest.mark.usefixtures("worker")
def test_a_visit_from_a_job_to_a_plan(page: Any, url: str, planar: Scene, client: TestClient) -> None:
    # A job, to its end, without a reload.
    job_id = submit(page, url)
    page.evaluate("window.loadedOnce = true")
    page.locator(".badge.succeeded").wait_for(timeout=240_000)
    page.get_by_text("The job has succeeded").wait_for()
    assert page.evaluate("window.loadedOnce"), "the page was not loaded again"
    regions = {region["id"] for region in client.get(f"/v1/regions?job={job_id}").json()["regions"]}

    # A pair, with its outcome in the last iteration, and a cell of it. Columns move until the page shows all iterations.
    iterations = client.get(f"/v1/jobs/{job_id}/pairs/states").json()["iterations"]
    page.locator(f"#cell-1-{len(iterations) - 1}").wait_for()
    page.locator("#cell-1-0").click()
    page.get_by_role("heading", name="world/obstacle").wait_for()
    page.get_by_text("A verified proof says").wait_for()
    page.locator(".cells tbody button").first.click()
    page.get_by_role("heading", name=re.compile(r"^Cell \d+: ")).wait_for()
    assert page.get_by_label("Bounds of the cell").locator("tbody tr").count() == 2
    page.get_by_role("link", name="All pairs").click()
    page.get_by_role("grid").wait_for()

    # The region, and its slice.
    page.locator("a[href^='/regions/']").first.click()
    page.get_by_text("The robot is inside the region").wait_for()
    page.get_by_text("of this slice is in certified regions").first.wait_for()
    assert page.url.rpartition("/")[2] in regions
    assert re.search(r"[1-9]\d* % of this slice is in certified regions", page.locator(".slice figcaption").text_content())

    # A plan between two configurations in the region, played to its end.
    page.get_by_role("link", name="planar").click()
    page.get_by_text("1 component").wait_for()
    plan(page, "-15, -7", "-25, -17")
    page.locator(".moment", has_text="in region").wait_for()
    assert page.locator(".moment a").get_attribute("href").rpartition("/")[2] in regions
    page.get_by_label("speed").select_option("2")
    page.get_by_role("button", name="Play", exact=True).click()
    page.get_by_role("button", name="Play", exact=True).wait_for(timeout=20_000)
    shown = [float(field.input_value()) for field in page.locator(".library .sliders input[type=number]").all()]
    assert shown == pytest.approx([-25, -17], abs=0.06)
    page.get_by_text("No collision of the scene's pairs, as proved.").wait_for()

    # Another job, which is cancelled.
    seed = box_seed(planar.to_s(np.deg2rad([-20, -12])), 0.3)
    request = {"kind": "grow", "scene": "planar", "seed": seed, "options": {"cells": 64}}
    other = client.post("/v1/jobs", json=request).json()["id"]
    page.goto(f"{url}/jobs/{other}")
    page.get_by_role("button", name="Cancel").click()
    page.locator(".badge.cancelled").wait_for()
    assert client.get(f"/v1/jobs/{other}").json()["state"] == "cancelled"
