"""The kinds of job, one object each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from certifier.growth.actions import Finish
from certifier.outcome import Outcome
from jobs.registry import KINDS

TEMPLATES = Path(__file__).parents[2] / "dashboard" / "templates"


@pytest.mark.parametrize("name", KINDS)
def test_a_kind_has_its_request_and_its_part_of_the_page(name: str) -> None:
    kind = KINDS[name]
    field = kind.request.model_fields["kind"]
    assert (kind.name, field.annotation.__args__) == (name, (name,))  # type: ignore[union-attr]
    assert (TEMPLATES / kind.template).is_file()
    assert type(kind).__doc__


CAUSE: dict[str, Any] = {"code": "cause", "message": "it failed", "field": None, "hint": ""}


@pytest.mark.parametrize(
    ("kind", "outcome", "succeeds"),
    [
        ("grow", Outcome.CERTIFIED, True),
        ("grow", Outcome.REFUTED, False),
        ("grow", Outcome.INCONCLUSIVE, False),
        ("recertify", Outcome.REFUTED, False),
        ("certify", Outcome.CERTIFIED, True),
        ("certify", Outcome.REFUTED, True),
        ("certify", Outcome.NOT_CERTIFIABLE, True),
        ("certify", Outcome.ERROR, False),
        ("certify-path", Outcome.CERTIFIED, True),
        ("certify-path", Outcome.TOO_CLOSE, True),
        ("certify-path", Outcome.ERROR, False),
    ],
)
def test_how_a_job_ends(kind: str, outcome: Outcome, succeeds: bool) -> None:
    finish = Finish(outcome, "because")
    assert KINDS[kind].failure(finish, CAUSE) == (None if succeeds else CAUSE)


@pytest.mark.parametrize("outcome", [Outcome.CERTIFIED, Outcome.INCONCLUSIVE])
def test_a_cover_fails_only_where_something_went_wrong(outcome: Outcome) -> None:
    finish = Finish(outcome, "because")
    assert (KINDS["cover"].failure(finish, None), KINDS["cover"].failure(finish, CAUSE)) == (None, CAUSE)


@pytest.mark.parametrize(
    ("reason", "code", "hint"),
    [
        ("the deadline was reached", "not_grown", "allow more time"),
        ("a and b touch", "not_grown", "try another seed, or look at the pair named"),
        ("revoked: a and b touch", "revoked", "grow a region of the new scene from another seed"),
    ],
)
def test_a_growth_in_vain_says_what_to_do(reason: str, code: str, hint: str) -> None:
    error = KINDS["grow"].failure(Finish(Outcome.INCONCLUSIVE, reason), None)
    assert error == {"code": code, "message": reason, "field": None, "hint": hint}
