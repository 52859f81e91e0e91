"""The page of a scene in a real browser: its robot, its regions and how they are connected, coverage, plans."""

from __future__ import annotations

import base64
import itertools
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from pydrake.math import RigidTransform, RollPitchYaw

from certifier.jobs.region import Region
from certifier.model import Scene
from certifier.verify.decimals import at_least_mm
from db import scenes
from db.session import Database
from planner.poses.frame import frame_of, pose_at, pose_of
from tests.api.conftest import certified_polytope, store_region
from tests.api.test_planning import store_map
from tests.certifier.scenes import cube, planar_arm
from tests.dashboard.test_truth import until

BOXES = [((-0.2, -0.1), 0.1), ((-0.05, -0.1), 0.1), ((-0.5, -0.5), 0.05)]
"""Centres and half widths in s of three regions: the first two overlap, the third is apart."""


@cache
def certified_boxes() -> list[Region]:
    scene = planar_arm(limit=1.2)
    return [certified_polytope(scene, cube(scene, center, half), np.array(center)) for center, half in BOXES]


@pytest.fixture
def regions(database: Database, planar: Scene) -> list[str]:
    return [store_region(database, region) for region in certified_boxes()]


@pytest.fixture
def opened(page: Any, url: str, regions: list[str]) -> Any:
    page.goto(f"{url}/scenes/planar")
    page.get_by_text("2 components").wait_for()
    return page


def degrees(center: tuple[float, ...]) -> str:
    return ", ".join(f"{2 * np.rad2deg(np.arctan(s)):.1f}" for s in center)


def plan(page: Any, start: str, goal: str, only: bool = False) -> None:
    page.get_by_label("From").fill(start)
    page.get_by_label("To", exact=True).fill(goal)
    page.get_by_label("Only in certified regions").set_checked(only)
    page.get_by_role("button", name="Plan a motion").press("Enter")


def test_the_graph_shows_what_overlaps_and_leads_into_a_region(opened: Any, regions: list[str]) -> None:
    assert opened.locator(".graph .place").count() == 3
    assert opened.locator(".graph .edge").count() == 1
    node = opened.get_by_role("button", name=f"region {regions[2][:8]}")
    node.focus()
    node.press("Enter")
    opened.locator(".said", has_text=f"In a certified region: {regions[2][:8]}").wait_for()
    assert opened.locator(".graph .halo").count() == 1
    opened.get_by_text("Overlaps as a table").click()
    opened.get_by_role("button", name="go to the overlap").click()
    opened.get_by_text("In 2 certified regions").wait_for()


def test_the_claim_of_a_scene_says_which_region_its_distance_is_of(opened: Any, client: TestClient, regions: list[str]) -> None:
    newest = client.get("/v1/regions").json()["regions"][0]["id"]
    least = min(pair["margin"] for pair in client.get(f"/v1/regions/{newest}").json()["manifest"]["pairs"])
    words = opened.locator(".claim dl").inner_text()
    assert f"Smallest proved distance of the newest region\nat least {at_least_mm(least)}" in words
    assert "in each of the 3 certified regions of this scene" in opened.locator(".claim").text_content()


def test_coverage_is_that_of_the_same_configurations(opened: Any, client: TestClient, planar: Scene) -> None:
    opened.get_by_text("of the free configurations").wait_for()
    text = opened.locator("section[aria-labelledby=h-graph] p").first.text_content()
    value, error = (float(number) for number in text.split("They cover ")[1].split(" %")[0].split(" ± "))
    q = np.random.default_rng(0).uniform(-1.2, 1.2, (4000, 2))
    free = np.array([not c["pairs"] for part in np.split(q, 40) for c in contacts(client, part)])
    inside = [point["inside"] for point in client.post("/v1/planning/contains", json={"scene": "planar", "q": q.tolist()}).json()["points"]]
    assert abs(100 * np.mean(np.array(inside)[free]) - value) < 4 * max(error, 1)


def contacts(client: TestClient, q: Any) -> Any:
    return client.post("/v1/planning/contacts", json={"scene": "planar", "q": q.tolist()}).json()["contacts"]


def test_what_touches_is_said_as_the_robot_moves(opened: Any) -> None:
    opened.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").fill("30")
    opened.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").fill("15")
    opened.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").press("Enter")
    opened.get_by_text("Not free: arm/link2/bar and world/obstacle touch").wait_for()


