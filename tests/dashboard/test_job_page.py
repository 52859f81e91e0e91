"""The page of a job in a real browser: live to its end, its pairs, their cells, what limits the region, and a job that is large."""

from __future__ import annotations

import base64
import json
import re
import time
from typing import Any

import pytest

from certifier.model import Scene
from db import jobs, scenes, steps, webhooks, work
from db.session import Database
from db.states import JobState
from db.types import utcnow
from tests.dashboard.job_scenes import begin, certified, large_job, new_job, settle, too_close
from tests.dashboard.test_region_page import OBSERVE
from tests.dashboard.test_truth import until
from tests.scenes import slider

DESK = {"viewport": {"width": 1280, "height": 800}}
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True}
WATCH = """
let frames = [], tasks = [], last = performance.now();
requestAnimationFrame(function frame(now) { frames.push(now - last); last = now; requestAnimationFrame(frame); });
new PerformanceObserver((list) => { for (const task of list.getEntries()) tasks.push(task.duration); }).observe({type: 'longtask'});
window.watched = () => {
    const sorted = frames.slice(1).sort((a, b) => a - b), at = (part) => Math.round(sorted[Math.floor(part * (sorted.length - 1))] ?? 0);
    const found = {frames: sorted.length, median_ms: at(0.5), p95_ms: at(0.95), longest_ms: at(1),
        long_tasks: tasks.length, task_ms: Math.max(0, ...tasks)};
    frames = []; tasks = [];
    return found;
};
"""
MARKED = """() => {
    const found = [];
    inView.traverse((one) => { if (one.isMesh && one.visible && !one.material.depthTest) found.push(one.position.toArray()); });
    return found;
}"""
"""The places in the world that are seen through all that is before them."""


@pytest.fixture
def job_id(database: Database, scene: Scene) -> str:
    """A running job: the first of two pairs is too close and has 64 cells, the second is open."""
    job_id = new_job(database, scene)
    begin(database, scene, job_id, cells=64)
    settle(database, job_id, too_close(scene, 64), batch=0)
    return job_id


def orange(browser: Any, png: bytes) -> int:
    """How many pixels of a picture are of the colour that bodies in contact are painted in, in light or shade."""
    page = browser.new_page()
    count: int = page.evaluate(
        """async (data) => {
            const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + data)).blob());
            const pen = new OffscreenCanvas(image.width, image.height).getContext('2d');
            pen.drawImage(image, 0, 0);
            const bytes = pen.getImageData(0, 0, image.width, image.height).data;
            let count = 0;
            for (let i = 0; i < bytes.length; i += 4)
                if (bytes[i] > 100 && bytes[i] > 1.8 * bytes[i + 1] && bytes[i] > 3 * bytes[i + 2]) count++;
            return count;
        }""",
        base64.b64encode(png).decode(),
    )
    page.close()
    return count


def middle(browser: Any, png: bytes) -> str:
    """The colour in the middle of a picture, as #rrggbb."""
    page = browser.new_page()
    colour: str = page.evaluate(
        """async (data) => {
            const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + data)).blob());
            const pen = new OffscreenCanvas(image.width, image.height).getContext('2d');
            pen.drawImage(image, 0, 0);
            const found = pen.getImageData(image.width / 2, image.height / 2, 1, 1).data;
            return '#' + [...found].slice(0, 3).map((value) => value.toString(16).padStart(2, '0')).join('');
        }""",
        base64.b64encode(png).decode(),
    )
    page.close()
    return colour


def finish(database: Database, job_id: str) -> None:
    with database.write() as session:
        jobs.finish(session, jobs.lock(session, job_id), JobState.SUCCEEDED, reason="as asked", outcome="inconclusive")


