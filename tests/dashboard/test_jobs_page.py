"""The list of jobs: what it shows of each, and how it is filtered and paged."""

from __future__ import annotations

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import jobs
from db.models import JobRow
from db.session import Database
from db.states import JobState
from tests.db.builders import add_pairs


@pytest.fixture
def listed(database: Database, scene: Scene, planar: Scene) -> dict[str, str]:
    """Three jobs, by what they are: one that waits, one that was cancelled, and one for another scene."""
    with database.write() as session:
        waiting, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})
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
        ("state=gone&kind=gone", {"waiting", "cancelled", "cover"}),
    ],
)
def test_jobs_are_filtered(client: TestClient, listed: dict[str, str], query: str, names: set[str]) -> None:
    assert shown(client, query) == {listed[name] for name in names}
    assert shown(client, query) == set(re.findall(r'href="/jobs/([^"]+)"', client.get(f"/live?{query}").text))


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


def test_older_jobs_are_a_page_away(client: TestClient, database: Database, scene: Scene) -> None:
    with database.write() as session:
        for _ in range(51):
            jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})
    first = client.get("/?kind=grow").text
    older = re.search(r'href="/\?(kind=grow&amp;after=[^"]+)"', first)
    assert older is not None
    assert len(shown(client, older[1].replace("&amp;", "&"))) == 1


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
