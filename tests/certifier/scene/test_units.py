"""Numbers that look as if they were not metres and radians are remarked on by `ciris scene check`."""

from __future__ import annotations

import pytest

from tests.certifier.scene.workshop import BOX, parsed, write

FINGER = """<link name="{0}"><collision name="pad"><geometry><box size="{1} 0.02 0.02"/></geometry></collision></link>
  <joint name="to_{0}" type="fixed"><parent link="hand"/><child link="{0}"/></joint>"""


def warned(directory, words, **parts):
    return [w for w in parsed(write(directory, **parts)).warnings if words in w]


@pytest.mark.parametrize(("far", "number"), [(1000.0, 1), (60.0, 1), (8.0, 1), (2.0, 0)])
def test_a_slide_far_longer_than_the_robot_is_remarked_on(tmp_path, far, number):
    said = warned(tmp_path, "slides", kind="prismatic", limit=f'<limit lower="-{far}" upper="{far}"/>')
    assert len(said) == number
    assert not said or f"joint arm/turn slides {2 * far:.3g} m" in said[0]
    assert not said or "say so by limits: {arm/turn: [LOWER, UPPER]}" in said[0]


def test_a_long_slide_that_the_scene_file_narrows_is_not_remarked_on(tmp_path):
    limit = '<limit lower="-999" upper="999"/>'
    assert not warned(tmp_path, "slides", kind="prismatic", limit=limit, extra="limits: {turn: [-1, 1]}\n")


@pytest.mark.parametrize(
    ("lower", "upper", "number"),
    [("-170", "170", 1), ("0", "90", 1), ("-1", "45", 1), ("-6.283185307179586", "6.283185307179586", 0), ("-6", "6", 0), ("-7.5", "1", 0)],
)
def test_limits_that_look_like_degrees_are_remarked_on(tmp_path, lower, upper, number):
    said = warned(tmp_path, "units radians", limit=f'<limit lower="{lower}" upper="{upper}"/>')
    assert said == [f"joint arm/turn has the limits {lower} and {upper}: are its units radians?"] * number


@pytest.mark.parametrize(("length", "number"), [(30.0, 1), (9.0, 1), (0.9, 0)])
def test_a_part_in_millimetres_is_remarked_on(tmp_path, length, number):
    """9 m is short of what any geometry is remarked on for; that it is a finger, the other parts say."""
    more = FINGER.format("left", length) + FINGER.format("right", 0.05)
    said = warned(tmp_path, "units metres", more=more)
    assert len(said) == number
    assert not said or said[0].startswith(f"geometry arm/left/pad is {length:.3g} m long, and the other ones of its model about 0.075 m")


def test_what_stands_around_is_not_compared_with_the_robot(tmp_path):
    assert not warned(tmp_path, "units metres", shape=BOX.replace("0.1", "0.01"))
