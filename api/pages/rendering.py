"""The dashboard's templates are filled in here."""

from __future__ import annotations

import math
import re
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fastapi import Request, Response
from fastapi.responses import RedirectResponse
from fastapi.templating import Jinja2Templates

import dashboard
from api import problems
from certifier.verify.decimals import at_least_degrees, at_least_mm, at_most_mm, rounded_down
from db.keys import Scope

ROOT = Path(dashboard.__file__).parent
DOCS = ROOT.parent / "docs"
"""A checkout has the documentation; an image has not."""
_SECURITY = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
}


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def powers(unit: str) -> str:
    """Returns a unit with its powers raised, as people write them: rad^3 m as rad³ m."""
    return re.sub(r"\^(\d+)", lambda power: power[1].translate(_RAISED), unit)


def significant(value: float, digits: int = 3) -> str:
    """Returns a number with this many significant digits, as people write it: 8190, and 1.15 · 10⁻¹² where it is far from 1."""
    text, _, exponent = f"{value:.{digits}g}".partition("e")
    if not exponent:
        return text
    power = int(exponent)
    return f"{float(f'{text}e{power}'):.0f}" if 0 < power < 6 else f"{text} · 10{str(power).translate(_RAISED)}"


_STAGES = {"given": "the given polytope", "box": "a box around the seed", "cells": "cell by cell"}


def stage(label: str) -> str:
    """Returns the label of an iteration in words; the other labels are terms of the papers."""
    return _STAGES.get(label, label)


_KINDS = {"certify-path": "certify a motion", "certify": "certify a polytope", "recertify": "certify a region again"}


def kind_in_words(kind: str) -> str:
    """Returns what a kind of job does, in the words of the form; the other kinds are such words."""
    return _KINDS.get(kind, kind)


_WORK = {
    "decide": "deciding what comes next",
    "seed": "looking for a starting region",
    "step": "moving the faces of a region",
    "accept": "putting a proof together and verifying it",
    "scout": "looking at what is covered",
    "move": "looking for motions between regions",
    "motion": "certifying a motion",
    "map": "choosing which cells of a map to prove",
    "piece": "proving cells of a map",
}


def work_in_words(work: str) -> str:
    """Returns what a process does that certifies no pairs, by the API's word for it."""
    return _WORK.get(work, work)


_MEANINGS = {
    "certified": "The bodies are apart, and the verifier has accepted the proof.",
    "refuted": "Bodies touch, at a configuration that is shown.",
    "not_certifiable": "It is proved that no certificate of this kind exists. The bodies may still be apart.",
    "too_close": "The bodies are so close that no plane was found between them.",
    "inconclusive": "The search ended without an answer.",
    "error": "It could not be computed.",
    "exact": "The verifier has checked every proof in exact arithmetic.",
    "numeric": "Proofs were found, and not checked in exact arithmetic.",
    "sampled": "Samples say so. Nothing is proved.",
    "none": "Nothing is proved.",
}


def meaning(word: str) -> str:
    """Returns what an outcome or a guarantee means, in a sentence; empty for another word."""
    return _MEANINGS.get(word, "")


@cache
def docs() -> list[str]:
    """Returns the names of the pages of the documentation that are here, such as ``scenes``."""
    return sorted(path.stem for path in DOCS.glob("*.md"))


templates = Jinja2Templates(ROOT / "templates")
templates.env.globals["docs"] = docs
templates.env.filters |= {
    "at_least_degrees": at_least_degrees,
    "at_least_mm": at_least_mm,
    "at_most_mm": at_most_mm,
    "degrees": math.degrees,
    "kind_in_words": kind_in_words,
    "meaning": meaning,
    "powers": powers,
    "radians": math.radians,
    "rounded_down": rounded_down,
    "significant": significant,
    "stage": stage,
    "work_in_words": work_in_words,
}


def page(request: Request, name: str, context: dict[str, Any], status: int = 200) -> Response:
    """Fills in a template of the dashboard. The response's headers forbid the page to load anything from other sites.

    Templates offer what needs the scope ``submit`` only where ``may_start`` says so.
    """
    caller = getattr(request.state, "caller", None)
    context = context | {"may_start": caller is None or caller.scope.includes(Scope.SUBMIT)}
    return templates.TemplateResponse(request, name, context, status_code=status, headers=_SECURITY)


def render_problem(request: Request, problem: problems.Problem) -> Response:
    """Answers a browser with an HTML page, and everybody else with problem+json.

    Where a key is needed, a browser that asked for a page is sent to the page for signing in.
    """
    if request.url.path.startswith(("/v1/", "/static/")) or "text/html" not in request.headers.get("accept", ""):
        return problems.as_json(problem)
    if problem.code == "key_needed" and request.method == "GET":
        wanted = request.url.path + (f"?{request.url.query}" if request.url.query else "")
        return RedirectResponse(f"/login?next={quote(wanted)}", HTTPStatus.SEE_OTHER)
    return page(request, "problem.html", {"problem": problem}, problem.status)
