"""Jobs carried out by real worker processes on a real queue, on both databases."""

from __future__ import annotations

import os
import signal
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select

from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.model import Scene
from certifier.verify.region import verify_region
from db import jobs, pairs, proofs, regions
from db.models import IterationRow, PairRow, SubtreesRow
from db.session import database
from db.settings import settings
from tests.certifier.scenes import beads
from tests.workers.options import box_around, grow_box
from tests.workers.record import check_record
from tests.workers.service import Service, ended, events_of, eventually, holder, kill_holder, pairs_of, submit
from workers.app import send_coordinate

pytestmark = pytest.mark.usefixtures("service")
SEED = [0.0, 0.0]
SAME = ("halfspace_normals", "halfspace_offsets", "interior_point", "inscribed_ellipsoid", "share", "joint_ranges", "archimedean")


@pytest.mark.lengthy
@pytest.mark.parametrize("paper", [None, {}, {"contraction": "uniform", "bisection_steps": 2}], ids=["by cells", "targeted", "uniform"])
def test_a_region_grows_as_it_does_without_the_service_and_its_proof_holds(planar: Scene, paper: dict[str, Any] | None) -> None:
    more = {"cells": 600} if paper is None else {"paper": {"pushes": 1, "max_rounds": 1, **paper}}
    options = grow_box(planar.to_s(SEED), 0.22, **more)
    job = ended(submit(planar, options))
    assert (job.state, job.outcome, job.error) == ("succeeded", "certified", None)
    with database().read() as session:
        region = regions.get(session, job.region_id or "")
        proof = proofs.get(session, region.proof_digest)
        volumes = {row.index: row.ellipsoid_volume for row in pairs.iterations(session, job.id) if row.ellipsoid_volume}
    statement = verify_region(proof)
    alone = grow(planar, GrowthOptions.from_document(options)).manifest
    assert (region.arrays["C"].tolist(), region.arrays["d"].tolist()) == (alone["halfspace_normals"], alone["halfspace_offsets"])
    assert region.manifest["share"] == region.summary["share"] == alone["share"]
    assert certified_pairs(region.manifest) == certified_pairs(alone)
    assert region.manifest["joint_ranges"] == alone["joint_ranges"]
    assert region.manifest["provenance"]["proposal"] == alone["provenance"]["proposal"]
    curves = ([(p["iteration"], p["share"]) for p in manifest["provenance"]["growth_curve"]] for manifest in (region.manifest, alone))
    assert next(curves) == next(curves)
    assert len(statement.gaps) == len(planar.pairs)
    assert np.all(region.arrays["C"] @ planar.to_s(SEED) <= region.arrays["d"])
    assert region.manifest["guarantee"] == region.guarantee == "exact"
    assert region.ellipsoid_volume == volumes[max(volumes)]
    assert 0 < region.manifest["provenance"]["pair_seconds"] < 1.001 * sum(row.seconds or 0 for row in pairs_of(job.id))
    assert 0 < alone["provenance"]["seeding_seconds"] + alone["provenance"]["pair_seconds"] < alone["provenance"]["seconds"]
    events = events_of(job.id)
    assert [event.seq for event in events] == list(range(1, len(events) + 1))
    assert (events[0].data["state"], events[-1].data["state"]) == ("queued", "succeeded")
    assert {"iteration", "pairs", "step", "region"} < {event.kind for event in events}


@pytest.mark.lengthy
def test_pairs_that_are_certified_as_one_come_to_the_same_region_as_without_the_service() -> None:
    scene, options = beads(), grow_box(SEED, 0.3, cells=600)
    job = ended(submit(scene, options))
    with database().read() as session:
        region = regions.get(session, job.region_id or "")
        iterations = pairs.iterations(session, job.id)
    assert {str(row.together) for row in iterations} == {str({"0": [1, 2, 3], "4": [5, 6, 7]})}
    assert {row.pair_index for row in pairs_of(job.id)} == {0, 4}
    alone = grow(scene, GrowthOptions.from_document(options)).manifest
    assert all(region.manifest[name] == alone[name] for name in SAME)
    assert certified_pairs(region.manifest) == certified_pairs(alone)


