"""Names and sentences: what a statement may print."""

from __future__ import annotations

import pytest

from certifier.names import escaped, is_name, is_sentence


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
