"""This is the page of the workers: what each of them does, and buttons for those who may ask something of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db, Reader
from api.pages import copies
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.routers import workers
from api.schemas.common import Cursor
from api.schemas.workers import Worker
from db.states import WorkerState

router = APIRouter()

COPIES = copies.one("ciris worker ls", "/v1/workers", "print(service.client.workers())")


@router.get("/workers", dependencies=[KNOWN_TO_PAGE])
def workers_page(request: Request, caller: Reader, db: Db, after: Cursor = None) -> Response:
    return page(request, "workers.html", _crew(caller, db, after) | {"copied": COPIES})


@router.get("/workers/live", dependencies=[KNOWN_TO_PAGE])
def workers_live(request: Request, caller: Reader, db: Db, after: Cursor = None) -> Response:
    return page(request, "workers_live.html", _crew(caller, db, after))


def _crew(caller: Reader, db: Db, after: str | None) -> dict[str, Any]:
    found = workers.list_workers(db, after)
    last = _last(one for one in found.workers if one.wanted == WorkerState.RUNNING)
    context = {"last": last, "last_of_all": last | _last(one for one in found.workers if one.wanted != WorkerState.DRAINING)}
    return {
        "workers": found.workers,
        "missing": found.missing,
        **context,
        "next": found.next,
        "after": after,
        "may_ask": caller.runs_service,
    }


def _last(workers: Iterable[Worker]) -> set[str]:
    """Returns the ids of the workers that are the only one of their kind."""
    alike: dict[str, list[str]] = {}
    for one in workers:
        alike.setdefault(one.kind, []).append(one.id)
    return {ids[0] for ids in alike.values() if len(ids) == 1}