def certified_pairs(manifest: dict[str, Any]) -> list[tuple[Any, ...]]:
    return [tuple(pair[name] for name in ("a", "b", "outcome", "margin", "proof_digest")) for pair in manifest["pairs"]]


@pytest.mark.slow
def test_a_whole_region_is_the_same_when_workers_die_between_its_rounds(planar: Scene, service: Service) -> None:
    """What a dead process had begun is gone on with from where the round before left it."""
    options = grow_box(planar.to_s(SEED), 0.4, cells=600)
    job_id = submit(planar, options)

    def goes_on() -> PairRow | None:
        with database().read() as session:
            rows = session.scalars(select(IterationRow).where(IterationRow.job_id == job_id))
            begun = {row.index for row in rows if row.action["begun"]}
        return next((row for row in pairs_of(job_id) if row.state == "running" and row.iteration in begun), None)

    killed = eventually(goes_on, "a pair is gone on with")
    os.kill(holder(killed), signal.SIGKILL)
    eventually(lambda: any(row.iteration > killed.iteration for row in pairs_of(job_id)), "the next round begins")
    service.kill("solve")
    service.start("solve")
    job = ended(job_id)
    check_record(job_id)
    again = next(row for row in pairs_of(job_id) if row.id == killed.id)
    assert again.attempts == 2
    with database().read() as session:
        manifest = regions.get(session, job.region_id or "").manifest
        assert session.scalars(select(SubtreesRow.pair_index).where(SubtreesRow.job_id == job_id)).all() == []
    alone = grow(planar, GrowthOptions.from_document(options)).manifest
    assert {name: manifest[name] for name in SAME} == {name: alone[name] for name in SAME}
    assert certified_pairs(manifest) == certified_pairs(alone)


@pytest.mark.lengthy
def test_the_workers_say_that_they_are_alive() -> None:
    file = settings().heartbeat_file
    assert file is not None
    eventually(file.exists, "the file is made")
    since = file.stat().st_mtime
    eventually(lambda: file.stat().st_mtime > since, "the file is touched again")


def test_a_given_polytope_gets_a_verdict_for_every_pair(planar: Scene) -> None:
    job = ended(submit(planar, box_around(planar.to_s(SEED), 10.0)))
    rows = pairs_of(job.id)
    assert (job.state, job.outcome, job.region_id) == ("succeeded", "refuted", None)
    assert len(rows) == len(planar.pairs)
    refuted = next(row for row in rows if row.state == "refuted")
    assert refuted.witness_s is not None
    assert len(refuted.witness_s) == planar.n


def test_a_job_ends_the_same_when_a_solving_process_is_killed(arm: tuple[Scene, np.ndarray]) -> None:
    scene, s = arm
    job_id = submit(scene, box_around(s, 0.01))
    kill_holder(job_id, index=1, attempt=1)
    job = ended(job_id)
    assert (job.state, job.outcome) == ("succeeded", "certified")
    rows = pairs_of(job_id)
    assert rows[1].attempts == 2
    assert all(row.state == "certified" for row in rows)
    assert sum(event.kind == "region" for event in events_of(job_id)) == 1


def test_cancel_stops_the_work_at_once(arm: tuple[Scene, np.ndarray]) -> None:
    scene, s = arm
    job_id = submit(scene, box_around(s, 0.011))
    eventually(lambda: any(row.state == "running" for row in pairs_of(job_id)), "a pair is running")
    with database().write() as session:
        jobs.cancel(session, job_id)
    send_coordinate(job_id)
    assert ended(job_id).state == "cancelled"
    assert {row.state for row in pairs_of(job_id)} <= {"certified", "skipped"}
    assert any(row.state == "skipped" for row in pairs_of(job_id))
