"""``python -m tests.dashboard.pictures`` takes the pictures of docs/dashboard.md from a real run, and times the first view of each page.

It starts a service of its own, has regions grown for some minutes, and looks at the pages in the tests' Chromium.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

import ciris
from benchmarks.makers import ARMS
from benchmarks.service import running

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
WIDE, PHONE = {"width": 1280, "height": 860}, {"width": 390, "height": 844}
COLOURS = 128
MODEL = ARMS["ur5_gripper"].file.parent
"""The folder of a maker's arm, from the packages of the tests."""
PATIENCE_MS, SECONDS = 240_000, 240
"""For a page, and for some iterations of a job."""
ITERATIONS = 6
ELSEWHERE = [1.2, -0.8, 0.9]
"""A configuration of arm_3dof, away from its seed."""
Prepare = Callable[[Page], object]


def main() -> None:
    with tempfile.TemporaryDirectory() as data, running(Path(data), 2) as service, sync_playwright() as playwright:
        chromium = os.environ.get("CHROMIUM_BIN", Path(sys.prefix) / "browser" / "chromium")
        browser = playwright.chromium.launch(executable_path=chromium)
        asked = ciris.connect(service.url)
        planar, arm, bin_ = (asked.add_scene(ROOT / "examples" / name / "scene.yaml") for name in ("planar_2dof", "arm_3dof", "ur3e_bin"))
        asked.cover(planar, coverage=0.8, deadline=300)
        jobs = [asked.submit_grow(arm, q, deadline=200) for q in (seed("arm_3dof"), ELSEWHERE)]
        regions = [job.result().id for job in jobs]
        ids = {"planar": planar.id, "pair": jobs[0].id, "region": regions[0], "other": regions[1]}
        views(browser, service.url, ids)
        growing = asked.submit_grow(bin_, seed("ur3e_bin"), deadline=600)
        growing_views(browser, service.url, asked, growing.id)
        shoot(browser, f"{service.url}/new", "dashboard_meshes", "#new-upload", own_robot, part=".stage .robot")
        browser.close()


def seed(example: str) -> Any:
    """The joint positions beside an example's scene."""
    return yaml.safe_load((ROOT / "examples" / example / "seed.yaml").read_text())["q"]


def views(browser: Browser, url: str, ids: dict[str, str]) -> None:
    """Takes the pictures of what has ended."""
    planned = f"/scenes/{ids['planar']}"
    shoot(browser, f"{url}/new?scene={ids['planar']}&q=0.3,-0.6", "dashboard_new", ".said >> text=/computed|certified/")
    shoot(browser, f"{url}{planned}", "dashboard_scene", "text=/component/", planning)
    shoot(browser, f"{url}{planned}", "dashboard_scene_dark", "text=/component/", planning, scheme="dark")
    shoot(browser, f"{url}/regions/{ids['region']}", "dashboard_region", "text=of this slice is in certified regions")
    shoot(browser, f"{url}/regions/{ids['region']}", "dashboard_region_phone", "text=of this slice is in certified regions", size=PHONE)
    shoot(
        browser,
        f"{url}/regions/{ids['region']}",
        "dashboard_plane",
        "text=of this slice is in certified regions",
        plane,
        part=".explore .views",
    )
    shoot(
        browser,
        f"{url}/compare?a={ids['region']}&b={ids['other']}",
        "dashboard_compare",
        "text=of this slice is in certified regions",
        part=".slice",
    )
    shoot(browser, f"{url}/jobs/{ids['pair']}", "dashboard_pair", "role=grid", pair)
    shoot(browser, f"{url}/jobs/{ids['pair']}", "dashboard_contact", "role=grid", part="section[aria-labelledby=h-obstacles]")


def growing_views(browser: Browser, url: str, asked: ciris.Service, job: str) -> None:
    """Takes the pictures of a job that runs, once some iterations have begun, or after some minutes."""
    until = time.monotonic() + SECONDS
    while time.monotonic() < until and len(asked.client.job_pairs(job)["iterations"]) < ITERATIONS:
        time.sleep(1)
    shoot(browser, f"{url}/jobs/{job}", "dashboard_job", "role=grid")
    shoot(browser, f"{url}/jobs/{job}", "dashboard_job_phone", "role=grid", size=PHONE)
    asked.job(job).wait()
    shoot(browser, f"{url}/jobs/{job}", "dashboard_timeline", "role=grid", part="section[aria-labelledby=h-timeline]")


def planning(page: Page) -> None:
    """Has a motion planned between two configurations that are far from each other, and stops halfway."""
    page.get_by_label("From").fill("-90, -35")
    page.get_by_label("To", exact=True).fill("90, 50")
    page.get_by_label("Only in certified regions").check()
    page.get_by_role("button", name="Plan a motion").click()
    page.locator(".moment", has_text="in region").wait_for()
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


def shoot(
    browser: Browser,
    address: str,
    name: str,
    there: str,
    prepare: Prepare = lambda page: None,
    *,
    size: dict[str, int] = WIDE,
    scheme: str = "light",
    part: str | None = None,
) -> None:
    """Takes a picture of a page, or of a part of it, and says how long it took until something was to be seen, and until ``there`` was."""
    context = browser.new_context(viewport=size, color_scheme=scheme, device_scale_factor=1)  # type: ignore[arg-type]
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    began = time.perf_counter()
    page.goto(address, wait_until="commit")
    page.locator(there).first.wait_for()
    drawn = time.perf_counter() - began
    first = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN") / 1000
    print(f"{name}: first view {first:.2f} s, {there!r} after {drawn:.2f} s", flush=True)
    prepare(page)
    page.wait_for_timeout(2500)
    file = PICTURES / f"{name}.png"
    if part is None:
        page.evaluate("scrollTo(0, 0)" if size is WIDE else "document.querySelector('.robot, .pairs')?.scrollIntoView()")
        page.wait_for_timeout(1000)
        page.screenshot(path=file, full_page=size is WIDE)
    else:
        page.locator(part).first.scroll_into_view_if_needed()
        page.wait_for_timeout(1000)
        page.locator(part).first.screenshot(path=file)
    picture = Image.open(file).convert("RGB")
    picture.crop((0, 0, picture.width, min(picture.height, 1600))).quantize(COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    print(f"{file.relative_to(ROOT)}: {file.stat().st_size // 1024} KiB, mean {np.asarray(picture).mean():.0f}", flush=True)
    context.close()


if __name__ == "__main__":
    main()
