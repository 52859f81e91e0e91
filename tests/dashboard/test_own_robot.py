"""A robot of one's own: what people have of it on their disks is taken as it is, and what cannot be taken says what to do."""

from __future__ import annotations

import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import events, jobs, pairs, scenes, steps
from db.models import RegionRow
from db.session import Database
from db.states import IterationState
from tests.certifier.scene.test_xacro import confining
from tests.dashboard.job_scenes import SLIDE, add_iteration
from tests.scenes import slider

__all__ = ["confining"]

LIMITS = "joint_limits:\n  shoulder: {max_velocity: !degrees 90}\n"
TETRAHEDRON = "v 0 0 0\nv 0.05 0 0\nv 0 0.05 0\nv 0 0 0.05\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def urdf(name: str, mesh: str = "package://arm_description/meshes/link.obj") -> str:
    """A robot of two links, whose second one is a mesh that turns half a metre away from the first."""
    return f"""<robot name="{name}"><link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="middle"/><link name="tip"><collision><origin xyz="0.5 0 0"/><geometry><mesh filename="{mesh}"/></geometry></collision></link>
<joint name="pan" type="revolute"><parent link="base"/><child link="middle"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="lift" type="revolute"><parent link="middle"/><child link="tip"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


def packed(directory: Path, **files: str) -> Path:
    """A zip of files; in names, two underscores stand for a slash, and three for a dot."""
    path = directory / "mine.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name.replace("___", ".").replace("__", "/"), text)
    return path


def upload(page: Any, url: str, path: Path) -> None:
    page.goto(f"{url}/new")
    page.get_by_label("or upload one").set_input_files(path)


@pytest.mark.parametrize(
    ("mesh", "model", "link"),
    [
        ("package://arm_description/meshes/link.obj", "arm_description__urdf__arm___urdf", "arm_description__meshes__link___obj"),
        ("package://arm_description/meshes/link.obj", "urdf__arm___urdf", "meshes__link___obj"),
        ("package://robots/models/arm/meshes/link.obj", "arm__arm___urdf", "arm__meshes__link___obj"),
    ],
    ids=["whole", "without its folder", "a folder inside of it"],
)
def test_the_zip_of_a_package_is_taken_whatever_part_of_it_it_is(
    page: Any, url: str, client: TestClient, tmp_path: Path, mesh: str, model: str, link: str
) -> None:
    """A package has settings in YAML, other models with references to nowhere, and xacro. None of it is about the robot."""
    beside = {
        "config__joint_limits___yaml": LIMITS,
        "config__controllers___yaml": "a: &a 1\nb: *a\n",
        "worlds__sun___xml": '<uri file="/x"/>',
    }
    upload(page, url, packed(tmp_path, **{model: urdf("arm", mesh), link: TETRAHEDRON, **beside}))
    page.get_by_text("arm is stored, with 2 joints and 1 pair").wait_for()
    page.locator(".slider").nth(1).wait_for()
    (scene,) = client.get("/v1/scenes").json()["scenes"]
    assert (scene["name"], scene["joints"], scene["pairs"]) == ("arm", 2, 1)


def test_a_zip_with_several_robots_asks_for_one(
    page: Any, url: str, client: TestClient, tmp_path: Path, complaints: list[str], barriers: Any
) -> None:
    robots = {f"arm_description__urdf__{name}___urdf": urdf(name) for name in ("left", "right")}
    upload(page, url, packed(tmp_path, **robots, arm_description__meshes__link___obj=TETRAHEDRON))
    which = page.get_by_label("mine.zip has several robots or scenes. Which one?")
    which.wait_for()
    assert barriers(page) == []
    assert which.locator("option").all_text_contents()[1:] == [f"arm_description/urdf/{name}.urdf" for name in ("left", "right")]
    which.select_option("arm_description/urdf/right.urdf")
    page.get_by_text("right is stored, with 2 joints and 1 pair").wait_for()
    assert which.count() == 0
    assert [scene["name"] for scene in client.get("/v1/scenes").json()["scenes"]] == ["right"]
    complaints.clear()


def test_a_zip_with_several_scenes_asks_for_one(page: Any, url: str, tmp_path: Path, complaints: list[str]) -> None:
    """Both use the same model, which is no choice then, but the page cannot know."""
    add = "directives:\n- add_model: {name: arm, file: arm.urdf}\n- add_weld: {parent: world, child: arm::base}\n"
    scenes = {f"{name}___yaml": f"name: {name}\n{add}" for name in ("left", "right")}
    upload(page, url, packed(tmp_path, arm___urdf=urdf("arm", "link.obj"), link___obj=TETRAHEDRON, **scenes))
    page.get_by_label("mine.zip has several robots or scenes. Which one?").select_option("left.yaml")
    page.get_by_text("left is stored, with 2 joints and 1 pair").wait_for()
    complaints.clear()


def test_a_robot_without_its_meshes_says_which_file_is_missing(page: Any, url: str, tmp_path: Path, complaints: list[str]) -> None:
    (tmp_path / "arm.urdf").write_text(urdf("arm"))
    upload(page, url, tmp_path / "arm.urdf")
    takes = "arm.urdf takes a file from the package arm_description, such as meshes/link.obj."
    page.get_by_text(f"{takes} A single file brings none along: choose the folder that has the model and these files.").wait_for()
    assert page.get_by_text("the zip").count() == 0, "nobody has given one"
    complaints.clear()


def test_a_folder_with_several_robots_is_called_by_its_name(page: Any, url: str, tmp_path: Path, complaints: list[str]) -> None:
    folder = tmp_path / "two"
    folder.mkdir()
    (folder / "link.obj").write_text(TETRAHEDRON)
    for name in ("left", "right"):
        (folder / f"{name}.urdf").write_text(urdf(name, "link.obj"))
    page.goto(f"{url}/new")
    page.get_by_label("or its folder").set_input_files(folder)
    page.get_by_label("two has several robots or scenes. Which one?").select_option("two/left.urdf")
    page.get_by_text("left is stored, with 2 joints and 1 pair").wait_for()
    complaints.clear()


def test_what_to_know_of_a_robot_is_read_where_it_is_uploaded(
    page: Any, url: str, client: TestClient, tmp_path: Path, barriers: Any
) -> None:
    endless = urdf("arm", "link.obj").replace('type="revolute"', 'type="continuous"')
    upload(page, url, packed(tmp_path, arm___urdf=endless, link___obj=TETRAHEDRON))
    page.get_by_text("Read this before you trust a proof about it:").wait_for()
    assert page.locator(".choose li").all_text_contents() == client.get("/v1/scenes/arm/lint").json()["warnings"]
    assert barriers(page) == []


def test_a_robot_that_cannot_collide_is_said_to_leave_nothing_to_prove(
    page: Any, url: str, client: TestClient, tmp_path: Path, barriers: Any, complaints: list[str]
) -> None:
    """Its second link has geometry for looks alone. All proofs about it would be about nothing, so no job is started."""
    looks = (
        urdf("arm")
        .replace('<link name="tip"><collision>', '<link name="tip"><visual>')
        .replace("</collision></link>\n<joint", "</visual></link>\n<joint")
    )
    (tmp_path / "arm.urdf").write_text(
        looks.replace('<mesh filename="package://arm_description/meshes/link.obj"/>', '<sphere radius="0.1"/>')
    )
    upload(page, url, tmp_path / "arm.urdf")
    page.get_by_text("arm is stored, with 2 joints and 0 pairs").wait_for()
    page.get_by_text("No pair of bodies can collide in this scene, so there is nothing to prove").wait_for()
    assert barriers(page) == []
    page.get_by_role("button", name="Start the job").click()
    page.get_by_text("no pair of bodies can collide in this scene, so there is nothing to prove (give the robot's links").wait_for()
    assert "422" in complaints.pop()
    certified: dict[str, Any] = {"polytope": {"C": [[1.0, 0.0]], "d": [0.1]}}
    kinds: dict[str, dict[str, Any]] = {"grow": {"seed": {"q": [0.0, 0.0]}}, "cover": {}, "map": {}, "certify": certified}
    for kind, given in {**kinds, "certify-path": {"q": [[0.0, 0.0], [0.1, 0.0]]}}.items():
        refused = client.post("/v1/jobs", json={"kind": kind, "scene": "arm", **given})
        assert (refused.status_code, refused.json()["code"], refused.json()["field"]) == (422, "no_pairs", "scene"), kind
    assert client.get("/v1/jobs").json()["jobs"] == []


def test_what_versions_before_certified_of_a_scene_without_pairs_is_not_called_proved(
    client: TestClient, database: Database, region: str
) -> None:
    with database.write() as session:
        row = session.get_one(RegionRow, region)
        bare = scenes.add(session, replace(slider(), pairs=()))
        job, _ = jobs.create(session, kind="grow", scene_id=bare.id, options={"seed": {"q": [0.0]}})
        row.job_id, row.scene_id, row.manifest = job.id, bare.id, {**row.manifest, "pairs": []}
    claim = client.get(f"/regions/{region}").text.partition('<section class="claim nothing"')[2].partition("</section>")[0]
    assert "No pair of bodies can collide in this scene, so nothing is proved about it." in claim
    assert "Proved:" not in claim
    assert "Pairs covered" not in claim
    text = client.get(f"/jobs/{job.id}").text
    assert "No pair of bodies can collide in this scene: it has no two bodies that move against each other." in text
    assert "is covered" not in text


BALL = '<collision><origin xyz="0.53 0.02 0.03"/><geometry><sphere radius="0.1"/></geometry></collision>'
"""Where the tip is at q* = 0."""


def joints(page: Any) -> list[float]:
    """The joint positions that the form shows, in degrees."""
    return [float(field.input_value()) for field in page.get_by_role("spinbutton", name=re.compile("as a number")).all()]


def end(page: Any, label: str) -> list[float]:
    """The start or the goal of a motion to plan, in degrees."""
    return [float(text) for text in page.get_by_label(label, exact=True).input_value().split(",")]


def test_a_robot_that_collides_at_its_centre_begins_beside_it(
    page: Any, url: str, client: TestClient, tmp_path: Path, barriers: Any
) -> None:
    """A region that is grown where bodies almost touch is thin, so there is room around where the robot begins."""
    upload(
        page,
        url,
        packed(tmp_path, arm___urdf=urdf("arm", "link.obj").replace("</collision>", f"</collision>{BALL}", 1), link___obj=TETRAHEDRON),
    )
    page.get_by_text("The robot began at a free configuration near it.").wait_for()
    assert page.get_by_text("At q*, arm/base/").count() == 1
    page.get_by_text("No collision (computed, not proved)").wait_for()
    begun = np.deg2rad(joints(page))
    around = [(begun + 0.05 * np.array(way)).tolist() for way in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    contacts = client.post("/v1/planning/contacts", json={"scene": "arm", "q": [[0.0, 0.0], begun.tolist(), *around]}).json()["contacts"]
    assert [bool(one["pairs"]) for one in contacts] == [True, False, False, False, False, False]
    assert np.abs(begun).max() < 1.2, "it is near"
    assert barriers(page) == []
    # Whoever asks for q* gets it.
    page.get_by_role("button", name="Centre q*").click()
    page.get_by_text("Not free: arm/base/").wait_for()
    page.wait_for_timeout(1500)
    assert joints(page) == [0.0, 0.0]
    page.goto(f"{url}/new?scene=arm&q=0,0")
    page.get_by_text("Not free: arm/base/").wait_for()
    page.wait_for_timeout(1500)
    assert joints(page) == [0.0, 0.0]


def test_the_page_of_a_scene_begins_where_the_robot_is_free(page: Any, url: str, client: TestClient, tmp_path: Path, barriers: Any) -> None:
    path = packed(tmp_path, arm___urdf=urdf("arm", "link.obj").replace("</collision>", f"</collision>{BALL}", 1), link___obj=TETRAHEDRON)
    client.post("/v1/scenes", files={"bundle": ("arm.zip", path.read_bytes(), "application/zip")}).raise_for_status()
    page.goto(f"{url}/scenes/arm")
    page.get_by_text("The robot began at a free configuration near it.").wait_for()
    page.get_by_text("No collision (computed, not proved)").wait_for()
    assert barriers(page) == []
    # So does a motion.
    page.get_by_text("From and To began at a free configuration near it.").wait_for()
    assert end(page, "From") == end(page, "To") == joints(page) != [0.0, 0.0]
    page.get_by_role("button", name="Plan a motion").click()
    page.locator(".found").wait_for()
    graph = client.get("/v1/planning/graph?scene=arm").json() | {"nodes": [{"region": "0123456789", "component": 0}], "components": 1}
    page.route("**/v1/planning/graph*", lambda route: route.fulfill(json=graph))
    page.route(
        "**/v1/regions/0123456789/*", lambda route: route.fulfill(json={"center": [1.0, 0.5], "seed": None, "samples": [], "extremes": []})
    )
    page.goto(f"{url}/scenes/arm")
    page.get_by_text("The robot began at the centre of region 01234567.").wait_for()
    page.get_by_text("From and To began at the centre of region 01234567.").wait_for()
    for found in (joints(page), end(page, "From"), end(page, "To")):
        assert np.deg2rad(found) == pytest.approx([1.0, 0.5], abs=1e-3)
    # Whoever asks for q* gets it.
    page.goto(f"{url}/scenes/arm?q=0,0&from=0,0")
    page.get_by_text("Not free: arm/base/").wait_for()
    page.get_by_text(re.compile("At q.*, arm/base/.* To began at the centre of region 01234567.")).wait_for()
    assert np.deg2rad(end(page, "To")) == pytest.approx([1.0, 0.5], abs=1e-3)
    assert joints(page) == end(page, "From") == [0.0, 0.0]
    assert page.get_by_text("The robot began").count() == page.get_by_text("From and To began").count() == 0


def test_a_robot_that_is_moved_while_a_free_configuration_is_looked_for_stays_where_it_is(page: Any, url: str, tmp_path: Path) -> None:
    held: list[Any] = []
    page.route("**/v1/planning/plan", lambda route: held.append(route))
    upload(
        page,
        url,
        packed(tmp_path, arm___urdf=urdf("arm", "link.obj").replace("</collision>", f"</collision>{BALL}", 1), link___obj=TETRAHEDRON),
    )
    page.get_by_text("Looking for a free configuration").wait_for()
    field = page.get_by_role("spinbutton", name="pan, degrees, as a number")
    field.fill("3")
    field.press("Enter")
    page.get_by_text("Not free: arm/base/").wait_for()
    held[0].continue_()
    page.get_by_text("Looking for a free configuration").wait_for(state="detached")
    page.wait_for_timeout(500)
    assert joints(page) == [3.0, 0.0]
    assert page.get_by_text("The robot began").count() == 0


@pytest.mark.usefixtures("confining")
def test_a_robot_in_xacro_is_expanded(page: Any, url: str, tmp_path: Path) -> None:
    head = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm"><xacro:property name="size" value="0.1"/>'
    xacro = urdf("arm", "link.obj").replace('<robot name="arm">', head).replace('radius="0.1"', 'radius="${size}"')
    upload(page, url, packed(tmp_path, arm___urdf___xacro=xacro, link___obj=TETRAHEDRON))
    page.get_by_text("arm is stored, with 2 joints and 1 pair").wait_for()


def test_what_is_wrong_in_a_scene_file_says_where(page: Any, url: str, tmp_path: Path, complaints: list[str]) -> None:
    upload(page, url, packed(tmp_path, scene___yaml="paddings: 1\ndirectives: []\n"))
    page.get_by_text("mine.zip is no scene that can be used: paddings: is not a key of a scene file").wait_for()
    complaints.clear()


def test_the_page_of_a_scene_has_its_warnings_in_one_list(page: Any, url: str, client: TestClient, tmp_path: Path, barriers: Any) -> None:
    endless = urdf("arm").replace('type="revolute"', 'type="continuous"')
    path = packed(tmp_path, arm___urdf=endless, meshes__link___obj=TETRAHEDRON)
    client.post("/v1/scenes", files={"bundle": ("arm.zip", path.read_bytes(), "application/zip")}).raise_for_status()
    page.goto(f"{url}/scenes/arm")
    listed = page.get_by_role("region", name="Read this before you trust a proof about the scene").get_by_role("listitem")
    assert listed.count() == len(client.get("/v1/scenes/arm/lint").json()["warnings"]) >= 2
    assert barriers(page) == []


def test_a_small_region_is_not_said_to_be_nothing(page: Any, url: str, planar: Scene) -> None:
    """One of many samples of the slice is in a region, and all but one are free."""

    def answer(route: Any) -> None:
        found = route.fetch().json()
        free = "." * len(found["rows"][0])
        route.fulfill(json={**found, "rows": ["o" + free[1:], *[free] * (len(found["rows"]) - 2), "#" * len(free)]})

    page.route("**/v1/planning/slice", answer)
    page.goto(f"{url}/scenes/planar")
    page.get_by_text("less than 1 % of this slice is in certified regions").first.wait_for()


def test_a_proposal_tells_its_progress_beside_a_settled_iteration(
    page: Any, url: str, running: str, scene: Scene, database: Database, barriers: Any
) -> None:
    """A box around the seed is certified first, while the proposal is looked for."""
    iteration = {"index": 0, "label": "box", **SLIDE, "pairs": [], "reuse": {}, "hard": [], "failures": None}
    with database.write() as session:
        job = jobs.lock(session, running)
        add_iteration(session, job, **iteration)
        pairs.iterations(session, running)[-1].state = IterationState.CERTIFIED
        steps.add(session, job, "propose", {})
        assert steps.claim(session, job, accepts=False, lease_seconds=600) is not None
        events.emit(session, job, events.NOTE, {"text": "proposing, 40 s, 31 faces"})
    page.goto(f"{url}/jobs/{running}")
    page.get_by_role("heading", name="Iteration 0: a box around the seed certified").wait_for()
    page.get_by_text("Looking for a starting region around the seed (proposing, 40 s, 31 faces).").wait_for()
    assert barriers(page) == []
    with database.write() as session:
        pairs.iterations(session, running)[-1].state = IterationState.RUNNING
    page.reload()
    page.get_by_role("heading", name="Iteration 0: a box around the seed since").wait_for()
    page.locator("p.empty", has_text="Looking for a starting region around the seed").wait_for(state="detached")  # the log says it, too


def test_a_long_name_stays_in_its_place(page: Any, url: str, client: TestClient, tmp_path: Path) -> None:
    name = "a_robot_whose_name_somebody_made_long_with_box_collision"
    path = packed(tmp_path, **{f"{name}___urdf": urdf("arm", "link.obj"), "link___obj": TETRAHEDRON})
    client.post("/v1/scenes", files={"bundle": ("arm.zip", path.read_bytes(), "application/zip")}).raise_for_status()
    page.goto(f"{url}/scenes/{client.get('/v1/scenes').json()['scenes'][0]['id']}")
    fact = page.locator(".facts dd").first
    assert fact.text_content() == name
    assert fact.evaluate("(one) => one.scrollWidth - one.clientWidth") == 0
