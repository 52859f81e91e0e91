"""This is the page with the list of jobs."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from api.access import Db
from api.pages import copies
from api.pages.job import elapsed
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.routers import regions, scenes
from api.routers.jobs import described
from api.schemas.jobs import JobKind
from certifier.outcome import Outcome
from db import jobs, keys
from db import scenes as known_scenes
from db.regions import grown
from db.session import Database
from db.states import JobState
from jobs import patterns
from jobs.registry import KINDS

ENDED = {"active": False, "ended": True}
"""Groups of states that people ask for, and whether their jobs have ended."""

router = APIRouter()


class Chosen(BaseModel):
    """Says which jobs somebody wants to see. A form sends an empty text for what nobody has chosen."""

    state: JobState | Literal["active", "ended", ""] = ""
    kind: JobKind | Literal[""] = ""
    outcome: Outcome | Literal[""] = ""
    scene: Annotated[str, Query(max_length=200)] = ""
    key: Annotated[str, Query(max_length=200)] = ""
    search: Annotated[str, Query(max_length=200, pattern=patterns.ANY)] = ""
    after: Annotated[str, Query(max_length=200)] = ""
    before: Annotated[str, Query(max_length=200)] = ""


@router.get("/", dependencies=[KNOWN_TO_PAGE])
def jobs_page(request: Request, db: Db, chosen: Annotated[Chosen, Query()]) -> Response:
    return page(request, "jobs.html", _home(db, chosen) | {"copied": _copies(chosen)})


@router.get("/live", dependencies=[KNOWN_TO_PAGE])
def jobs_live(request: Request, db: Db, chosen: Annotated[Chosen, Query()]) -> Response:
    return page(request, "jobs_live.html", _home(db, chosen))


def _copies(chosen: Chosen) -> copies.Copies:
    """Describes the list for others, by the names that the interface has for what was chosen."""
    filters = {name: str(value) for name, value in chosen.model_dump(exclude={"after", "before"}).items() if value}
    if chosen.state in ENDED:
        filters["ended"] = str(ENDED[filters.pop("state")]).lower()
    if re.fullmatch(patterns.LABEL, chosen.search):
        filters["label"] = filters.pop("search")
    return copies.of_jobs(filters)


def _home(db: Database, chosen: Chosen) -> dict[str, Any]:
    """Returns what the list shows.

    Raises:
        CirisError: scene_not_found, key_not_found, or cursor.
    """
    filters = {name: str(value) for name, value in chosen.model_dump(exclude={"after", "before"}).items() if value}
    with db.read() as session:
        wanted: jobs.Filters = {
            "state": None if chosen.state in ENDED else chosen.state or None,
            "ended": ENDED.get(chosen.state),
            "kind": chosen.kind or None,
            "outcome": chosen.outcome or None,
            "scene_id": known_scenes.find(session, chosen.scene) if chosen.scene else None,
            "key_id": keys.named(session, chosen.key) if chosen.key else None,
        }
        if re.fullmatch(patterns.LABEL, chosen.search):
            name, _, value = chosen.search.partition("=")
            wanted["given_labels"] = {name: value}
        else:
            wanted["search"] = chosen.search or None
        found = jobs.page(session, after=chosen.after or None, before=chosen.before or None, **wanted)
        total = jobs.count(session, **wanted)
        numbers = grown(session, [row.id for row in found.rows if KINDS[row.kind].makes_jobs])
        key_names = keys.names(session)
    known = scenes.list_scenes(db, limit=1000).scenes
    here = {name: value for name in ("after", "before") if (value := getattr(chosen, name))}
    return {
        "jobs": [(job, elapsed(job)) for job in described(db, found.rows)],
        "total": total,
        "grown": numbers,
        "chosen": chosen,
        "filtered": bool(filters),
        "query": urlencode(filters | here),
        "older": urlencode(filters | {"after": found.next}) if found.next else None,
        "newer": urlencode(filters | {"before": found.previous}) if found.previous else None,
        "states": [*ENDED, *JobState],
        "kinds": KINDS,
        "outcomes": [*Outcome],
        "keys": key_names,
        "scenes": known,
        "scene_names": {scene.id: scene.name for scene in known},
        "regions": regions.list_regions(db, limit=10).regions if not filters and not here else [],
    }
