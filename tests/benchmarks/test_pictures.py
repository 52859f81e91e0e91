"""The pictures of the docs show what they say: a certified region, configurations that collide, and what was measured."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks import catalogue, cover, cover_picture, growth, pictures, report
from benchmarks.outline import outlines
from certifier.kinematics import Kinematics
from certifier.model import WORLD
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.polytopes.closest import closest

REGION = json.loads(pictures.REGION.read_text(encoding="utf-8"))


def test_the_picture_is_that_of_its_region() -> None:
    assert pictures.picture(REGION) == pictures.PICTURE.read_text(encoding="utf-8")


def test_the_region_is_certified() -> None:
    scene = catalogue.scene(pictures.EXAMPLE)
    certification = Certification(scene, pictures.polytope(REGION))
    assert {certification.certify(index).outcome for index in range(len(scene.pairs))} == {Outcome.CERTIFIED}


def test_the_picture_of_a_cover_is_that_of_its_regions() -> None:
    covered = json.loads(cover_picture.REGIONS.read_text(encoding="utf-8"))
    assert cover_picture.picture(covered) == cover_picture.PICTURE.read_text(encoding="utf-8")
    assert covered["coverage"]["value"] >= cover.CASES[cover_picture.EXAMPLE].options["coverage"]


def test_what_is_drawn_as_colliding_collides() -> None:
    scene = catalogue.scene(pictures.EXAMPLE)
    kinematics = Kinematics.of(scene)
    s = np.random.default_rng(0).uniform(scene.s_lower, scene.s_upper, (300, scene.n))
    for name in pictures.OBSTACLES:
        obstacle = scene.geometry(f"obstacles/body/{name}")
        (fixed,) = kinematics.points(WORLD, obstacle.body, obstacle.vertices, s[:1])
        distances = [
            [closest(points, fixed).distance - obstacle.radius for points in kinematics.points(WORLD, link.body, link.vertices, s)]
            for link in scene.geometries
            if link.name.startswith("arm/")
        ]
        expected, found = np.min(distances, axis=0), pictures.clearance(kinematics, name, s)
        apart = expected > 1e-6
        np.testing.assert_allclose(found[apart], expected[apart], atol=1e-6)
        assert (found[~apart] < 1e-6).all()
        assert 0 < apart.sum() < len(s)


def test_outlines_go_around_a_ring_and_its_hole() -> None:
    x, y = np.meshgrid(np.arange(41), np.arange(31), indexing="ij")
    radius = np.hypot(x - 20, y - 15)
    inner, outer = sorted((np.hypot(*(loop - [20, 15]).T) for loop in outlines(np.maximum(5 - radius, radius - 12))), key=np.max)
    np.testing.assert_allclose(inner, 5, atol=0.1)
    np.testing.assert_allclose(outer, 12, atol=0.1)


def test_outlines_end_where_the_grid_does() -> None:
    (loop,) = outlines(np.full((4, 3), -1.0))
    assert loop.min() == 0
    assert (loop.max(axis=0) == [3, 2]).all()


@pytest.mark.parametrize("name", report.PICTURES)
def test_the_curves_are_those_of_the_figures(name: str) -> None:
    path, picture = report.PICTURES[name]
    assert picture(json.loads((report.FIGURES / f"{name}.json").read_text(encoding="utf-8"))) == path.read_text(encoding="utf-8")


def test_a_share_is_as_high_in_the_picture_as_it_is_large() -> None:
    """Shares are drawn from 0 at the bottom of a panel to 1 at its top, and seconds in proportion to their logarithms."""
    curve = [{"seconds": seconds, "share": share} for seconds, share in ((1, 0.0), (10, 0.25), (1000, 1.0))]
    row = {"way": "whole", "curve": curve}
    names = catalogue.EXAMPLES[:4]
    ways = [{"scene": name, **row} for name in names] + [{"scene": "sphere_arm", "way": "whole", "curve": []}]
    svg = ElementTree.fromstring(growth.picture({"ways": ways}))
    places = np.array([[float(dot.attrib[key]) for key in ("cx", "cy")] for dot in svg.findall(".//{*}circle")]).reshape(4, 3, 2)
    frames = [frame.attrib for frame in svg.findall(".//{*}rect") if frame.get("class") == "frame"]
    assert len(frames) == len(names), "an example without a region has no panel"
    for (start, middle, end), frame in zip(places, frames, strict=True):
        low, high = float(frame["y"]) + float(frame["height"]), float(frame["y"])
        np.testing.assert_allclose([start[1], middle[1], end[1]], [low, 0.75 * low + 0.25 * high, high], atol=0.06)
        assert middle[0] - start[0] == pytest.approx((end[0] - start[0]) / 3, abs=0.11)
        assert float(frame["x"]) < start[0] < end[0] < float(frame["x"]) + float(frame["width"])
    titles = [text.text for text in svg.findall(".//{*}text") if text.get("font-weight")]
    assert titles == list(names)
    assert places[3, 0, 1] > places[0, 0, 1], "the fourth panel begins a row"


def test_a_way_keeps_its_colour_where_the_other_has_no_region() -> None:
    curve = [{"seconds": 1.0, "share": 0.5}]
    ways = [{"scene": "planar_2dof", "way": way, "curve": points} for way, points in (("whole", []), ("targeted", curve))]
    svg = ElementTree.fromstring(growth.picture({"ways": ways}))
    (dot,) = svg.findall(".//{*}circle")
    (name,) = [text for text in svg.findall(".//{*}text") if text.text == "targeted"]
    assert name.attrib["style"] == f"fill: {dot.attrib['fill']}"
    assert any(text.text == "whole" for text in svg.findall(".//{*}text"))
