"""This is the page of a region."""

from __future__ import annotations

import math
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import regions

router = APIRouter()


@router.get("/regions/{region_id}")
def region_page(request: Request, region_id: str, db: Db) -> Response:
    region = regions.get_region(region_id, db)
    # Regions that an earlier checkout stored have no ranges, and their units are not known.
    ranges = [region.manifest.get("joint_ranges", {}).get(name) for name in region.manifest["space"]["joints"]]
    limits = [_limits(*joint) for joint in zip(*(region.manifest["space"][name] for name in ("q_lower", "q_upper")), ranges, strict=True)]
    alone = [_alone(known) for known in ranges]
    context = {"region": region, "manifest": region.manifest, "ranges": ranges, "alone": alone, "limits": limits}
    return page(request, "region.html", context)


def _limits(lower: float, upper: float, range_: dict[str, Any] | None) -> dict[str, Any]:
    """Returns a joint's limits, radians or metres, in the unit of its range."""
    unit = range_["unit"] if range_ else ""
    scale = math.degrees(1.0) if unit == "deg" else 1.0
    return {"lower": scale * lower, "upper": scale * upper, "unit": unit}


def _alone(known: dict[str, Any] | None) -> dict[str, Any] | None:
    """Returns how far a joint moves while the others stay at the seed, as ranges are; None where that is not known."""
    ends = None if known is None else known.get("through_seed")
    return None if known is None or ends is None else {"lower": ends[0], "upper": ends[1], "unit": known["unit"]}
