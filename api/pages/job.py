"""This is the page of a job: its head, which the server writes. What is below it is drawn in the browser."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import jobs, regions, scenes, webhooks
from api.schemas.common import MAX_INT
from api.schemas.jobs import Iteration, Job, PairMatrix
from api.schemas.webhooks import Webhook
from certifier.errors import CirisError
from certifier.model import JointKind
from certifier.outcome import DEADLINE, Outcome
from certifier.seeding.options import Method
from db import events, pairs
from db import jobs as rows
from db.session import Database
from jobs.registry import KINDS

router = APIRouter()


@router.get("/jobs/{job_id}")
def job_page(request: Request, job_id: str, db: Db) -> Response:
    return page(request, "job.html", _job(db, job_id))


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


MORE_CELLS = 200
"""Cells for a pair of a polytope that one plane for each pair does not certify."""


def remedies(job: Job) -> list[tuple[str, str]]:
    """Returns what people may do about a job that has ended: the text of a link, and the query of the form that it leads to.

    The form is filled in with what the job was asked for, and with what the query gives besides.
    """
    if not job.ended or job.options.get("seed", {}).get("method") == Method.POLYTOPE:  # the form has no field for a first polytope
        return []
    found, query = [], f"from={job.id}"
    said = (job.error or {}).get("message") or job.reason or ""
    if job.deadline_at is not None and said.startswith(DEADLINE):
        minutes = (job.deadline_at - job.created_at).total_seconds() / 60
        found.append(("Allow twice the time", f"{query}&minutes={2 * minutes:.6g}"))
    if (job.error or {}).get("code") == "seed_in_collision":
        found.append(("Move the configuration", query))
    if job.kind == "certify" and job.outcome in (Outcome.INCONCLUSIVE, Outcome.NOT_CERTIFIABLE) and job.options.get("cells") == 1:
        found.append(("Cut it into cells", f"{query}&cells={MORE_CELLS}"))
    return [*found, ("Edit and run again", query)]


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
