"""The pages as HTML: they work offline, escape what users wrote, and say what the JSON says."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

import dashboard
from api.pages.job import growth_chart, matrix_rows, progress
from api.schemas.jobs import GrowthPoint, Iteration, PairCell, PairMatrix
from api.schemas.scenes import PairInfo
from certifier.jobs.region import Region
from certifier.outcome import Outcome
from db import regions, scenes
from db.session import Database
from db.states import IterationState, PairState
from tests.scenes import slider

ROOT = Path(dashboard.__file__).parent


@pytest.fixture
def paths(client: TestClient, region: str) -> list[str]:
    job = client.get("/v1/jobs").json()["jobs"][0]
    return ["/", "/live", f"/jobs/{job['id']}", f"/jobs/{job['id']}/live", f"/regions/{region}", f"/scenes/{job['scene']}"]


def test_every_page_works_offline_and_under_a_strict_policy(client: TestClient, paths: list[str]) -> None:
    for path in [*paths, "/static/ciris.css", "/static/built/main.js", "/static/icon.svg"]:
        answer = client.get(path)
        assert answer.status_code == 200, path
        assert re.findall(r"(?:src|href|url)\s*[=(]\s*[\"']?(?:https?:)?//", answer.text) == [], path
        if not path.startswith("/static"):
            assert "default-src 'self'" in answer.headers["content-security-policy"]
            assert not re.search(r"<script>|\sstyle=|\son\w+=", answer.text), path


def test_the_pages_are_no_part_of_the_api(client: TestClient, paths: list[str]) -> None:
    assert all(path.startswith(("/v1/", "/healthz", "/readyz", "/metrics")) for path in client.get("/openapi.json").json()["paths"])


def test_names_are_escaped(client: TestClient, database: Database) -> None:
    with database.write() as session:
        row = scenes.add(session, replace(slider(), name="<script>alert(1)</script>"))
    for path in ("/", f"/scenes/{row.id}"):
        text = client.get(path).text
        assert "&lt;script&gt;alert(1)" in text
        assert "<script>alert" not in text


def test_the_job_page_shows_outcomes_regions_and_their_files(client: TestClient, region: str) -> None:
    job = client.get("/v1/jobs").json()["jobs"][0]
    text = client.get(f"/jobs/{job['id']}").text
    assert text.count('class="cell certified"') == 2
    for link in (f"/regions/{region}", f"/v1/regions/{region}/proof", f"/v1/regions/{region}/export?format=json"):
        assert f'href="{link}"' in text
    assert "data-events" not in text, "an ended job is not followed"


def test_the_region_page_shows_the_share_and_the_ranges(client: TestClient, region: str, certified: Region, database: Database) -> None:
    text = client.get(f"/regions/{region}").text
    kept = certified.manifest["share"]
    assert f'{100 * kept["value"]:.3g} <span class="small">± {100 * kept["stderr"]:.1g}</span> %' in text
    assert "from 10000 samples, of which 100 % are collision-free" in text
    assert "-0.3000 to 0.2000 m" in text
    with database.write() as session:
        row = regions.get(session, region)
        turning = {"joint_ranges": {"model/slide": {"lower": -17.2, "upper": 11.5, "unit": "deg"}}}
        row.manifest = row.manifest | turning
    text = client.get(f"/regions/{region}").text
    assert "-17.2° to 11.5°" in text
    assert "-57.3° to 57.3°" in text


def test_the_page_of_a_region_that_was_stored_before_there_were_shares(client: TestClient, region: str, database: Database) -> None:
    with database.write() as session:
        row = regions.get(session, region)
        row.manifest = {name: value for name, value in row.manifest.items() if name not in ("share", "joint_ranges")}
        row.share = None
    text = client.get(f"/regions/{region}").text
    assert "<dt>Share of proposal</dt><dd>\N{EN DASH}</dd>" in text
    assert "samples" not in text
    assert client.get("/v1/regions").json()["regions"][0]["share"] is None


def test_an_empty_service_says_how_to_begin(client: TestClient) -> None:
    assert "ciris grow" in client.get("/").text


NOW = datetime(2026, 1, 1, tzinfo=UTC)


def iteration(index: int, reused: dict[int, int]) -> Iteration:
    return Iteration(
        index=index,
        label="round",
        state=IterationState.RUNNING,
        faces=4,
        ellipsoid_volume=None,
        reused=reused,
        started_at=NOW,
        finished_at=None,
    )


def cell(pair: int, index: int, state: PairState, **values: object) -> PairCell:
    known = dict.fromkeys(("stage", "margin", "seconds", "detail", "worker", "witness_q", "open_cells", "proof")) | values
    return PairCell(iteration=index, pair=pair, parts=1, state=state, **known)  # type: ignore[arg-type]


@pytest.fixture
def matrix() -> PairMatrix:
    return PairMatrix(
        pairs=[PairInfo(index=i, a=f"a{i}", b=f"b{i}") for i in range(3)],
        iterations=[iteration(0, {}), iteration(1, {0: 0})],
        cells=[
            cell(0, 0, PairState.CERTIFIED, seconds=0.5, margin=0.0123, stage="sos"),
            cell(1, 0, PairState.REFUTED, witness_q=[0.5, 1.0]),
            cell(1, 1, PairState.RUNNING),
            cell(2, 1, PairState.OPEN),
        ],
    )


def test_the_matrix_has_a_cell_for_every_pair_and_iteration(matrix: PairMatrix) -> None:
    rows = matrix_rows(matrix)
    assert [[cell.state for cell in row.cells] for row in rows] == [["certified", "reused"], ["refuted", "running"], ["absent", "open"]]
    assert rows[0].cells[0].title == "certified; by sos; 0.5 s; margin at least 12.3 mm"
    assert rows[0].cells[1].title == "certified by the proof of iteration 0"
    assert rows[1].cells[0].title == "refuted; in collision at q = 0.5, 1"


def test_what_a_search_has_left_open_is_said(matrix: PairMatrix) -> None:
    left = [
        cell(1, 1, PairState.TOO_CLOSE, witness_q=[0.5, 1.0], open_cells=4, detail="0.001 m apart"),
        cell(2, 1, PairState.INCONCLUSIVE, open_cells=1),
    ]
    later = matrix.model_copy(update={"cells": [*matrix.cells[:2], *left]})
    rows = matrix_rows(later)
    assert rows[1].cells[1].title == "too close; nearest at q = 0.5, 1; 4 open cells; 0.001 m apart"
    assert rows[2].cells[1].title == "inconclusive; 1 open cell"
    found = progress(later)
    assert found is not None
    assert (found.parts, found.open_cells) == ([("too_close", 1), ("inconclusive", 1), ("reused", 1)], "5 open cells")
    nothing_left = progress(matrix)
    assert nothing_left is not None
    assert nothing_left.open_cells is None


def test_every_state_of_a_pair_has_a_colour_and_a_key() -> None:
    css, page = ((ROOT / name).read_text() for name in ("static/ciris.css", "templates/job_live.html"))
    for outcome in Outcome:
        for selector in (f".badge.{outcome}", f".cell.{outcome}", f".key.{outcome}", f".bar .{outcome}"):
            assert re.search(rf"{re.escape(selector)}\b", css), selector
        assert f'class="key {outcome}"' in page


def test_progress_counts_what_is_settled(matrix: PairMatrix) -> None:
    found = progress(matrix)
    assert found is not None
    assert (found.parts, found.settled, found.total) == ([("running", 1), ("open", 1), ("reused", 1)], 1, 3)
    assert progress(matrix.model_copy(update={"iterations": [], "cells": []})) is None


def test_the_chart_stays_inside_its_frame() -> None:
    points = [GrowthPoint(iteration=i, region="r", ellipsoid_volume=10.0 ** (i - 20), share=i / 10, seconds=float(i)) for i in range(5)]
    chart = growth_chart(points)
    assert chart is not None
    assert all(0 <= x <= chart.width and 0 <= y <= chart.height for x, y, _ in chart.dots)
    assert [y for _, y, _ in chart.dots] == sorted((y for _, y, _ in chart.dots), reverse=True)
    assert chart.dots[3][2] == "iteration 3: 30 % of the proposal after 3.0 s"
    assert growth_chart(points[:1]) is not None
    assert growth_chart([]) is None
