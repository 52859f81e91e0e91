"""This is the page with the form that starts a job. Its fields come from the tables in which the options are written."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import scenes
from certifier.options import Takes, table
from certifier.seeding.options import Method
from jobs.certify_path import CertifyPath, GivenMotion
from jobs.registry import KINDS

router = APIRouter()

LISTS = (Takes.POINT, Takes.POINTS, Takes.PATHS)
"""The form has no fields for lists of numbers, nor for the method that needs them."""

_LABELS = {
    "epsilon": "Share in collision",
    "delta": "Probability of more",
    "max_iterations": "Rounds of IRIS",
    "max_iterations_separating_planes": "Rounds of faces",
    "margin": "Distance to collisions",
    "tries": "Starting regions to try",
    "paper": "The papers' algorithm",
}
"""What the page calls an option whose name says little to who has not read IRIS, or is the glossary's for something else."""

OF_MOTIONS = (("clearance", Takes.FLAG), ("tube", Takes.FLAG), ("padding", Takes.REAL))
"""What may be asked for of a motion."""


def _in_words(name: str) -> str:
    """Returns an option's name as people read it: ``max_rounds`` as "Max rounds"."""
    return name.capitalize().replace("_", " ")


def _plain(text: str) -> str:
    """Returns what an option means in the page's word for the polytope with which growth begins."""
    return text.replace("first polytope", "starting region").replace("proposal", "starting region")


@router.get("/new")
def new_job_page(request: Request, db: Db) -> Response:
    parts = {
        kind.name: [{"place": place, "title": title, "options": _fields(cls)} for place, (title, cls) in kind.forms.items()]
        for kind in KINDS.values()
    }
    parts[CertifyPath.name] = [{"place": "", "title": "Motion", "options": [_of_motion(*one) for one in OF_MOTIONS]}]
    return page(request, "new.html", {"parts": parts, "empty": not scenes.list_scenes(db, limit=1).scenes})


def _of_motion(name: str, takes: Takes) -> dict[str, Any]:
    """Describes a field of the request for a motion."""
    known = GivenMotion.model_fields[name]
    described = {
        "name": name,
        "label": _in_words(name),
        "takes": takes,
        "text": known.description,
        "default": known.default,
        "argument": name,
    }
    return {**described, "unit": "", "least": 0.0 if takes is Takes.REAL else None, "greatest": None, "choices": [], "options": []}


def _fields(cls: type) -> list[dict[str, Any]]:
    """Describes the fields of a dataclass' options. The form lets a number reach each bound; the service refuses some bounds."""
    return [
        {
            "name": one.name,
            "label": _LABELS.get(one.name, _in_words(one.name)),
            "takes": one.takes,
            "text": _plain(one.described),
            "argument": one.argument,
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
