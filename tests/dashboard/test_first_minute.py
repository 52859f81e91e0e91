"""A newcomer's first minute: what an empty service says and offers, and which files it takes as they are."""

from __future__ import annotations

import io
import shutil
import zipfile
from pathlib import Path
from typing import Any

import pytest
import yaml
from fastapi.testclient import TestClient

from certifier.model import Scene
from certifier.scene.bundle import pack_bundle
from tests.dashboard.samples import NAMES, ROOT, SAMPLES, files
from tests.dashboard.test_truth import EFFECTS

ARM = ROOT / "examples" / "arm_3dof" / "arm.urdf"


@pytest.mark.parametrize("name", NAMES)
def test_the_samples_are_the_examples(name: str) -> None:
    packed = (SAMPLES / f"{name}.zip").read_bytes()
    assert files(packed) == files(pack_bundle(ROOT / "examples" / name / "scene.yaml")), "run: python -m tests.dashboard.samples"


@pytest.mark.parametrize("path", ["/", "/scenes", "/new"])
def test_an_empty_service_says_what_it_is_for_and_has_a_scene_by_one_click(
    page: Any, url: str, client: TestClient, barriers: Any, path: str
) -> None:
    page.goto(url + path)
    page.get_by_text("ciris proves that a robot does not collide").wait_for()
    assert barriers(page) == []
    offered = {
        Path(button.get_attribute("data-sample")).stem: button.get_attribute("data-q") for button in page.locator("[data-sample]").all()
    }
    seeds = {name: yaml.safe_load((ROOT / "examples" / name / "seed.yaml").read_text())["q"] for name in NAMES}
    assert offered == {name: ",".join(map(str, q)) for name, q in seeds.items()}
    page.get_by_role("button", name="Try two links in a plane").click()
    page.get_by_text("No collision (computed, not proved)").wait_for()
    assert [scene["name"] for scene in client.get("/v1/scenes").json()["scenes"]] == ["planar-2dof"]
    page.goto(url + path)
    page.get_by_role("heading", level=1).wait_for()
    assert page.get_by_text("ciris proves that a robot does not collide").count() == 0


def test_a_sample_that_may_not_be_added_is_said(page: Any, url: str, complaints: list[str]) -> None:
    page.route(
        "**/v1/scenes", lambda route: route.fulfill(status=403, content_type="application/problem+json", body='{"detail": "no key"}')
    )
    page.goto(url)
    button = page.get_by_role("button", name="Try two links in a plane")
    button.click()
    page.get_by_role("alert").filter(has_text="no key").wait_for()
    assert button.is_enabled()
    complaints.clear()


def test_a_urdf_is_taken_as_it_is(page: Any, url: str, client: TestClient) -> None:
    page.goto(f"{url}/new")
    page.get_by_label("or upload one").set_input_files(ARM)
    page.get_by_text("arm is stored, with 3 joints").wait_for()
    page.locator(".slider").nth(2).wait_for()
    assert page.get_by_text("What this is for").count() == 0, "the robot is there to be looked at"
    (scene,) = client.get("/v1/scenes").json()["scenes"]
    assert (scene["name"], scene["joints"]) == ("arm", 3)


def test_a_folder_is_taken_as_it_is(page: Any, url: str, client: TestClient) -> None:
    page.goto(f"{url}/new")
    page.get_by_label("or its folder").set_input_files(ROOT / "examples" / "planar_2dof")
    page.get_by_text("planar-2dof is stored, with 2 joints and 6 pairs").wait_for()


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize(
    ("seed", "shown"),
    [
        ("q: [0.1, -0.2]\nabout: here\n", ["5.7", "-11.5"]),
        ("about: here\nq:\n- 0.1\n- -2e-1\n", ["5.7", "-11.5"]),
        ("q: home\n", ["0.0", "0.0"]),
        ("q: [0.1, 90]\n", ["5.7", "137.5"]),
    ],
    ids=["a list", "a list in lines", "a name", "beyond a limit"],
)
def test_the_robot_begins_at_the_seed_beside_the_scene_file(
    page: Any, url: str, tmp_path: Path, seed: str, shown: list[str], compression: int
) -> None:
    with zipfile.ZipFile(tmp_path / "cell.zip", "w", compression) as archive:
        for file in (ROOT / "examples" / "planar_2dof").iterdir():
            archive.writestr(f"cell/{file.name}", seed if file.name == "seed.yaml" else file.read_bytes())
    page.goto(f"{url}/new")
    page.get_by_label("or upload one").set_input_files(tmp_path / "cell.zip")
    page.get_by_text("planar-2dof is stored").wait_for()
    page.locator(".slider").nth(1).wait_for()
    assert [field.input_value() for field in page.locator(".slider input[type=number]").all()] == shown
    assert page.get_by_text("stands at the seed").count() == ("home" not in seed)
    assert page.get_by_text("The seed file does not name a configuration within the limits").count() == ("90" in seed)


def drop(page: Any, place: Any, path: Path, steps: tuple[str, ...] = ("dragEnter", "dragOver", "drop")) -> None:
    """Drops a file or a folder on the page, as the file manager of a desktop does."""
    box = place.bounding_box()
    drag(page, box["x"] + 5, box["y"] + 5, path, steps)


