"""Models of requests are made from tables of options, groups too."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from certifier.options import read
from jobs.fields import model_of
from tests.options import Grouped

MODEL = model_of(Grouped)


def test_the_defaults_are_those_of_the_table() -> None:
    assert read(Grouped, MODEL().model_dump(), "options") == Grouped()


def test_a_group_is_a_document() -> None:
    asked = MODEL.model_validate({"old_way": {"max_rounds": 3}, "names": {"a": "b"}})
    options = read(Grouped, asked.model_dump(), "options")
    assert options.old_way is not None
    assert (options.old_way.max_rounds, options.old_way.how, options.names) == (3, "soft", {"a": "b"})


@pytest.mark.parametrize(
    ("given", "place"),
    [
        ({"cells": 0}, ("cells",)),
        ({"share": 1}, ("share",)),
        ({"old_way": {"max_rounds": 10}}, ("old_way", "max_rounds")),
        ({"old_way": {"how": "no way"}}, ("old_way", "how")),
        ({"old_way": {"haste": 1}}, ("old_way", "haste")),
        ({"old_way": True}, ("old_way",)),
    ],
)
def test_what_is_out_of_bounds_is_refused_at_its_place(given: dict[str, Any], place: tuple[str, ...]) -> None:
    with pytest.raises(ValidationError) as caught:
        MODEL.model_validate(given)
    assert caught.value.errors()[0]["loc"] == place
