"""The page of a job in a real browser: it changes while the job runs, without a reload; by keyboard; on a phone; in the dark."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from certifier.model import Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, keys, pairs
from db.keys import Scope
from db.session import Database
from db.states import JobState
from tests.db.builders import add_iteration

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True}


@pytest.fixture
def job_id(database: Database, scene: Scene) -> str:
    with database.write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}, "random_seed": 0})
        return job.id


def begin(database: Database, scene: Scene, job_id: str) -> None:
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        polytope: dict[str, Any] = {"C": [[1.0], [-1.0]], "d": [0.5, 0.5], "center": [0.0]}
        new = [pairs.NewPair(index, pair.a, pair.b, 1.0) for index, pair in enumerate(scene.pairs)]
        add_iteration(session, job, index=0, label="contract", **polytope, pairs=new, reuse={}, hard=[], failures=None)


def settle(database: Database, job_id: str, index: int) -> None:
    with database.write() as session:
        claim = pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=0)
        assert claim is not None
        assert [pair.index for pair in claim.pairs] == [index]
        result = PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=0.1, margin=0.01, proof=b"proof")
        pairs.save(session, claim, {(index, 0): result})


def test_text_takes_room(page: Any) -> None:
    """In a browser without fonts nothing is drawn, and no page is too wide."""
    page.set_content("<span>certified</span> <code>certified</code>")
    assert [page.locator(tag).bounding_box()["width"] > 40 for tag in ("span", "code")] == [True, True]


def test_what_leaves_the_machine_is_noticed(page: Any, outside: tuple[str, list[str]], complaints: list[str]) -> None:
    page.evaluate("fetch('http://elsewhere.invalid/beacon', {mode: 'no-cors'}).catch(() => {})")
    page.evaluate("new Promise((done) => { new WebSocket('ws://elsewhere.invalid:81/').onerror = done; })")
    page.evaluate("""new Promise((done) => {
        const source = "fetch('http://worker.invalid/').catch(() => postMessage(0))";
        new Worker(URL.createObjectURL(new Blob([source]))).onmessage = done;
    })""")
    assert [name in " ".join(outside[1]) for name in ("elsewhere.invalid/beacon", "elsewhere.invalid:81", "worker.invalid")] == [True] * 3
    assert "ws://elsewhere.invalid:81/" in complaints
    assert "http://elsewhere.invalid/beacon" in complaints
    outside[1].clear()
    complaints.clear()


def test_a_job_is_followed_live_to_its_end(page: Any, url: str, database: Database, scene: Scene, job_id: str) -> None:
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_text("queued: no worker").first.wait_for()
    page.evaluate("window.loadedOnce = true")
    begin(database, scene, job_id)
    page.get_by_text("0 of 2 pairs settled").wait_for()
    settle(database, job_id, 0)
    page.get_by_text("1 of 2 pairs settled").wait_for()
    page.locator(".pairs .cell.certified").wait_for()
    page.get_by_text("Options").click()
    settle(database, job_id, 1)
    page.get_by_text("2 of 2 pairs settled").wait_for()
    assert page.locator("details#options[open]").count() == 1, "what the reader opened stays open"
    with database.write() as session:
        jobs.finish(session, jobs.lock(session, job_id), JobState.SUCCEEDED, reason="as asked", outcome="certified")
    page.locator(".badge.succeeded").wait_for()
    assert page.evaluate("window.loadedOnce"), "the page was not loaded again"
    assert page.get_by_role("button", name="Cancel").count() == 0


def test_a_job_is_cancelled_and_tried_again_from_the_page(page: Any, url: str, job_id: str) -> None:
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_role("button", name="Cancel").click()
    page.locator(".badge.cancelled").wait_for()
    page.get_by_role("button", name="Try again").click()
    page.wait_for_url(lambda address: "/jobs/" in address and job_id not in address)
    page.locator(".badge.queued").wait_for()


def test_the_region_is_two_links_away_by_keyboard(page: Any, url: str, region: str) -> None:
    page.goto(url)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the content"
    page.locator(f"a[href='/regions/{region}']").first.focus()
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Region of slider").wait_for()
    with page.expect_download() as download:
        page.get_by_role("link", name="proof").click()
    assert Path(download.value.path()).stat().st_size > 0


def test_the_proof_is_checked_again_from_the_page(page: Any, url: str, region: str) -> None:
    page.goto(f"{url}/regions/{region}")
    page.get_by_role("button", name="Verify here").click()
    page.get_by_text("The proof holds:").wait_for()
    assert "guarantee: exact" in page.locator("#statement").text_content()


@pytest.mark.parametrize("path", ["/", "/scenes/slider", "/regions/{region}", "/login", "/workers"])
def test_axe_finds_no_barrier(page: Any, url: str, region: str, barriers: Any, path: str) -> None:
    page.goto(url + path.format(region=region))
    assert barriers(page) == []


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_no_page_is_wider_than_a_phone(browser: Any, url: str, region: str, scheme: str) -> None:
    context = browser.new_context(**PHONE, color_scheme=scheme)
    page = context.new_page()
    page.goto(url)
    job, scene = (page.locator(f"a[href^='/{kind}/']").first.get_attribute("href") for kind in ("jobs", "scenes"))
    for path in ("/", job, scene, "/workers", f"/regions/{region}"):
        page.goto(f"{url}{path}")
        if path.startswith("/regions/"):
            page.get_by_role("button", name="Verify here").click()
            page.get_by_text("The proof holds:").wait_for()
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), path
        light = page.evaluate("getComputedStyle(document.body).backgroundColor").split("(")[1].split(",")[0]
        assert (int(light) > 128) == (scheme == "light")
    context.close()


def test_signing_in_leads_to_the_page_that_was_asked_for_and_follows_the_job(
    page: Any, url: str, database: Database, scene: Scene, job_id: str
) -> None:
    with database.write() as session:
        key = keys.add(session, "reader", Scope.READ)
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_label("API key").fill(key)
    page.keyboard.press("Enter")
    page.wait_for_url(f"{url}/jobs/{job_id}")
    begin(database, scene, job_id)
    page.get_by_text("pairs settled").first.wait_for()
    assert key not in page.content()
    assert page.evaluate("document.cookie") == ""
    page.get_by_text("reader · default · read").wait_for()
    page.get_by_role("button", name="Sign out").click()
    page.wait_for_url(f"{url}/login")
