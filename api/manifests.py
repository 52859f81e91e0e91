"""A region's manifest as it is served."""

from __future__ import annotations

from certifier.verify import uncovered
from db import scenes
from db.models import Document, RegionRow
from db.session import Database


def manifest(db: Database, row: RegionRow) -> Document:
    """Returns a region's manifest. A region that an earlier version stored does not say what is not covered; its scene does.

    Call it outside of any session: it may open its own.
    """
    if "not_covered" in row.manifest:
        return row.manifest
    return {**row.manifest, "not_covered": uncovered.document(scenes.load(db, row.scene_id))}
