"""The page of a project, in a browser: what it stores, its keys, and who changed what."""

from __future__ import annotations

import time
from datetime import timedelta
from typing import Any

from fastapi.testclient import TestClient

from api.access import KEYS_SECONDS
from db import keys, projects, solver_time
from db.keys import Scope
from db.session import Database
from db.types import utcnow


def made(database: Database, *wanted: tuple[str, Scope, str]) -> list[str]:
    """Makes keys, and waits until the service knows that it has some."""
    with database.write() as session:
        projects.add(session, "others")
        found = [keys.add(session, name, scope, project) for name, scope, project in wanted]
    time.sleep(KEYS_SECONDS)
    return found


def test_an_admin_makes_and_revokes_keys_and_sees_who_did(
    page: Any, url: str, database: Database, barriers: Any, complaints: list[str]
) -> None:
    boss, _ = made(database, ("boss", Scope.ADMIN, "default"), ("theirs", Scope.ADMIN, "others"))
    page.set_extra_http_headers({"Authorization": f"Bearer {boss}"})
    page.goto(f"{url}/project")
    assert "0.0 MB of scenes" in page.text_content("main")
    page.get_by_label("Name").fill("planner")
    page.get_by_label("It may").select_option("submit")
    page.get_by_role("button", name="Make the key").click()
    page.get_by_role("row").filter(has_text="planner").first.wait_for()
    shown = page.locator("#made-key code").text_content()
    with database.read() as session:
        known = keys.check(session, shown)
    assert known is not None
    assert (known.name, known.scope, known.project) == ("planner", Scope.SUBMIT, "default")
    assert barriers(page) == []
    asked: list[str] = []
    page.once("dialog", lambda dialog: (asked.append(dialog.message), dialog.accept()))
    page.get_by_role("button", name="Revoke the key planner").click()
    page.get_by_role("button", name="Revoke the key planner").wait_for(state="detached")
    assert asked == ["Who uses the key planner is refused from now on. Nothing takes this back."]
    with database.read() as session:
        assert keys.check(session, shown) is None
    log = page.get_by_role("region", name="Who changed what").text_content()
    assert "key revoked" in log
    assert "planner (submit)" in log
    assert "theirs" not in page.text_content("main"), "another project's key"
    page.get_by_label("Name").fill("visitor")
    page.get_by_label("For days").fill("90")
    page.get_by_role("button", name="Make the key").click()
    page.get_by_role("row").filter(has_text="visitor (read, for 90 days)").wait_for()
    visitor = page.get_by_role("region", name="Keys").get_by_role("row").filter(has_text="visitor").locator("td")
    expires = (utcnow() + timedelta(days=90)).date().isoformat()
    assert visitor.nth(4).locator("time").count() == 0, "it was not used"
    assert visitor.nth(5).locator("time").get_attribute("datetime")[:10] == expires
    page.get_by_label("Name").fill("boss")
    page.get_by_role("button", name="Make the key").click()
    page.locator("#made-key.bad").wait_for()
    assert "422" in complaints.pop(), "the browser notes the refusal"


def test_others_see_what_the_project_stores_and_nothing_of_its_keys(client: TestClient, database: Database) -> None:
    reader, submitter = made(database, ("reader", Scope.READ, "default"), ("submitter", Scope.SUBMIT, "default"))
    for key, may in ((reader, "look at everything<"), (submitter, "start and cancel jobs")):
        for path in ("/project", "/project/live"):
            answer = client.get(path, headers={"Authorization": f"Bearer {key}"})
            assert answer.status_code == 200
            assert "data-delete" not in answer.text
            assert "submitter" not in answer.text.partition("<main")[2]
        assert may in client.get("/project", headers={"Authorization": f"Bearer {key}"}).text


def test_the_page_says_how_much_of_the_solvers_time_is_left(client: TestClient, database: Database) -> None:
    with database.write() as session:
        solver_time.add(session, "default", 7200.0)
    assert "have worked 2 h 0 min for the project this month." in client.get("/project").text
    with database.write() as session:
        projects.get(session, "default").max_solver_seconds = 10_800.0
    page = client.get("/project").text
    assert "2 h 0 min for the project this month, of at most 3 h 0 min;\n60 min 0 s are left. The next month begins" in page
    with database.write() as session:
        solver_time.add(session, "default", 3600.0)
    assert "nothing is left, and new jobs are refused" in client.get("/project").text


def test_a_service_without_keys_says_so(client: TestClient) -> None:
    answer = client.get("/project")
    assert answer.status_code == 200
    assert "everybody may do everything" in answer.text
    assert "make-key" not in answer.text, "the first key is made at the command line"
