"""Words that readers have to read twice (prose.toml) stand in no file."""

from __future__ import annotations

import pytest

from tests.docs import prose


@pytest.mark.parametrize("pattern", prose.PATTERNS, ids=lambda pattern: pattern["find"])
def test_every_pattern_finds_its_example(pattern: dict[str, str]) -> None:
    (compiled,) = [regex for regex, about in prose._FOUND if about is pattern]
    assert compiled.search(pattern["bad"])


def test_code_is_not_read() -> None:
    page = "Text.\n\n    so many\n\n```sh\nso many\n```\n`so many` [link](so many)\n"
    assert "so many" not in prose._CODE.sub(prose._blank, page)


def test_no_file_has_these_words() -> None:
    assert list(prose.said(prose.files())) == []
