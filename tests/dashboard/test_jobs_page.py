"""The list of jobs: what it shows of each, and how it is filtered and paged."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import jobs, keys, scenes
from db.keys import Scope
from db.models import JobRow
from db.session import Database
from db.states import JobState
from tests.db.builders import add_pairs
from tests.scenes import slider


@pytest.fixture
def listed(database: Database, scene: Scene, planar: Scene) -> dict[str, str]:
    """Three jobs, by what they are: one that waits, one that was cancelled, and one for another scene."""
    with database.write() as session:
        given = {"team": "welding"}
        waiting, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}}, given_labels=given)
        cancelled, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})
        cover, _ = jobs.create(session, kind="cover", scene_id=planar.hash[:16], options={})
        session.flush()
        jobs.cancel(session, cancelled.id)
        found = session.get_one(JobRow, waiting.id)
        add_pairs(session, found, 12)
        found.pieces, found.open_pairs, found.running_pairs = 12, 4, 1
        return {"waiting": waiting.id, "cancelled": cancelled.id, "cover": cover.id}


def shown(client: TestClient, query: str) -> set[str]:
    answer = client.get(f"/?{query}")
    assert answer.status_code == 200
    return set(re.findall(r'href="/jobs/([^"]+)"', answer.text))


@pytest.mark.parametrize(
    ("query", "names"),
    [
        ("", {"waiting", "cancelled", "cover"}),
        ("state=active", {"waiting", "cover"}),
        ("state=ended", {"cancelled"}),
        ("state=cancelled", {"cancelled"}),
        ("kind=cover", {"cover"}),
        ("scene=planar&kind=&state=", {"cover"}),
        ("scene=planar&kind=grow", set()),
        ("outcome=certified", set()),
        ("search=planar", {"cover"}),
        ("search=team%3Dwelding", {"waiting"}),
        ("search=weld", {"waiting"}),
        ("search=%25", set()),
    ],
)
def test_jobs_are_filtered(client: TestClient, listed: dict[str, str], query: str, names: set[str]) -> None:
    assert shown(client, query) == {listed[name] for name in names}
    assert shown(client, query) == set(re.findall(r'href="/jobs/([^"]+)"', client.get(f"/live?{query}").text))


def test_jobs_are_filtered_by_the_key_that_asked_for_them(client: TestClient, database: Database, scene: Scene) -> None:
    with database.write() as session:
        made = [keys.add(session, name, Scope.READ) for name in ("cell", "lab")]
        for name in ("cell", "lab"):
            jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}}, key_id=keys.named(session, name))
    found = [client.get(f"/?key={name}", headers={"Authorization": f"Bearer {made[0]}"}).text for name in ("cell", "lab")]
    first, second = map(shown_in, found)
    assert (len(first), len(second), first & second) == (1, 1, set())
    assert '<option value="lab" selected>' in found[1]


def test_goals_that_samples_measure_are_not_called_certified(client: TestClient, database: Database, listed: dict[str, str]) -> None:
    """A cover has reached its share, as samples say. Its regions are certified, and the share is not."""
    with database.write() as session:
        job = jobs.lock(session, listed["cover"])
        jobs.start(session, job)
        jobs.finish(session, job, JobState.SUCCEEDED, outcome="certified", reason="the goals are reached")
    for path in ("/?kind=cover", f"/jobs/{job.id}"):
        text = client.get(path).text
        assert '<span class="badge computed">goals reached</span>' in text
        assert "badge certified" not in text


def test_progress_is_shown(client: TestClient, listed: dict[str, str]) -> None:
    text = client.get("/").text
    assert "7 of 12" in text
    assert "0 regions" in text


@pytest.mark.parametrize("query", ["state=gone", "kind=gone", "outcome=gone", "scene=gone", "key=gone", "after=gone", "search=%00"])
def test_a_wrong_filter_is_refused(client: TestClient, listed: dict[str, str], query: str) -> None:
    """An old bookmark is said to be wrong, and does not show all jobs."""
    for path in ("/", "/live"):
        answer = client.get(f"{path}?{query}", headers={"Accept": "text/html"})
        assert answer.status_code in (404, 422)
        assert shown_in(answer.text) == set()


def shown_in(text: str) -> set[str]:
    return set(re.findall(r'href="/jobs/([^"]+)"', text))


def test_older_and_newer_jobs_are_a_page_away(client: TestClient, database: Database, scene: Scene) -> None:
    with database.write() as session:
        made = [jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})[0].id for _ in range(120)]
        jobs.create(session, kind="certify", scene_id=scene.hash[:16], options={"seed": {}})
    pages = [client.get("/?kind=grow").text]
    while older := re.search(r'href="/\?(kind=grow&amp;after=[^"]+)"', pages[-1]):
        pages.append(client.get(f"/?{older[1].replace('&amp;', '&')}").text)
    assert [len(shown_in(text)) for text in pages] == [50, 50, 20]
    assert set().union(*map(shown_in, pages)) == set(made)
    assert all("120 jobs like that" in text for text in pages)
    assert "Newer jobs" not in pages[0]
    for before in reversed(pages[:-1]):
        newer = re.search(r'href="/\?(kind=grow&amp;before=[^"]+)"', pages.pop())
        assert newer is not None
        assert shown_in(client.get(f"/?{newer[1].replace('&amp;', '&')}").text) == shown_in(before)
    assert "Newer jobs" not in client.get(f"/?{newer[1].replace('&amp;', '&')}").text


def test_each_job_has_its_time_and_reason(client: TestClient, database: Database, listed: dict[str, str]) -> None:
    with database.write() as session:
        job = jobs.lock(session, listed["cover"])
        jobs.start(session, job)
        jobs.finish(session, job, JobState.SUCCEEDED, outcome="inconclusive", reason="the deadline was reached")
        job.finished_at = job.started_at + timedelta(seconds=75)
    text = client.get("/?kind=cover").text
    assert '<td class="number">75.0 s</td>' in text
    assert '<span class="clip" title="the deadline was reached">' in text


def test_scenes_are_searched_and_counted(client: TestClient, database: Database) -> None:
    with database.write() as session:
        for number in range(120):
            scenes.add(session, replace(slider(), name=f"cell-{number}", padding=1e-6 * number))
    first = client.get("/scenes").text
    assert "120 scenes" in first
    older = re.search(r'href="/scenes\?(after=[^"]+)"', first)
    assert older is not None
    last = client.get(f"/scenes?{older[1]}").text
    assert "Older scenes" not in last
    assert "Newer scenes" in last
    found = client.get("/scenes?search=cell-11").text
    assert set(re.findall(r">(cell-\d+)</a>", found)) == {"cell-11", *(f"cell-11{i}" for i in range(10))}
    assert "11 scenes like that" in found
    assert "No scene is like that" in client.get("/scenes?search=nothing").text


def test_a_refresh_loses_neither_selection_nor_focus(page: Any, url: str, database: Database, scene: Scene, listed: dict[str, str]) -> None:
    """Text that is selected stays selected, and a link stays focused where a new row comes before it."""
    page.goto(url)
    link = page.locator(f"a[href='/jobs/{listed['waiting']}']")
    link.focus()
    another(database, scene)
    page.locator("#jobs-table tbody tr").nth(3).wait_for()
    assert page.evaluate("document.activeElement.getAttribute('href')") == f"/jobs/{listed['waiting']}"
    page.evaluate("getSelection().selectAllChildren(document.querySelector('#jobs-table tbody tr'))")
    selected = page.evaluate("getSelection().toString()")
    another(database, scene)
    page.wait_for_timeout(4000)
    assert page.evaluate("getSelection().toString()") == selected != ""
    page.evaluate("getSelection().removeAllRanges()")
    page.locator("#jobs-table tbody tr").nth(4).wait_for()


def another(database: Database, scene: Scene) -> None:
    with database.write() as session:
        jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})


def test_a_choice_filters_at_once_and_stays_in_the_address(page: Any, url: str, listed: dict[str, str]) -> None:
    page.goto(url)
    page.get_by_label("State").select_option("active")
    page.wait_for_url("**/?state=active")
    assert page.locator("tbody tr").count() == 2
    page.get_by_label("Kind").select_option("certify")
    page.wait_for_url("**/?state=active&kind=certify")
    page.get_by_text("No job is like that").wait_for()
    page.get_by_role("link", name="Show all jobs").click()
    page.locator("tbody tr").nth(2).wait_for()


def test_an_empty_list_says_where_to_begin(page: Any, url: str) -> None:
    page.goto(url)
    page.get_by_role("link", name="Start one here").click()
    page.get_by_text("or upload one").wait_for()


def test_the_log_of_a_cover_does_not_call_its_goals_certified(page: Any, url: str, database: Database, listed: dict[str, str]) -> None:
    with database.write() as session:
        job = jobs.lock(session, listed["cover"])
        jobs.start(session, job)
        jobs.finish(session, job, JobState.SUCCEEDED, outcome="certified", reason="the goals are reached")
    page.goto(f"{url}/jobs/{listed['cover']}")
    page.get_by_text("The job has succeeded: the goals are reached.").wait_for()
    assert page.get_by_text("certified", exact=True).count() == 0