def test_a_plan_is_played_to_its_end_with_the_region_of_each_moment(opened: Any, regions: list[str], tmp_path: Path) -> None:
    plan(opened, degrees((-0.28, -0.1)), degrees((0.03, -0.1)))
    opened.locator(".moment", has_text="in region").wait_for()
    assert regions[0][:8] in opened.locator(".moment").text_content()
    assert opened.locator(".edge.planned").count() == 1
    with opened.expect_download() as download:
        opened.get_by_role("link", name="Download").click()
    saved = json.loads(Path(download.value.path()).read_text())
    assert saved["found"]
    assert saved["guarantee"] == "exact"
    opened.get_by_label("speed").select_option("2")
    opened.get_by_role("button", name="Play", exact=True).click()
    opened.get_by_role("button", name="Play", exact=True).wait_for(timeout=20000)
    assert regions[1][:8] in opened.locator(".moment").text_content()
    assert opened.locator(".player output").text_content() == f"{saved['t'][-1]:.2f} s"
    assert shown(opened) == pytest.approx(np.rad2deg(saved["q"][-1]), abs=0.06)
    assert "on all of the planned motion, no collision of the scene's pairs" in opened.locator(".claim").text_content()


def test_the_robot_and_its_player_stay_in_view_while_the_page_scrolls(opened: Any) -> None:
    plan(opened, degrees((-0.28, -0.1)), degrees((0.03, -0.1)))
    play = opened.get_by_role("button", name="Play", exact=True)
    play.wait_for()
    canvas = opened.locator(".robot canvas").bounding_box()
    claim = opened.locator(".claim").bounding_box()
    assert claim["y"] + claim["height"] <= canvas["y"] < canvas["y"] + canvas["height"] <= play.bounding_box()["y"] < 720


def test_on_a_phone_the_buttons_of_the_view_are_over_the_robot(opened: Any) -> None:
    opened.set_viewport_size({"width": 390, "height": 844})
    button = opened.get_by_role("button", name="View: front")
    button.wait_for()  # before, another element keeps the robot's place
    robot, front = opened.locator(".robot").bounding_box(), button.bounding_box()
    assert robot["y"] <= front["y"] <= robot["y"] + robot["height"]


def cut_off(page: Any, canvas: Any) -> int:
    """How many pixels at the edge of a drawing have the colours of links."""
    found: int = page.evaluate(
        """async (data) => {
            const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + data)).blob());
            const pen = new OffscreenCanvas(image.width, image.height).getContext('2d');
            pen.drawImage(image, 0, 0);
            const { width, height } = image;
            let count = 0;
            const [right, down] = [width - 4, height - 4];
            for (const [x, y, w, h] of [[3, 3, right - 3, 1], [3, down, right - 3, 1], [3, 3, 1, down - 3], [right, 3, 1, down - 3]]) {
                const bytes = pen.getImageData(x, y, w, h).data;
                for (let i = 0; i < bytes.length; i += 4) {
                    const colours = bytes.slice(i, i + 3);
                    count += Math.max(...colours) - Math.min(...colours) > 60;
                }
            }
            return count;
        }""",
        base64.b64encode(canvas.screenshot()).decode(),
    )
    return found


def changed(canvas: Any, before: bytes) -> bytes:
    """A canvas that does not look as before, and does not change any more."""
    pictures = [before]

    def still() -> bool:
        pictures.append(canvas.screenshot())
        return pictures[-1] == pictures[-2] != before

    until(still)
    return pictures[-1]


def test_the_robot_is_in_view_wherever_it_stands_until_somebody_turns_the_view(browser: Any, url: str, planar: Scene) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, bypass_csp=True)  # the test reads a picture of its own
    page = context.new_page()
    page.goto(f"{url}/scenes/{planar.name}?q=-1.7,-0.6")
    canvas, slider = page.locator(".robot canvas"), page.locator(".slider input[type=number]").first
    slider.wait_for()
    for degrees in ("97", "-97"):
        before = canvas.screenshot()
        slider.fill(degrees)
        slider.press("Tab")
        changed(canvas, before)
        assert cut_off(page, canvas) == 0, degrees
    tools = page.locator(".view-tools").bounding_box()
    assert tools["y"] + tools["height"] <= canvas.bounding_box()["y"], "nor is it behind the buttons"
    page.goto(f"{url}/scenes/{planar.name}?q=0,0")
    slider.wait_for()
    canvas.press("+")
    before = canvas.screenshot()
    slider.fill("-97")
    slider.press("Tab")
    changed(canvas, before)
    assert cut_off(page, canvas) > 0, "the view stays where somebody has brought it"
    context.close()


