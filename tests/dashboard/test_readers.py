"""What somebody may not do is not offered: a key of the scope ``read`` finds no link, button or form that starts or ends anything."""

from __future__ import annotations

from typing import Any

from fastapi.testclient import TestClient

from certifier.jobs.region import Region
from certifier.model import Scene
from db.keys import Scope
from db.session import Database
from tests.dashboard.everywhere import NAMES, addresses
from tests.dashboard.job_scenes import new_job
from tests.dashboard.test_project_page import made

STARTING = (
    'href="/new',
    "/cancel",
    "/retry",
    "/resend",
    "data-sample",
    "data-delete",
    'id="make-key"',
    'data-island="new"',
    "/drain",
    "/pause",
)
"""What begins, ends or changes something in the pages of the server."""


def offered(client: TestClient, key: str, known: dict[str, str]) -> dict[str, list[str]]:
    texts = {name: client.get(known[name], headers={"Authorization": f"Bearer {key}"}).text for name in NAMES if name != "inventory"}
    return {name: found for name, text in texts.items() if (found := [what for what in STARTING if what in text])}


def test_a_reader_is_offered_nothing_that_it_may_not_do(
    client: TestClient, database: Database, scene: Scene, region: str, certified: Region
) -> None:
    known = addresses(client, database, scene, region, certified) | {"running": f"/jobs/{new_job(database, scene)}"}
    reader, submitter = made(database, ("reader", Scope.READ, "default"), ("submitter", Scope.SUBMIT, "default"))
    assert offered(client, reader, known) == {}
    assert {"jobs", "new", "scenes", "scene", "region"} <= offered(client, submitter, known).keys()
    running = [client.get(known["running"], headers={"Authorization": f"Bearer {key}"}).text for key in (reader, submitter)]
    assert ["/cancel" in text for text in running] == [False, True]
    form = client.get("/new", headers={"Authorization": f"Bearer {reader}"}).text
    assert "start no jobs" in form


def test_a_reader_plans_and_uploads_no_path(page: Any, url: str, planar: Scene, database: Database) -> None:
    reader, submitter = made(database, ("reader", Scope.READ, "default"), ("submitter", Scope.SUBMIT, "default"))
    for key, uploads in ((submitter, 1), (reader, 0)):
        page.set_extra_http_headers({"Authorization": f"Bearer {key}"})
        page.goto(f"{url}/scenes/planar")
        page.get_by_role("button", name="Plan a motion").wait_for()
        page.get_by_text("This scene has no region yet.").wait_for()
        assert page.get_by_role("heading", name="Certify a motion").count() == uploads
        assert page.locator("main a[href^='/new']").count() == 3 * uploads
