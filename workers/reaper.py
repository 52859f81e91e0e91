"""``python -m workers.reaper`` ends what a supervisor has started, at once, when the supervisor is killed.

It reads lines from standard input, whose other end the supervisor alone holds. Each line has the process groups that run now. When the
lines end, the supervisor is gone, and the groups of the last line are killed. Unlike Linux' signal at the death of a parent, this reaches
the children of children, and works on macOS too.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress


class Reaper:
    """Holds the process that outlives this one for a moment."""

    def __init__(self) -> None:
        command = [sys.executable, "-P", "-m", "workers.reaper"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, text=True, bufsize=1)

    def watch(self, groups: Iterable[int]) -> None:
        """Names the process groups that are to end with this process."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # somebody has killed it
            self._process.stdin.write(" ".join(map(str, groups)) + "\n")

    def close(self) -> None:
        """Ends the watch. Nothing is killed any more."""
        self.watch([])
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait()


def main() -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    groups: list[int] = []
    for line in sys.stdin:
        groups = [int(word) for word in line.split()]
    for group in groups:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(group, signal.SIGKILL)


if __name__ == "__main__":
    main()
