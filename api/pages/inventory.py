"""This is the page of those who run the service: what it is made of, and what every project uses."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Request, Response

from api.access import Operator, WholeDb
from api.pages import copies
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.probes import Asked, Probes
from api.routers.inventory import Order, Sorted, get_inventory
from api.schemas.common import NameCursor
from db.session import Database

router = APIRouter()

COPIES = copies.one("ciris project ls", "/v1/inventory", "print(service.client.projects())")


@router.get("/inventory", dependencies=[KNOWN_TO_PAGE])
async def inventory_page(
    request: Request, caller: Operator, db: WholeDb, probes: Asked, sort: Sorted = Order.NAME, after: NameCursor = None
) -> Response:
    return page(request, "inventory.html", await _inventory(caller, db, probes, sort, after) | {"copied": COPIES})


@router.get("/inventory/live", dependencies=[KNOWN_TO_PAGE])
async def inventory_live(
    request: Request, caller: Operator, db: WholeDb, probes: Asked, sort: Sorted = Order.NAME, after: NameCursor = None
) -> Response:
    return page(request, "inventory_live.html", await _inventory(caller, db, probes, sort, after))


async def _inventory(caller: Operator, db: Database, probes: Probes, sort: Order, after: str | None) -> dict[str, Any]:
    """Returns what the page shows.

    Raises:
        CirisError: cursor.
    """
    found = await get_inventory(caller, db, probes, sort, after)
    chosen = {} if sort == Order.NAME else {"sort": sort.value}
    here = chosen | ({} if after is None else {"after": after})
    following = None if found.next is None else urlencode(chosen | {"after": found.next})
    return {"found": found, "sort": sort, "query": urlencode(here), "next": following, "after": after}
