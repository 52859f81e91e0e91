"""What a job's rows and events must look like once it has ended, whatever happened on the way."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from sqlalchemy import select

from certifier.verify.region import verify_region
from db import jobs, pairs, proofs, regions, scenes, steps
from db.models import RegionRow
from db.session import database
from db.states import IterationState, PairState, StepState
from tests.db.builders import all_pairs
from tests.workers.service import events_of

SETTLED = set(PairState) - {PairState.OPEN, PairState.RUNNING, PairState.SKIPPED}


def check_record(job_id: str) -> None:
    """Nothing is unfinished, lost, or done twice, and the events say the same as the rows."""
    with database().read() as session:
        job = jobs.get(session, job_id)
        rows, iterations, did = all_pairs(session, job_id), pairs.iterations(session, job_id), steps.of_job(session, job_id)
        stored = session.scalars(select(RegionRow).where(RegionRow.job_id == job_id)).all()
        scene_pairs = len(scenes.get(session, job.scene_id).document["pairs"])
    events = events_of(job_id)
    assert [event.seq for event in events] == list(range(1, len(events) + 1))
    assert [event.data["state"] for event in events if event.kind == "job"] == ["queued", "running", job.state]

    told = Counter(
        (event.data["iteration"], pair["index"], pair["part"]) for event in events if event.kind == "pairs" for pair in event.data["pairs"]
    )
    assert told == Counter({(row.iteration, row.pair_index, row.part) for row in rows if row.state in SETTLED})
    assert {row.state for row in rows} <= SETTLED | {PairState.SKIPPED}
    for iteration in iterations:
        mine = [row for row in rows if row.iteration == iteration.index]
        assert {row.pair_index for row in mine} | {int(index) for index in iteration.reuse} == set(range(scene_pairs))
        parts = {str(pair): count for pair, count in Counter(row.pair_index for row in mine).items() if count > 1}
        assert parts == iteration.parts
        certified = all(row.state == PairState.CERTIFIED for row in mine)
        assert iteration.state == (IterationState.CERTIFIED if certified else IterationState.FAILED)
    assert all((row.proof_digest is None) == (row.part > 0) for row in rows if row.state == PairState.CERTIFIED)

    done = Counter(step.kind for step in did if step.state == StepState.DONE)
    assert Counter(event.data["kind"] for event in events if event.kind == "step" and event.data["state"] == "done") == done
    assert {step.state for step in did} <= {StepState.DONE, StepState.SKIPPED}, [step.report for step in did]
    assert sorted(event.data["region_id"] for event in events if event.kind == "region") == sorted(region.id for region in stored)
    assert len(stored) == done["accept"]


def region_of(job_id: str) -> dict[str, Any]:
    """What is certified, without when and by whom; the proof is verified once more."""
    with database().read() as session:
        region = regions.get(session, jobs.get(session, job_id).region_id or "")
        statement = verify_region(proofs.get(session, region.proof_digest))
    manifest = region.manifest
    assert len(statement.gaps) == len(manifest["pairs"])
    assert np.array_equal(region.arrays["C"], manifest["halfspace_normals"])
    kept = ("scene", "space", "halfspace_normals", "halfspace_offsets", "interior_point", "inscribed_ellipsoid", "volume", "guarantee")
    return {name: manifest[name] for name in kept} | {"pairs": [(pair["a"], pair["b"], pair["outcome"]) for pair in manifest["pairs"]]}
