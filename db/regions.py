"""Regions are certified polytopes. They are stored as a job reaches them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, TypedDict, Unpack
from uuid import uuid4

import numpy as np
from sqlalchemy import Select, func, or_, select, update
from sqlalchemy.orm import Session, defer

from certifier.errors import CirisError
from certifier.model import StoredRegion
from db import events, jobs, pages, proofs
from db.ids import found
from db.models import IterationRow, JobRow, LibraryRow, RegionRow
from db.pages import Page
from db.session import insert_new

_UNREAD = [defer(column, raiseload=True) for column in (RegionRow.manifest, RegionRow.arrays, RegionRow.box)]


def add(session: Session, job: JobRow, iteration: int, manifest: dict[str, Any], summary: dict[str, Any], proof: bytes) -> RegionRow:
    """Stores a region whose proof has been verified. The caller holds the job's lock.

    Args:
        summary: what lists show of the manifest.
    """
    volume = manifest["volume"]["ellipsoid"]
    d = np.array(manifest["halfspace_offsets"])
    region = RegionRow(
        id=str(uuid4()),
        project=job.project,
        job_id=job.id,
        scene_id=job.scene_id,
        number=changed(session, job.scene_id),
        iteration=iteration,
        guarantee=manifest["guarantee"],
        manifest=manifest,
        arrays={"C": np.array(manifest["halfspace_normals"]), "d": d},
        box={side: np.array(bound) for side, bound in manifest["bounding_box"].items()},
        faces=len(d),
        proof_digest=proofs.put(session, [proof])[proof],
        ellipsoid_volume=volume,
        summary=summary,
    )
    session.add(region)
    session.get_one(IterationRow, (job.id, iteration)).ellipsoid_volume = volume
    session.flush()
    job.region_id = session.scalar(_latest(job.id))
    data = {"region_id": region.id, "iteration": iteration, "guarantee": region.guarantee, "ellipsoid_volume": volume}
    events.emit(session, job, "region", data | summary)
    return region


def get(session: Session, region_id: str) -> RegionRow:
    """Returns the region with this id, or with the only id that begins like this.

    Raises:
        CirisError: region_not_found, or ambiguous_id.
    """
    row = found(session, RegionRow, region_id)
    if row is None:
        hint = "`ciris region ls`, or `regions()` in Python, lists them"
        raise CirisError("region_not_found", f"there is no region {region_id!r}", field="region", hint=hint)
    return row


class Filters(TypedDict, total=False):
    """Says which regions are wanted. A search finds those whose id, or whose job's id, begins with it."""

    scene_id: str | None
    job_id: str | None
    guarantee: str | None
    search: str | None


def page(
    session: Session, *, after: str | None = None, before: str | None = None, limit: int = 100, **filters: Unpack[Filters]
) -> Page[RegionRow]:
    """Returns one page of the regions that match the filters, without their manifests and arrays.

    Args:
        after, before: the ``next`` or the ``previous`` of another page.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, RegionRow, _matching(**filters).options(*_UNREAD), after, limit, before)


def count(session: Session, **filters: Unpack[Filters]) -> int:
    """Returns how many regions match the filters."""
    return session.scalar(_matching(**filters).with_only_columns(func.count(RegionRow.id))) or 0


def _matching(**filters: Unpack[Filters]) -> Select[RegionRow]:
    columns = (RegionRow.scene_id, RegionRow.job_id, RegionRow.guarantee)
    query = select(RegionRow).where(*(column == value for column in columns if (value := filters.get(column.key)) is not None))
    if (search := filters.get("search")) is None:
        return query
    return query.where(or_(*(column.startswith(search, autoescape=True) for column in (RegionRow.id, RegionRow.job_id))))


def of_job(session: Session, job_id: str) -> Sequence[RegionRow]:
    """Returns the job's regions, in the order of their iterations, without their manifests and arrays."""
    return session.scalars(select(RegionRow).where(RegionRow.job_id == job_id).order_by(RegionRow.iteration).options(*_UNREAD)).all()


