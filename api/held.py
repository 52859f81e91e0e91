"""This module describes what processes hold at this moment: pairs, steps and decisions."""

from __future__ import annotations

from collections.abc import Sequence

from api.schemas.progress import DECIDE, PAIRS, HeldWork
from db.models import JobRow, PairRow, StepRow

SAID = {"propose": "seed"}
"""What the API calls a kind of step, where that is another word."""


def certifying(rows: Sequence[PairRow]) -> list[HeldWork]:
    """Describes pairs that are held, those together that a process has claimed together."""
    claims: dict[str | None, list[PairRow]] = {}
    for row in rows:
        claims.setdefault(row.lease_token, []).append(row)
    return [
        HeldWork(
            job=held[0].job_id,
            process=held[0].worker or "",
            work=PAIRS,
            iteration=held[0].iteration,
            pairs=sorted({row.pair_index for row in held}),
            since=held[0].lease_since,
            until=held[0].lease_until,
        )
        for held in claims.values()
    ]


def doing(step: StepRow) -> HeldWork:
    """Describes a step that is held."""
    return HeldWork(
        job=step.job_id,
        process=step.worker or "",
        work=SAID.get(step.kind, step.kind),
        iteration=None,
        pairs=[],
        since=step.lease_since,
        until=step.lease_until,
    )


def deciding(job: JobRow) -> HeldWork:
    """Describes the decision about a job that somebody is making."""
    return HeldWork(
        job=job.id,
        process=job.coordinator or "",
        work=DECIDE,
        iteration=None,
        pairs=[],
        since=job.coordinator_since,
        until=job.coordinator_until,
    )
