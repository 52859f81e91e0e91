"""These are the messages to users when the service itself fails; its log says what happened."""

from __future__ import annotations

from certifier.errors import CirisError
from certifier.outcome import DEADLINE

LOST = "its process died {deaths} times (killed, crashed, out of memory or over the time limit) in {attempts} attempts at"
ON_LOSS = "give the workers more memory or time, or ask for less"
IN_LOG = "try again; the service's log has the details"


def not_begun() -> CirisError:
    """Returns the error of a job whose deadline came first. It ends with nothing, and that is no result."""
    hint = "`ciris worker ls` and /readyz say whether workers run and the queue answers; retry it, or give it longer"
    return CirisError("not_begun", f"{DEADLINE} before a worker had done anything", field="deadline_seconds", hint=hint)