def test_the_slice_says_that_it_does_not_draw_the_map(page: Any, url: str, planar_region: str, planar: Scene, database: Database) -> None:
    page.goto(f"{url}/scenes/planar")
    page.get_by_text("of this slice is in certified regions").wait_for()
    assert page.get_by_text("What the map proves is not drawn here.").count() == 0
    store_map(database, planar, planar_region)
    page.reload()
    page.get_by_text("What the map proves is not drawn here.").wait_for()


def test_only_the_overlaps_that_the_motion_goes_through_are_marked(page: Any, url: str, regions: list[str]) -> None:
    """All three regions overlap each other. The motion goes from the first to the second and on to the third."""
    page.route("**/v1/planning/graph*", lambda route: route.fulfill(json=triangle(regions)))
    page.route("**/v1/planning/plan", lambda route: route.fulfill(json=through(regions)))
    page.goto(f"{url}/scenes/planar")
    page.get_by_text("1 component").wait_for()
    legend = page.locator("section[aria-labelledby=h-graph] p").nth(1)
    assert "planned" not in legend.text_content()
    plan(page, "0, 0", "-10, 0")
    page.locator(".moment", has_text="in region").wait_for()
    assert page.locator(".edge").count() == 3
    assert page.locator(".edge.planned").count() == 2
    assert "A blue edge: the planned motion goes through it." in legend.text_content()
    page.locator(".parts li.map", has_text="in proved cells of the map").wait_for()


def triangle(regions: list[str]) -> dict[str, Any]:
    nodes = [{"region": region, "component": 0} for region in regions]
    edges = [{"a": a, "b": b, "depth": 0.1, "q": [0.0, 0.0]} for a, b in itertools.combinations(regions, 2)]
    return {"scene": "", "version": 0, "complete": True, "components": 1, "nodes": nodes, "edges": edges, "gaps": []}


def through(regions: list[str]) -> dict[str, Any]:
    """A motion through three regions, and through the cells of a map."""
    proved = [{"region": region, "map": None} for region in regions] + [{"region": None, "map": "a map"}]
    pieces = [{"begin": i, "end": i + 1, "motion": None, "guarantee": "exact", **one} for i, one in enumerate(proved)]
    motion = {"found": True, "q": [[0, 0], [-0.1, 0]], "t": [0, 4], "pieces": pieces, "length": 0.1, "duration": 4.0, "guarantee": "exact"}
    return NO_MOTION | {"reason": None} | motion


@pytest.mark.parametrize(
    ("start", "goal", "words"),
    [
        (
            (-0.2, -0.1),
            (-0.5, -0.5),
            "No region that is connected with the start overlaps one that is connected with the goal (2 regions and 1).",
        ),
        ((0.5, 0.5), (-0.2, -0.1), "No region contains the start"),
        ((-0.2, -0.1), (0.5, 0.5), "No region contains the goal"),
    ],
)
def test_why_regions_have_no_motion_is_said(opened: Any, start: tuple[float, ...], goal: tuple[float, ...], words: str) -> None:
    plan(opened, degrees(start), degrees(goal), only=True)
    assert words in opened.locator(".planning .notice").text_content()


def move(page: Any, joint1: float, joint2: float) -> None:
    for name, value in (("arm/joint1", joint1), ("arm/joint2", joint2)):
        field = page.get_by_role("spinbutton", name=f"{name}, degrees, as a number")
        field.fill(str(value))
        field.press("Enter")


