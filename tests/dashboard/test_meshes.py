"""The meshes of a model beside the bodies that are certified, in a real browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.api.test_meshes import CORNER
from tests.dashboard.test_own_robot import packed, urdf
from tests.dashboard.test_region_page import OBSERVE
from tests.dashboard.test_truth import until

SEEN = """() => {
    const found = [];
    inView.traverse((one) => { if (one.isMesh && one.geometry.type === "BufferGeometry" && one.visible) found.push(
        [one.geometry.getAttribute("position").count / 3, one.material.opacity, one.material.color.getHexString()]); });
    return found;
}"""
"""Of what is drawn by its triangles: how many there are, how much it hides, and its colour."""


@pytest.fixture
def arm(page: Any, url: str, client: TestClient, tmp_path: Path) -> Any:
    """The form with a robot whose second link is a corner, which has a hollow."""
    page.add_init_script(OBSERVE)
    page.goto(f"{url}/new")
    path = packed(tmp_path, arm___urdf=urdf("arm", "link.obj"), link___obj=CORNER)
    page.get_by_label("or upload one").set_input_files(path)
    page.get_by_text("arm is stored, with 2 joints and 1 pair").wait_for()
    page.locator(".slider").nth(1).wait_for()
    return page


def drawn(page: Any, count: int) -> list[tuple[int, float, str]]:
    until(lambda: len(page.evaluate(SEEN)) == count)
    return [tuple(one) for one in page.evaluate(SEEN)]


def test_the_meshes_of_a_model_are_drawn_in_the_bodies_that_are_certified(arm: Any, barriers: Any) -> None:
    """The hull of the corner has 16 triangles or so; the corner has 20, and it is grey."""
    certified, meshes = arm.get_by_label("certified bodies"), arm.get_by_label("meshes of the model")
    assert certified.is_checked()
    assert not meshes.is_checked()
    ((hull, opaque, colour),) = drawn(arm, 1)
    assert opaque == 1
    meshes.check()
    arm.get_by_text("Grey: the model's collision meshes. Proofs are about the certified bodies, which contain them.").wait_for()
    both = drawn(arm, 2)
    assert {count for count, _, _ in both} == {hull, 20}
    assert all(opacity < 1 for _, opacity, _ in both), "one is seen through the other"
    ((_, _, grey),) = [one for one in both if one[0] == 20]
    assert grey not in (colour, "009e73"), "neither the colour of a certified body nor that of what is proved"
    assert barriers(arm) == []
    certified.uncheck()
    assert [count for count, _, _ in drawn(arm, 1)] == [20]
    certified.check()
    meshes.uncheck()
    assert drawn(arm, 1) == [(hull, 1, colour)]


def test_a_mesh_moves_and_hides_with_its_body(arm: Any) -> None:
    arm.get_by_label("meshes of the model").check()
    drawn(arm, 2)
    arm.get_by_label("certified bodies").uncheck()
    drawn(arm, 1)
    place = "() => { let found; inView.traverse((one) => { if (one.geometry?.getAttribute('position')?.count === 60) found = one; });"
    before = arm.evaluate(f"{place} return found.matrix.elements; }}")
    arm.locator(".slider input[type=range]").first.press("End")
    until(lambda: arm.evaluate(f"{place} return found.matrix.elements; }}") != before)
    arm.locator(".view-tools summary").click()
    arm.get_by_label("arm/tip", exact=True).uncheck()
    drawn(arm, 0)


def test_a_scene_without_meshes_has_no_switch(page: Any, url: str, planar: Any) -> None:
    page.goto(f"{url}/new?scene=planar")
    page.get_by_role("button", name="View: fit").wait_for()
    assert page.get_by_label("meshes of the model").count() == 0
    assert page.get_by_label("certified bodies").count() == 0
