"""The form that starts a job, in a real browser: which scene, from which configuration, what shall be done."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene

REFUSED = "Failed to load resource: the server responded with a status of "
EXAMPLE = Path(__file__).parents[2] / "examples" / "planar_2dof"


@pytest.fixture
def opened(page: Any, url: str, planar: Scene) -> Any:
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_text("Free here").wait_for()
    return page


def jobs(client: TestClient) -> list[dict[str, Any]]:
    return client.get("/v1/jobs").json()["jobs"]


def set_joint(page: Any, joint: str, degrees: float) -> None:
    field = page.get_by_role("spinbutton", name=f"{joint}, degrees, as a number")
    field.fill(str(degrees))
    field.press("Enter")


def test_a_job_is_started_from_the_configuration_that_is_shown(opened: Any, url: str, client: TestClient) -> None:
    set_joint(opened, "arm/joint2", -20)
    opened.get_by_label("First polytope").select_option("iris_zo")
    opened.locator("summary", has_text="Effort").click()
    opened.get_by_label("Deadline").fill("2")
    opened.get_by_role("button", name="Start the job").press("Enter")
    opened.wait_for_url(f"{url}/jobs/*")
    (job,) = jobs(client)
    assert opened.url.endswith(job["id"])
    seed = job["options"]["seed"]
    assert seed["q"] == pytest.approx([0.1, np.deg2rad(-20)])
    assert seed["method"] == "iris_zo"
    assert job["deadline_at"] is not None


def test_what_touches_is_said_live_and_no_job_starts_there(opened: Any, client: TestClient) -> None:
    set_joint(opened, "arm/joint1", 30)
    set_joint(opened, "arm/joint2", 15)
    opened.get_by_text("In collision: arm/link2/bar and world/obstacle").wait_for()
    opened.get_by_role("button", name="Start the job").click()
    opened.get_by_text("no region can hold the configuration").wait_for()
    assert jobs(client) == []
    opened.get_by_role("button", name="Random free one").click()
    opened.get_by_text("Free here").wait_for()


def test_the_address_keeps_the_configuration(opened: Any) -> None:
    set_joint(opened, "arm/joint1", 10)
    opened.wait_for_function("location.search.includes('q=0.1745,-0.2')")
    opened.reload()
    opened.get_by_text("Free here").wait_for()
    assert opened.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").input_value() == "10.0"


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


def test_what_the_service_refuses_is_said_and_nothing_is_lost(opened: Any, client: TestClient, complaints: list[str]) -> None:
    opened.route(
        "**/v1/jobs",
        lambda route: route.fulfill(status=429, content_type="application/problem+json", body='{"detail": "too many", "hint": "wait"}'),
    )
    opened.get_by_role("button", name="Start the job").click()
    opened.get_by_text("too many. wait").wait_for()
    assert opened.get_by_role("button", name="Start the job").is_enabled()
    assert jobs(client) == []
    assert complaints.pop().startswith(f"{REFUSED}429")


def test_a_scene_is_uploaded_as_the_zip_of_its_directory(page: Any, url: str, client: TestClient, complaints: list[str]) -> None:
    page.goto(f"{url}/new")
    page.get_by_text("none yet").wait_for(state="attached")
    page.get_by_label("or upload one").set_input_files({"name": "bad.zip", "mimeType": "application/zip", "buffer": b"no zip"})
    page.get_by_text("bad.zip is no scene that can be used. this is no zip of a scene").wait_for()
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


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_keeps_people_out(browser: Any, url: str, planar: Scene, barriers: Any, scheme: str) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme=scheme)
    page = context.new_page()
    page.goto(f"{url}/new?scene=planar")
    page.get_by_text("Free here").wait_for()
    for choice in ("Grow one region", "Cover the scene"):
        page.get_by_text(choice).click()
        page.get_by_role("button", name="Add this configuration").click()
        for summary in page.locator("summary").all():
            if summary.evaluate("element => !element.parentElement.open"):
                summary.click()
        assert barriers(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    context.close()