def test_a_motion_needs_no_region_and_is_listed_with_what_proves_it(page: Any, url: str, planar: Scene, client: TestClient) -> None:
    page.goto(f"{url}/scenes/planar")
    page.get_by_text("This scene has no region yet").wait_for()
    move(page, -20, 10)
    page.get_by_role("button", name="Set as start").press("Enter")
    move(page, -50, 40)
    page.get_by_role("button", name="Set as goal").press("Enter")
    page.get_by_role("button", name="Plan a motion").press("Enter")
    page.locator(".moment", has_text="in the tube of the proved motion").wait_for()
    asked = {"scene": "planar", "start": np.deg2rad([-20, 10]).tolist(), "goal": np.deg2rad([-50, 40]).tolist()}
    motion = client.post("/v1/planning/plan", json=asked).json()["motion"]
    assert page.locator(".parts li.motion").count() == 1
    assert motion[:8] in page.locator(".parts").text_content()
    assert page.locator(".chart .part.motion").count() == 1
    page.locator(".said", has_text=f"In the tube of the proved motion {motion[:8]}").wait_for()


def shown(page: Any) -> list[float]:
    """The configuration of the robot, in degrees."""
    return [float(field.input_value()) for field in page.locator(".library .sliders input[type=number]").all()]


def test_a_link_is_dragged_and_the_rest_of_the_view_turns(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/scenes/planar")
    canvas = page.locator(".robot canvas")
    page.locator(".said", has_text="No collision (computed").wait_for()
    until(lambda: canvas.evaluate("one => one.width") > 300)  # the view has its size, and listens
    box = canvas.bounding_box()
    middle, corner = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2), (box["x"] + 15, box["y"] + box["height"] - 15)
    drag(page, middle, 70)
    there = shown(page)
    assert np.abs(there).max() > 5, "the view begins with its middle on the arm"
    drag(page, corner, -70)
    assert shown(page) == there, "no link is there"


def test_bodies_are_hidden_faded_and_named_from_a_tree_and_the_view_stands_elsewhere(opened: Any, planar: Scene) -> None:
    canvas = opened.locator(".robot canvas")

    def looks() -> None:
        """Waits for a picture that differs from the last one."""
        seen.append(changed(canvas, seen[-1]))

    seen = [canvas.screenshot()]
    for view in ("front", "top"):
        opened.get_by_role("button", name=f"View: {view}").click()
        looks()
    opened.get_by_label("frames").check()
    looks()
    opened.locator(".view-tools summary").click()
    tree = opened.locator(".view-tools details")
    assert {name.strip() for name in tree.locator("label").all_text_contents()} == {*planar.bodies}
    nested = tree.locator("li", has=opened.get_by_label("arm/link1", exact=True)).locator("li").get_by_label("arm/link2", exact=True)
    assert nested.count() == 1, "the second link hangs on the first"
    tree.get_by_label("arm/link2", exact=True).focus()
    looks()
    fade = tree.get_by_role("button", name="Fade arm/link2")
    fade.click()
    looks()
    assert fade.get_attribute("aria-pressed") == "true"
    tree.get_by_label("arm/link2", exact=True).uncheck()
    looks()
    opened.get_by_text("bodies, 1 hidden").wait_for()
    before = shown(opened)
    opened.get_by_role("button", name="View: fit").click()
    looks()
    assert shown(opened) == before
    tree.get_by_label("arm/link2", exact=True).check()
    looks()


def drag(page: Any, at: tuple[float, float], down: float) -> None:
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(at[0], at[1] + down, steps=5)
    page.mouse.up()
    page.mouse.move(*at)
    page.wait_for_timeout(100)  # What moves after the button is up would move the robot by now.


