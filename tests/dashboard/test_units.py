"""Angles are degrees on every page, and radians for who asks: the choice stays in the browser, and stands in the address."""

from __future__ import annotations

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene

RADIANS = re.compile(r"[?&]angles=rad")


def test_one_switch_shows_radians_on_every_page(page: Any, url: str, planar: Scene) -> None:
    page.goto(f"{url}/new?scene=planar&q=0.1,-0.2")
    page.get_by_role("spinbutton", name="arm/joint1, degrees, as a number").wait_for()
    page.get_by_role("button", name="Angles in degrees").click()
    field = page.get_by_role("spinbutton", name="arm/joint1, radians, as a number")
    assert field.input_value() == "0.1000"
    page.wait_for_url(RADIANS)
    assert "q=0.1,-0.2" in page.url
    field.fill("0.25")
    field.press("Enter")
    page.wait_for_url(re.compile("q=0.25,-0.2"))
    page.get_by_role("button", name="Add this configuration").click()
    page.get_by_text("0.2500, -0.2000").first.wait_for()
    page.goto(f"{url}/scenes/planar")
    page.wait_for_url(RADIANS)
    assert page.get_by_role("row", name="arm/joint1").first.locator("td").all_text_contents()[2:] == [
        "-1.2000 rad",
        "1.2000 rad",
        "0.0000 rad",
    ]
    page.get_by_text("in radians. Move the robot").wait_for()
    page.get_by_label("Goal").select_option("arm/link2")
    page.get_by_label("yaw, radians").wait_for()
    page.get_by_role("button", name="Angles in radians").click()
    page.get_by_label("From").wait_for()
    assert page.get_by_role("row", name="arm/joint1").first.locator("td").all_text_contents()[2:] == [
        "-68.8\N{DEGREE SIGN}",
        "68.8\N{DEGREE SIGN}",
        "0.0\N{DEGREE SIGN}",
    ]
    assert not RADIANS.search(page.url)


def test_an_address_shows_the_same_numbers_to_somebody_else(browser: Any, url: str, planar_region: str) -> None:
    """It does not change what that reader sees elsewhere."""
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{url}/regions/{planar_region}?angles=rad")
    page.get_by_role("slider", name="arm/joint1, radians").wait_for()
    row = page.get_by_role("row", name="arm/joint1").last
    assert [text[-4:] for text in row.locator("td").all_text_contents()[1:3]] == [" rad", " rad"]
    page.goto(f"{url}/regions/{planar_region}")
    page.get_by_role("slider", name="arm/joint1, degrees").wait_for()
    context.close()


@pytest.mark.parametrize("path", ["/scenes/planar", "/regions/{region}"])
def test_the_server_writes_degrees_with_their_sign(client: TestClient, planar_region: str, path: str) -> None:
    text = client.get(path.format(region=planar_region)).text
    assert "68.8\N{DEGREE SIGN}" in text
    assert not re.search(r">-?1\.2000<", text)
