"""Covers carried out by real worker processes, on both databases: their regions are jobs of their own, and anything may die in between."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from certifier import stored
from certifier.model import Scene
from certifier.pair.collisions import in_collision
from certifier.proof.motion import MotionProof
from certifier.verify.motion import verify_motion
from certifier.verify.region import verify_region
from db import jobs, motions, proofs, regions, scenes, steps
from db.models import JobRow
from db.session import database
from db.states import JOB, unfinished
from planner.cover.options import CoverOptions
from planner.cover.result import said
from planner.cover.state import CoverState
from planner.library import Library, renewed
from planner.membership import locate
from tests.workers.options import grow_box
from tests.workers.service import Service, ended, events_of, eventually, job_of, submit
from tests.workers.turning import late
from workers.app import send_coordinate

pytestmark = pytest.mark.usefixtures("service")

LEFT, RIGHT = (-1.6, -0.6), (1.6, 0.9)
NUMBERS = count(1)


def cover(scene: Scene, seconds: float | None = None, **options: Any) -> str:
    """Commits a cover of the scene with a padding of its own, so that the regions of other tests do not count. Its regions grow quickly."""
    document = CoverOptions.from_document({"cells": 600, "stages": 1, **options}).to_document()
    with database().write() as session:
        row = scenes.add(session, replace(scene, padding=scene.padding + 1e-6 * next(NUMBERS)))
        job, _ = jobs.create(session, kind="cover", scene_id=row.id, options=document, deadline_seconds=seconds)
    send_coordinate(job.id)
    return job.id


def children(job_id: str) -> list[JobRow]:
    with database().read() as session:
        return list(jobs.children(session, job_id))


def known(job_id: str) -> dict[str, Any]:
    with database().read() as session:
        growth = jobs.growth(session, job_id)
        assert growth is not None
        return said(stored.value(CoverState, growth)) or {}


def check_rows(job_id: str) -> None:
    """What must hold of every cover that has ended."""
    job, grown = job_of(job_id), children(job_id)
    assert [child.number for child in grown] == list(range(len(grown)))
    assert all(child.state not in unfinished(JOB) for child in grown)
    assert len({json.dumps(child.options, sort_keys=True) for child in grown}) == len(grown), "nothing is asked for twice"
    events = events_of(job_id)
    assert [event.seq for event in events] == list(range(1, len(events) + 1))
    begun = [event.data["job"] for event in events if event.kind == "child" and event.data["state"] == "queued"]
    assert begun == [child.id for child in grown]
    assert (events[-1].kind, events[-1].data["state"]) == ("job", job.state)
    with database().read() as session:
        assert len(regions.of_cover(session, job_id)) == sum(child.region_id is not None for child in grown), "one region each"
        for region in regions.of_cover(session, job_id):
            verify_region(proofs.get(session, region.proof_digest))


@pytest.mark.slow
def test_regions_come_to_cover_a_scene_and_each_is_proved(planar: Scene) -> None:
    job = ended(cover(planar, coverage=0.75, connected=True))
    assert (job.state, job.outcome, job.error, job.reason) == ("succeeded", "certified", None, "the goals are reached")
    check_rows(job.id)
    found = known(job.id)
    assert found["goals"] is found["connected"] is True
    q = np.random.default_rng(7).uniform(planar.q_lower, planar.q_upper, (20_000, planar.n))
    free = planar.to_s(q)[~in_collision(planar, planar.to_s(q))]
    with database().read() as session:
        stored = regions.of_cover(session, job.id)
        ids = [region.id for region in stored]
        library = renewed(Library(planar.n), lambda: (1, ids), lambda some: regions.polytopes(session, some))
        listed = jobs.page(session, scene_id=job.scene_id).rows
        assert [row.id for row in listed] == [job.id], "its regions' jobs are listed apart"
        assert len(jobs.page(session, parent_id=job.id).rows) == len(children(job.id))
    value = len(np.unique(locate(library, free).point)) / len(free)
    assert abs(value - found["coverage"]["value"]) < 4 * found["coverage"]["stderr"] + 0.01


@pytest.mark.slow
def test_configurations_are_connected(planar: Scene) -> None:
    job = ended(cover(planar, connect=[LEFT, RIGHT]))
    assert (job.state, job.outcome) == ("succeeded", "certified")
    check_rows(job.id)
    assert known(job.id)["connect"] == [0, 0]


@pytest.mark.lengthy
def test_a_proved_motion_connects_what_regions_do_not(planar: Scene) -> None:
    job = ended(cover(planar, connect=[LEFT, RIGHT], regions=1))
    assert (job.state, job.outcome, job.reason) == ("succeeded", "certified", "the goals are reached, by motions where regions do not lead")
    with database().read() as session:
        (motion_id,) = [row.id for row in motions.since(session, job.scene_id, 0)]
        motion = motions.get(session, motion_id)
        statement = verify_motion(MotionProof.from_bytes(proofs.get(session, motion.proof_digest), scenes.load(database(), job.scene_id)))
    assert (motion.arrays["q"][[0, -1]] == [LEFT, RIGHT]).all()
    assert (statement.end, statement.rho) == (1.0, motion.tube)


@pytest.mark.slow
def test_it_goes_on_when_workers_die_between_its_regions(planar: Scene, service: Service) -> None:
    """The process that looks is killed, then the control worker, then all solving processes, when a region has just ended."""
    job_id = cover(planar, coverage=0.7)

    def looking() -> int | None:
        with database().read() as session:
            step = next((step for step in steps.of_job(session, job_id) if step.kind == "scout" and step.state == "running"), None)
        return None if step is None else int((step.worker or "").rsplit(":", 2)[1])

    os.kill(eventually(looking, "somebody looks at the scene"), signal.SIGKILL)
    eventually(lambda: children(job_id), "a region is begun")
    service.kill("control")
    service.start("control")
    eventually(lambda: any(child.state not in unfinished(JOB) for child in children(job_id)), "a region has ended")
    service.kill("solve")
    service.kill("control")
    service.start("solve")
    service.start("control")
    job = ended(job_id)
    assert (job.state, job.outcome) == ("succeeded", "certified")
    check_rows(job_id)


@pytest.mark.lengthy
def test_cancelling_it_ends_what_grows_and_keeps_what_is_certified(planar: Scene) -> None:
    job_id = cover(planar, coverage=1.0)
    eventually(lambda: any(child.region_id for child in children(job_id)), "there is a region")
    with database().write() as session:
        jobs.cancel(session, job_id)
    send_coordinate(job_id)
    job = ended(job_id, seconds=30)
    assert (job.state, job.reason) == ("cancelled", "cancelled")
    check_rows(job_id)
    with database().read() as session:
        assert regions.of_cover(session, job_id)
    with database().write() as session:
        again = jobs.retry(session, job_id)
        jobs.cancel(session, again.id)
    assert (again.kind, again.options, again.parent_id) == ("cover", job.options, None)


@pytest.mark.lengthy
def test_the_deadline_ends_it_and_what_grows(planar: Scene) -> None:
    job_id = cover(planar, seconds=600.0, coverage=1.0)
    eventually(lambda: any(event.kind == "cover" for event in events_of(job_id)), "the cover has looked at the scene")
    began = time.monotonic()
    late(job_id)
    send_coordinate(job_id)
    job = ended(job_id, seconds=40)
    assert time.monotonic() - began < 30
    assert job.reason is not None
    assert job.reason.startswith("the deadline was reached; ")
    assert job.reason.endswith(f"{100 * known(job.id)['coverage']['value']:.4g} % of the free configurations are covered, not 100 %")
    assert job.state == ("succeeded" if any(child.region_id for child in children(job.id)) else "failed")
    check_rows(job.id)


@pytest.mark.lengthy
def test_a_configuration_in_collision_is_refused(planar: Scene) -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(planar.q_lower, planar.q_upper, (500, planar.n))
    inside = q[in_collision(planar, planar.to_s(q))][0]
    job = ended(cover(planar, connect=[LEFT, inside.tolist()]))
    assert (job.state, job.outcome) == ("failed", "error")
    assert job.error is not None
    assert (job.error["code"], job.error["field"]) == ("seed_in_collision", "options.connect[1]")
    assert children(job.id) == []


@pytest.mark.lengthy
def test_a_cover_that_cannot_go_on_says_why(planar: Scene) -> None:
    """Its regions have no time, so none comes of them."""
    job = ended(cover(planar, seeds=[LEFT], coverage=0.5, at_once=1, regions=3, region_seconds=0.01))
    assert (job.state, job.outcome) == ("failed", "inconclusive")
    assert job.error is not None
    assert job.error["code"] == "not_covered"
    assert "no region contains seed[0]" in (job.reason or "")
    assert "seed[0]: the deadline was reached" in (job.reason or "")


@pytest.mark.lengthy
def test_a_grow_job_is_no_part_of_a_cover(planar: Scene) -> None:
    job_id = submit(planar, grow_box(planar.to_s([0.0, 0.0]), 0.05, cells=100))
    assert job_of(job_id).parent_id is None
    ended(job_id)
