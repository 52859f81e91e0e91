"""The page of a region in a real browser: sliders that stay inside, the ends of each joint, slices, cells, and the sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Scene
from certifier.pair.collisions import in_collision
from certifier.verify.decimals import at_least_mm
from db.session import Database
from tests.api.test_cells import grown, passing, stored
from tests.dashboard.test_truth import until

READY = "The robot is inside the region"
OBSERVE = """
window.inView = { traverse() {} };
window.__THREE_DEVTOOLS__ = new EventTarget();
__THREE_DEVTOOLS__.addEventListener("observe", ({ detail }) => { if (detail.isScene) window.inView = detail; });
"""
"""three.js tells whoever looks for faults of its scenes. Until it is loaded, there is nothing in view."""
DRAWN = """() => {
    const found = [];
    inView.traverse((one) => { if (one.geometry?.type === "PlaneGeometry") found.push([one.visible, one.matrixWorld.elements]); });
    return found;
}"""


CORNERS = np.array([[x, y, 0.0, 1.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)] + [[0.0, 0.0, 0.0, 1.0]])
"""The corners and the middle of the square that is drawn, in its own frame."""


def square(page: Any) -> tuple[bool, Array]:
    """The square of the one plane in view: whether it is seen, and its pose in the world, shape (4, 4)."""
    until(lambda: len(page.evaluate(DRAWN)) == 1)
    ((visible, elements),) = page.evaluate(DRAWN)
    return visible, np.array(elements).reshape(4, 4).T


@pytest.fixture
def faces(client: TestClient, planar_region: str) -> tuple[Array, Array]:
    manifest = client.get(f"/v1/regions/{planar_region}").json()["manifest"]
    return np.array(manifest["halfspace_normals"]), np.array(manifest["halfspace_offsets"])


@pytest.fixture
def opened(page: Any, url: str, planar_region: str) -> Any:
    page.goto(f"{url}/regions/{planar_region}")
    page.get_by_text(READY).wait_for()
    page.get_by_text("of this slice is in certified regions").first.wait_for()
    return page


def shown(page: Any) -> Array:
    """The joint positions that the fields show, in radians."""
    fields = page.locator(".explore input[type=number]")
    return np.deg2rad(fields.evaluate_all("fields => fields.map((field) => Number(field.value))"))  # at one moment


def test_sliders_stay_inside_the_region(opened: Any, planar: Scene, faces: tuple[Array, Array]) -> None:
    C, d = faces
    for joint in ("arm/joint1", "arm/joint2"):
        for key in ("End", "Home"):
            opened.get_by_role("slider", name=f"{joint}, degrees").press(key)
            q = shown(opened)
            slack = (d - C @ planar.to_s(q)).min()
            assert abs(slack) < 2e-3, "it goes to the face, as far as the field says it"
            opened.get_by_text(READY).wait_for()
    field = opened.get_by_role("spinbutton", name="arm/joint1, degrees, as a number")
    field.fill("60")
    field.press("Enter")
    assert (d - C @ planar.to_s(shown(opened))).min() > -2e-3


def test_a_number_outside_the_region_is_not_taken_without_a_word(opened: Any) -> None:
    field = opened.get_by_role("spinbutton", name="arm/joint1, degrees, as a number")
    held = opened.locator(".sliders").get_by_role("status")
    for typed in ("60", "999"):
        field.fill(typed)
        field.press("Enter")
        held.get_by_text(f"and not at {typed}.0°.").wait_for()
        assert f"so it is at {field.input_value()}°" in held.text_content()
        assert held.text_content().startswith("arm/joint1 may be between ")
    opened.get_by_role("slider", name="arm/joint1, degrees").press("Home")
    until(lambda: held.text_content() == "")
    end = field.input_value()
    field.fill("0")
    field.press("Enter")
    field.fill(end)
    field.press("Enter")
    until(lambda: field.input_value() == end)
    assert held.text_content() == "", "the end as it is shown"


def test_one_region_is_not_counted(client: TestClient, planar_region: str) -> None:
    assert "in the certified region of this scene" in client.get("/scenes/planar").text


def test_the_claim_stays_in_view_and_names_what_it_does_not_cover(opened: Any, client: TestClient, url: str, planar_region: str) -> None:
    """One box says what is proved, of how many pairs, not of which, how far they are apart, and when and by what it was verified."""
    region = client.get(f"/v1/regions/{planar_region}").json()
    claim, summary = opened.locator(".claim"), "1 pair of neighbouring links is not covered: arm/link1 \N{EN DASH} arm/link2"
    assert "in every configuration of this region, the bodies of each covered pair stay apart" in claim.text_content()
    assert claim.get_by_role("status").text_content() == "The robot is inside the region: no collision of the 2 covered pairs, as proved."
    facts = claim.locator("dd").all_text_contents()
    least = min(pair["margin"] for pair in region["manifest"]["pairs"])
    assert (facts[0], facts[1]) == ("2", f"at least {at_least_mm(least)}")
    assert facts[2].endswith("in exact arithmetic")
    opened.get_by_role("heading", name="Pairs").scroll_into_view_if_needed()
    opened.mouse.wheel(0, 4000)
    until(lambda: opened.evaluate("scrollY") > 300)
    assert claim.bounding_box()["y"] == pytest.approx(0, abs=1)
    for path in (f"regions/{planar_region}", f"scenes/{region['scene']}", f"jobs/{region['job']}"):
        opened.goto(f"{url}/{path}")
        folded = opened.locator("#not-covered")
        assert folded.locator("summary").text_content() == summary
        row = folded.get_by_role("row", name="arm/link1")
        assert not row.is_visible()
        folded.locator("summary").click()
        row.wait_for()
        assert row.inner_text().split("\t") == ["arm/link1 \N{EN DASH} arm/link2", "1", "neighbours"]


def test_what_is_proved_and_what_is_computed_have_two_looks(opened: Any) -> None:
    def look(selector: str) -> tuple[str, str]:
        script = "element => [getComputedStyle(element, '::before').content[1], getComputedStyle(element).textDecorationStyle]"
        return tuple(opened.locator(selector).first.evaluate(script))  # type: ignore[return-value]

    assert look(".claim .proved") == look("td .proved") == look(".key-map .proved") == ("\N{CHECK MARK}", "solid")
    assert look(".facts .computed") == look(".key-map .computed") == ("\N{ALMOST EQUAL TO}", "dashed")


def test_buttons_lead_to_the_ends_of_a_joint(opened: Any, client: TestClient, planar_region: str) -> None:
    ends = client.get(f"/v1/regions/{planar_region}/configurations?samples=0").json()["extremes"]
    for extreme in ends:
        for word, end in (("min", "lower"), ("max", "upper")):
            opened.get_by_role("button", name=f"{extreme['joint']} {word}").click()
            assert shown(opened) == pytest.approx(extreme[end], abs=1e-3)


def test_the_sweep_stays_inside_and_can_be_paused(opened: Any, planar: Scene, faces: tuple[Array, Array]) -> None:
    C, d = faces
    before = shown(opened)
    opened.get_by_role("button", name="Sweep through the region").click()
    for _ in range(8):
        opened.wait_for_timeout(120)
        assert (d - C @ planar.to_s(shown(opened))).min() > -2e-3
    opened.get_by_role("button", name="Pause").click()
    opened.get_by_role("button", name="Sweep through the region").wait_for()
    stopped = shown(opened)
    assert np.abs(stopped - before).max() > 1e-3
    opened.wait_for_timeout(200)
    assert np.array_equal(shown(opened), stopped)


def test_the_slice_is_what_samples_say_and_leads_the_robot(opened: Any, planar: Scene, faces: tuple[Array, Array]) -> None:
    size = 90
    middles = -1.2 + 2.4 * (np.arange(size) + 0.5) / size
    q = np.array([[x, y] for y in middles for x in middles])
    taken = round(100 * in_collision(planar, planar.to_s(q)).mean())
    C, d = faces
    covered = round(100 * (planar.to_s(q) @ C.T <= d).all(axis=1).mean())
    said = opened.locator(".slice figcaption").text_content()
    assert f"{covered} % of this slice is in certified regions, {taken} % in collision" in said
    canvas = opened.locator(".slice canvas")
    box = canvas.bounding_box()
    canvas.click(position={"x": 52 + 0.75 * (box["width"] - 62), "y": 10 + 0.25 * (box["height"] - 44)})
    assert shown(opened) == pytest.approx([0.6, 0.6], abs=0.02)
    opened.get_by_text("The robot is outside the region").wait_for()
    canvas.press("ArrowLeft")
    assert shown(opened) == pytest.approx([0.6 - 2.4 / 60, 0.6], abs=0.02)
    across, up = opened.locator(".axes select").all()
    across.select_option("joint2")
    assert (across.input_value(), up.input_value()) == ("1", "0"), "the other axis swaps"


def test_the_cells_of_a_pair_are_drawn_over_the_slice(opened: Any, planar: Scene) -> None:
    before = opened.locator(".slice canvas").screenshot()
    choice = opened.get_by_label("Cells of the pair")
    with opened.expect_response(lambda response: response.url.endswith("/cells")) as answer:
        choice.select_option(index=1)
    cells = answer.value.json()
    assert (cells["certified"], cells["pair"]["a"] in planar.pairs[0].a) == (True, True)
    until(lambda: opened.locator(".slice canvas").screenshot() != before)
    assert opened.locator(".key-map.cells").count() == 1


def test_the_plane_of_the_cell_is_drawn_between_the_bodies_and_moves(opened: Any, barriers: Any) -> None:
    canvas, says = opened.locator(".robot canvas"), opened.locator(".plane-said")
    samples = canvas.screenshot()
    opened.get_by_label("show 40 samples").uncheck()
    until(lambda: canvas.screenshot() != samples)
    without = canvas.screenshot()
    with opened.expect_response(lambda response: "/plane?" in response.url) as answer:
        opened.get_by_label("Cells of the pair").select_option(index=1)
    plane = answer.value.json()
    says.get_by_text(f"the plane of cell {plane['cell']} is between {plane['volumes'][0]} and {plane['volumes'][1]}").wait_for()
    assert says.locator(".proved").text_content() == "Proved:"
    until(lambda: canvas.screenshot() != without)
    assert barriers(opened) == []
    between = canvas.screenshot()
    opened.get_by_role("button", name="arm/joint2 max").click()
    says.get_by_text("the plane of cell").wait_for()
    until(lambda: canvas.screenshot() not in (between, without))
    opened.locator(".slice canvas").click(position={"x": 300, "y": 60})
    opened.get_by_text("nothing is proved here").wait_for()
    says.get_by_text("no plane is proved here").wait_for()


def test_the_square_is_in_the_plane_that_the_proof_has_at_the_joint_positions(
    page: Any, url: str, planar: Scene, planar_region: str, client: TestClient
) -> None:
    page.add_init_script(OBSERVE)
    page.goto(f"{url}/regions/{planar_region}#pair=0")
    page.get_by_text(READY).wait_for()
    ends = client.get(f"/v1/regions/{planar_region}/configurations").json()["extremes"]

    def normal(joint: str, end: str) -> Array:
        """Moves the joint to its end, and gives the normal of the square there, in the world."""
        page.get_by_role("button", name=f"{joint} {'min' if end == 'lower' else 'max'}").click()
        q = np.array(next(one[end] for one in ends if one["joint"] == joint))
        asked = "&".join(f"q={value}" for value in q)
        plane = client.get(f"/v1/regions/{planar_region}/pairs/0/plane?{asked}").json()
        s = planar.to_s(q)
        *a, b = np.array(plane["Z"]) @ [1.0, *s[plane["joints"]]]

        def off() -> float:
            """How far the corners and the middle of the square are from the plane, in metres."""
            p = Kinematics.of(planar).points(plane["frame"], WORLD, (CORNERS @ square(page)[1].T)[:, :3], s[None])[0]
            return float(np.abs(p @ a + b).max() / np.linalg.norm(a))

        until(lambda: off() < 1e-6)
        visible, X = square(page)
        assert visible
        tip = (X @ [0.0, 0.0, 1.0, 0.0])[:3] / np.linalg.norm(X[:3, 2])
        beyond = Kinematics.of(planar).points(plane["frame"], WORLD, X[None, :3, 3] + tip, s[None])[0]
        assert (beyond @ a + b)[0] / np.linalg.norm(a) == pytest.approx(1.0), "it faces the first body"
        return np.array(tip)

    assert np.abs(normal("arm/joint1", "lower") - normal("arm/joint2", "upper")).max() > 1e-3, "it has moved"


def test_the_cells_of_a_pair_of_a_job_lead_to_its_planes(page: Any, url: str, client: TestClient, worker: None, database: Database) -> None:
    job = grown(client, stored(database, passing()), half_width=0.15)
    page.goto(f"{url}/jobs/{job['id']}#pair=1")
    page.get_by_role("link", name=f"region {job['region'][:8]}").click()
    page.locator(".plane-said").get_by_text("the plane of cell").wait_for()
    assert page.url == f"{url}/regions/{job['region']}#pair=1"
    assert page.get_by_label("Cells of the pair").input_value() == "1"
    assert page.locator(".robot canvas").evaluate("one => one.getBoundingClientRect().top < innerHeight / 2"), "the robot is in view"


def test_an_address_chooses_the_pair(page: Any, url: str, planar: Scene, planar_region: str) -> None:
    for fragment, chosen in (("#pair=0", "0"), ("#pair=99", ""), ("#pair=", ""), ("", "")):
        page.goto("about:blank")
        page.goto(f"{url}/regions/{planar_region}{fragment}")
        page.get_by_text(READY).wait_for()
        assert page.get_by_label("Cells of the pair").input_value() == chosen
    assert page.locator(".plane-said").count() == 0


def test_the_page_is_saved_as_one_file_that_needs_no_service(
    opened: Any, browser: Any, planar_region: str, outside: tuple[str, list[str]], barriers: Any, tmp_path: Path
) -> None:
    claim = opened.locator(".claim p").first.text_content()
    with opened.expect_download() as saved:
        opened.get_by_role("button", name="Save as HTML").click()
    assert saved.value.suggested_filename == f"{planar_region}.html"
    saved.value.save_as(tmp_path / "region.html")
    context = browser.new_context(offline=True)
    page, asked, complaints = context.new_page(), [], []
    context.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((tmp_path / "region.html").as_uri())
    page.get_by_text("The robot is inside the region: no collision of the 2 covered pairs, as proved.").wait_for()
    assert page.locator(".claim p").first.text_content() == claim
    assert f"ciris verify {planar_region}.proof" in page.locator("main").text_content()
    before = page.locator(".robot canvas").screenshot()
    page.get_by_role("slider", name="arm/joint1, degrees").press("End")
    until(lambda: page.locator(".robot canvas").screenshot() != before)
    page.get_by_text("The robot is inside the region").wait_for()
    assert barriers(page) == []
    assert [url for url in asked if not url.startswith("file:")] == complaints == outside[1] == []
    context.close()


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_nothing_keeps_people_out(browser: Any, url: str, planar_region: str, barriers: Any, scheme: str) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme=scheme, reduced_motion="reduce")
    page = context.new_page()
    page.goto(f"{url}/regions/{planar_region}")
    page.get_by_text(READY).wait_for()
    assert barriers(page) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    context.close()
