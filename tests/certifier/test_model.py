"""Names and sentences: what a statement may print. Joint limits in s: the same on every machine."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import assume, given
from hypothesis import strategies as st

from certifier.model import WORLD, Joint, JointKind, Scene, escaped, is_name, is_sentence


@pytest.mark.parametrize("name", ["world", "arm/link_1/Box_2", "a::b/c", "sub/a b (1) [2], x=3", "m/world-a", "a@b#c+d", "x" * 200])
def test_names(name):
    assert is_name(name)


SPACES = ["", " a", "a ", "a  b", "a\nb", "a\n", "a\tb"]


@pytest.mark.parametrize("name", [*SPACES, "\x1b[31mred", "a\u202eb", "\u00e4rm", "a\\b", "a'b", "x" * 201, "\ud800", None, 3, ["a"]])
def test_what_is_no_name(name):
    assert not is_name(name)


def test_sentences():
    assert is_sentence("cylinder -> circumscribed prism with 8 sides; 4.9 mm \u00fcber")
    for text in ("two\nlines", "\x1b[2K", "\u202egnol", "\u2028", "\ud800", "x" * 501, None, 3):
        assert not is_sentence(text)


def test_escaped_text_is_one_printable_line_and_tells_different_texts_apart():
    assert escaped("a\n\x1b[31m\u202e\ud800\\n") == "a\\n\\x1b[31m\\u202e\\ud800\\\\n"
    assert escaped("4 mm \u00fcber") == "4 mm \u00fcber"


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.sampled_from([JointKind.REVOLUTE, JointKind.PRISMATIC]))
def test_joint_limits_in_s_are_the_nearest_doubles_that_leave_nothing_out(limit, center, kind):
    revolute = kind is JointKind.REVOLUTE
    assume(not revolute or -3.0 < limit - center < 3.0)
    joint = Joint("a/j", kind, WORLD, "a/b", np.array([0.0, 0.0, 1.0]), np.eye(4), np.eye(4), 0, limit, limit)
    scene = Scene("s", (joint,), (WORLD, "a/b"), (), (), (), np.array([center]))
    with ctx.workprec(3000):
        exactly = arb(limit) - arb(center)
        exactly = (exactly / 2).tan() if revolute else exactly
        lower, upper = (float(limit[0]) for limit in scene.outer_limits)
        assert arb(lower) <= exactly <= arb(upper)
        assert not arb(math.nextafter(upper, -math.inf)) >= exactly
        assert not arb(math.nextafter(lower, math.inf)) <= exactly
