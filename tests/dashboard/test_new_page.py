"""The form that starts a job, in a real browser: which scene, from which configuration, what shall be done."""

from __future__ import annotations

import html
import io
import json
import os
import re
import shlex
import subprocess
import sys
import zipfile
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api.pages.remedies import remedies
from api.schemas.jobs import Job
from certifier.model import Scene
from certifier.options import option
from db import scenes, staging
from db.keys import Scope
from db.session import Database
from db.states import JobState
from jobs.grow import Grow
from tests.dashboard.test_project_page import made
from tests.dashboard.test_truth import until

REFUSED = "Failed to load resource: the server responded with a status of "
EXAMPLE = Path(__file__).parents[2] / "examples" / "planar_2dof"


@pytest.fixture
def opened(page: Any, url: str, planar: Scene) -> Any:
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_text("No collision (computed").wait_for()
    return page


def jobs(client: TestClient) -> list[dict[str, Any]]:
    return client.get("/v1/jobs").json()["jobs"]


def set_joint(page: Any, joint: str, degrees: float) -> None:
    field = page.get_by_role("spinbutton", name=f"{joint}, degrees, as a number")
    field.fill(str(degrees))
    field.press("Enter")


def test_a_job_is_started_from_the_configuration_that_is_shown(opened: Any, url: str, client: TestClient) -> None:
    set_joint(opened, "arm/joint2", -20)
    opened.locator("summary", has_text="More options").press("Enter")
    opened.get_by_label("Method").select_option("iris_zo")
    opened.get_by_label("Cells").fill("64")
    opened.locator("summary", has_text="Deadline").press("Enter")
    opened.get_by_label("Deadline").fill("2")
    opened.get_by_role("button", name="Start the job").press("Enter")
    opened.wait_for_url(f"{url}/jobs/*")
    (job,) = jobs(client)
    assert opened.url.endswith(job["id"])
    seed = job["options"]["seed"]
    assert seed["q"] == pytest.approx([0.1, np.deg2rad(-20)])
    assert (seed["method"], job["options"]["cells"]) == ("iris_zo", 64)
    assert job["deadline_at"] is not None


def test_the_robot_takes_a_named_configuration_and_keeps_the_joints_that_it_leaves_open(
    page: Any, url: str, planar: Scene, database: Database
) -> None:
    with database.write() as session:
        scenes.add(
            session, replace(planar, name="named", configurations={"arm/home": {"arm/joint2": -0.5}, "arm/far": {"arm/joint1": 0.7}})
        )
    page.goto(f"{url}/new?scene=named&q=0.1,-0.2")
    page.get_by_label("Named configuration").select_option("arm/home")
    page.wait_for_url("**/new?scene=named&q=0.1,-0.5")
    page.get_by_label("Named configuration").select_option("arm/far")
    page.wait_for_url("**/new?scene=named&q=0.7,-0.5")


def test_each_name_of_a_scene_is_offered_with_its_own_configurations(page: Any, url: str, planar: Scene, database: Database) -> None:
    with database.write() as session:
        for name in ("one", "two"):
            scenes.add(session, replace(planar, name=name, configurations={f"{name}/home": {"arm/joint2": -0.5}}))
        staging.stage(session, "one", replace(planar, padding=0.001))
    page.goto(f"{url}/new?scene=one&q=0.1,-0.2")
    select, named = page.get_by_label("Scene", exact=True), page.get_by_label("Named configuration")
    named.wait_for()
    assert "scene=one&" in page.url
    offered = {option.partition(" ")[0] for option in select.locator("option").all_text_contents()}
    assert offered == {"planar", "one", "two", "one@staged"}
    assert named.locator("option").all_text_contents() == ["choose …", "one/home"]
    select.select_option("two")
    page.wait_for_url("**/new?scene=two&**")
    named.locator("option", has_text="two/home").wait_for(state="attached")
    select.select_option("one@staged")
    page.wait_for_url("**/new?scene=one%40staged&**")
    page.goto(f"{url}/new?scene={planar.hash[:16]}")
    page.locator(".slider").first.wait_for()
    assert select.input_value() == planar.hash[:16]
    assert select.locator("option:checked").text_content() == f"planar · 2 joints, {len(planar.pairs)} pairs · {planar.hash[:8]}"


