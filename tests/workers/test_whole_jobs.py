"""Jobs that are certified cell by cell, round by round, by calls in this process, on both databases."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from sqlalchemy import func, select, update

from certifier.model import Scene
from certifier.outcome import Outcome
from db import jobs, pairs
from db.models import IterationRow, PairRow, SubtreesRow
from db.session import database
from db.settings import settings
from db.types import utcnow
from tests.scenes import slider
from tests.workers.options import box_around
from tests.workers.record import check_record
from tests.workers.service import environment, job_of, pairs_of, submit
from tests.workers.turning import WHOLE, work_all
from workers.turns import coordinate

pytestmark = pytest.mark.usefixtures("here")


def in_the_way() -> Scene:
    """A slider whose first post stands in its way, 0.4 m from where they touch at s = 0; the other is far off."""
    free = slider(posts=2)
    cart, post, other = free.geometries
    return replace(free, geometries=(cart, replace(post, vertices=np.array([[0.6, 0.0, 0.0]])), other))


def left_of(job_id: str, *, outlines: bool = False) -> dict[int, int]:
    """Pair index -> the last iteration whose subtrees, or outlines, are kept."""
    with database().read() as session:
        columns = (SubtreesRow.pair_index, SubtreesRow.iteration)
        kept = SubtreesRow.outline.is_not(None) if outlines else func.length(SubtreesRow.data) > 0
        rows = session.execute(select(*columns).where(SubtreesRow.job_id == job_id, kept).order_by(SubtreesRow.iteration))
        return {row.pair_index: row.iteration for row in rows}


@pytest.mark.lengthy
def test_a_whole_job_keeps_what_its_last_round_left_and_nothing_in_the_end() -> None:
    job_id = submit(in_the_way(), WHOLE)
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    rounds = 0
    while any(row.state == "open" for row in pairs_of(job_id)):
        work_all()
        last = pairs_of(job_id)[-1].iteration
        failed = {row.pair_index for row in pairs_of(job_id) if row.iteration == last and row.state != "certified"}
        assert {pair: iteration for pair, iteration in left_of(job_id).items() if iteration == last} == dict.fromkeys(failed, last)
        assert {row.pair_index for row in pairs_of(job_id) if row.weakness} == failed
        rounds += bool(failed)
        coordinate(job_id)
        assert not any(row.weakness for row in pairs_of(job_id))
        following = {row.pair_index for row in pairs_of(job_id) if row.state == "open"}
        assert not following or set(left_of(job_id)) <= following, "what is certified is not gone on with"
    assert rounds >= 1
    rows = pairs_of(job_id)
    assert {row.state for row in rows} >= {"certified", "refuted"}
    proving = [row for row in rows if row.state == "refuted" or (row.state == "certified" and row.part == 0)]
    assert all((row.proof_digest is not None) == (row in proving) for row in rows)
    assert all((row.open_cells is None) == (row.state == "certified") for row in rows)
    work_all()
    coordinate(job_id)
    assert (job_of(job_id).state, left_of(job_id), left_of(job_id, outlines=True)) == ("succeeded", {}, {})
    check_record(job_id)


@pytest.mark.lengthy
def test_a_whole_job_that_is_cancelled_leaves_outlines_alone() -> None:
    job_id = begun_whole_job()
    before = left_of(job_id, outlines=True)
    assert before
    with database().write() as session:
        jobs.cancel(session, job_id)
    coordinate(job_id)
    assert (job_of(job_id).state, left_of(job_id), left_of(job_id, outlines=True)) == ("cancelled", {}, before)


@pytest.mark.lengthy
def test_a_whole_job_ends_at_its_deadline_with_its_best_region() -> None:
    job_id = submit(in_the_way(), WHOLE)
    while not any(row.label == "cells" and row.state == "certified" for row in iterations_of(job_id)):
        coordinate(job_id)
        work_all()
    coordinate(job_id)
    assert job_of(job_id).state == "running"
    with database().write() as session:
        jobs.lock(session, job_id).deadline_at = utcnow() - timedelta(seconds=1)
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, job.outcome, job.reason) == ("succeeded", Outcome.CERTIFIED, "the deadline was reached")
    assert job.region_id is not None


@pytest.mark.lengthy
def test_a_whole_job_ends_when_nothing_is_known_of_a_failure() -> None:
    """There is nothing to cut off for a pair that kills its process, so another round would end as this one."""
    job_id = begun_whole_job()
    with database().write() as session:
        session.execute(update(PairRow).where(PairRow.state == "open").values(deaths=3))
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, (job.error or {})["code"]) == ("failed", "worker_lost")


def test_pairs_that_are_certified_cell_by_cell_need_not_fit_the_forecast() -> None:
    with environment(CIRIS_PAIR_MEMORY_BYTES="1000", CIRIS_DATABASE_URL=settings().database, CIRIS_REDIS_URL=settings().redis_url):
        job_ids = [submit(slider(), options) for options in (box_around([0.0], 0.1), {**box_around([0.0], 0.1), "cells": 20})]
        for job_id in job_ids:
            coordinate(job_id)
        assert [job_of(job_id).state for job_id in job_ids] == ["failed", "running"]


@pytest.mark.lengthy
@pytest.mark.parametrize(("upper", "outcome"), [(0.3, "certified"), (0.3999, "too_close"), (0.45, "refuted")])
def test_a_polytope_is_decided_cell_by_cell(upper: float, outcome: str) -> None:
    """The slider touches the post at s = 0.4."""
    job_id = submit(in_the_way(), {"kind": "certify", "seed": {"C": [[1.0], [-1.0]], "d": [upper, 0.9]}, "cells": 300})
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    first, second = pairs_of(job_id)
    assert (first.state, first.stage, second.state) == (outcome, "cells", "certified")
    job = job_of(job_id)
    assert (job.state, job.outcome, job.region_id is not None) == ("succeeded", outcome, outcome == "certified")
    assert left_of(job_id) == {}
    if outcome == "certified":
        assert first.witness_s is None
    else:
        (s,) = first.witness_s or []
        assert (s >= 0.4 - 1e-6) == (outcome == "refuted")
        assert s <= upper
    if outcome == "too_close":
        assert f"are {1000 * (0.4 - s):.3g} mm apart" in (first.detail or "")


def begun_whole_job() -> str:
    """A job whose first round has left a partition; its second round is open."""
    job_id = submit(in_the_way(), WHOLE)
    for _ in range(2):
        coordinate(job_id)
        work_all()
    coordinate(job_id)
    assert left_of(job_id) == {0: 0}
    assert any(row.state == "open" for row in pairs_of(job_id))
    return job_id


def iterations_of(job_id: str) -> list[IterationRow]:
    with database().read() as session:
        return list(pairs.iterations(session, job_id))