def test_the_page_finds_out_who_works_without_an_event(page: Any, url: str, database: Database, scene: Scene) -> None:
    with database.write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})
        jobs.start(session, job)
        steps.add(session, job, "propose", {})
    page.goto(f"{url}/jobs/{job.id}")
    page.get_by_text("No process works on the job at this moment.").wait_for()
    assert page.locator(".title .badge").text_content() == "queued: no worker"
    page.get_by_text("Nobody is there who can do what comes next.").wait_for()
    asked: list[float] = []
    page.on("request", lambda request: asked.append(time.monotonic()) if request.url.endswith("/workers") else None)
    while len(asked) < 3:
        page.wait_for_timeout(100)
    assert asked[2] - asked[0] < 9, "it asks each second while the job is queued"
    with database.write() as session:
        assert work.claim(session, job.id, lease_seconds=60, batch_seconds=0.5) is not None
    page.locator(".workers li", has_text=re.compile(r"Looking for a starting region around the seed, for \d+ s")).wait_for()
    page.locator(".workers li", has_text=re.compile(r"around the seed, for [1-9]\d? s")).wait_for()
    page.locator(".title .badge", has_text="working").wait_for()


def test_a_job_is_watched_to_its_end(page: Any, url: str, database: Database, job_id: str) -> None:
    page.goto(f"{url}/jobs/{job_id}")
    page.locator(".pairs .cell.too_close").wait_for()
    assert page.locator(".pairs .cell.open").count() == 1
    page.get_by_text("1 of 2 pairs settled").wait_for()
    settle(database, job_id, certified(), batch=0)
    page.locator(".pairs .cell.certified").wait_for()
    page.get_by_text("1 result in iteration 0: 1 certified").wait_for()
    assert all(item.bounding_box()["height"] > 20 for item in page.locator(".log li").all()), "every event can be read"
    page.get_by_text("2 of 2 pairs settled").wait_for()
    assert page.get_by_role("heading", name="Working on it").count() == 1
    finish(database, job_id)
    page.locator(".badge.succeeded").wait_for()
    page.get_by_text("The job has succeeded: as asked.").wait_for()
    assert page.get_by_role("heading", name="Working on it").count() == 0
    assert page.get_by_role("button", name="Cancel").count() == 0
    page.get_by_label("Show events").select_option("job")
    assert page.locator(".log li").count() == page.locator(".log li[data-kind=job]").count() >= 2


def test_what_is_said_of_a_pair_is_said_on_hover_and_on_focus(page: Any, url: str, job_id: str) -> None:
    page.goto(f"{url}/jobs/{job_id}")
    tip = page.get_by_role("tooltip")
    page.locator(".pairs .cell.too_close").hover()
    assert "2.0 s" in tip.text_content()
    page.mouse.move(0, 0)
    tip.wait_for(state="detached")
    page.get_by_role("grid").focus()
    text = tip.text_content()
    for part in ("too close in iteration 0", "2.0 s", "1 open cell", "0.001 m apart", "nearest at q = 0.400 m"):
        assert part in text
    page.keyboard.press("ArrowDown")
    page.get_by_text("open in iteration 0").wait_for()
    page.keyboard.press("Escape")
    tip.wait_for(state="detached")


def test_pairs_are_filtered_and_sorted(page: Any, url: str, database: Database, job_id: str) -> None:
    page.goto(f"{url}/jobs/{job_id}")
    settle(database, job_id, certified(), batch=0)
    page.locator(".pairs .cell.certified").wait_for()
    first = page.locator(".pairs .row").first
    assert "post0" in first.text_content()
    page.get_by_label("Show pairs").select_option("not")
    page.get_by_text("1 of 2 pairs", exact=True).wait_for()
    assert page.locator(".pairs .row").count() == 1
    page.get_by_label("Show pairs").select_option("")
    page.get_by_label("Name").fill("post1")
    page.get_by_text("1 of 2 pairs", exact=True).wait_for()
    assert "post1" in first.text_content()
    page.get_by_label("Name").fill("")
    for order in ("outcome", "time", "open"):
        page.get_by_label("Sort by").select_option(order)
        assert "post0" in first.text_content()


