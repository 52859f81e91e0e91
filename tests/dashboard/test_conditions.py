"""The page of a scene with conditions, in a browser: which of them is not kept, by how much, and where zones and cones are."""

from __future__ import annotations

from typing import Any

from tests.api.test_conditions import upright
from tests.dashboard.test_job_page import orange

__all__ = ["upright"]


def test_a_condition_that_is_not_kept_is_said_and_painted(page: Any, url: str, upright: Any) -> None:
    page.goto(f"{url}/scenes/planar")
    robot = page.locator("figure.robot canvas")
    page.get_by_text("No collision (computed, not proved)").wait_for()
    assert orange(page.context.browser, robot.screenshot()) == 0
    page.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").fill("-40")
    page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").fill("-40")
    page.get_by_role("spinbutton", name="arm/joint2, degrees, as a number").press("Enter")
    page.get_by_text("Not free: the condition 'along-x' is not kept: the angle is 80 degrees, and 60 at most.").wait_for()
    assert orange(page.context.browser, robot.screenshot()) > 30, "the edge of the cone, and the arrow"
