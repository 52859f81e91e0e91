"""These are the list of regions, the page of a region, and the one that has two of them side by side."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from api.access import Db
from api.pages import copies
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.routers import regions, scenes
from api.schemas.regions import RegionDetail, RegionSummary
from certifier.outcome import Guarantee
from db import regions as rows
from db import scenes as known_scenes
from jobs import patterns

ON_A_PAGE = 50

router = APIRouter()


class Chosen(BaseModel):
    """Says which regions somebody wants to see. A form sends an empty text for what nobody has chosen."""

    scene: Annotated[str, Query(max_length=200)] = ""
    guarantee: Guarantee | Literal[""] = ""
    search: Annotated[str, Query(max_length=64, pattern=patterns.ANY)] = ""
    after: Annotated[str, Query(max_length=200)] = ""
    before: Annotated[str, Query(max_length=200)] = ""


@router.get("/regions", dependencies=[KNOWN_TO_PAGE])
def regions_page(request: Request, db: Db, chosen: Annotated[Chosen, Query()]) -> Response:
    """Lists the regions of the project, or those that are like what was chosen.

    Raises:
        CirisError: scene_not_found, or cursor.
    """
    filters = {name: str(value) for name, value in chosen.model_dump(exclude={"after", "before"}).items() if value}
    with db.read() as session:
        wanted: rows.Filters = {
            "scene_id": known_scenes.find(session, chosen.scene) if chosen.scene else None,
            "guarantee": chosen.guarantee or None,
            "search": chosen.search or None,
        }
        found = rows.page(session, after=chosen.after or None, before=chosen.before or None, limit=ON_A_PAGE, **wanted)
        total = rows.count(session, **wanted)
    known = scenes.list_scenes(db, limit=1000).scenes
    context = {
        "regions": [RegionSummary.of(row) for row in found.rows],
        "total": total,
        "chosen": chosen,
        "filtered": bool(filters),
        "guarantees": [*Guarantee],
        "scenes": known,
        "scene_names": {scene.id: scene.name for scene in known},
        "copied": copies.of_regions(filters),
        "older": urlencode(filters | {"after": found.next}) if found.next else None,
        "newer": urlencode(filters | {"before": found.previous}) if found.previous else None,
    }
    return page(request, "regions.html", context)


@router.get("/regions/{region_id}")
def region_page(request: Request, region_id: str, db: Db) -> Response:
    region = regions.get_region(region_id, db)
    ranges = _ranges(region)
    limits = [_limits(*joint) for joint in zip(*(region.manifest["space"][name] for name in ("q_lower", "q_upper")), ranges, strict=True)]
    alone = [_alone(known) for known in ranges]
    others = [other for other in regions.list_regions(db, scene=region.scene).regions if other.id != region.id]
    context = {"region": region, "manifest": region.manifest, "ranges": ranges, "alone": alone, "limits": limits, "others": others}
    python = f'region = service.region("{region.id}")  # region.C, region.d'
    copied = copies.one(f"ciris region show {region.id}", f"/v1/regions/{region.id}", python)
    return page(request, "region.html", context | {"copied": copied})


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
        "copied": copies.of_two("region", (both[0].id, both[1].id)),
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
