"""The pages as HTML: they work offline, escape what users wrote, and say what the JSON says."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

import dashboard
from api.pages.job import progress
from api.schemas.jobs import Iteration, PairCell, PairMatrix
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
    return [
        "/",
        "/live",
        "/workers",
        "/workers/live",
        f"/jobs/{job['id']}",
        f"/jobs/{job['id']}/live",
        f"/regions/{region}",
        f"/scenes/{job['scene']}",
    ]


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
    assert 'class="certified" x="0" width="2"' in text
    assert 'data-island="job"' in text
    for link in (f"/regions/{region}", f"/v1/regions/{region}/proof", f"/v1/regions/{region}/export?format=json"):
        assert f'href="{link}"' in text
    assert '"ended": true' in text, "an ended job is not followed"


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
        row.summary = {**row.summary, "share": None}
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
        together={},
        started_at=NOW,
        finished_at=None,
    )


def cell(pair: int, index: int, state: PairState, **values: object) -> PairCell:
    known = (
        dict.fromkeys(("stage", "proved_distance", "margin", "seconds", "detail", "worker", "witness_q", "open_cells", "proof")) | values
    )
    return PairCell(iteration=index, pair=pair, parts=1, state=state, **known)  # type: ignore[arg-type]


@pytest.fixture
def matrix() -> PairMatrix:
    return PairMatrix(
        pairs=[PairInfo(index=i, a=f"a{i}", b=f"b{i}") for i in range(3)],
        iterations=[iteration(0, {}), iteration(1, {0: 0})],
        cells=[
            cell(0, 0, PairState.CERTIFIED, seconds=0.5, proved_distance=0.0123, stage="sos"),
            cell(1, 0, PairState.REFUTED, witness_q=[0.5, 1.0]),
            cell(1, 1, PairState.RUNNING),
            cell(2, 1, PairState.OPEN),
        ],
        next=None,
    )


def test_what_a_search_has_left_open_is_said(matrix: PairMatrix) -> None:
    left = [
        cell(1, 1, PairState.TOO_CLOSE, witness_q=[0.5, 1.0], open_cells=4, detail="0.001 m apart"),
        cell(2, 1, PairState.INCONCLUSIVE, open_cells=1),
    ]
    later = matrix.model_copy(update={"cells": [*matrix.cells[:2], *left]})
    found = progress(later)
    assert (found.parts, found.open_cells) == ([("too_close", 1), ("inconclusive", 1), ("reused", 1)], "5 open cells")
    assert progress(matrix).open_cells is None


def test_every_state_of_a_pair_has_a_colour_and_a_key() -> None:
    css, words = ((ROOT / name).read_text() for name in ("static/ciris.css", "source/job/outcomes.ts"))
    for outcome in Outcome:
        for selector in (f".badge.{outcome}", f".cell.{outcome}", f".key.{outcome}", f".bar .{outcome}"):
            assert re.search(rf"{re.escape(selector)}\b", css), selector
        assert f'name: "{outcome}"' in words


def test_progress_counts_what_is_settled(matrix: PairMatrix) -> None:
    found = progress(matrix)
    assert (found.parts, found.settled, found.total) == ([("running", 1), ("open", 1), ("reused", 1)], 1, 3)