def shares(session: Session, region_ids: Collection[str]) -> dict[str, float | None]:
    """Returns id -> the share of the proposal that the region keeps, for these regions; None where it has none."""
    rows = session.execute(select(RegionRow.id, RegionRow.summary).where(RegionRow.id.in_(region_ids))) if region_ids else ()
    return {region_id: summary["share"] and summary["share"]["value"] for region_id, summary in rows}


def of_cover(session: Session, job_id: str) -> Sequence[RegionRow]:
    """Returns the regions that a cover has grown, in order, without their manifests and arrays."""
    query = select(RegionRow).join(JobRow, JobRow.id == RegionRow.job_id).where(JobRow.parent_id == job_id)
    return session.scalars(query.order_by(RegionRow.number).options(*_UNREAD)).all()


def grown(session: Session, cover_ids: Sequence[str]) -> dict[str, int]:
    """Returns the id of a cover -> number of certified regions that it has grown, for each of these covers."""
    query = select(JobRow.parent_id, func.count().label("number")).join(RegionRow, RegionRow.job_id == JobRow.id)
    rows = session.execute(query.where(JobRow.parent_id.in_(cover_ids)).group_by(JobRow.parent_id))
    return dict.fromkeys(cover_ids, 0) | {row.parent_id: row.number for row in rows}


def counts(session: Session, scene_ids: Sequence[str]) -> dict[str, int]:
    """Returns scene id -> number of its regions, for each of these scenes."""
    counted = select(RegionRow.scene_id, func.count().label("number")).where(RegionRow.scene_id.in_(scene_ids)).group_by(RegionRow.scene_id)
    return dict.fromkeys(scene_ids, 0) | {row.scene_id: row.number for row in session.execute(counted)}


def version(session: Session, scene_id: str) -> int:
    """Returns how often a region of this scene was added or deleted."""
    return session.scalar(select(LibraryRow.version).where(LibraryRow.scene_id == scene_id)) or 0


def roll(session: Session, scene_id: str) -> tuple[int, list[str]]:
    """Returns the version of a scene's regions, and the ids of the regions that it has, in the order of their numbers."""
    both = select(LibraryRow.version, RegionRow.id).outerjoin(RegionRow, RegionRow.scene_id == LibraryRow.scene_id)
    rows = session.execute(both.where(LibraryRow.scene_id == scene_id).order_by(RegionRow.number)).all()
    return rows[0][0] if rows else 0, [region_id for _, region_id in rows if region_id is not None]


def polytopes(session: Session, ids: Sequence[str]) -> list[StoredRegion]:
    """Returns the half-spaces of these regions, without the manifests, by their numbers; those that are gone are left out."""
    columns = RegionRow.id, RegionRow.guarantee, RegionRow.arrays, RegionRow.box
    rows = session.execute(select(*columns).where(RegionRow.id.in_(ids)).order_by(RegionRow.number))
    return [StoredRegion(row.id, row.guarantee, **row.arrays, **row.box) for row in rows]


def delete(session: Session, region_id: str) -> None:
    """Deletes a region, and its proof file unless another region has it. The job then names its latest remaining region, if any.

    Only a whole id will do.

    Raises:
        CirisError: region_not_found.
    """
    region = get(session, region_id)
    if region.id != region_id:
        raise CirisError("region_not_found", f"there is no region {region_id!r}", field="region", hint="give all of its id to delete it")
    job = jobs.lock(session, region.job_id)
    changed(session, region.scene_id)
    session.delete(region)
    session.flush()
    proofs.drop_unused(session, [region.proof_digest])
    job.region_id = session.scalar(_latest(job.id))


def changed(session: Session, scene_id: str) -> int:
    """Counts a change of the scene's regions and returns the new version. Changes of one scene wait for each other until they commit."""
    insert_new(session, LibraryRow, [{"scene_id": scene_id, "version": 0, "motions": 0}])
    counted = update(LibraryRow).where(LibraryRow.scene_id == scene_id).values(version=LibraryRow.version + 1)
    return session.scalars(counted.returning(LibraryRow.version)).one()


def _latest(job_id: str) -> Select[str]:
    return select(RegionRow.id).where(RegionRow.job_id == job_id).order_by(RegionRow.iteration.desc()).limit(1)
