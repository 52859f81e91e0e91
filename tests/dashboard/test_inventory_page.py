"""The page of those who run the service, in a browser: what it is made of, what projects use, and who sees it."""

from __future__ import annotations

import time
from typing import Any

from fastapi.testclient import TestClient

from api import probes
from api.access import KEYS_SECONDS
from db import keys, projects, solver_time, workers
from db.keys import Scope
from db.session import Database
from db.states import WorkerState
from db.workers import Made, WorkerKind


def test_an_admin_sees_what_every_project_uses_and_sorts_them(page: Any, url: str, region: str, database: Database, barriers: Any) -> None:
    with database.write() as session:
        projects.add(session, "welding")
        projects.set_limits(session, "welding", {"max_bytes": 50e9, "max_solver_seconds": 7200.0, "keep_days": 30.0})
        solver_time.add(session, "welding", 3600.0)
        boss = keys.add(session, "boss", Scope.ADMIN)
        workers.tell(session, Made("host:1:1", WorkerKind.SOLVE, "0.0.1", 4, 8, 2**34), WorkerState.RUNNING)
    time.sleep(KEYS_SECONDS)
    page.set_extra_http_headers({"Authorization": f"Bearer {boss}"})
    page.goto(url)
    page.get_by_role("link", name="Inventory").click()
    rows = page.get_by_role("region", name="Projects").get_by_role("row")
    rows.nth(2).wait_for()
    page.get_by_text("being counted").first.wait_for(state="detached", timeout=60_000)  # a busy machine needs a while

    def cells(row: int) -> list[str]:
        return [" ".join(text.split()) for text in rows.nth(row).locator("td").all_text_contents()]

    assert [cells(row)[0] for row in (1, 2)] == ["default", "welding"]
    assert cells(2)[1:5] == ["0.0 MB of 50.0 GB", "60 min 0 s of 2 h 0 min", "0, 0", "0"]
    assert cells(2)[-1] == "30 days"
    assert (cells(1)[6:9], cells(1)[-1]) == (["1", "1", "0"], "for ever")
    crew = page.get_by_role("region", name="Workers").get_by_role("row").nth(1).text_content()
    assert "0.0.1 not that of this page" in crew
    assert barriers(page) == []
    page.get_by_role("link", name="Solvers this month").click()
    page.wait_for_url("**/inventory?sort=solver_seconds")
    assert [cells(row)[0] for row in (1, 2)] == ["welding", "default"]
    assert page.locator("th[aria-sort=descending]").text_content() == "Solvers this month"
    with database.write() as session:
        projects.add(session, "painting")
    page.get_by_text("painting").wait_for()  # the page looks again
    assert page.locator("th[aria-sort=descending]").text_content() == "Solvers this month"
    page.set_viewport_size({"width": 390, "height": 844})
    assert not page.evaluate("document.documentElement.scrollWidth > innerWidth")


def test_nobody_else_has_the_page_or_a_link_to_it(client: TestClient, database: Database) -> None:
    with database.write() as session:
        projects.add(session, "others")
        wanted = (("boss", Scope.ADMIN, "default"), ("submitter", Scope.SUBMIT, "default"), ("stranger", Scope.ADMIN, "others"))
        made = {name: keys.add(session, name, scope, project) for name, scope, project in wanted}
    time.sleep(KEYS_SECONDS)
    for name, key in made.items():
        headers = {"Authorization": f"Bearer {key}", "Accept": "text/html"}
        linked = 'href="/inventory"' in client.get("/workers", headers=headers).text
        answers = [client.get(path, headers=headers) for path in ("/inventory", "/inventory/live")]
        seen = [answer.status_code == 200 and "others" in answer.text for answer in answers]
        assert (linked, seen) == (name == "boss", [name == "boss"] * 2)
        assert name == "boss" or {answer.status_code for answer in answers} == {403}


def test_many_projects_have_several_pages(client: TestClient, database: Database) -> None:
    with database.write() as session:
        for number in range(101):
            projects.add(session, f"p{number:03}")
    first = client.get("/inventory?sort=bytes").text
    assert ("p098" in first, "p099" in first) == (True, False)
    assert 'href="/inventory?sort=bytes&amp;after=p098"' in first
    second = client.get("/inventory?sort=bytes&after=p098").text
    assert ("p098</td>" in second, "p099" in second, 'href="/inventory?sort=bytes">The first projects' in second) == (False, True, True)
    assert client.get("/inventory?sort=size").status_code == 422
    assert client.get("/inventory?by=bytes").status_code == 422


def test_what_is_counted_slowly_keeps_nobody_waiting(client: TestClient, database: Database, monkeypatch: Any) -> None:
    """Then the page says so; what it knows without counting is there."""
    monkeypatch.setattr(probes, "WAIT_SECONDS", 0.0)
    page = client.get("/inventory").text
    assert "being counted" in page
    assert "default</td>" in page