def test_a_pair_and_a_cell_are_opened_by_keyboard_and_left_again(page: Any, url: str, job_id: str) -> None:
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_label("Show pairs").select_option("t")
    page.get_by_role("grid").focus()
    page.keyboard.press("Enter")
    heading = page.get_by_role("heading", name="model/cart/ball \N{EN DASH} world/post0")
    heading.wait_for()
    assert page.url.endswith("#pair=0")
    page.get_by_text("The pair is not certified.").wait_for()
    facts = dict(zip(page.locator(".cells dt").all_text_contents(), page.locator(".cells dd").all_text_contents(), strict=True))
    assert facts == {"Cells": "64", "With a plane": "62", "Miss the polytope": "1", "Open": "1"}
    page.locator(".cells tbody button").first.click()
    assert "cell=" in page.url
    page.get_by_role("heading", name=re.compile(r"^Cell \d+: ")).wait_for()
    bounds = page.get_by_label("Bounds of the cell").locator("tbody tr")
    assert bounds.count() == 1
    assert re.search(r"-?0\.\d{3} m", bounds.text_content()), "a sliding joint's bounds are in metres"
    page.get_by_role("button", name="Zoom in").click()
    page.get_by_text("A part 3 cuts deep").wait_for()
    page.go_back()
    page.get_by_text("The whole partition").wait_for()
    page.locator(".treemap canvas").focus()
    before = page.url
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowDown")
    page.wait_for_function("before => location.href !== before", arg=before)
    page.go_back()
    page.get_by_text("Choose a cell").wait_for()
    page.go_back()
    page.get_by_role("grid").wait_for()
    assert page.get_by_label("Show pairs").input_value() == "t", "the reader comes back to what he has left"
    assert page.evaluate("document.activeElement.id") == "matrix"
    page.get_by_role("tooltip").wait_for()


def test_a_pair_without_cells_and_a_pair_that_is_none_say_so(browser: Any, url: str, job_id: str) -> None:
    page = browser.new_page()
    page.goto(f"{url}/jobs/{job_id}#pair=1")
    page.get_by_text("pair 1 has no cells").wait_for()
    page.evaluate("location.hash = '#pair=7'")
    page.get_by_text("There is no pair 7 in this scene.").wait_for()
    page.close()


def test_the_cells_of_a_drawing_are_those_that_are_open_and_proved(page: Any, url: str, job_id: str) -> None:
    """A click chooses the cell under it: the open one is the last along the joint, and it is painted as such."""
    page.goto(f"{url}/jobs/{job_id}#pair=0")
    canvas = page.locator(".treemap canvas")
    canvas.wait_for()
    page.wait_for_function("document.querySelector('.treemap canvas').width > 300")
    box = canvas.bounding_box()
    canvas.click(position={"x": box["width"] - 3, "y": box["height"] - 3})
    page.get_by_role("heading", name=re.compile(": open$")).wait_for()
    corner = "c => [...c.getContext('2d').getImageData(c.width - 6, c.height - 6, 1, 1).data].slice(0, 3)"
    assert canvas.evaluate(corner) == [0xE6, 0x9F, 0x00]
    canvas.click(position={"x": 3, "y": 3})
    page.get_by_role("heading", name=re.compile(": misses the polytope$")).wait_for()


def test_what_holds_the_region_back_is_said_and_drawn(page: Any, url: str, job_id: str) -> None:
    page.add_init_script(OBSERVE)
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_text("model/cart/ball and world/post0 come too close at q = (0.400 m): 0.001 m apart, as floating point says.").wait_for()
    page.get_by_text("world/post0 are painted").scroll_into_view_if_needed()
    robot = page.get_by_role("img", name=re.compile(r"^The robot at slide 0\.400 m"))
    robot.wait_for()
    until(lambda: orange(page.context.browser, robot.screenshot()) > 500)  # the two bodies are painted
    picture = robot.screenshot()
    (place,) = page.evaluate(MARKED)
    assert place == pytest.approx([0.2, 0.25, 0], abs=1e-6), "midway between the cart and the post"
    ink = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--ink')").strip()
    assert middle(page.context.browser, picture) == ink, "the place is marked, and in the middle of the view"
    page.get_by_role("link", name="Open the pair").click()
    page.get_by_role("heading", name="world/post0").wait_for()
    about = page.locator(".pair .said")
    assert about.all_text_contents() == [
        "Too close in iteration 0; 2.0 s; 1 open cell.",
        "model/cart/ball and world/post0 come too close at q = (0.400 m): 0.001 m apart, as floating point says.",
    ], "nothing is read twice"
    about.get_by_role("link", name="q = (0.400 m)").click()
    page.wait_for_url(f"{url}/scenes/*?q=0.4*")
    page.get_by_role("spinbutton", name="slide, metres, as a number").wait_for()
    assert page.get_by_role("spinbutton", name="slide, metres, as a number").input_value() == "0.400"


