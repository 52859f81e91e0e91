"""Child processes do not outlive their parent."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


def die_with_parent(sig: int = signal.SIGKILL, parent: int | None = None) -> None:
    """Makes the kernel send this process a signal when its parent dies (Linux only; elsewhere nothing happens).

    The signal comes even while native code keeps Python's threads waiting. It comes when the *thread* ends that started the process. It
    ends this process even where a script's background processes inherit that SIGINT is ignored.

    Args:
        sig: 0 for none, which takes back what was asked for before.
        parent: the process that forked this one; if it has died before this call, the signal comes at once. None: do not look.
    """
    if sig not in (0, signal.SIGKILL):
        signal.signal(sig, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, sig)
        if parent is not None and os.getppid() != parent:
            os.kill(os.getpid(), sig)
