"""These are the dashboard's pages. They fill the templates of dashboard/ with what the functions of the JSON routes return."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles
from fastapi.templating import Jinja2Templates

import dashboard
from api import problems
from api.access import READ, Db
from api.routers import jobs, regions, scenes
from api.schemas.jobs import GrowthPoint, Iteration, Job, PairCell, PairMatrix
from api.schemas.scenes import PairInfo
from certifier.verify.decimals import at_least_mm, at_most_mm
from db.session import Database
from db.states import JobKind, PairState

_ROOT = Path(dashboard.__file__).parent
_CHART = (600, 150)
_SECURITY = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
}

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse, dependencies=[READ])
templates = Jinja2Templates(_ROOT / "templates")
templates.env.filters |= {"at_least_mm": at_least_mm, "at_most_mm": at_most_mm}


def install(app: FastAPI) -> None:
    """Adds the pages and their static files to the application."""
    app.include_router(router)
    app.mount("/static", StaticFiles(directory=_ROOT / "static"), name="static")


def render_problem(request: Request, problem: problems.Problem) -> Response:
    """Answers a browser with an HTML page, and everybody else with problem+json.

    Where a key is needed, a browser that asked for a page is sent to the page for signing in.
    """
    if request.url.path.startswith(("/v1/", "/static/")) or "text/html" not in request.headers.get("accept", ""):
        return problems.as_json(problem)
    if problem.code == "key_needed" and request.method == "GET":
        return RedirectResponse(f"/login?next={quote(request.url.path)}", HTTPStatus.SEE_OTHER)
    return page(request, "problem.html", {"problem": problem}, problem.status)


@router.get("/")
def jobs_page(request: Request, db: Db) -> Response:
    return page(request, "jobs.html", _home(db))


@router.get("/live")
def jobs_live(request: Request, db: Db) -> Response:
    return page(request, "jobs_live.html", _home(db))


@router.get("/jobs/{job_id}")
def job_page(request: Request, job_id: str, db: Db) -> Response:
    return page(request, "job.html", _job(db, job_id))


@router.get("/jobs/{job_id}/live")
def job_live(request: Request, job_id: str, db: Db) -> Response:
    return page(request, "job_live.html", _job(db, job_id))


def _alone(known: dict[str, Any] | None) -> dict[str, Any] | None:
    """Returns how far a joint moves while the others stay at the seed, as ranges are; None where that is not known."""
    ends = None if known is None else known.get("through_seed")
    return None if known is None or ends is None else {"lower": ends[0], "upper": ends[1], "unit": known["unit"]}


@router.get("/regions/{region_id}")
def region_page(request: Request, region_id: str, db: Db) -> Response:
    region = regions.get_region(region_id, db)
    # Regions that an earlier checkout stored have no ranges, and their units are not known.
    ranges = [region.manifest.get("joint_ranges", {}).get(name) for name in region.manifest["space"]["joints"]]
    limits = [_limits(*joint) for joint in zip(*(region.manifest["space"][name] for name in ("q_lower", "q_upper")), ranges, strict=True)]
    alone = [_alone(known) for known in ranges]
    context = {"region": region, "manifest": region.manifest, "ranges": ranges, "alone": alone, "limits": limits}
    return page(request, "region.html", context)


def _limits(lower: float, upper: float, range_: dict[str, Any] | None) -> dict[str, Any]:
    """Returns a joint's limits, radians or metres, in the unit of its range."""
    unit = range_["unit"] if range_ else ""
    scale = math.degrees(1.0) if unit == "deg" else 1.0
    return {"lower": scale * lower, "upper": scale * upper, "unit": unit}


@router.get("/scenes/{scene_id}")
def scene_page(request: Request, scene_id: str, db: Db) -> Response:
    context = {
        "scene": scenes.get_scene(scene_id, db),
        "lint": scenes.get_scene_lint(scene_id, db),
        "pairs": scenes.get_scene_pairs(scene_id, db).pairs,
        "regions": regions.list_regions(db, scene=scene_id).regions,
    }
    return page(request, "scene.html", context)


def page(request: Request, name: str, context: dict[str, Any], status: int = 200) -> Response:
    """Fills in a template of the dashboard. The response's headers forbid the page to load anything from other sites."""
    return templates.TemplateResponse(request, name, context, status_code=status, headers=_SECURITY)


def _home(db: Database) -> dict[str, Any]:
    known = scenes.list_scenes(db).scenes
    return {
        "jobs": jobs.list_jobs(db).jobs,
        "scenes": known,
        "scene_names": {scene.id: scene.name for scene in known},
        "regions": regions.list_regions(db, limit=20).regions,
    }


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