def drag(page: Any, x: float, y: float, path: Path, steps: tuple[str, ...]) -> None:
    dragged = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
    tools = page.context.new_cdp_session(page)
    page.evaluate(EFFECTS)
    for step in steps:
        tools.send("Input.dispatchDragEvent", {"type": step, "x": x, "y": y, "data": dragged})


@pytest.mark.parametrize("place", ["main h1", ".choose"])
def test_a_folder_that_is_dropped_anywhere_is_taken_with_all_below_it(page: Any, url: str, tmp_path: Path, place: str) -> None:
    given = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "arm_3dof", given / "models")
    shutil.move(given / "models" / "scene.yaml", given / "scene.yaml")
    text = (given / "scene.yaml").read_text()
    (given / "scene.yaml").write_text(text.replace("file: ", "file: models/"))
    page.goto(f"{url}/new")
    page.get_by_label("or upload one").wait_for()
    drop(page, page.locator(place).first, given)
    page.get_by_text("is stored, with 3 joints").wait_for()


def test_a_urdf_that_is_dropped_is_taken_as_it_is(page: Any, url: str) -> None:
    page.goto(f"{url}/new")
    page.get_by_label("or upload one").wait_for()
    drop(page, page.locator(".choose"), ARM)
    page.get_by_text("arm is stored, with 3 joints").wait_for()


def test_the_page_marks_what_takes_a_file_that_is_dragged(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/new")
    page.get_by_text("Certify a motion").click()
    marked, motion, carried = page.locator(".choose.over"), page.get_by_label("Motion", exact=True), ("dragEnter", "dragOver")
    drop(page, page.locator(".choose"), ARM, carried)
    marked.wait_for()
    motion.scroll_into_view_if_needed()
    drop(page, motion, ARM, carried)
    marked.wait_for(state="detached")
    page.locator("main h1").scroll_into_view_if_needed()
    drop(page, page.locator(".choose"), ARM, carried)
    marked.wait_for()
    drop(page, page.locator(".choose"), ARM)
    marked.wait_for(state="detached")


def test_a_file_that_is_dragged_out_of_the_page_leaves_no_mark(page: Any, url: str) -> None:
    page.goto(f"{url}/new")
    page.get_by_label("or upload one").wait_for()
    for _ in range(2):
        drop(page, page.locator(".choose"), ARM, ("dragEnter", "dragOver"))
        page.locator(".choose.over").wait_for()
        drag(page, -5, -5, ARM, ("dragOver",))
        page.locator(".choose:not(.over)").wait_for()


def zipped(directory: Path) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for file in sorted(directory.rglob("*")):
            archive.write(file, file.relative_to(directory))
    return data.getvalue()


def test_two_robots_without_a_scene_are_refused(client: TestClient, tmp_path: Path) -> None:
    for name in ("one", "two"):
        shutil.copy(ARM, tmp_path / f"{name}.urdf")
    answer = client.post("/v1/scenes", files={"bundle": ("two.zip", zipped(tmp_path), "application/zip")})
    assert (answer.status_code, answer.json()["code"]) == (422, "bundle_choice")
    assert answer.json()["detail"].endswith("2 files that may be the scene file or the robot's model: one.urdf, two.urdf")


def test_a_zip_with_nothing_but_macros_says_how_to_name_the_model(client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "arm_macro.xacro").write_text("<robot/>")
    answer = client.post("/v1/scenes", files={"bundle": ("arm.zip", zipped(tmp_path), "application/zip")}).json()
    assert answer["detail"] == "the zip has no scene file, and no model of a robot but macros in xacro"
    assert ".urdf.xacro" in answer["hint"]


def test_a_zip_without_a_package_that_its_robot_names_says_what_to_put_there(client: TestClient, tmp_path: Path) -> None:
    """The service looks into no variable of its own, tells no path of its own, and offers no option of the command."""
    mesh = '<collision><geometry><mesh filename="package://tools/hand/grip.obj"/></geometry></collision>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="base">{mesh}</link></robot>')
    answer = client.post("/v1/scenes", files={"bundle": ("arm.zip", zipped(tmp_path), "application/zip")}).json()
    assert answer["code"] == "scene_package"
    assert answer["detail"] == "arm.urdf takes a file from the package tools, and the zip has no hand/grip.obj"
    hint = "make the zip of the folder that has the model and these files, or put the package into it, as a folder tools"
    assert answer["hint"] == hint


def test_a_model_that_leads_out_of_its_zip_is_refused_before_drake_sees_it(client: TestClient, tmp_path: Path) -> None:
    mesh = '<collision><geometry><mesh filename="../../secret.obj"/></geometry></collision>'
    (tmp_path / "bad.urdf").write_text(f'<robot name="bad"><link name="base">{mesh}</link></robot>')
    answer = client.post("/v1/scenes", files={"bundle": ("bad.zip", zipped(tmp_path), "application/zip")})
    assert (answer.status_code, answer.json()["code"]) == (422, "bundle_uri")
