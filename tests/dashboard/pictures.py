"""``python -m tests.dashboard.pictures`` takes the pictures of docs/dashboard.md from a real run, and times the first view of each page.

It starts a service of its own, grows regions for some minutes, and looks at the pages in the tests' Chromium. With names of pictures
as arguments it takes only these.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from PIL import Image
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

import ciris
from benchmarks.makers import ARMS
from benchmarks.service import running

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "pictures"
WIDE: ViewportSize = {"width": 1280, "height": 860}
PHONE: ViewportSize = {"width": 390, "height": 844}
COLOURS = 128
MODEL = ARMS["ur5_gripper"].file.parent
"""The folder of a maker's arm, from the packages of the tests."""
PATIENCE_MS, SECONDS = 240_000, 240
"""For a page, and for some iterations of a job."""
ITERATIONS = 6
OBSTACLES = "section[aria-labelledby=h-obstacles]"


class Shown:
    """What the pictures show. Each part is made when a picture first asks for it."""

    def __init__(self, asked: ciris.Service) -> None:
        self._asked = asked

    @cached_property
    def planar(self) -> str:
        return self._scene("planar_2dof")

    @cached_property
    def covers(self) -> str:
        """Two covers that go on at the same time and ask for different shares, as the address of their comparison names them."""
        jobs = [self._asked.submit_cover(self.planar, coverage=coverage, deadline=600) for coverage in (0.8, 0.5)]
        return "a={}&b={}".format(*(job.wait().id for job in jobs))

    @cached_property
    def regions(self) -> str:
        """A middling and the largest region of the covers."""
        assert self.covers
        sizes = sorted(self._asked.regions(self.planar), key=lambda region: region.q_volume.value if region.q_volume else 0.0)
        return f"a={sizes[len(sizes) // 2].id}&b={sizes[-1].id}"

    @cached_property
    def planned(self) -> str:
        """The scene with regions."""
        assert self.covers
        return self.planar

    @cached_property
    def grown(self) -> ciris.Job:
        return self._asked.submit_grow(self._scene("arm_3dof"), seed("arm_3dof"), deadline=200).wait()

    @cached_property
    def region(self) -> str:
        return self.grown.result().id

    @cached_property
    def motion(self) -> str:
        """A job that certifies a motion of arm_3dof from its seed."""
        start = seed("arm_3dof")
        return self._asked.submit_certify_path(self._scene("arm_3dof"), [start, [start[0] + 0.6, *start[1:]]]).wait().id

    @cached_property
    def growing(self) -> ciris.Job:
        """A job that runs, once some iterations have begun, or after some minutes."""
        job = self._asked.submit_grow(self._scene("ur3e_bin"), seed("ur3e_bin"), deadline=600)
        until = time.monotonic() + SECONDS
        while time.monotonic() < until and len(self._asked.client.job_pairs(job.id)["iterations"]) < ITERATIONS:
            time.sleep(1)
        return job

    def _scene(self, example: str) -> str:
        return self._asked.add_scene(ROOT / "examples" / example / "scene.yaml").id


@dataclass(frozen=True)
class Picture:
    """A picture of a page, or of a part of it.

    Attributes:
        address: of the page, without the service's.
        there: what is there once the page is complete.
        prepare: what is done on the page before.
    """

    name: str
    address: Callable[[Shown], str]
    there: str
    prepare: Callable[[Page], object] = lambda page: None
    size: ViewportSize = field(default_factory=lambda: WIDE)
    scheme: Literal["light", "dark"] = "light"
    part: str | None = None


def main() -> None:
    wanted = [picture for picture in PICTURES if not sys.argv[1:] or picture.name in sys.argv[1:]]
    with tempfile.TemporaryDirectory() as data, running(Path(data), 2) as service, sync_playwright() as playwright:
        chromium = os.environ.get("CHROMIUM_BIN", Path(sys.prefix) / "browser" / "chromium")
        browser = playwright.chromium.launch(executable_path=chromium)
        shown = Shown(ciris.connect(service.url))
        for picture in wanted:
            shoot(browser, service.url + picture.address(shown), picture)
        browser.close()


def seed(example: str) -> Any:
    """The joint positions beside an example's scene."""
    return yaml.safe_load((ROOT / "examples" / example / "seed.yaml").read_text())["q"]


def planning(page: Page) -> None:
    """Has a motion planned between two configurations that are far from each other, and stops halfway."""
    page.get_by_label("From").fill("-90, -35")
    page.get_by_label("To", exact=True).fill("90, 50")
    page.get_by_label("Only in certified regions").check()
    page.get_by_role("button", name="Plan a motion").click()
    page.locator(".moment", has_text="in region").wait_for()
    play(page)


def play(page: Page) -> None:
    """Stops halfway along the motion."""
    page.get_by_label("Time, seconds").evaluate("field => { field.value = field.max / 2; field.dispatchEvent(new Event('input')); }")


