"""The page of a motion that a job has certified, in a real browser: its claim stays in view, and the robot moves along it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from certifier.verify.decimals import at_least_mm
from tests.dashboard.test_truth import EFFECTS, until

FREE, BLOCKED = [[-0.3, 0.1], [-0.6, 0.4]], [[-0.3, 0.1], [0.0, 0.1], [0.8, 0.1]]


def to_the_end(page: Any) -> None:
    """Moves the robot to the end of the motion, once the player does not go to its beginning any more."""
    time = page.get_by_label("Time, seconds")
    time.wait_for()
    page.evaluate(EFFECTS)
    time.press("End")


@pytest.mark.usefixtures("worker")
def test_a_motion_has_its_claim_and_is_played(page: Any, url: str, planar: Scene, client: TestClient, barriers: Any) -> None:
    asked = {"kind": "certify-path", "scene": "planar", "q": FREE, "clearance": True}
    job = client.post("/v1/jobs", json=asked).json()["id"]
    page.goto(f"{url}/jobs/{job}")
    claim = page.locator(".claim")
    claim.get_by_text("all along the motion, the bodies of each covered pair stay apart").wait_for(timeout=60_000)
    verdict = client.get(f"/v1/jobs/{job}/motion").json()
    assert claim.locator("dd").all_text_contents()[:2] == ["2", f"at least {at_least_mm(verdict['clearance'])}"]
    to_the_end(page)
    page.locator(".moment", has_text="on the motion, which is certified").wait_for()
    length = np.linalg.norm(np.subtract(*FREE))
    assert page.locator(".player output").text_content() == f"{length:.2f} s"
    assert barriers(page) == []
    page.set_viewport_size({"width": 1000, "height": 500})
    page.mouse.wheel(0, 4000)
    until(lambda: page.evaluate("scrollY") > 300)
    assert claim.bounding_box()["y"] == pytest.approx(0, abs=1)


@pytest.mark.usefixtures("worker")
def test_where_nothing_is_proved_the_motion_says_so(page: Any, url: str, planar: Scene, client: TestClient) -> None:
    job = client.post("/v1/jobs", json={"kind": "certify-path", "scene": "planar", "q": BLOCKED}).json()["id"]
    page.goto(f"{url}/jobs/{job}")
    page.locator(".claim", has_text="After that, nothing is proved.").wait_for(timeout=60_000)
    to_the_end(page)
    page.locator(".moment", has_text="where nothing is proved").wait_for()
    (stop,) = client.get(f"/v1/jobs/{job}/obstacles").json()["obstacles"]
    words = ", ".join(f"{np.rad2deg(angle):.1f}\N{DEGREE SIGN}" for angle in stop["q"])
    page.get_by_text(f"touch at q = ({words}), the first configuration on the motion that could not be certified.").wait_for()
    assert page.locator(".obstacles a[href^='/scenes/']").count() == 0, "at the first contact, rounding may see none"
    assert "m apart" not in page.locator("main").text_content()


@pytest.mark.usefixtures("worker")
@pytest.mark.parametrize("given", ["s", "q"])
def test_a_motion_that_is_straight_in_s_is_played_so(page: Any, url: str, planar: Scene, client: TestClient, given: str) -> None:
    s = planar.to_s(np.array(FREE))
    asked = {"s": s.tolist()} if given == "s" else {"q": FREE, "space": "s"}
    job = client.post("/v1/jobs", json={"kind": "certify-path", "scene": "planar", **asked}).json()["id"]
    page.goto(f"{url}/jobs/{job}")
    page.locator(".claim").get_by_text("stay apart").wait_for(timeout=60_000)
    page.get_by_text("The motion is straight in s.").wait_for()
    assert page.locator(".joint-key").all_text_contents() == [
        f" joint{i + 1} {np.rad2deg(a):.1f}\N{DEGREE SIGN} \N{RIGHTWARDS ARROW} {np.rad2deg(b):.1f}\N{DEGREE SIGN}"
        for i, (a, b) in enumerate(zip(*FREE, strict=True))
    ]
    # The curves are those of q along the line in s.
    drawn = page.locator(".player .chart > path").all()
    for joint, path in enumerate(drawn):
        heights = np.array([float(place.split(",")[1]) for place in path.get_attribute("d")[1:].split("L")])
        q = planar.to_q(np.linspace(*s, len(heights)))[:, joint]
        assert (heights - heights[0]) / (heights[-1] - heights[0]) == pytest.approx((q - q[0]) / (q[-1] - q[0]), abs=2e-3)
    to_the_end(page)
    page.locator(".moment", has_text="on the motion, which is certified").wait_for()


def test_a_large_distance_has_no_exponent() -> None:
    assert [at_least_mm(metres) for metres in (1.1547, 0.5, 12.3456)] == ["1150 mm", "500 mm", "12300 mm"]