def test_what_touches_is_said_live_and_no_job_starts_there(opened: Any, client: TestClient) -> None:
    set_joint(opened, "arm/joint1", 30)
    set_joint(opened, "arm/joint2", 15)
    opened.get_by_text("Not free: arm/link2/bar and world/obstacle touch").wait_for()
    opened.get_by_role("button", name="Start the job").click()
    opened.get_by_text("no region can hold the configuration").wait_for()
    assert jobs(client) == []
    opened.get_by_role("button", name="Random free one").click()
    opened.get_by_text("No collision (computed").wait_for()


def test_the_address_keeps_the_configuration(opened: Any) -> None:
    set_joint(opened, "arm/joint1", 10)
    opened.wait_for_url("**q=0.1745,-0.2")
    opened.reload()
    opened.get_by_text("No collision (computed").wait_for()
    assert opened.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").input_value() == "10.0"


def test_the_configuration_of_the_address_is_for_its_scene_only(opened: Any, planar: Scene, database: Database) -> None:
    """Another scene with the same number of joints begins at its own q*. The page does not complain about the address."""
    with database.write() as session:
        other = replace(planar, name="other", padding=0.001)
        scenes.add(session, other)
    opened.reload()
    opened.get_by_label("Scene", exact=True).select_option(label=f"other · 2 joints, {len(other.pairs)} pairs · {other.hash[:8]}")
    opened.wait_for_url("**/new?scene=other&q=0,0")
    assert opened.get_by_text("The address does not name").count() == 0


