"""The page of the workers, in a browser: what it says, its buttons, and who sees them."""

from __future__ import annotations

import os
import re
import time
from typing import Any

from fastapi.testclient import TestClient

from api.access import KEYS_SECONDS
from api.held import SAID
from api.pages.rendering import ROOT as DASHBOARD
from api.pages.rendering import work_in_words
from certifier.model import Scene
from db import jobs, keys, leases, projects, workers
from db.keys import Scope
from db.session import Database
from db.states import WorkerState
from db.workers import Made, WorkerKind


def test_the_page_shows_what_workers_do_and_pauses_them(page: Any, url: str, busy: str, database: Database, barriers: Any) -> None:
    with database.write() as session:
        made = Made(leases.name_of(os.getppid()), WorkerKind.SOLVE, "1.2", 4, 8, 2**34)
        workers.tell(session, made, WorkerState.RUNNING, "expiry failed: OverflowError")
    page.goto(url)
    page.get_by_role("link", name="Workers").click()
    row = page.get_by_role("row").nth(1)
    assert "1 of 4" in row.text_content()
    assert "certifying 1 pair, job" in row.text_content()
    assert "expiry failed: OverflowError" in row.text_content()
    assert row.get_by_role("link", name=busy[:8]).get_attribute("href") == f"/jobs/{busy}"
    (since,) = row.get_by_role("cell").nth(4).locator("time").all()
    began, now = page.evaluate("time => [Date.parse(time.dateTime), Date.now()]", since.element_handle())
    assert now - 60_000 < began <= now, "the pair is held since a moment ago"
    assert barriers(page) == []
    asked: list[str] = []
    page.once("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    row.get_by_role("button", name="Pause").click()
    assert asked == ["This is the last solve worker that takes work. Jobs are queued until you resume it."]
    page.on("dialog", lambda dialog: dialog.accept())
    row.get_by_role("button", name="Pause").click()
    page.get_by_text("to be paused").wait_for()
    with database.read() as session:
        assert workers.page(session).rows[0].wanted == "paused"
    page.get_by_role("button", name="Resume").click()
    page.get_by_role("button", name="Pause").wait_for()
    page.get_by_role("button", name="Drain").click()
    page.get_by_text("to be draining").wait_for()
    assert page.get_by_role("button", name="Pause").count() == 0


def test_pages_have_words_for_the_same_work() -> None:
    """The page of a job is written in the browser, that of the workers in the service."""
    source = (DASHBOARD / "source/job/steps.ts").read_text()
    known = re.findall(r"^  (\w+): ", source.partition("const STEPS")[2], re.MULTILINE)
    assert {"map", "piece", "seed"} <= set(known)
    assert [kind for kind in known if work_in_words(SAID.get(kind, kind)) == kind] == []


def test_only_those_who_run_the_service_have_buttons(client: TestClient, busy: str, database: Database) -> None:
    with database.write() as session:
        projects.add(session, "others")
        made = [keys.add(session, "k", scope, project) for scope, project in ((Scope.ADMIN, "default"), (Scope.ADMIN, "others"))]
        made.append(keys.add(session, "reader", Scope.READ))
    time.sleep(KEYS_SECONDS)
    buttons = []
    for key in made:
        answer = client.get("/workers", headers={"Authorization": f"Bearer {key}"})
        assert "1 of 4" in answer.text
        buttons.append("data-post" in answer.text)
    assert buttons == [True, False, False]


def test_the_last_worker_is_not_drained_without_a_question_while_it_is_paused(page: Any, url: str, database: Database) -> None:
    """The only solve worker is paused, so none takes work. Draining it ends it for good all the same."""
    with database.write() as session:
        made = Made("host:solve:1", WorkerKind.SOLVE, "1.2", 4, 8, 2**34)
        workers.tell(session, made, WorkerState.PAUSED)
        workers.ask(session, workers.page(session).rows[0].id, WorkerState.PAUSED)
    page.goto(f"{url}/workers")
    asked: list[str] = []
    page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    page.get_by_role("button", name="Drain").click()
    assert [text.partition(".")[0] for text in asked] == ["This is the last solve worker"]
    with database.read() as session:
        assert workers.page(session).rows[0].wanted == "paused"


def test_a_job_says_that_workers_compile_also_on_a_phone(page: Any, url: str, scene: Scene, database: Database) -> None:
    with database.write() as session:
        for kind, state in ((WorkerKind.CONTROL, WorkerState.RUNNING), (WorkerKind.SOLVE, WorkerState.COMPILING)):
            workers.tell(session, Made(f"host:{kind}:1", kind, "1.2", 4, 8, 2**34), state)
        job, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(f"{url}/jobs/{job.id}")
    page.get_by_text("It goes on by itself when they are ready.").wait_for()
    assert page.locator(".title .badge").text_content() == "queued: workers compile, which takes some minutes, once"
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_the_page_says_which_worker_is_missing(client: TestClient, database: Database) -> None:
    def notices() -> list[str]:
        return re.findall("<strong>(.*?)</strong>", client.get("/workers/live").text)

    solver, control = (Made(f"host:{kind}:1", kind, "1.2", 4, 8, 2**34) for kind in (WorkerKind.SOLVE, WorkerKind.CONTROL))
    assert notices() == ["Jobs stay queued: no worker."]
    with database.write() as session:
        workers.tell(session, control, WorkerState.RUNNING)
    assert notices() == ["Jobs stay queued: no worker."], "a control worker solves nothing"
    for state, said in ((WorkerState.STARTING, "get ready"), (WorkerState.COMPILING, "compile, which takes some minutes, once")):
        with database.write() as session:
            workers.tell(session, solver, state)
        assert notices() == [f"Jobs stay queued: workers {said}."]
        text = client.get("/workers/live").text
        assert "Then they begin by themselves." in text
        assert "python -m workers" not in text, "nothing is to be started"
        assert f'<span class="badge {state}">{state}</span></td>' in text.replace("\n", ""), "nor is it to be anything else"
    with database.write() as session:
        workers.tell(session, solver, WorkerState.PAUSED)
    assert notices() == ["Jobs stay queued: all workers paused."]
    with database.write() as session:
        workers.tell(session, solver, WorkerState.RUNNING)
    assert notices() == []