def pair(page: Page) -> None:
    """Opens the pair that has the most cells."""
    page.get_by_role("grid").focus()
    page.keyboard.press("Enter")
    page.get_by_text("Cells", exact=True).first.wait_for()


def plane(page: Page) -> None:
    """Has the plane drawn between the bodies of the pair that has the most cells."""
    page.get_by_label("Cells of the pair").select_option(index=1)


def own_robot(page: Page) -> None:
    """Uploads a maker's arm and has its own meshes drawn beside the certified bodies."""
    with tempfile.TemporaryDirectory() as directory:
        zipped = shutil.make_archive(f"{directory}/{MODEL.name}", "zip", MODEL.parent, MODEL.name)
        page.get_by_label("or upload one").set_input_files(zipped)
        page.get_by_label("meshes of the model").check()
    page.get_by_text("Grey: the model's collision meshes.").wait_for()


SLICED, SLICES = "text=of this slice is in certified regions", "section[aria-labelledby=h-slices]"
PICTURES = (
    Picture("dashboard_new", lambda shown: f"/new?scene={shown.planned}&q=0.3,-0.6", ".said >> text=/computed|certified/"),
    Picture("dashboard_scene", lambda shown: f"/scenes/{shown.planned}", "text=/component/", planning),
    Picture("dashboard_scene_dark", lambda shown: f"/scenes/{shown.planned}", "text=/component/", planning, scheme="dark"),
    Picture(
        "dashboard_compare", lambda shown: f"/compare?{shown.regions}", f"{SLICES} section:last-child >> text=of this slice", part=SLICES
    ),
    Picture("dashboard_compare_jobs", lambda shown: f"/compare/jobs?{shown.covers}", "svg.chart[role=img]", part="main section"),
    Picture("dashboard_region", lambda shown: f"/regions/{shown.region}", SLICED),
    Picture("dashboard_region_phone", lambda shown: f"/regions/{shown.region}", SLICED, size=PHONE),
    Picture("dashboard_plane", lambda shown: f"/regions/{shown.region}", SLICED, plane, part=".explore .views"),
    Picture("dashboard_pair", lambda shown: f"/jobs/{shown.grown.id}", "role=grid", pair),
    Picture("dashboard_contact", lambda shown: f"/jobs/{shown.grown.id}", "role=grid", part=OBSTACLES),
    Picture("dashboard_motion_phone", lambda shown: f"/jobs/{shown.motion}", ".player", play, size=PHONE),
    Picture("dashboard_job", lambda shown: f"/jobs/{shown.growing.id}", "role=grid"),
    Picture("dashboard_job_phone", lambda shown: f"/jobs/{shown.growing.id}", "role=grid", size=PHONE),
    Picture(
        "dashboard_timeline", lambda shown: f"/jobs/{shown.growing.wait().id}", "role=grid", part="section[aria-labelledby=h-timeline]"
    ),
    Picture("dashboard_meshes", lambda shown: "/new", "#new-upload", own_robot, part=".stage .robot"),
)


def shoot(browser: Browser, address: str, picture: Picture) -> None:
    """Takes a picture, and says how long it took until the page showed something, and until it was complete."""
    context = browser.new_context(viewport=picture.size, color_scheme=picture.scheme, device_scale_factor=1)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    began = time.perf_counter()
    page.goto(address, wait_until="commit")
    page.locator(picture.there).first.wait_for()
    drawn = time.perf_counter() - began
    first = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN") / 1000
    print(f"{picture.name}: first view {first:.2f} s, {picture.there!r} after {drawn:.2f} s", flush=True)
    picture.prepare(page)
    page.wait_for_timeout(2500)
    for waiting in page.locator(".waiting").all():  # robots that are drawn once they come into view
        waiting.scroll_into_view_if_needed()
        page.wait_for_function("waiting => !waiting.isConnected", arg=waiting.element_handle())
    file = FOLDER / f"{picture.name}.png"
    wide = picture.size is WIDE
    if picture.part is None:
        page.evaluate("scrollTo(0, 0)" if wide else "document.querySelector('.robot, .pairs')?.scrollIntoView()")
        page.wait_for_timeout(1000)
        page.screenshot(path=file, full_page=wide)
    else:
        page.locator(picture.part).first.scroll_into_view_if_needed()
        page.wait_for_timeout(1000)
        page.locator(picture.part).first.screenshot(path=file)
    taken = Image.open(file).convert("RGB")
    taken.crop((0, 0, taken.width, min(taken.height, 1600))).quantize(COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    print(f"{file.relative_to(ROOT)}: {file.stat().st_size // 1024} KiB, mean {np.asarray(taken).mean():.0f}", flush=True)
    context.close()


if __name__ == "__main__":
    main()