def test_the_notice_quotes_what_the_address_named(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/new?scene=planar&q=0,-9")
    page.get_by_text("The address does not name a configuration within the limits: 0,-9.").wait_for()
    page.wait_for_url("**&q=0,-1.2")
    set_joint(page, "arm/joint1", 5)
    assert page.get_by_text("within the limits: 0,-9.").count() == 1


def test_configurations_are_marked_to_be_connected(opened: Any, url: str, client: TestClient) -> None:
    opened.get_by_text("Cover the scene").click()
    opened.get_by_label("Goal").select_option("connect")
    start = opened.get_by_role("button", name="Start the job")
    add = opened.get_by_role("button", name="Add this configuration")
    add.click()
    start.click()
    opened.get_by_text("Add at least two configurations").wait_for()
    set_joint(opened, "arm/joint1", -30)
    add.click()
    opened.get_by_text("-30.0, -11.5").first.wait_for()
    start.click()
    opened.wait_for_url(f"{url}/jobs/*")
    (job,) = jobs(client)
    assert job["kind"] == "cover"
    assert job["options"]["connect"] == [pytest.approx([0.1, -0.2]), pytest.approx([np.deg2rad(-30), -0.2])]
    assert job["options"]["coverage"] is None


def test_what_stands_between_configurations_to_contain_is_said_before_a_job_begins(opened: Any, url: str, client: TestClient) -> None:
    """The second link passes the box on the straight line between the two, and at neither end."""
    start = opened.get_by_role("button", name="Start the job")
    set_joint(opened, "arm/joint1", 65)
    set_joint(opened, "arm/joint2", 0)
    opened.get_by_text("No collision (computed").wait_for()
    opened.get_by_role("button", name="Add this configuration").click()
    set_joint(opened, "arm/joint1", 0)
    said = opened.get_by_role("alert").filter(
        has_text="One region cannot contain both ends of the straight line in s from this configuration"
    )
    said.wait_for()
    assert "obstacle" in said.text_content()
    start.click()
    opened.wait_for_timeout(1000)
    assert jobs(client) == []
    said.get_by_role("button", name="Connect them with several regions").click()
    start.click()
    opened.wait_for_url(f"{url}/jobs/*")
    (job,) = jobs(client)
    assert job["kind"] == "cover"
    assert job["options"]["connect"] == [pytest.approx([0.0, 0.0]), pytest.approx([np.deg2rad(65), 0.0])]


def test_a_configuration_to_contain_that_is_not_free_is_named(opened: Any, client: TestClient) -> None:
    set_joint(opened, "arm/joint1", 34)
    set_joint(opened, "arm/joint2", 0)
    opened.get_by_text("Not free").wait_for()
    opened.get_by_role("button", name="Add this configuration").click()
    set_joint(opened, "arm/joint1", -30)
    said = opened.get_by_role("alert").filter(has_text="No region can contain configuration 1")
    said.wait_for()
    opened.get_by_role("button", name="Start the job").click()
    opened.wait_for_timeout(1000)
    assert jobs(client) == []
    opened.get_by_role("button", name="remove").click()
    said.wait_for(state="detached")


def test_a_map_is_asked_for(opened: Any, url: str, client: TestClient) -> None:
    opened.get_by_text("Map the scene").click()
    opened.get_by_label("Coverage").fill("0.7")
    opened.get_by_role("button", name="Add this configuration").click()
    opened.get_by_role("button", name="Start the job").click()
    opened.wait_for_url(f"{url}/jobs/*")
    (job,) = jobs(client)
    assert job["kind"] == "map"
    assert job["options"] == {
        "coverage": 0.7,
        "at": [pytest.approx([0.1, -0.2])],
        "random_seed": 0,
        "former": None,
        "paths": [],
        "asked": False,
    }


def copied(page: Any, form: str) -> str:
    """The job of the form as a command, as curl, or in Python."""
    if page.locator(".copies[open]").count() == 0:
        page.locator(".copies summary").click()
    page.get_by_role("button", name=form, exact=True).click()
    return str(page.locator(".copies pre").inner_text())


def fill_in(page: Any, kind: str) -> None:
    """Wishes for a job of a kind, with something that is not the default."""
    page.get_by_role("radio", name=kind).check()
    if kind == "Certify a polytope":
        choose(page, "polytope.json", {"C": [[1.0, 0.0], [-1.0, 0.0]], "d": [0.1, 0.05], "center": [0.02, 0.0]})
    elif kind == "Certify a motion":
        choose(page, "motion.json", {"q": [[0.1, -0.2], [-0.1, 0.1]]})
        page.get_by_label("Clearance").check()
    else:
        page.get_by_role("button", name="Add this configuration").click()
    if kind != "Certify a motion":
        page.locator("summary", has_text="More options").click()
        page.get_by_label("Random seed", exact=True).last.fill("7")
    page.locator("summary", has_text="Deadline").click()
    page.get_by_label("Deadline").fill("2")


def choose(page: Any, name: str, document: dict[str, Any]) -> None:
    page.locator("#new-file").set_input_files({"name": name, "mimeType": "application/json", "buffer": json.dumps(document).encode()})
    page.get_by_text(f"{name}: 2 rows of").wait_for()


ALL = ["Grow one region", "Cover the scene", "Map the scene", "Certify a polytope", "Certify a motion"]


@pytest.mark.parametrize("kind", ALL)
def test_the_form_the_command_curl_and_python_ask_for_the_same_job(
    opened: Any, url: str, client: TestClient, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_in(opened, kind)
    texts = {form: copied(opened, form) for form in ("command", "curl", "Python")}
    opened.get_by_role("button", name="Start the job").click()
    opened.wait_for_url(f"{url}/jobs/*")
    (mine,) = jobs(client)
    for name, document in (("polytope", mine["options"].get("seed")), ("motion", {"q": mine["options"].get("q")})):
        (tmp_path / f"{name}.json").write_text(json.dumps(document))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CIRIS_API_KEY", "")
    arguments = shlex.split(texts["command"])
    assert arguments.pop(0) == "ciris"
    with subprocess.Popen([sys.executable, "-m", "client.cli", *arguments], stderr=subprocess.PIPE) as command:
        until(lambda: len(jobs(client)) == 2)
        command.terminate()
    subprocess.run(["sh", "-c", texts["curl"]], check=True, capture_output=True)
    exec(texts["Python"].replace(".wait()", ""), {})
    others = jobs(client)[:3]
    assert len(jobs(client)) == 4
    same = ("kind", "scene", "options", "priority")
    for other in others:
        assert [other[name] for name in same] == [mine[name] for name in same]
        assert lasts(other) == pytest.approx(lasts(mine)) == 120


def test_who_is_signed_in_copies_curl_with_the_key(page: Any, url: str, planar: Scene, database: Database) -> None:
    (key,) = made(database, ("somebody", Scope.SUBMIT, "default"))
    page.set_extra_http_headers({"Authorization": f"Bearer {key}"})
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_text("No collision (computed").wait_for()
    text = copied(page, "curl")
    subprocess.run(["sh", "-c", text], check=True, capture_output=True, env={**os.environ, "CIRIS_API_KEY": key})
    page.goto(url)
    page.get_by_role("cell", name="grow").wait_for()


@pytest.mark.parametrize("kind", ["Certify a polytope", "Certify a region again"])
def test_the_command_has_no_configurations_that_its_kind_does_not_take(opened: Any, kind: str) -> None:
    opened.get_by_role("radio", name="Map the scene").check()
    opened.get_by_role("button", name="Add this configuration").click()
    assert "--at=0.1,-0.2" in copied(opened, "command")
    opened.get_by_role("radio", name=kind).check()
    assert "0.1,-0.2" not in copied(opened, "command")


def test_a_configuration_is_added_once_and_a_motion_may_come_back_to_it(opened: Any) -> None:
    opened.get_by_role("radio", name="Map the scene").check()
    add, added = (opened.get_by_role("button", name=name) for name in ("Add this configuration", "This configuration is added"))
    add.click()
    assert added.is_disabled()
    set_joint(opened, "arm/joint1", -30)
    add.click()
    opened.locator(".marks li button").first.click()
    added.wait_for()
    opened.get_by_role("radio", name="Certify a motion").check()
    add.click()
    added.wait_for()
    assert opened.locator(".marks li").count() == 3


def test_the_text_is_copied(opened: Any) -> None:
    opened.context.grant_permissions(["clipboard-read", "clipboard-write"])
    text = copied(opened, "curl")
    opened.get_by_role("button", name="Copy", exact=True).click()
    opened.get_by_role("button", name="Copied").wait_for()
    assert opened.evaluate("navigator.clipboard.readText()") == text


def lasts(job: dict[str, Any]) -> float:
    """The seconds that a job has from its creation to its deadline."""
    return (datetime.fromisoformat(job["deadline_at"]) - datetime.fromisoformat(job["created_at"])).total_seconds()


@pytest.mark.parametrize("kind", ALL)
def test_a_job_is_edited_and_run_again(opened: Any, url: str, client: TestClient, kind: str) -> None:
    """The form of a job that has ended is filled in with all that it was asked for: unchanged, it asks for the same again."""
    fill_in(opened, kind)
    opened.get_by_role("button", name="Start the job").click()
    opened.wait_for_url(f"{url}/jobs/*")
    opened.get_by_role("button", name="Cancel").click()
    opened.get_by_role("link", name="Edit and run again").click()
    opened.locator(".slider").first.wait_for()
    opened.get_by_role("button", name="Start the job").click()
    opened.wait_for_url(f"{url}/jobs/*")
    again, first = jobs(client)
    assert {**again["options"], "seed": rounded(again)} == {**first["options"], "seed": rounded(first)}
    assert (again["kind"], lasts(again)) == (first["kind"], lasts(first))


def rounded(job: dict[str, Any]) -> Any:
    return json.loads(json.dumps(job["options"].get("seed")), parse_float=lambda text: round(float(text), 4))


def test_a_region_is_certified_again_in_another_scene(page: Any, url: str, planar_region: str, client: TestClient) -> None:
    page.goto(f"{url}/regions/{planar_region}")
    page.get_by_role("link", name="Certify it again in another scene").click()
    page.locator(".slider").first.wait_for()
    assert page.get_by_label("Region", exact=True).input_value() == planar_region
    page.get_by_role("button", name="Start the job").click()
    page.wait_for_url(f"{url}/jobs/*")
    assert jobs(client)[0]["kind"] == "recertify"
    assert jobs(client)[0]["options"]["seed"]["region"] == planar_region


def test_what_a_kind_of_job_needs_is_asked_for(opened: Any, client: TestClient) -> None:
    for kind, words in (
        ("Certify a polytope", "Choose the file with the polytope."),
        ("Certify a motion", "Choose the file with the motion, or add at least two waypoints."),
        ("Certify a region again", "Name the region to certify again."),
    ):
        opened.get_by_role("radio", name=kind).check()
        opened.get_by_role("button", name="Start the job").click()
        opened.get_by_text(words).wait_for()
        opened.get_by_role("radio", name="Grow one region").check()
        opened.get_by_text(words).wait_for(state="detached")
    assert jobs(client) == []
    opened.get_by_role("radio", name="Certify a polytope").check()
    opened.locator("#new-file").set_input_files({"name": "bad.json", "mimeType": "application/json", "buffer": b"[]"})
    opened.get_by_text("bad.json cannot be used. It must be an object with C and d.").wait_for()


@pytest.mark.parametrize(
    ("ends", "text", "query"),
    [
        ({"reason": "the deadline was reached", "deadline_at": 90.0}, "Allow twice the time", "minutes=3"),
        ({"error": {"code": "seed_in_collision", "message": "they overlap", "field": "seed.q", "hint": ""}}, "Move the configuration", ""),
        ({"kind": "certify", "outcome": "inconclusive", "options": {"cells": 1, "seed": {}}}, "Cut it into cells", "cells=200"),
    ],
)
def test_a_failure_offers_its_remedy(client: TestClient, planar: Scene, ends: dict[str, Any], text: str, query: str) -> None:
    body = {"kind": "grow", "scene": "planar", "seed": {"q": [0.1, -0.2]}}
    job = Job.model_validate(client.post("/v1/jobs", json=body).json())
    if "deadline_at" in ends:
        ends = {**ends, "deadline_at": job.created_at + timedelta(seconds=ends["deadline_at"])}
    assert remedies(job) == [], "it has not ended"
    ended = job.model_copy(update={"ended": True, "state": JobState.FAILED, **ends})
    first, last = remedies(ended)
    assert first == (text, f"from={job.id}{'&' * bool(query)}{query}")
    assert last == ("Edit and run again", f"from={job.id}")


def test_the_robot_moves_to_a_free_configuration_near_by(opened: Any) -> None:
    set_joint(opened, "arm/joint1", 22)
    set_joint(opened, "arm/joint2", 15)
    opened.get_by_role("button", name="Free one near by").click()
    opened.get_by_text("No collision (computed").wait_for()


def test_what_the_service_refuses_is_said_and_nothing_is_lost(opened: Any, client: TestClient, complaints: list[str]) -> None:
    opened.route(
        "**/v1/jobs",
        lambda route: route.fulfill(
            status=429, content_type="application/problem+json", body='{"detail": "too many", "hint": "wait", "field": "scene"}'
        ),
    )
    opened.get_by_role("button", name="Start the job").click()
    opened.get_by_text("too many (wait)").wait_for()
    assert opened.get_by_role("button", name="Start the job").is_enabled()
    assert jobs(client) == []
    assert complaints.pop().startswith(f"{REFUSED}429")


def test_a_scene_is_uploaded_as_the_zip_of_its_directory(page: Any, url: str, client: TestClient, complaints: list[str]) -> None:
    page.goto(f"{url}/new")
    page.get_by_text("none yet").wait_for(state="attached")
    page.get_by_label("or upload one").set_input_files({"name": "bad.zip", "mimeType": "application/zip", "buffer": b"no zip"})
    page.get_by_text("bad.zip is no scene that can be used: this is no zip of a scene").wait_for()
    assert complaints.pop().startswith(f"{REFUSED}422")
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for file in EXAMPLE.iterdir():
            archive.write(file, f"planar_2dof/{file.name}")
    page.get_by_label("or upload one").set_input_files({"name": "planar.zip", "mimeType": "application/zip", "buffer": data.getvalue()})
    page.get_by_text("planar-2dof is stored, with 2 joints and 6 pairs").wait_for()
    page.locator(".slider").first.wait_for()
    assert [scene["name"] for scene in client.get("/v1/scenes").json()["scenes"]] == ["planar-2dof"]


def test_a_scene_that_is_not_there_is_said(page: Any, url: str, planar: Scene, complaints: list[str]) -> None:
    page.goto(f"{url}/new?scene=nothing")
    page.get_by_text("there is no scene").wait_for()
    assert complaints.pop().startswith(f"{REFUSED}404")
    page.get_by_label("Scene", exact=True).select_option(label=f"planar · 2 joints, {len(planar.pairs)} pairs · {planar.hash[:8]}")
    page.locator(".slider").first.wait_for()


@dataclass(frozen=True)
class Inner:
    depth: int | None = option(None, "How deep.", least=1, greatest=9)


@dataclass(frozen=True)
class Outer:
    how_often: int = option(3, "How often.", least=0, greatest=2**63 - 1)
    width: float | None = option(None, "How wide, as in `width`.", above=0, unit="m")
    fast: bool = option(False, "Whether it is fast.")
    careful: bool = option(True, "Whether it is careful.")
    colour: Literal["red", "green"] | None = option(None, "Which colour.", otherwise="`red`")
    inner: Inner | None = option(None, "Another way.")
    centre: tuple[float, ...] = option((), "Where.")


def test_an_option_of_each_kind_gets_into_the_request(page: Any, url: str, planar: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Grow, "forms", {"seed": ("Seed", Inner), "options": ("Ways", Outer)})
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_text("No collision (computed").wait_for()
    page.locator("figure.robot canvas").wait_for()  # it has a summary too, which comes late
    for summary in page.locator("summary").all():
        summary.click()
    ways = page.get_by_role("group", name="Ways")

    def asked() -> dict[str, Any]:
        return json.loads(copied(page, "curl").rpartition("-d '")[2].removesuffix("'"))

    assert asked() == {"kind": "grow", "scene": planar.hash[:16], "seed": {"q": [0.1, -0.2]}}, "defaults are not sent"
    assert ways.get_by_label("Centre").count() == ways.get_by_label("Depth").count() == 0
    assert ways.get_by_label("How often").get_attribute("max") == str(2**53 - 1)
    ways.get_by_label("How often").fill("5")
    ways.get_by_label("Width").fill("0.25")
    ways.get_by_label("Fast").check()
    ways.get_by_label("Careful").uncheck()
    ways.get_by_label("Colour").select_option("green")
    ways.get_by_label("Inner").check()
    assert asked()["options"]["inner"] == {}
    ways.get_by_label("Depth").fill("2")
    assert ways.get_by_label("Width").get_attribute("aria-describedby") == "option-options.width-says"
    assert page.locator("[id='option-options.width-says']").inner_text() == "In m. How wide, as in width."
    wished = {"how_often": 5, "width": 0.25, "fast": True, "careful": False, "colour": "green", "inner": {"depth": 2}}
    assert asked()["options"] == wished
    ways.get_by_label("Careful").check()
    ways.get_by_label("Inner").uncheck()
    ways.get_by_label("Width").fill("")
    assert asked()["options"] == {"how_often": 5, "fast": True, "colour": "green"}


def test_what_is_wrong_with_an_option_is_said_at_its_field(opened: Any, client: TestClient, complaints: list[str]) -> None:
    more = opened.locator("details", has_text="More options")
    more.locator("summary").click()
    cells, tolerance = opened.get_by_label("Cells"), opened.get_by_role("group", name="Starting region").get_by_label("Tolerance")
    cells.fill("0")
    more.locator("summary").click()
    opened.get_by_role("button", name="Start the job").click()
    assert cells.is_visible(), "the browser refuses it, and the field is shown"
    cells.fill("")
    tolerance.fill("0")
    more.locator("summary").click()
    opened.get_by_role("button", name="Start the job").click()
    more.get_by_text("input should be greater than 0").wait_for()
    assert tolerance.evaluate("field => field === document.activeElement && field.ariaInvalid") == "true"
    assert complaints.pop().startswith(f"{REFUSED}422")
    assert jobs(client) == []


def test_the_form_has_one_name_for_the_starting_region_and_each_option_another_name(client: TestClient) -> None:
    """The glossary's word for the pages; commands and their documentation call it the proposal."""
    text = html.unescape(client.get("/new").text)
    assert not re.search("proposal|first polytope", text)
    parts = json.loads(text.partition('data-island="new" data-props=\'')[2].partition("'>")[0])["parts"]
    for kind in parts.values():
        for part in kind:
            labels = [option["label"] for option in part["options"]]
            assert len(set(labels)) == len(labels)
            assert not {"Margin", "Epsilon", "Delta"} & set(labels)


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_nothing_keeps_people_out(browser: Any, url: str, planar: Scene, barriers: Any, scheme: str) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme=scheme)
    page = context.new_page()
    page.goto(f"{url}/new?scene=planar")
    page.get_by_text("No collision (computed").wait_for()
    for choice in (*ALL, "Certify a region again"):
        page.get_by_role("radio", name=choice).check()
        if (add := page.get_by_role("button", name="Add this configuration")).count():
            add.click()
        for summary in page.locator("summary").all():
            if summary.evaluate("element => !element.parentElement.open"):
                summary.click()
        assert barriers(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    context.close()


@pytest.mark.parametrize(
    ("q", "button", "asks"), [("0,0", "Random free one", "contacts"), ("0.384,0.262", "Free one near by", "plan")], ids=["random", "near"]
)
def test_the_form_says_that_it_looks_for_a_free_configuration(page: Any, url: str, planar: Scene, q: str, button: str, asks: str) -> None:
    """The first search on a machine may take minutes, because programs are compiled for it."""
    page.goto(f"{url}/new?scene=planar&q={q}")
    page.get_by_text("Not free" if "near" in button else "No collision (computed").wait_for()
    held: list[Any] = []
    page.route(f"**/v1/planning/{asks}", lambda route: route.continue_() if held else held.append(route))
    page.get_by_role("button", name=button).click()
    page.get_by_role("status").filter(has_text="Looking for a free configuration").wait_for()
    assert page.get_by_role("button", name=button).is_disabled()
    while not held:
        page.wait_for_timeout(20)
    held[0].continue_()
    page.get_by_text("Looking for a free configuration").wait_for(state="detached")
    page.get_by_text("No collision (computed").wait_for()


def test_the_form_says_that_a_box_is_for_the_papers_algorithm(opened: Any, url: str, client: TestClient, complaints: list[str]) -> None:
    opened.locator("summary", has_text="More options").click()
    method, start = opened.get_by_label("Method"), opened.get_by_role("button", name="Start the job")
    method.select_option("box")
    opened.get_by_label("Half width").fill("0.1")
    start.click()
    opened.get_by_text("only the papers' algorithm begins with the method box").wait_for()
    assert method.get_attribute("aria-invalid") == "true"
    assert complaints.pop().startswith(f"{REFUSED}422")
    opened.get_by_label("The papers' algorithm").check()
    start.click()
    opened.wait_for_url(f"{url}/jobs/*")
    assert jobs(client)[0]["options"]["paper"]["contraction"] == "targeted"
