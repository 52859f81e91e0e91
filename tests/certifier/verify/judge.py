"""The verifier's answer about a file of a stranger, as a child process gives it that says how much memory it took."""

from __future__ import annotations

import resource
from typing import Any

from certifier.verify.file import answer_about_file


def judge(payload: dict[str, Any]) -> dict[str, Any]:
    """The answer about the file at ``path``, and the child's peak memory in bytes."""
    return {"answer": answer_about_file(payload), "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}
