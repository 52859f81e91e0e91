"""This module runs the command as a user types it, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Container

from certifier.errors import CirisError

CIRIS = [sys.executable, "-P", "-m", "client.cli"]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs ``ciris`` with these arguments."""
    return subprocess.run([*CIRIS, *arguments], capture_output=True, text=True, check=False)


def output(done: subprocess.CompletedProcess[str], ok: Container[int] = (0,)) -> str:
    """Returns what the command printed.

    Args:
        ok: the exit statuses that are answers.

    Raises:
        CirisError: ``command_failed``, with the last line on standard error.
    """
    if done.returncode not in ok:
        raise CirisError("command_failed", (done.stderr.strip().splitlines() or ["no word"])[-1].removeprefix("error: "))
    return done.stdout