def test_a_goal_in_collision_is_moved_to_a_free_configuration_near_by(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/scenes/planar")
    plan(page, "-20, 10", "22, 15")
    page.get_by_text("arm/link2/bar and world/obstacle touch at the goal").wait_for()
    page.get_by_role("button", name="Use the free configuration near by").press("Enter")
    page.locator(".said", has_text="No collision (computed").wait_for()
    assert page.get_by_label("To", exact=True).input_value() != "22, 15"
    page.get_by_role("button", name="Plan a motion").press("Enter")
    page.locator(".moment", has_text="in the tube of the proved motion").wait_for()


@pytest.mark.parametrize("straight", [False, True])
def test_a_goal_may_be_the_pose_of_a_frame(page: Any, url: str, planar: Scene, straight: bool) -> None:
    """The frame ends where it was when the goal was set, and the robot, of two joints, has one configuration for that."""
    plans: list[dict[str, Any]] = []
    page.on("request", lambda request: plans.append(request.post_data_json) if request.url.endswith("/plan") else None)
    page.goto(f"{url}/scenes/planar")
    move(page, -20, 10)
    page.get_by_role("button", name="Set as start").press("Enter")
    page.get_by_label("Goal").select_option("arm/link2")
    move(page, -17, 25)
    page.get_by_role("button", name="Set as goal").press("Enter")
    assert float(page.get_by_label("yaw, degrees").input_value()) == pytest.approx(8)
    if straight:
        page.get_by_label("On a straight line").check()
    page.get_by_role("button", name="Plan a motion").press("Enter")
    page.locator(".moment", has_text="in the tube of the proved motion").wait_for()
    (asked,) = plans
    assert asked["pose"]["position"] == pytest.approx([np.cos(np.deg2rad(17)), -np.sin(np.deg2rad(17)), 0.0])
    assert asked["pose"]["rpy"] == pytest.approx([0.0, 0.0, np.deg2rad(8)])
    assert ("line" in asked, "goal" in asked) == (straight, False)
    end = page.get_by_label("Time, seconds")
    end.focus()
    end.press("End")
    assert shown(page) == pytest.approx([-17, 25], abs=0.06)


def test_a_pose_out_of_reach_is_shown_how_near_the_robot_comes(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/scenes/planar")
    page.get_by_label("Goal").select_option("arm/link2")
    page.get_by_label("z, metres").fill("0.25")
    page.get_by_label("z, metres").press("Enter")
    page.get_by_text("No configuration was found at which the frame has this pose").wait_for()
    page.get_by_role("button", name="Show the nearest configuration").press("Enter")
    page.get_by_label("z, metres").fill("")
    page.get_by_role("button", name="Plan a motion").press("Enter")
    assert page.get_by_label("z, metres").evaluate("field => field.matches(':focus:invalid')"), "the browser says what is missing"


@pytest.mark.parametrize("angles", [(0.3, -0.7, 2.0), (0.4, np.pi / 2, 0.0)])
def test_roll_pitch_and_yaw_are_those_of_the_service(page: Any, url: str, database: Database, angles: tuple[float, ...]) -> None:
    wrist = wrist_at(*angles)
    with database.write() as session:
        scenes.add(session, wrist)
    page.goto(f"{url}/scenes/{wrist.name}")
    page.get_by_label("Goal").select_option("arm/link1")
    angles_shown = [np.deg2rad(float(page.get_by_label(f"{name}, degrees").input_value())) for name in ("roll", "pitch", "yaw")]
    frame = frame_of(wrist, "arm/link1")
    at, expected = pose_of(np.zeros(3), angles_shown).turn, pose_at(frame, np.zeros(wrist.n)).turn
    assert abs(at @ expected) == pytest.approx(1.0, abs=1e-12)


def wrist_at(roll: float, pitch: float, yaw: float) -> Scene:
    """The planar arm on a base that is turned."""
    arm = planar_arm(limit=1.2)
    first, *others = arm.joints
    turned = RigidTransform(RollPitchYaw(roll, pitch, yaw), np.zeros(3)).GetAsMatrix4()
    return replace(arm, name="wrist", joints=(replace(first, X_PF=turned), *others))


def test_a_joint_beyond_its_limit_is_named(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/scenes/planar")
    plan(page, "-20, 10", "80, 0")
    page.get_by_text("arm/joint1 of the goal is at 80.0°. This is above its upper limit, 68.8°.").wait_for()


NOWHERE = dict.fromkeys(("length", "duration", "guarantee", "motion", "tube", "proof", "limit", "collision", "reached", "line"))
NO_MOTION = {"scene": "", "version": 0, "regions": 0, "found": False, "complete": True, "q": [], "t": [], "pieces": []} | NOWHERE
LINE = {"part": 0.48, "joint": None, "a": None, "b": None}


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({"reason": "no_motion"}, "The search found no motion in time. There may be one."),
        ({"reason": "not_certified"}, "none that can be certified"),
        ({"reason": "not_proved"}, "no motion was found that is proved to lie in them"),
        ({"reason": "pose_unreachable", "reached": {"q": [0.1, 0.2], "metres": 0.12, "radians": 0.5}}, "is off by 120 mm and 28.6°"),
        (
            {"reason": "pose_in_collision", "collision": {"where": "pose", "a": "one", "b": "two", "depth": 0.1, "free": None}},
            "At one of them, one and two touch.No free configuration was found near by.",
        ),
        ({"reason": "line_limit", "line": LINE | {"joint": "arm/joint2"}}, "for 48 % of the line. There arm/joint2 is at its limit"),
        ({"reason": "line_singular", "line": LINE}, "There the arm cannot move the frame on"),
        ({"reason": "line_tolerance", "line": LINE}, "There the line asks for segments that are too short"),
        ({"reason": "line_collision", "line": LINE | {"a": "one", "b": "two"}}, "There one and two touch"),
        ({"reason": "no_motion", "complete": False}, "Not all regions have been compared with each other yet"),
    ],
)
def test_every_other_reason_is_said_in_words(page: Any, url: str, planar: Scene, answer: dict[str, Any], words: str) -> None:
    """The answers are made up here, because the service gives some of them only after a long search."""
    page.route("**/v1/planning/plan", lambda route: route.fulfill(json=NO_MOTION | answer))
    page.goto(f"{url}/scenes/planar")
    plan(page, "0, 0", "-10, 0")
    assert words in page.locator(".planning .notice").text_content()


def upload(page: Any, url: str, name: str, text: str) -> None:
    page.goto(f"{url}/scenes/planar")
    choose(page, name, text)


def choose(page: Any, name: str, text: str) -> None:
    page.get_by_label("File", exact=True).set_input_files({"name": name, "mimeType": "text/plain", "buffer": text.encode()})


FREE = [[-0.3, 0.1], [-0.6, 0.4], [-0.9, 0.2]]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("path.json", json.dumps({"q": FREE, "t": [10.0, 10.5, 11.5]})),
        ("path.csv", "t,q1,q2\r\n" + "".join(f"{t},{a},{b}\r\n" for t, (a, b) in zip((10.0, 10.5, 11.5), FREE, strict=True))),
    ],
)
def test_a_path_from_a_file_is_certified_and_played(page: Any, url: str, planar: Scene, client: TestClient, name: str, text: str) -> None:
    upload(page, url, name, text)
    page.get_by_text("Certified.").wait_for()
    verdict = client.post("/v1/planning/certify-path", json={"scene": "planar", "q": FREE, "clearance": True}).json()
    said = page.locator(".upload .notice").text_content()
    proved = float(said.split("at least ")[1].split(" mm")[0])
    assert proved <= 1000 * verdict["clearance"] <= 1.02 * proved
    claim = page.locator("#claim-motion").text_content()
    assert claim.startswith(f"Proved: on all of the motion, the bodies of each covered pair are at least {proved:g} mm apart; verified now")
    assert "as seconds, from 0 on" in page.locator(".upload").text_content()
    page.get_by_label("speed").select_option("2")
    page.get_by_role("button", name="Play", exact=True).press("Enter")
    page.locator(".player output", has_text="1.50 s").wait_for()
    assert shown(page) == pytest.approx(np.rad2deg(FREE[-1]), abs=0.06)
    page.get_by_role("button", name="Show where they are nearest").press("Enter")
    nearest = verdict["nearest"]
    assert f"with {nearest['a']} and {nearest['b']} painted" in page.locator(".robot canvas").get_attribute("aria-label")