def test_what_holds_the_region_back_is_said_while_an_iteration_lasts(page: Any, url: str, database: Database, scene: Scene) -> None:
    """A pair that has failed is no secret until the others of its iteration have ended."""
    job_id = new_job(database, scene)
    begin(database, scene, job_id)
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_text("Nothing is known to limit it.").wait_for()
    settle(database, job_id, too_close(scene, 4), batch=0)
    page.get_by_text("model/cart/ball and world/post0 come too close at").wait_for()
    assert page.get_by_text("Nothing is known to limit it.").count() == 0


def test_without_a_stream_the_page_asks_again(page: Any, url: str, database: Database, job_id: str) -> None:
    page.route("**/events/stream*", lambda route: route.fulfill(status=204))
    page.goto(f"{url}/jobs/{job_id}")
    page.locator(".pairs .cell.open").wait_for()
    settle(database, job_id, certified(), batch=0)
    page.locator(".pairs .cell.certified").wait_for()
    finish(database, job_id)
    page.locator(".badge.succeeded").wait_for()


def test_a_pair_is_followed_through_the_iterations(browser: Any, url: str, database: Database, scene: Scene) -> None:
    job_id = large_job(database, scene, 12, 16)
    page = browser.new_page()
    page.goto(f"{url}/jobs/{job_id}#pair=1&iteration=9")
    strip = page.get_by_role("navigation", name="Iterations of the pair").get_by_role("link")
    strip.first.wait_for()
    assert strip.all_text_contents()[:4] == [
        "12 \N{MIDDLE DOT}iteration 12: open",
        "11 ?iteration 11: inconclusive",
        "10 \N{DOUBLE VERTICAL LINE}iteration 10: too close",
        "9 \N{CHECK MARK}iteration 9: certified",
    ]
    page.get_by_text("Certified in iteration 9; by sos; 0.1 s; at least 1 mm apart.").wait_for()
    page.close()


def test_a_service_that_does_not_answer_is_asked_again(browser: Any, url: str, job_id: str) -> None:
    page = browser.new_page()
    page.route("**/pairs/states*", lambda route: route.abort())
    page.goto(f"{url}/jobs/{job_id}")
    page.get_by_text("The service does not answer. It is asked again every few seconds.").wait_for()
    page.unroute("**/pairs/states*")
    page.locator(".pairs .cell.too_close").wait_for()
    page.route("**/cells", lambda route: route.abort())
    page.evaluate("location.hash = '#pair=0'")
    page.get_by_text("The cells could not be fetched. The service does not answer.").wait_for()
    page.unroute("**/cells")
    page.get_by_role("button", name="Try again").click()
    page.locator(".treemap canvas").wait_for()
    page.close()


@pytest.mark.parametrize("screen", [PHONE, DESK], ids=["phone", "desk"])
@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_no_barriers_and_no_sideways_scrolling(
    browser: Any, url: str, job_id: str, barriers: Any, scheme: str, screen: dict[str, Any]
) -> None:
    context = browser.new_context(**screen, color_scheme=scheme, reduced_motion="reduce")
    page = context.new_page()
    for fragment, there in (("", ".pairs .row"), ("#pair=0&cell=7", ".treemap .mark")):
        page.goto("about:blank")
        page.goto(f"{url}/jobs/{job_id}{fragment}")
        page.locator(there).first.wait_for()
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), fragment
        assert barriers(page) == [], fragment
    context.close()


