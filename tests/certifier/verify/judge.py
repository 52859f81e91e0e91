"""The verifier's answer about a file of a stranger, as a child process gives it that says how much memory it took."""

from __future__ import annotations

import base64
import resource
from typing import Any

from certifier.verify.file import answer


def judge(payload: dict[str, Any]) -> dict[str, Any]:
    """The answer about ``proof``, in base 64, and the child's peak memory in bytes."""
    found = answer(base64.b64decode(payload["proof"]))
    return {"answer": found, "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}