def test_the_first_contact_of_a_path_is_shown(page: Any, url: str, planar: Scene, client: TestClient) -> None:
    q = [[-0.3, 0.1], [0.0, 0.1], [0.8, 0.1]]
    upload(page, url, "path.csv", "".join(f"{a}, {b}\n" for a, b in q))
    page.get_by_text("Not certified.").wait_for()
    stop = client.post("/v1/planning/certify-path", json={"scene": "planar", "q": q}).json()["stop"]
    said = page.locator(".upload .notice").text_content()
    assert f"{stop['a']} and {stop['b']} touch. Their first contact is between waypoints 1 and 2" in said
    assert shown(page) == pytest.approx(np.rad2deg(stop["q"]), abs=0.06)
    assert f"with {stop['a']} and {stop['b']} painted" in page.locator(".robot canvas").get_attribute("aria-label")
    assert [part.get_attribute("class") for part in page.locator(".parts li").all()] == ["motion", "nothing"]
    claim = page.locator("#claim-motion").text_content()
    assert claim.startswith("Not proved from ")
    assert "; proved before, verified now" in claim
    proved = float(claim.split("Not proved from ")[1].split(" s ")[0])
    assert 0.3 < proved <= 0.3 + 0.8 * stop["time"] + 0.005, (
        "the motion moves by a radian a second, and is proved until the contact at most"
    )
    assert "1 radian or metre a second" in page.locator(".upload").text_content()
    time = page.get_by_label("Time, seconds")
    time.focus()
    time.press("End")
    page.locator(".moment", has_text="where nothing is proved").wait_for()
    assert "painted" not in page.locator(".robot canvas").get_attribute("aria-label")


