"""Arguments and errors of commands come from the tables of options: every option, at both doors."""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import Any

import pytest

from certifier.errors import CirisError, RegionError
from certifier.model import Scene
from certifier.options import Option, Takes, read
from client.arguments import parser
from client.options import CERTIFY, COVER, GROW, JOB, RECERTIFY, Part, add_options, typed
from client.request import refuse_options, request
from tests.client.conftest import PLANAR, Ciris
from tests.docs.commands import leaf
from tests.options import Grouped

GROUPED = (Part(Grouped, "options"), *JOB)


def refused(one: Option) -> str | None:
    """Returns a value that an option refuses; None where every value is one."""
    match one.takes:
        case Takes.WHOLE | Takes.REAL:
            bound = one.least if one.least is not None else one.above
            assert bound is not None
            return str(bound - 1 if one.takes is Takes.WHOLE or one.least is not None else bound)
        case Takes.CHOICE | Takes.POINT | Takes.POINTS | Takes.LABELS:
            return "nonsense"
        case Takes.PATHS:
            return "nothing.csv"
    return None


def trials(parts: tuple[Part, ...]) -> list[Any]:
    """Each option with the arguments that give it a value which it refuses: the flag of its group, if it is in one, and its own."""
    options = {field: one for part in parts for field, one in part.fields()}
    flags = {field: [f"--{group.argument}" for place, group in options.items() if field.startswith(f"{place}.")] for field in options}
    return [
        pytest.param(one.argument, [*flags[field], f"--{one.argument}={refused(one)}"], id=field)
        for field, one in options.items()
        if refused(one) is not None
    ]


@pytest.mark.parametrize(("argument", "typed"), trials(GROW))
@pytest.mark.usefixtures("parsed_once")
def test_growing_here_names_the_argument_that_was_typed(ciris: Ciris, argument: str, typed: list[str]) -> None:
    done = ciris("grow", PLANAR, "--local", *typed)
    assert done.status == 2
    said = done.stderr.splitlines()[-1]
    assert said.startswith((f"error: --{argument}: ", f"error: --{argument}[0]"))
    assert not re.search(r"options\.|is an option of|max_", said)


@pytest.mark.parametrize(("argument", "typed"), trials(COVER))
def test_the_services_refusal_names_the_argument_that_was_typed(
    ciris: Ciris, url: str, scene: Scene, argument: str, typed: list[str]
) -> None:
    done = ciris("cover", "slider", *typed, CIRIS_URL=url)
    assert done.status == 2
    assert done.error.startswith((f"--{argument}: ", f"--{argument}[0]"))
    assert not re.search(r"options\.|is an option of", done.error)


@pytest.mark.parametrize(("where", "C"), [(["slider"], [[1], [-1]]), ([PLANAR, "--local"], [[1, 0], [-1, 0]])], ids=["service", "here"])
def test_so_does_the_refusal_of_a_polytopes_options(
    ciris: Ciris, url: str, scene: Scene, tmp_path: Path, where: list[str | Path], C: list[list[float]]
) -> None:
    (tmp_path / "p.json").write_text(json.dumps({"C": C, "d": [0.1, 0.1]}))
    for part in CERTIFY:
        for one in part.options:
            done = ciris("certify", *where, "--polytope", "p.json", f"--{one.argument}={refused(one)}", CIRIS_URL=url)
            assert (done.status, done.error.startswith(f"--{one.argument}: ")) == (2, True)


@pytest.mark.parametrize(
    ("command", "arguments", "parts"),
    [
        ("grow", ("slider", "--q=0"), GROW),
        ("certify", ("slider", "--polytope=p.json"), CERTIFY),
        ("recertify", ("1f9b2a7c", "--scene=slider"), RECERTIFY),
        ("certify-path", ("slider", "--q=0", "--q=0.1", "--job"), JOB),
        ("plan", ("slider", "--from=0", "--to=5", "--regions-only", "--grow"), JOB),
    ],
)
def test_every_field_has_its_argument(command: str, arguments: tuple[str, ...], parts: tuple[Part, ...]) -> None:
    parsed = parser().parse_args([command, *arguments])
    assert parsed.parser is not None
    for part in parts:
        for field, one in part.fields():
            error = typed(RegionError("option_value", f"{one.name} must be right", field=field, hint="mend it"), parsed.parser)
            assert (type(error), str(error)) == (RegionError, f"--{one.argument}: must be right (mend it)")


