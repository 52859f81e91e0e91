"""These are the page of a region, and the one that has two of them side by side."""

from __future__ import annotations

import math
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.routers import regions
from api.schemas.regions import RegionDetail

router = APIRouter()


@router.get("/regions/{region_id}")
def region_page(request: Request, region_id: str, db: Db) -> Response:
    region = regions.get_region(region_id, db)
    ranges = _ranges(region)
    limits = [_limits(*joint) for joint in zip(*(region.manifest["space"][name] for name in ("q_lower", "q_upper")), ranges, strict=True)]
    alone = [_alone(known) for known in ranges]
    others = [other for other in regions.list_regions(db, scene=region.scene).regions if other.id != region.id]
    context = {"region": region, "manifest": region.manifest, "ranges": ranges, "alone": alone, "limits": limits, "others": others}
    return page(request, "region.html", context)


@router.get("/compare", dependencies=[KNOWN_TO_PAGE])
def compare_page(request: Request, a: str, b: str, db: Db) -> Response:
    """Shows two regions side by side. Joints and pairs are matched by their names, so the scenes may differ."""
    both = [regions.get_region(region, db) for region in (a, b)]
    joints = [dict(zip(one.manifest["space"]["joints"], _ranges(one), strict=True)) for one in both]
    margins = [{(pair["a"], pair["b"]): pair["margin"] for pair in one.manifest["pairs"]} for one in both]
    context = {
        "both": both,
        "least": [min((margin for margin in known.values() if margin is not None), default=None) for known in margins],
        "joints": [(name, [known.get(name) for known in joints]) for name in dict.fromkeys([*joints[0], *joints[1]])],
        "pairs": [(pair, [known.get(pair, "not covered") for known in margins]) for pair in dict.fromkeys([*margins[0], *margins[1]])],
    }
    return page(request, "compare.html", context)


def _ranges(region: RegionDetail) -> list[dict[str, Any] | None]:
    """Returns how far each joint moves in a region; None in one that an earlier checkout stored, whose units are not known."""
    return [region.manifest.get("joint_ranges", {}).get(name) for name in region.manifest["space"]["joints"]]


def _limits(lower: float, upper: float, range_: dict[str, Any] | None) -> dict[str, Any]:
    """Returns a joint's limits, radians or metres, in the unit of its range."""
    unit = range_["unit"] if range_ else ""
    scale = math.degrees(1.0) if unit == "deg" else 1.0
    return {"lower": scale * lower, "upper": scale * upper, "unit": unit}


def _alone(known: dict[str, Any] | None) -> dict[str, Any] | None:
    """Returns how far a joint moves while the others stay at the seed, as ranges are; None where that is not known."""
    ends = None if known is None else known.get("through_seed")
    return None if known is None or ends is None else {"lower": ends[0], "upper": ends[1], "unit": known["unit"]}
