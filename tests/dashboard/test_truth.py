"""What a page says is about what it shows: answers that come late, out of order or never do not stand beside something else."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

from certifier.model import Scene
from db import jobs, keys
from db.keys import Scope
from db.session import Database
from db.states import JobState


def end(database: Database, job_id: str) -> None:
    with database.write() as session:
        jobs.finish(session, jobs.lock(session, job_id), JobState.SUCCEEDED, outcome="certified", reason="all is well")


EFFECTS = "new Promise((done) => requestAnimationFrame(() => setTimeout(done)))"
"""Preact runs the effects of what it has drawn, and adds listeners, in the frame after. This is over when they have run."""


def until(holds: Callable[[], bool]) -> None:
    """Waits without the browser's help, whose page may be held up."""
    give_up = time.monotonic() + 20
    while not holds():
        assert time.monotonic() < give_up
        time.sleep(0.05)


def test_nothing_is_said_of_a_configuration_that_was_not_asked_about(page: Any, url: str, planar: Scene) -> None:
    """The robot moves into a collision while the service is slow: what was true of the configuration before is not said any more."""
    page.goto(f"{url}/new?scene=planar&q=0,0")
    page.get_by_text("No collision (computed").wait_for()
    held: list[Any] = []
    slow = [True]
    page.route("**/v1/planning/contacts", lambda route: held.append(route) if slow else route.continue_())
    page.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").fill("30")
    page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").fill("15")
    page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").press("Enter")
    until(lambda: page.locator(".said").text_content() == "…" and len(held) > 0)
    page.wait_for_timeout(300)
    assert page.locator(".said").text_content() == "…"
    slow.clear()
    for one in held:
        one.continue_()
    page.get_by_text("Not free: arm/link2/bar and world/obstacle touch").wait_for()


def test_nothing_is_said_of_a_slice_that_is_not_there_yet(page: Any, url: str, planar_region: str) -> None:
    page.goto(f"{url}/scenes/planar")
    page.get_by_text("of this slice is in certified regions").wait_for()
    page.route("**/v1/planning/slice", lambda route: None)
    page.locator(".slice select").first.select_option(index=1)
    page.get_by_text("Computing …").wait_for()
    assert page.get_by_text("of this slice is in certified regions").count() == 0


def test_a_job_is_followed_without_a_stream(page: Any, url: str, database: Database, running: str, complaints: list[str]) -> None:
    """Somebody holds streams back, so the events are asked for."""
    page.route("**/events/stream*", lambda route: None)
    page.goto(f"{url}/jobs/{running}")
    page.get_by_role("button", name="Cancel").wait_for()
    end(database, running)
    page.locator("#live .badge.succeeded").wait_for()
    assert page.get_by_role("button", name="Cancel").count() == 0


def test_a_job_is_followed_where_streams_are_refused(page: Any, url: str, database: Database, running: str, complaints: list[str]) -> None:
    page.route("**/events/stream*", lambda route: route.abort())
    page.goto(f"{url}/jobs/{running}")
    page.get_by_role("button", name="Cancel").wait_for()
    end(database, running)
    page.locator("#live .badge.succeeded").wait_for()
    assert page.locator("#connection").is_hidden()
    assert {text.split(":")[0] for text in complaints} == {"Failed to load resource"}
    complaints.clear()


def test_answers_out_of_order_and_lost_ones_leave_the_last_word_to_the_end(
    page: Any, url: str, database: Database, running: str, complaints: list[str]
) -> None:
    page.goto(f"{url}/jobs/{running}")
    page.get_by_role("button", name="Cancel").wait_for()
    page.wait_for_timeout(1000)
    old = page.request.get(f"{url}/jobs/{running}/live", headers={"Accept": "text/html"}).text()
    asked: list[Any] = []

    def answer(route: Any) -> None:
        asked.append(route)
        if len(asked) == 2:
            route.abort()  # this one is lost
        elif len(asked) > 2:
            route.continue_()

    page.route("**/live", answer)
    with database.write() as session:
        from db import events

        events.emit(session, jobs.lock(session, running), "step", {"kind": "propose", "state": "open"})
    until(lambda: page.locator("#live").count() == 1 and len(asked) >= 1)
    end(database, running)
    page.locator("#live .badge.succeeded").wait_for()
    asked[0].fulfill(status=200, content_type="text/html", body=old)  # the first answer comes last
    page.wait_for_timeout(500)
    assert page.locator("#live .badge.succeeded").count() == 1
    assert page.get_by_role("button", name="Cancel").count() == 0
    complaints.clear()


def test_a_configuration_of_which_nothing_is_known_is_not_said_to_be_free(page: Any, url: str, planar: Scene) -> None:
    answer = {"scene": planar.hash[:16], "contacts": [{"pairs": None, "outside": [], "trouble": []}]}
    page.route("**/v1/planning/contacts", lambda route: route.fulfill(json=answer))
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_text("Not known here: a joint is half a turn away from q*.").wait_for()
    assert page.get_by_text("No collision (computed").count() == 0


def test_whoever_signs_in_again_comes_back_to_the_same_place(browser: Any, url: str, database: Database, planar: Scene) -> None:
    with database.write() as session:
        key = keys.add(session, "operator", Scope.SUBMIT)
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_label("API key").fill(key)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url(f"{url}/new?scene=planar**")
    page.locator(".slider").first.wait_for()
    assert page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").input_value() == "-11.5"
    context.close()


def test_who_is_signed_out_is_led_to_the_page_for_signing_in(browser: Any, url: str, database: Database, running: str) -> None:
    with database.write() as session:
        key = keys.add(session, "reader", Scope.READ)
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{url}/login")
    page.get_by_label("API key").fill(key)
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("heading", name="Jobs").wait_for()
    context.clear_cookies()
    page.wait_for_url(re.compile(r"/login\?next=/$"))
    assert page.locator("main").count() == 1
    context.close()


def test_a_button_that_is_refused_says_so_and_may_be_tried_again(page: Any, url: str, running: str, complaints: list[str]) -> None:
    problem = '{"code": "scope_missing", "detail": "this needs a key of the scope submit", "field": "", "hint": ""}'
    page.route("**/cancel", lambda route: route.fulfill(status=403, content_type="application/problem+json", body=problem))
    page.goto(f"{url}/jobs/{running}")
    button = page.get_by_role("button", name="Cancel")
    button.click()
    page.get_by_role("alert").filter(has_text="this needs a key of the scope submit").wait_for()
    assert button.is_enabled()
    assert button.text_content() == "Cancel"
    complaints.clear()
