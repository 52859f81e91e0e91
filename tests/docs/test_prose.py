"""Words that readers have to read twice (prose.toml) get fewer and never more."""

from __future__ import annotations

import json

import pytest

from tests.docs import prose


@pytest.mark.parametrize("pattern", prose.PATTERNS, ids=lambda pattern: pattern["find"])
def test_every_pattern_finds_its_example(pattern: dict[str, str]) -> None:
    (compiled,) = [regex for regex, about in prose._FOUND if about is pattern]
    assert compiled.search(pattern["bad"])


def test_code_is_not_read() -> None:
    page = "Text.\n\n    so many\n\n```sh\nso many\n```\n`so many` [link](so many)\n"
    assert "so many" not in prose._CODE.sub(prose._blank, page)


def test_no_file_has_more_of_these_words_than_before() -> None:
    allowed, found = json.loads(prose.COUNTS.read_text()), prose.counts()
    more = {name: number for name, number in found.items() if number > allowed.get(name, 0)}
    said = [f"{name}:{one.line}: {one.words}: write {one.write}" for name in more for one in prose.findings(prose.ROOT / name)]
    assert not said, "\n".join(["some of these are new:", *said])
    assert found == allowed, "there are fewer now: run python -m tests.docs.prose --write"
