"""This is the page of a job."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import jobs, regions, scenes
from api.schemas.jobs import GrowthPoint, Iteration, Job, PairCell, PairMatrix
from api.schemas.scenes import PairInfo
from certifier.verify.decimals import at_least_mm
from db.session import Database
from db.states import JobKind, PairState

_CHART = (600, 150)

router = APIRouter()


@router.get("/jobs/{job_id}")
def job_page(request: Request, job_id: str, db: Db) -> Response:
    return page(request, "job.html", _job(db, job_id))


@router.get("/jobs/{job_id}/live")
def job_live(request: Request, job_id: str, db: Db) -> Response:
    return page(request, "job_live.html", _job(db, job_id))


def _job(db: Database, job_id: str) -> dict[str, Any]:
    job = jobs.get_job(job_id, db)
    matrix = jobs.get_job_pairs(job_id, db)
    curve = jobs.get_job_growth(job_id, db).points
    return {
        "job": job,
        "cover": jobs.get_job_cover(job_id, db) if job.kind is JobKind.COVER else None,
        "elapsed": elapsed(job),
        "scene": scenes.get_scene(job.scene, db),
        "iterations": matrix.iterations,
        "rows": matrix_rows(matrix),
        "progress": progress(matrix),
        "chart": growth_chart(curve),
        "curve": curve,
        "regions": regions.list_regions(db, job=job_id).regions,
    }


def elapsed(job: Job) -> float | None:
    """Returns the seconds from the job's start to its end, or until now; None before the start."""
    return None if job.started_at is None else ((job.finished_at or datetime.now(UTC)) - job.started_at).total_seconds()


@dataclass(frozen=True)
class Cell:
    """A cell is what the matrix shows for one pair in one iteration."""

    state: str
    glyph: str
    title: str


@dataclass(frozen=True)
class Row:
    """A row is a pair and its cells, one for each iteration."""

    pair: PairInfo
    cells: list[Cell]


_GLYPHS = {
    "certified": "✓",
    "refuted": "✗",
    "not_certifiable": "⊘",
    "too_close": "≈",
    "inconclusive": "?",
    "error": "!",
    "running": "◌",
    "open": "·",
    "skipped": "\N{MINUS SIGN}",
    "reused": "↺",
    "absent": "",
}


def matrix_rows(matrix: PairMatrix) -> list[Row]:
    """Returns the rows of the pair matrix. A pair that an iteration has no result for gets a cell that says why."""
    cells = {(cell.pair, cell.iteration): cell for cell in matrix.cells}
    return [Row(pair, [_cell(cells.get((pair.index, it.index)), pair.index, it) for it in matrix.iterations]) for pair in matrix.pairs]


def _cell(cell: PairCell | None, pair: int, iteration: Iteration) -> Cell:
    if cell is None:
        source = iteration.reused.get(pair)
        state = "absent" if source is None else "reused"
        return Cell(state, _GLYPHS[state], "not reached" if source is None else f"certified by the proof of iteration {source}")
    parts = [cell.state.replace("_", " ")]
    if cell.stage:
        parts.append(f"by {cell.stage.replace('_', ' ')}")
    if cell.seconds is not None:
        parts.append(f"{cell.seconds:.3g} s")
    if cell.margin is not None:
        parts.append(f"margin at least {at_least_mm(cell.margin)}")
    if cell.witness_q is not None:
        what = "in collision" if cell.state is PairState.REFUTED else "nearest"
        parts.append(f"{what} at q = " + ", ".join(f"{value:.4g}" for value in cell.witness_q))
    if cell.open_cells:
        parts.append(_open_cells(cell.open_cells))
    if cell.detail:
        parts.append(cell.detail)
    return Cell(cell.state, _GLYPHS[cell.state], "; ".join(parts))


def _open_cells(number: int) -> str:
    return f"{number} open cell{'' if number == 1 else 's'}"


@dataclass(frozen=True)
class Progress:
    """Says how far the last iteration is.

    Attributes:
        parts: (state, number of pairs), certified first.
        settled: number of pairs that have their outcome or were reused.
        open_cells: what the searches over partitions have left open, in words; None where they left nothing.
    """

    iteration: Iteration
    parts: list[tuple[str, int]]
    settled: int
    total: int
    open_cells: str | None


def progress(matrix: PairMatrix) -> Progress | None:
    """Returns the progress of the last iteration; None before the first."""
    if not matrix.iterations:
        return None
    last = matrix.iterations[-1]
    cells = [cell for cell in matrix.cells if cell.iteration == last.index]
    counts, left = Counter(cell.state.value for cell in cells), sum(cell.open_cells or 0 for cell in cells)
    if last.reused:
        counts["reused"] = len(last.reused)
    parts = [(state, counts[state]) for state in _GLYPHS if counts[state]]
    unsettled = counts["open"] + counts["running"] + counts["skipped"]
    return Progress(last, parts, counts.total() - unsettled, counts.total(), _open_cells(left) if left else None)


@dataclass(frozen=True)
class Chart:
    """A chart is a step line in an SVG of ``width`` by ``height`` pixels, from 0 at the bottom to ``top`` at the top."""

    width: int
    height: int
    top: float
    line: str
    dots: list[tuple[float, float, str]]


def growth_chart(curve: list[GrowthPoint]) -> Chart | None:
    """Draws over time how much of the proposal is certified; returns None before the first region, and where no share is known."""
    known = [(point, point.share) for point in curve if point.share is not None]
    if not known:
        return None
    width, height = _CHART
    pad = 10
    end, top = max(point.seconds for point, _ in known) or 1.0, max(share for _, share in known)
    xs = [pad + (width - 2 * pad) * point.seconds / end for point, _ in known]
    ys = [height - pad - (height - 2 * pad) * (share / top if top else 0.0) for _, share in known]
    line = f"M{xs[0]:.1f},{ys[0]:.1f}" + "".join(f"H{x:.1f}V{y:.1f}" for x, y in zip(xs[1:], ys[1:], strict=True))
    labels = [f"iteration {point.iteration}: {100 * share:.3g} % of the proposal after {point.seconds:.1f} s" for point, share in known]
    return Chart(width, height, top, line, list(zip(xs, ys, labels, strict=True)))
