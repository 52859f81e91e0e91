"""A job as data: what has become of it, and why it has no region."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from certifier.errors import CirisError
from certifier.outcome import Outcome
from ciris.documents import SHORT, Document


@dataclass(frozen=True, repr=False)
class JobData:
    """A job as it was when the service was asked."""

    id: str
    kind: str
    """``grow``, ``recertify``, ``certify``, ``certify-path``, ``cover`` or ``map``."""
    scene: str
    """Id of the scene."""
    state: str
    """``queued``, ``running``, ``succeeded``, ``failed``, ``cancelled`` and others."""
    outcome: Outcome | None
    """Of the polytope or the motion asked for; None before the job has ended."""
    reason: str | None
    """A sentence that says why the job ended."""
    error: Document | None
    """What was wrong (code, message, field, hint) when the job failed."""
    region_id: str | None
    """Id of the last certified region."""
    created_at: datetime
    ended: bool

    def __repr__(self) -> str:
        return f"Job({self.id[:SHORT]}: {self.kind}, {self.state}{f', {self.reason}' if self.reason else ''})"


def why_no_region(job: Document) -> CirisError:
    """Returns the error that says why an ended job has no result."""
    if job["error"]:
        return CirisError.from_document(job["error"])
    hint = f"`ciris job show {job['id'][:8]}`, or `obstacles` of the job in Python, tells more"
    if job["state"] == "succeeded":
        return CirisError("no_region", f"the job has ended without a region; its outcome is {job['outcome']}", hint=hint)
    reason = job["reason"] or f"the job is {job['state']}"
    return CirisError(f"job_{job['state']}", reason, hint=hint)