def test_a_path_that_begins_in_contact_is_nowhere_proved(page: Any, url: str, planar: Scene) -> None:
    upload(page, url, "path.csv", "0.5236, 0.2618\n-0.3, 0.1\n")
    page.get_by_text("Not certified.").wait_for()
    page.locator("#claim-motion", has_text="Not proved from 0.00 s of the motion on.").wait_for()
    assert [part.get_attribute("class") for part in page.locator(".parts li").all()] == ["nothing"]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("path.npz", "", "neither .json nor .csv"),
        ("path.json", "{", "It is no JSON"),
        ("path.json", "[1]", "Its q must be a list of waypoints"),
        ("path.json", '{"q": [[0, "1"]]}', "Its q must be a list of waypoints"),
        ("path.json", '{"s": [[0, 0], [1, 1]]}', "This page takes waypoints q"),
        ("path.json", '{"q": [[0, 0], [1, 1]], "t": [1, 1]}', "ascending numbers, one for each waypoint"),
        ("path.json", '{"q": [[0, 0], [1, 1]], "t": [1]}', "ascending numbers, one for each waypoint"),
        ("path.csv", "", "It is empty"),
        ("path.csv", "s1,s2,t\n0,0,1\n", "Its columns are s"),
        ("path.csv", "joint2,joint1\n0,0\n0.1,0.2\n", "their names joint2, joint1 are not looked up"),
        ("path.csv", "shoulder,slide\n0,0\n0.1,0.2\n", "Columns are in the scene's order of joints"),
        ("path.csv", "0,0\n0,x\n", 'In waypoint 1, "x" is no number'),
        ("path.csv", "0,0\n0\n", "Waypoint 1 has 1 number, and the first row has 2"),
    ],
)
def test_a_file_without_a_path_is_refused(page: Any, url: str, planar: Scene, name: str, text: str, words: str) -> None:
    upload(page, url, name, text)
    page.locator(".upload .notice.bad", has_text=words).wait_for()


def test_a_path_that_the_service_refuses_is_said_why(page: Any, url: str, planar: Scene, complaints: list[str]) -> None:
    upload(page, url, "path.csv", "0,0,0\n1,1,1\n")
    page.locator(".upload .notice.bad", has_text="2").wait_for()
    assert ["422" in complaint for complaint in complaints] == [True]
    complaints.clear()


def test_numbers_that_make_no_sense_are_refused_where_they_are(opened: Any) -> None:
    plan(opened, "1, 2, 3", "0, 0")
    opened.get_by_text("Give 2 numbers for the start").wait_for()


def test_scenes_are_listed_with_their_regions(page: Any, url: str, regions: list[str]) -> None:
    page.goto(url)
    page.get_by_role("link", name="Scenes", exact=True).click()
    assert page.locator("tbody tr").first.locator("td").nth(4).text_content() == "3"
    page.get_by_role("link", name="planar", exact=True).click()
    page.get_by_text("Connected regions").wait_for()


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_nothing_keeps_people_out(browser: Any, url: str, regions: list[str], barriers: Any, scheme: str) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme=scheme)
    page = context.new_page()
    for path in ("/scenes", "/scenes/planar"):
        page.goto(url + path)
        if path != "/scenes":
            page.get_by_text("2 components").wait_for()
            plan(page, degrees((-0.28, -0.1)), degrees((0.03, -0.1)))
            page.locator(".moment", has_text="in region").wait_for()
            page.get_by_label("Goal").select_option("arm/link2")
            choose(page, "path.json", json.dumps({"q": FREE}))
            page.get_by_text("Certified.").wait_for()
            for summary in ("#not-covered summary", ".view-tools summary"):
                page.locator(summary).click()
        assert barriers(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    context.close()