@pytest.mark.parametrize(
    ("command", "field", "argument"),
    [
        ("certify", "cells", "--cells"),
        ("grow", "seed.q[1]", "--q[1]"),
        ("plan", "start[0]", "--from[0]"),
        ("plan", "goal", "--to"),
        ("cover", "options.paths[0][1]", "--path[0][1]"),
        ("grow", "seed.qx", "seed.qx"),
        ("grow", "options", "options"),
        ("grow", None, None),
    ],
)
def test_fields_with_places_and_fields_that_are_no_options(command: str, field: str | None, argument: str | None) -> None:
    assert typed(CirisError("code", "text", field=field), leaf(parser(), command)).field == argument


def asked(*arguments: str) -> dict[str, Any]:
    made = argparse.ArgumentParser(allow_abbrev=False)
    add_options(made, GROUPED)
    return request(made.parse_args(arguments), GROUPED)


def test_what_is_not_given_is_not_asked_for() -> None:
    assert asked() == {"options": {}}


def test_every_kind_of_option_is_read() -> None:
    given = asked(
        "--cells=3", "--share=0.25", "--careful", "--name=a=b", "--visit=0,1", "--visit=-1,2", "--old-way", "--rounds=1", "--start=0.5"
    )
    assert given == {
        "options": {
            "cells": 3,
            "share": 0.25,
            "careful": True,
            "names": {"a": "b"},
            "visit": [[0.0, 1.0], [-1.0, 2.0]],
            "old_way": {"max_rounds": 1, "start": [0.5]},
        }
    }
    options = read(Grouped, given["options"], "options")
    assert options.old_way is not None
    assert (options.old_way.max_rounds, options.old_way.how, options.old_way.start) == (1, "soft", (0.5,))
    assert asked("--old-way") == {"options": {"old_way": {}}}


def test_a_member_without_its_group_says_what_to_add() -> None:
    with pytest.raises(CirisError) as caught:
        asked("--rounds", "1")
    assert str(caught.value) == "--rounds: is an option of --old-way (add --old-way)"


def test_an_error_in_a_group_names_the_member() -> None:
    made = argparse.ArgumentParser(allow_abbrev=False)
    add_options(made, GROUPED)
    with pytest.raises(RegionError) as caught:
        read(Grouped, {"old_way": {"max_rounds": 10}}, "options")
    assert str(typed(caught.value, made)) == "--rounds: must be an integer from 0 to 9"
    with pytest.raises(CirisError, match=r"^--rounds: must be an integer from 0 to 9$"):
        asked("--old-way", "--rounds", "10")


def test_options_of_a_job_need_one() -> None:
    for command in ("certify-path", "plan"):
        ends = ("--from=0", "--to=0") if command == "plan" else ()
        parsed = parser().parse_args([command, "slider", *ends, "--priority", "1"])
        with pytest.raises(CirisError, match="is an option of --x"):
            refuse_options(parsed, JOB, "x")


@pytest.mark.usefixtures("scene")
def test_growing_between_two_ends_names_the_end_that_was_typed(ciris: Ciris, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def collides(*_: object) -> None:
        raise RegionError("seed_in_collision", "two bodies overlap", field="options.connect[1]")

    monkeypatch.setattr("client.service.run", collides)
    done = ciris("plan", "slider", "--from", "0", "--to", "0.5", "--regions-only", "--grow", CIRIS_URL=url)
    assert (done.status, done.error) == (2, "--to: two bodies overlap")
