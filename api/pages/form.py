"""This is the page with the form that starts a job. Its fields come from the tables in which the options are written."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from api.pages.rendering import page
from certifier.growth.options import GrowthOptions
from certifier.options import Takes, table
from certifier.seeding.options import Method, SeedOptions
from db.states import JobKind
from planner.cover.options import CoverOptions

router = APIRouter()

PARTS: dict[JobKind, dict[str, tuple[str, type]]] = {
    JobKind.GROW: {"seed": ("First polytope", SeedOptions), "options": ("Growth", GrowthOptions)},
    JobKind.COVER: {"options": ("Cover", CoverOptions)},
}
"""Kind of a job -> place of options in its request -> their title, and the dataclass that has them."""
LISTS = (Takes.POINT, Takes.POINTS, Takes.PATHS)
"""The form has no fields for lists of numbers, nor for the method that needs them."""


@router.get("/new")
def new_job_page(request: Request) -> Response:
    parts = {
        kind: [{"place": place, "title": title, "options": _fields(cls)} for place, (title, cls) in places.items()]
        for kind, places in PARTS.items()
    }
    return page(request, "new.html", {"parts": parts})


def _fields(cls: type) -> list[dict[str, Any]]:
    """Describes the fields of a dataclass' options. The form lets a number reach each bound; the service refuses some bounds."""
    return [
        {
            "name": one.name,
            "takes": one.takes,
            "text": one.described,
            "unit": one.unit,
            "default": one.default if isinstance(one.default, int | float | str) else None,
            "least": one.above if one.least is None else one.least,
            "greatest": one.below if one.greatest is None else one.greatest,
            "choices": [choice for choice in one.choices if choice != Method.POLYTOPE],
            "options": _fields(one.cls) if one.takes is Takes.GROUP and one.cls is not None else [],
        }
        for one in table(cls)
        if one.takes not in LISTS
    ]
