"""Overlaps of a scene's regions are kept here, so that each pair of regions is compared once.

A region is linked as far as its overlaps with the regions of lower numbers are known. A process that finds more saves it; none has to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.models import LibraryRow, OverlapRow, RegionRow
from db.session import insert_new


@dataclass(frozen=True)
class Overlap:
    """Two regions overlap: the ball in s with this centre, (n,), and radius is inside of both."""

    earlier: str
    later: str
    depth: float
    witness: list[float]


def all_of(session: Session, scene_id: str) -> list[Overlap]:
    """Returns the overlaps of the scene's regions that are known."""
    query = select(OverlapRow).join(RegionRow, RegionRow.id == OverlapRow.later).where(RegionRow.scene_id == scene_id)
    rows = session.scalars(query.order_by(RegionRow.number, OverlapRow.earlier))
    return [Overlap(row.earlier, row.later, row.depth, row.witness) for row in rows]


def numbers(session: Session, scene_id: str) -> dict[str, tuple[int, int]]:
    """Returns for every region of the scene its number and as far as which number it is linked, in the order of the numbers."""
    query = select(RegionRow.id, RegionRow.number, RegionRow.linked).where(RegionRow.scene_id == scene_id)
    return {row.id: (row.number, row.linked) for row in session.execute(query.order_by(RegionRow.number))}


def save(session: Session, scene_id: str, region_id: str, linked: int, found: Sequence[Overlap]) -> None:
    """Saves that a region is linked as far as this number, with the overlaps found. Regions that are gone meanwhile are left out."""
    # Regions are deleted under the same lock, so none of those found here can go before the end of the transaction.
    session.execute(select(LibraryRow.version).where(LibraryRow.scene_id == scene_id).with_for_update())
    there = set(session.scalars(select(RegionRow.id).where(RegionRow.id.in_([region_id, *(overlap.earlier for overlap in found)]))))
    if region_id not in there:
        return
    insert_new(session, OverlapRow, [vars(overlap) for overlap in found if overlap.earlier in there])
    region = session.get_one(RegionRow, region_id)
    region.linked = max(region.linked, linked)
