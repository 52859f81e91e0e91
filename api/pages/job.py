"""This is the page of a job: its head, which the server writes. What is below it is drawn in the browser."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages import copies
from api.pages.remedies import remedies
from api.pages.rendering import page
from api.routers import jobs, regions, scenes, webhooks
from api.schemas.common import MAX_INT
from api.schemas.jobs import Iteration, Job, PairMatrix
from api.schemas.webhooks import Webhook
from certifier.errors import CirisError
from certifier.model import JointKind
from db import events, pairs
from db import jobs as rows
from db.session import Database
from jobs.registry import KINDS

router = APIRouter()


@router.get("/jobs/{job_id}")
def job_page(request: Request, job_id: str, db: Db) -> Response:
    known = _job(db, job_id)
    with db.read() as session:
        others = [row for row in rows.page(session, scene_id=known["job"].scene).rows if row.id != known["job"].id]
    given = known["job"].id
    python = f'job = service.job("{given}")  # job.state, job.reason, job.region_id'
    copied = copies.one(f"ciris job show {given}", f"/v1/jobs/{given}", python)
    return page(request, "job.html", known | {"others": others, "copied": copied})


@router.get("/jobs/{job_id}/live")
def job_live(request: Request, job_id: str, db: Db) -> Response:
    return page(request, "job_live.html", _job(db, job_id))


def _job(db: Database, job_id: str) -> dict[str, Any]:
    job = jobs.get_job(job_id, db)
    kind, scene = KINDS[job.kind], scenes.get_scene(job.scene, db)
    with db.read() as session:
        note = events.last(session, job.id, events.NOTE)
        begun, result = pairs.begun(session, job.id), kind.result(session, rows.get(session, job.id))
    # Only the last iteration is looked at: a job may have 100 000 results. The matrix is drawn in the browser.
    last = jobs.get_job_pairs(job_id, db, begun - 1, limit=MAX_INT) if begun else None
    return {
        "job": job,
        "kind": kind,
        "result": result,
        "elapsed": elapsed(job),
        "scene": scene,
        "units": ["rad" if joint.kind is JointKind.REVOLUTE else "m" for joint in scene.positions],
        "begun": begun,
        "note": note and note["text"],
        "progress": None if last is None else progress(last),
        "regions": regions.list_regions(db, job=job_id).regions,
        "webhook": _webhook(db, job.id),
        "remedies": remedies(job),
    }


def _webhook(db: Database, job_id: str) -> Webhook | None:
    try:
        return webhooks.get_job_webhook(job_id, db)
    except CirisError as error:
        if error.code != "webhook_not_found":
            raise
        return None


def elapsed(job: Job) -> float | None:
    """Returns the seconds from the job's start to its end, or until now; None before the start."""
    return None if job.started_at is None else ((job.finished_at or datetime.now(UTC)) - job.started_at).total_seconds()


_ORDER = ("certified", "refuted", "not_certifiable", "too_close", "inconclusive", "error", "running", "open", "skipped", "reused")


def _open_cells(number: int) -> str:
    return f"{number} open cell{'' if number == 1 else 's'}"


@dataclass(frozen=True)
class Progress:
    """Says how far the last iteration is.

    Attributes:
        parts: (state, number of pairs), certified first.
        settled: number of pairs that have their outcome or were reused, those of a group each.
        open_cells: what the searches over partitions have left open, in words; None where they left nothing.
    """

    iteration: Iteration
    parts: list[tuple[str, int]]
    settled: int
    total: int
    open_cells: str | None


def progress(matrix: PairMatrix) -> Progress:
    """Returns the progress of the matrix's last iteration."""
    last = matrix.iterations[-1]
    cells = [cell for cell in matrix.cells if cell.iteration == last.index]
    counts, left = Counter[str](), sum(cell.open_cells or 0 for cell in cells)
    for state, pair in [*((cell.state.value, cell.pair) for cell in cells), *(("reused", pair) for pair in last.reused)]:
        counts[state] += 1 + len(last.together.get(pair, ()))
    parts = [(state, counts[state]) for state in _ORDER if counts[state]]
    unsettled = counts["open"] + counts["running"] + counts["skipped"]
    return Progress(last, parts, counts.total() - unsettled, counts.total(), _open_cells(left) if left else None)
