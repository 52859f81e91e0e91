"""These routes list regions, show their manifests, hand out and check their proofs, export them and delete them."""

from __future__ import annotations

import base64
import time
from enum import StrEnum
from typing import Annotated

from fastapi import APIRouter, Query, Response, status

from api import exports
from api.access import READ, Admin, Db
from api.children import Children
from api.delivery import unchanging
from api.manifests import manifest
from api.reading import ReadingRoute
from api.schemas.common import MAX_INT, Cursor, Listed, OfScene, RegionGiven
from api.schemas.drawing import MAX_SAMPLES, Extreme, RegionConfigurations
from api.schemas.regions import RegionDetail, RegionPage, RegionSummary, Verification
from api.writing import writing
from certifier.errors import CirisError
from certifier.isolation.child import run_in_child
from certifier.isolation.confinement import Confinement
from certifier.names import ALPHABET, escaped, is_name
from db import audit, jobs, proofs, regions, scenes
from db.audit import Action
from db.session import Database
from db.settings import settings

router = APIRouter(prefix="/v1/regions", tags=["regions"], dependencies=[READ], route_class=ReadingRoute)


class ExportFormat(StrEnum):
    """Names the format in which a region is exported."""

    JSON = "json"
    """The region's manifest."""
    NPZ = "npz"
    """The arrays of the region, C, d, center and the ellipsoid, for NumPy."""
    DRAKE_YAML = "drake-yaml"
    """Drake's IrisRegions, in tangent-space coordinates s, for Drake's LoadIrisRegionsYamlFile."""


Format = Annotated[ExportFormat, Query(description="The format of the file.")]
RegionName = Annotated[str | None, Query(max_length=255, description="What the region is called in the file; default: its id.")]


@router.get("")
def list_regions(
    db: Db,
    scene: OfScene = None,
    job: Annotated[str | None, Query(max_length=64, description="List only the regions that this job has grown.")] = None,
    after: Cursor = None,
    limit: Listed = 100,
) -> RegionPage:
    """Lists the certified regions, newest first.

    `scene` and `job` keep only the regions of that scene and of that job.
    """
    with db.read() as session:
        scene_id = scenes.find(session, scene) if scene else None
        job_id = jobs.get(session, job).id if job else None
        page = regions.page(session, scene_id=scene_id, job_id=job_id, after=after, limit=limit)
    return RegionPage(regions=[RegionSummary.of(row) for row in page.rows], next=page.next)


@router.get("/{region_id}")
@unchanging
def get_region(region_id: RegionGiven, db: Db) -> RegionDetail:
    """Returns one region with its manifest."""
    with db.read() as session:
        row = regions.get(session, region_id)
    return RegionDetail.whole(row, manifest(db, row))


@router.get("/{region_id}/configurations")
async def get_region_configurations(
    region_id: RegionGiven,
    db: Db,
    children: Children,
    samples: Annotated[int, Query(ge=0, le=MAX_SAMPLES, description="Number of samples.")] = 100,
    seed: Annotated[int, Query(ge=0, le=MAX_INT, description="Seed of the random choices.")] = 0,
) -> RegionConfigurations:
    """Returns configurations of a region: its centre, its seed, where each joint is as far as it can be, and samples."""
    return await children.run(_configurations, db, region_id, samples, seed)


def _configurations(db: Database, region_id: str, samples: int, seed: int) -> RegionConfigurations:
    with db.read() as session:
        row = regions.get(session, region_id)
    scene, limits = scenes.load(db, row.scene_id), settings()
    region = {"C": row.arrays["C"], "d": row.arrays["d"], "q_star": scene.q_star, "revolute": scene.revolute}
    payload = region | {"count": samples, "seed": seed}
    found = run_in_child(
        "certifier.polytopes.tour:answer", payload, timeout_s=limits.verify_timeout_seconds, memory_bytes=limits.child_memory_bytes
    )
    ends = zip(scene.moving, scene.to_q(found["lower"]).tolist(), scene.to_q(found["upper"]).tolist(), strict=True)
    return RegionConfigurations(
        center=scene.to_q(row.manifest["inscribed_ellipsoid"]["center"]).tolist(),
        seed=row.manifest["seed"],
        extremes=[Extreme(joint=joint.name, unit=joint.unit, lower=lower, upper=upper) for joint, lower, upper in ends],
        samples=scene.to_q(found["samples"]).tolist(),
    )


@router.get("/{region_id}/proof", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
@unchanging
def download_region_proof(region_id: RegionGiven, db: Db) -> Response:
    """Returns the region's proof file, which `ciris verify` checks offline."""
    with db.read() as session:
        digest = regions.get(session, region_id).proof_digest
        data = proofs.get(session, digest)
    return _download(data, f"{region_id}.proof", "application/octet-stream", etag=digest)


@router.post("/{region_id}/verify")
async def verify_region(region_id: RegionGiven, db: Db, children: Children) -> Verification:
    """Checks the region's whole stored proof again and returns what it proves, in plain words.

    A process of its own, with limits on time and memory, does the check.
    """
    return await children.run(_verify, db, region_id)


def _verify(db: Database, region_id: str) -> Verification:
    with db.read() as session:
        row = regions.get(session, region_id)
        payload = {
            "proof": base64.b64encode(proofs.get(session, row.proof_digest)).decode(),
            "scene_hash": row.manifest["scene"]["hash"],
            **row.arrays,
        }
    limits = settings()
    began = time.perf_counter()
    found = run_in_child(
        "certifier.verify.file:answer_about_region",
        payload,
        timeout_s=limits.verify_timeout_seconds,
        memory_bytes=limits.child_memory_bytes,
        confinement=Confinement(None, strange=True),
    )
    return Verification(region=region_id, seconds=time.perf_counter() - began, **found)


@router.get(
    "/{region_id}/export", response_class=Response, responses={200: {"content": {kind: {} for kind in exports.MEDIA_TYPES.values()}}}
)
@unchanging
def export_region(region_id: RegionGiven, db: Db, format: Format = ExportFormat.JSON, name: RegionName = None) -> Response:
    """Returns the region as a file for other programs.

    `json` is the manifest. `npz` holds arrays in s for NumPy: C, d, center and the ellipsoid. `drake-yaml` holds Drake's IrisRegions in s,
    which LoadIrisRegionsYamlFile reads. `name` is what the region is called in the file; without it, that is its id.
    """
    if name is not None and not is_name(name):
        raise CirisError("bad_name", f"{escaped(name)!r} cannot be a region's name", field="name", hint=f"give {ALPHABET}")
    with db.read() as session:
        row = regions.get(session, region_id)
    data, suffix = exports.WRITERS[format](manifest(db, row), row.arrays, name or row.id)
    return _download(data, f"{region_id}.{suffix}", exports.MEDIA_TYPES[format])


@router.delete("/{region_id}", status_code=status.HTTP_204_NO_CONTENT)
@writing
def delete_region(region_id: RegionGiven, caller: Admin, db: Db) -> None:
    """Deletes a region, and its proof file unless another region has the same."""
    with db.write() as session:
        regions.delete(session, region_id)
        audit.note(session, caller.project, str(caller), Action.REGION_DELETED, region_id)


def _download(data: bytes, filename: str, media_type: str, etag: str | None = None) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="{filename}"'}
    return Response(data, media_type=media_type, headers=headers | ({"ETag": f'"{etag}"'} if etag else {}))
