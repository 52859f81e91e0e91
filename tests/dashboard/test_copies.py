"""What a page shows can be asked for by a command, by curl and in Python, which say the same as the page."""

from __future__ import annotations

import io
import json
import shlex
import subprocess
from contextlib import redirect_stdout
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.jobs.region import Region
from certifier.model import Scene
from client.cli import main
from db.session import Database
from tests.dashboard.everywhere import NAMES, addresses
from tests.dashboard.test_library_page import move

WITHOUT = {"new", "help", "login", "problem"}
"""The form's copies have tests of their own; the others show nothing of the service."""


def copied(page: Any, form: str, where: str = "[data-island=copies]") -> str:
    """What a part of a page shows as a command, as curl, or in Python."""
    place = page.locator(f"{where} .copies")
    if not place.evaluate("one => one.open"):
        place.locator("summary").click()
    place.get_by_role("button", name=form, exact=True).click()
    return str(place.locator("pre").inner_text())


def run(text: str, form: str) -> str:
    """What a copied text prints."""
    if form == "curl":
        return subprocess.run(["sh", "-c", text], check=True, capture_output=True, text=True).stdout
    with redirect_stdout(io.StringIO()) as printed:
        if form == "Python":
            exec(text, {})
        for line in [shlex.split(line) for line in text.splitlines() if form == "command" and not line.startswith("#")]:
            assert line[0] == "ciris"
            assert main([*line[1:], "--json"]) == 0
    return printed.getvalue()


def test_every_view(
    page: Any,
    url: str,
    client: TestClient,
    database: Database,
    scene: Scene,
    region: str,
    certified: Region,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every text is one that its program takes, and the service answers."""
    monkeypatch.setenv("CIRIS_API_KEY", "")
    known = addresses(client, database, scene, region, certified)
    for name in NAMES:
        if name in WITHOUT:
            continue
        page.goto(url + known[name])
        texts = {form: copied(page, form) for form in ("command", "curl", "Python")}
        assert all(url in text for text in texts.values()), name
        assert "code" not in json.loads(run(texts["curl"].splitlines()[-1], "curl")), name
        assert run(texts["command"], "command"), name
        run(texts["Python"], "Python")


def test_a_list_as_it_is_filtered(page: Any, url: str, client: TestClient, region: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIRIS_API_KEY", "")
    page.goto(f"{url}/?state=succeeded&kind=grow&scene=slider")
    found = json.loads(run(copied(page, "curl"), "curl"))["jobs"]
    assert [job["id"] for job in found] == [job["id"] for job in client.get("/v1/jobs?state=succeeded").json()["jobs"]]
    assert copied(page, "command").splitlines()[0] == "# It cannot choose by kind."
    page.goto(f"{url}/?search=team%3Dwelding&state=ended")
    assert "label=team%3Dwelding" in copied(page, "curl")
    assert "ended=true" in copied(page, "curl")
    assert "--label team=welding" in copied(page, "command")
    assert 'labels={"team": "welding"}' in copied(page, "Python")
    page.goto(f"{url}/regions?scene=slider")
    assert json.loads(run(copied(page, "curl"), "curl"))["regions"][0]["id"] == region


@pytest.mark.parametrize("pose", [False, True])
def test_a_plan(page: Any, url: str, planar: Scene, monkeypatch: pytest.MonkeyPatch, pose: bool) -> None:
    monkeypatch.setenv("CIRIS_API_KEY", "")
    page.goto(f"{url}/scenes/planar")
    move(page, -20, 10)
    page.get_by_role("button", name="Set as start").press("Enter")
    if pose:
        page.get_by_label("Goal").select_option("arm/link2")
    move(page, -17, 25)
    page.get_by_role("button", name="Set as goal").press("Enter")
    if pose:
        page.get_by_label("On a straight line").check()
    texts = {form: copied(page, form, ".planning") for form in ("command", "curl", "Python")}
    first, second = (json.loads(run(texts[name], name)) for name in ("command", "curl"))
    assert [first["found"], second["found"]] == [True, True]
    assert first["q"][-1] == pytest.approx(second["q"][-1], abs=1e-6)
    assert "None" in run(texts["Python"], "Python"), "there is no reason why there is no motion"
