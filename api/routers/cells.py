"""These routes show how the pairs of regions and jobs are proved: by which proof, and over which cells."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request
from pydantic import FiniteFloat

from api import cells, checks
from api.access import READ, Db
from api.cells import OutlinesKept
from api.delivery import unchanging
from api.reading import ReadingRoute
from api.schemas.cells import Partition, RegionPairs, SeparatingPlane
from api.schemas.common import JobGiven, OfIteration, PairGiven, RegionGiven
from db import jobs, regions, scenes

router = APIRouter(prefix="/v1", dependencies=[READ], route_class=ReadingRoute)


async def _outlines(request: Request) -> OutlinesKept:
    kept: OutlinesKept = request.app.state.outlines
    return kept


Outlines = Annotated[OutlinesKept, Depends(_outlines)]
AtQ = Annotated[
    list[FiniteFloat],
    Query(min_length=1, max_length=64, description="The configuration: `q` once for each joint, in order, in radians or metres."),
]


@router.get("/regions/{region_id}/pairs", tags=["regions"])
@unchanging
def get_region_pairs(region_id: RegionGiven, db: Db, outlines: Outlines) -> RegionPairs:
    """Returns how each pair of a region is proved: by one plane or over how many cells, how far apart at least, and with which pairs."""
    with db.read() as session:
        region = regions.get(session, region_id)
    scene = scenes.load(db, region.scene_id)
    return RegionPairs(pairs=cells.of_region(scene, region, outlines.of(db, region.proof_digest, scene)))


@router.get("/regions/{region_id}/pairs/{pair}/cells", tags=["regions"])
@unchanging
def get_region_cells(region_id: RegionGiven, pair: PairGiven, db: Db, outlines: Outlines) -> Partition:
    """Returns the cells over which a pair of a region is proved; one cell where one plane serves on all of the region."""
    with db.read() as session:
        region = regions.get(session, region_id)
    scene = scenes.load(db, region.scene_id)
    cells.numbered(scene, pair)
    return cells.of_region_pair(scene, region, outlines.of(db, region.proof_digest, scene), pair)


@router.get("/regions/{region_id}/pairs/{pair}/plane", tags=["regions"])
def get_region_plane(region_id: RegionGiven, pair: PairGiven, q: AtQ, db: Db, outlines: Outlines) -> SeparatingPlane:
    """Returns the plane that separates a pair of a region in the cell of its proof that holds a configuration of the region."""
    with db.read() as session:
        region = regions.get(session, region_id)
    scene = scenes.load(db, region.scene_id)
    cells.numbered(scene, pair)
    return cells.plane_at(db, outlines, scene, region, pair, checks.point(scene, q, "q"))


@router.get("/jobs/{job_id}/pairs/{pair}/cells", tags=["jobs"])
def get_job_cells(job_id: JobGiven, pair: PairGiven, db: Db, outlines: Outlines, iteration: OfIteration = None) -> Partition:
    """Returns the cells of a pair as a job has left them in an iteration, or in its last one, proved and open.

    Where the pair's proof of an earlier iteration serves, these are its cells. A job that has ended keeps the cells of the pairs that it
    has not certified.
    """
    with db.read() as session:
        job = jobs.get(session, job_id)
    scene = scenes.load(db, job.scene_id)
    cells.numbered(scene, pair)
    return cells.of_job_pair(db, outlines, scene, job.id, pair, iteration)
