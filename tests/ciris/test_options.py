"""The options of the Python client are those of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from certifier.errors import CirisError
from ciris import options
from ciris.requests import asked_for
from client.options import JOB, Part
from tests.ciris.options import KINDS, MODULE, module
from tests.options import Grouped


def test_the_module_of_options_is_current() -> None:
    assert MODULE.read_text() == module(), "run python -m tests.ciris.options"


def test_every_option_has_its_place_in_the_request() -> None:
    for kind, parts in KINDS.items():
        fields: options.Fields = getattr(options, kind.upper())
        assert {field for field, _ in fields.values()} == {part.field(one) for part in parts for one in part.options}


def test_names_are_those_of_the_arguments_and_lists_are_in_the_plural() -> None:
    given = {"iris_random_seed": 1, "random_seed": 2, "deadline": 9, "contain": np.zeros(2), "labels": {"a": "b"}, "cells": None}
    assert asked_for(given, options.GROW) == {
        "seed": {"random_seed": 1, "contain": [[0.0, 0.0]]},
        "options": {"random_seed": 2},
        "deadline_seconds": 9,
        "labels": {"a": "b"},
    }
    assert asked_for({"seeds": [0.0], "paths": [np.zeros((2, 1))]}, options.COVER) == {
        "options": {"seeds": [[0.0]], "paths": [[[0.0], [0.0]]]}
    }


@pytest.fixture(scope="module")
def grouped() -> Mapping[str, Any]:
    """A module of options one of which is a group."""
    made: dict[str, Any] = {}
    exec(module({"job": JOB, "grow": (Part(Grouped, "options"), *JOB)}), made)
    return made


def test_a_group_is_a_mapping_of_options(grouped: Mapping[str, Any]) -> None:
    assert grouped["GrowOptions"].__annotations__["old_way"].__forward_arg__ == "Group"
    asked = asked_for({"old_way": {"max_rounds": 3, "start": np.array([1.0])}, "deadline": 1}, grouped["GROW"])
    assert asked == {"options": {"old_way": {"max_rounds": 3, "start": [1.0]}}, "deadline_seconds": 1}
    assert asked_for({"old_way": {}}, grouped["GROW"]) == {"options": {"old_way": {}}}


@pytest.mark.parametrize(
    ("given", "code", "field"), [({"old_way": 3}, "argument", "old_way"), ({"old_way": {"x": 1}}, "unknown_option", "x")]
)
def test_what_is_no_group_is_refused(grouped: Mapping[str, Any], given: dict[str, Any], code: str, field: str) -> None:
    with pytest.raises(CirisError) as caught:
        asked_for(given, grouped["GROW"])
    assert (caught.value.code, caught.value.field) == (code, field)
