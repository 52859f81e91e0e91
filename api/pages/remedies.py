"""What people may do about a job that has ended is said here."""

from __future__ import annotations

from api.schemas.jobs import Job
from certifier.outcome import DEADLINE, Outcome

MORE_CELLS = 200
"""Cells for a pair of a polytope that one plane for each pair does not certify."""


def remedies(job: Job) -> list[tuple[str, str]]:
    """Returns what people may do about a job that has ended: the text of a link, and the query of the form that it leads to.

    The form is filled in with what the job was asked for, and with what the query gives besides.
    """
    if not job.ended or (job.kind == "grow" and "C" in job.options.get("seed", {})):  # the form has no field for a first polytope
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