@pytest.mark.slow
def test_a_large_job_does_not_lag(page: Any, url: str, database: Database) -> None:
    """2000 pairs in 50 iterations, 10^5 results, and a pair with 10^5 cells. The longest frames and tasks are printed, tasks asserted."""
    scene = slider("large", posts=2000)
    with database.write() as session:
        scenes.add(session, scene)
    job_id = large_job(database, scene, 50, 100_000)
    page.add_init_script(WATCH)
    begun = time.perf_counter()
    page.goto(f"{url}/jobs/{job_id}")
    page.locator(".pairs .cell").first.wait_for()
    figures = {"first view": {"seconds": round(time.perf_counter() - begun, 2), **page.evaluate("watched()")}}
    page.wait_for_timeout(1500)
    assert page.locator(".pairs [role=gridcell]").count() < 2500, "only what is seen is in the page"
    page.evaluate("watched()")
    for step in range(60):
        page.evaluate("y => document.getElementById('matrix').scrollTo(y % 7 * 40, y * 90)", step)
        page.wait_for_timeout(20)
    for step in range(20):
        page.evaluate("y => document.getElementById('matrix').scrollTo(0, y * 2700)", step)
        page.wait_for_timeout(20)
    figures["scrolling"] = page.evaluate("watched()")
    asked: list[str] = []
    page.on("response", lambda response: asked.append(response.url) if "/v1/" in response.url else None)
    page.evaluate("document.getElementById('matrix').scrollTo(0, 0)")
    for settled in range(2, 7):
        settle(database, job_id, certified(), batch=0)
        page.get_by_text(f"{settled} of 2000 pairs settled").wait_for()
    page.locator(".pairs .cell.certified").first.wait_for()
    figures["receiving five events"] = page.evaluate("watched()")
    assert not [url for url in asked if url.endswith("/pairs") or re.search(r"iteration=\d+$", url)], "only what has changed is asked for"
    page.get_by_label("Sort by").select_option("outcome")
    page.get_by_label("Name").fill("post19")
    page.get_by_text("111 of 2,000 pairs").wait_for()
    figures["sorting and searching"] = page.evaluate("watched()")
    page.evaluate("location.hash = '#pair=0'")
    page.locator(".treemap canvas").wait_for()
    page.locator(".cells tbody button").first.click()
    page.locator(".treemap .mark").wait_for()
    page.wait_for_timeout(300)
    figures["opening 100000 cells"] = page.evaluate("watched()")
    print(json.dumps(figures, indent=1))
    assert figures["first view"]["seconds"] < 3
    assert all(figure["task_ms"] < 200 for figure in figures.values())


def test_a_webhook_is_shown_and_its_receiver_called_again(page: Any, url: str, database: Database, job_id: str, barriers: Any) -> None:
    with database.write() as session:
        webhooks.add(session, job_id, "https://planner.example.org/done", "whsec_" + "A" * 32)
    page.goto(f"{url}/jobs/{job_id}")
    section = page.get_by_role("region", name="Webhook")
    section.get_by_text("https://planner.example.org/done").wait_for()
    assert section.get_by_role("button").count() == 0, "it has not ended"
    with database.write() as session:
        jobs.finish(session, jobs.lock(session, job_id), JobState.SUCCEEDED, reason="as asked", outcome="inconclusive")
        row = webhooks.of_job(session, job_id)
        row.attempts = 7
        webhooks.settle(session, row.id, webhooks.Answered(utcnow(), 0.25, 500, "no room", "the receiver answered 500"))
    section.get_by_text("the receiver answered 500: no room").wait_for()
    assert barriers(page) == []
    section.get_by_role("button", name="Send again").click()
    section.get_by_text("waiting", exact=True).wait_for()
    with database.read() as session:
        assert (webhooks.of_job(session, job_id).state, webhooks.of_job(session, job_id).attempts) == ("waiting", 0)
    page.reload()
    section.get_by_text("the receiver answered 500: no room").wait_for()
