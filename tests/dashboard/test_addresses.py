"""The state of a page stands in its address: who opens the address sees the same."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

from certifier.model import Scene
from db.session import Database
from tests.dashboard.job_scenes import begin, new_job, settle, too_close
from tests.dashboard.test_library_page import move

SETTLED_MS = 800


@pytest.fixture
def elsewhere(page: Any, browser: Any) -> Any:
    """Returns a function that opens the address of the page in another browser, which knows nothing of the first."""
    contexts = []

    def opened() -> Any:
        page.evaluate(f"new Promise((done) => setTimeout(done, {SETTLED_MS}))")  # the page's own timers fire in order
        contexts.append(browser.new_context())
        other = contexts[-1].new_page()
        other.goto(page.url)
        return other

    yield opened
    for context in contexts:
        context.close()


def positions(page: Any) -> list[str]:
    page.locator(".slider").nth(1).wait_for()
    return [field.input_value() for field in page.locator(".slider input[type=number]").all()]


def test_the_page_of_a_scene(page: Any, url: str, planar: Scene, elsewhere: Callable[[], Any]) -> None:
    page.goto(f"{url}/scenes/planar")
    move(page, -20, 10)
    page.get_by_role("button", name="Set as start").click()
    move(page, -17, 25)
    page.locator(".axes select").first.select_option(label="joint2")
    page.get_by_label("Only in certified regions").check()
    other = elsewhere()
    assert positions(other) == ["-17.0", "25.0"]
    assert other.get_by_label("From").input_value() == "-20.0, 10.0"
    assert other.get_by_label("To", exact=True).input_value() == "0.0, 0.0"
    assert other.locator(".axes select").first.input_value() == "1"
    assert other.get_by_label("Only in certified regions").is_checked()
    page.get_by_label("Goal").select_option("arm/link2")
    page.get_by_label("On a straight line").check()
    pose = [page.get_by_label(re.compile(name)).first.input_value() for name in ("^x, ", "^yaw, ")]
    other = elsewhere()
    other.get_by_label(re.compile("^yaw, ")).wait_for()
    assert [other.get_by_label(re.compile(name)).first.input_value() for name in ("^x, ", "^yaw, ")] == pose
    assert other.get_by_label("On a straight line").is_checked()


def test_an_address_with_nothing_chosen_stays_short(page: Any, url: str, planar: Scene, planar_region: str) -> None:
    for path in ("/scenes/planar", f"/regions/{planar_region}"):
        page.goto(url + path)
        page.locator(".slider").nth(1).wait_for()
        page.wait_for_timeout(SETTLED_MS)
        assert page.url == url + path


def test_the_page_of_a_region(page: Any, url: str, planar_region: str, elsewhere: Callable[[], Any]) -> None:
    page.goto(f"{url}/regions/{planar_region}")
    page.get_by_role("button", name="arm/joint2 max").click()
    page.locator(".axes select").first.select_option(label="joint2")
    page.get_by_label("Cells of the pair").select_option(index=1)
    shown = positions(page)
    other = elsewhere()
    assert positions(other) == shown
    assert other.locator(".axes select").first.input_value() == "1"
    other.get_by_text("the plane of cell").wait_for()


def test_the_form(page: Any, url: str, planar: Scene, elsewhere: Callable[[], Any]) -> None:
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_role("radio", name="Cover the scene").check()
    page.get_by_label("Goal").select_option("connect")
    page.get_by_role("button", name="Add this configuration").click()
    page.locator("summary", has_text="More options").click()
    page.get_by_label("Random seed", exact=True).last.fill("7")
    page.locator("summary", has_text="Deadline").click()
    page.get_by_label("Deadline").fill("2")
    page.get_by_label("Priority").select_option("1")
    other = elsewhere()
    other.get_by_role("radio", name="Cover the scene").wait_for()
    assert other.get_by_role("radio", name="Cover the scene").is_checked()
    assert other.get_by_label("Goal").input_value() == "connect"
    assert other.locator(".marks li").count() == 1
    assert other.get_by_label("Random seed", exact=True).last.input_value() == "7"
    assert other.get_by_label("Deadline").input_value() == "2"
    assert other.get_by_label("Priority").input_value() == "1"


def test_what_was_taken_out_of_an_earlier_job_stays_out(
    page: Any, url: str, planar: Scene, client: Any, elsewhere: Callable[[], Any]
) -> None:
    seed = {"q": [0.1, -0.2], "contain": [[0.1, -0.21]]}
    asked = {"kind": "grow", "scene": "planar", "seed": seed, "options": {"cells": 64}}
    page.goto(f"{url}/new?from={client.post('/v1/jobs', json=asked).json()['id']}")
    page.get_by_role("button", name="remove").click()
    page.locator("summary", has_text="More options").click()
    page.get_by_label("Cells").fill("")
    other = elsewhere()
    other.get_by_label("Cells").wait_for(state="attached")
    assert other.get_by_label("Cells").input_value() == ""
    assert other.locator(".marks li").count() == 0


def test_the_page_of_a_job(page: Any, url: str, database: Database, scene: Scene, elsewhere: Callable[[], Any]) -> None:
    job_id = new_job(database, scene)
    begin(database, scene, job_id, cells=64)
    settle(database, job_id, too_close(scene, 64), batch=0)
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_label("Show pairs").select_option(label="too close")
    page.get_by_label("Sort by").select_option("time")
    page.get_by_label("Name").fill("post0")
    page.get_by_label("Show events").select_option("pairs")
    other = elsewhere()
    other.get_by_text("1 of 2 pairs").wait_for()
    assert other.get_by_label("Sort by").input_value() == "time"
    assert other.get_by_label("Name").input_value() == "post0"
    assert other.get_by_label("Show events").input_value() == "pairs"


def test_two_regions(page: Any, url: str, planar_region: str, elsewhere: Callable[[], Any]) -> None:
    page.goto(f"{url}/compare?a={planar_region}&b={planar_region}")
    page.locator(".axes select").first.select_option(label="joint2")
    other = elsewhere()
    other.locator(".axes select").first.wait_for()
    assert other.locator(".axes select").first.input_value() == "1"
