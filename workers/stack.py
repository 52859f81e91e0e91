"""The embedded stack of ``ciris up`` runs the queue, the API and the workers as supervised child processes on one machine.

Its data directory is for its user alone (mode 0700) and holds:

- ``ciris.sqlite3``, unless a database is given;
- ``queue.sock``; the queue itself is in memory, since the database has all open work;
- ``logs/``;
- ``secret.key``, with which secrets in the database are encrypted, unless a key is given;
- ``stack.json``, which says where the API is while the stack runs;
- ``stack.lock``, which the stack holds while it runs.

Nothing that cannot be written there ends the stack. It goes on without, and writes it when there is room.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import logging
import os
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import FrameType
from typing import IO

from certifier.errors import CirisError
from certifier.orphans import die_with_parent
from db import keys, leases, logs, migrate, unusable, workers
from db.disk import Disk, lacks_room
from db.session import UNAVAILABLE, Database
from db.settings import Settings, chosen
from db.states import WorkerState
from db.vault import kept_key
from workers.processes import queue_server_command, queue_url
from workers.reaper import Reaper

log = logging.getLogger(__name__)

QUEUE = "queue"
"""The queue is stopped last, so that the workers can give their messages back."""
SOCKET = "queue.sock"
LOCK = "stack.lock"
MAX_SOCKET_PATH = 100
POLL_SECONDS = 0.2
MAX_BACKOFF_SECONDS = 30.0
HEALTHY_SECONDS = 30.0
"""A child that has run for this many seconds is started again without waiting when it dies."""
COMPILES = "the solvers get ready: they compile, which takes some minutes, once"
START_SECONDS = 60.0
STOP_SECONDS = 8.0


@dataclass
class Child:
    """Holds one supervised process. It has a session of its own, so that Ctrl-C reaches only the supervisor.

    Attributes:
        may_end: True for a worker. Its status 0 says that somebody has drained it, and then it is not started again.
        own: environment variables of this child alone.
    """

    name: str
    command: list[str]
    stop_signal: int
    may_end: bool = False
    own: dict[str, str] = field(default_factory=dict)
    process: subprocess.Popen[bytes] | None = None
    started: float = 0.0
    backoff: float = 0.0

    def start(self, environment: dict[str, str], logs: Path) -> None:
        """Starts the process, with a log of its own, or where that cannot be opened with the supervisor's standard error."""
        supervisor = os.getpid()
        with ExitStack() as stack:
            output: IO[bytes] | None = None
            try:
                output = stack.enter_context((logs / f"{self.name}.log").open("ab"))
            except OSError as error:
                log.warning("the log of %s cannot be opened (%s); its lines come here", self.name, error.strerror)
            self.process = subprocess.Popen(
                self.command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env={**environment, **self.own},
                start_new_session=True,
                preexec_fn=partial(self._prepare, supervisor),
            )
        self.started = time.monotonic()

    def _prepare(self, supervisor: int) -> None:
        """Runs in the child before it becomes its program."""
        signal.signal(self.stop_signal, signal.SIG_DFL)  # a script's background processes inherit that SIGINT is ignored
        # Without the supervisor there is no queue that a worker could give its messages back to, and Celery would wait for it.
        die_with_parent(parent=supervisor)

    @property
    def dead(self) -> bool:
        return self.process is None or self.process.poll() is not None

    @property
    def drained(self) -> bool:
        return self.may_end and self.process is not None and self.process.poll() == os.EX_OK

    def wait_longer(self) -> bool:
        """Says whether it is too early to start the dead child again. The waits double while it keeps dying young."""
        ran = time.monotonic() - self.started
        if self.process is not None:
            log.warning("%s ended with status %s", self.name, self.process.returncode)
            self.backoff = 0.0 if ran > HEALTHY_SECONDS else min(MAX_BACKOFF_SECONDS, max(1.0, 2 * self.backoff))
            self.process = None
        return ran < self.backoff

    def ask_to_stop(self) -> None:
        if self.process is not None:
            with suppress(ProcessLookupError):
                self.process.send_signal(self.stop_signal)

    def wait_or_kill(self) -> None:
        """Waits for the child, and kills the rest of its group."""
        if self.process is None:
            return
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(STOP_SECONDS)
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def run_stack(
    settings: Settings,
    *,
    port: int | None = None,
    ready: Callable[[str], None] = lambda url: None,
    note: Callable[[str], None] = lambda text: None,
) -> None:
    """Runs the stack until SIGINT or SIGTERM. It must be called in the main thread.

    Args:
        port: the API's port; None takes the setting's port, or any free one when that is taken.
        ready: called once with the API's URL, when the API answers and the solve worker takes work.
        note: called with a sentence that says why that takes long, where it does.

    Raises:
        CirisError: data_directory, no_room, stack_running, port_taken, no_keys, or stack_failed when the API does not come up.
    """
    data = settings.data_dir.expanduser().absolute()
    with _data_directory(data), _stop_signals() as stopping, _socket_directory(data) as sockets, _reserved_port(settings, port) as bound:
        host = f"[{settings.host}]" if settings.family == socket.AF_INET6 else settings.host
        url = f"http://{host}:{bound}"
        children = _children(settings, data, sockets / SOCKET)
        _migrate(settings)
        environment = _environment(settings, data, sockets / SOCKET, bound)
        keys.check_bind(settings)
        reaper = Reaper()
        try:
            for child in children:
                child.start(environment, data / "logs")
                reaper.watch(_groups(children))
            _describe(data, url, children)
            if _wait_until_healthy(url, stopping, data) and _wait_for_solver(children, settings, stopping, note):
                ready(url)
            _supervise(children, environment, data, url, reaper, stopping)
        finally:
            _stop([child for child in children if child.name != QUEUE])
            _stop([child for child in children if child.name == QUEUE])
            reaper.close()
            with suppress(OSError):  # the disk is read-only; clients find nobody there
                (data / "stack.json").unlink(missing_ok=True)


def _migrate(settings: Settings) -> None:
    try:
        migrate.upgrade(settings.database)
    except unusable.ERRORS as error:
        if not lacks_room(error):
            raise unusable.refusal(error, settings.database) from None
        problem = f"the database in {settings.data_dir} cannot be written: the disk is full or read-only"
        raise CirisError("no_room", problem, field="--data", hint="free some room there") from None


def _groups(children: list[Child]) -> list[int]:
    return [child.process.pid for child in children if child.process is not None]


def _children(settings: Settings, data: Path, queue_socket: Path) -> list[Child]:
    """Returns the child processes, in the order of starting."""
    children = [
        Child("control", [sys.executable, "-P", "-m", "workers", "control"], signal.SIGQUIT, may_end=True),
        Child("solve", [sys.executable, "-P", "-m", "workers", "solve", "--background"], signal.SIGQUIT, may_end=True),
    ]
    for name in ["api", *(f"api-{i}" for i in range(2, settings.api_processes + 1))]:
        counts = {"CIRIS_REQUESTS_FILE": str(data / "requests" / name)}
        children.append(Child(name, [sys.executable, "-P", "-m", "api"], signal.SIGTERM, own=counts))
    if not settings.redis_url:
        children.insert(0, Child(QUEUE, queue_server_command(queue_socket), signal.SIGTERM))
    return children


def _environment(settings: Settings, data: Path, queue_socket: Path, port: int) -> dict[str, str]:
    return {
        **os.environ,
        "CIRIS_DATA_DIR": str(data),
        "CIRIS_PORT": str(port),
        "CIRIS_DATABASE_URL": settings.database,
        "CIRIS_REDIS_URL": settings.redis_url or queue_url(queue_socket),
        "CIRIS_SECRET_KEY": settings.secret_key or kept_key(data / "secret.key"),
    }


def _supervise(
    children: list[Child], environment: dict[str, str], data: Path, url: str, reaper: Reaper, stopping: Callable[[], bool]
) -> None:
    disk, trouble, described = Disk(data), "", True
    while not stopping():
        for child in children:
            if child.dead and not child.drained and not child.wait_longer():
                log.warning("starting %s again", child.name)
                child.start(environment, data / "logs")
                reaper.watch(_groups(children))
                described = False
        described = described or _describe(data, url, children)
        if (found := disk.trouble()) != trouble:
            if found and not trouble:
                log.warning("nothing new is begun: %s", found)
            elif not found:
                log.warning("there is room again, and work goes on")
            trouble = found
        time.sleep(POLL_SECONDS)


def _stop(children: list[Child]) -> None:
    for child in children:
        child.ask_to_stop()
    for child in children:
        child.wait_or_kill()


def _describe(data: Path, url: str, children: list[Child]) -> bool:
    """Writes stack.json, so that clients find the API. Returns False where it cannot be written now."""
    pids = {child.name: child.process.pid for child in children if child.process is not None}
    document = {"url": url, "pid": os.getpid(), "pids": pids, "started_at": datetime.now(UTC).isoformat()}
    partial_file = data / "stack.json.partial"
    try:
        partial_file.write_text(json.dumps(document))
        partial_file.replace(data / "stack.json")
    except OSError:
        return False
    return True


def _wait_until_healthy(url: str, stopping: Callable[[], bool], data: Path) -> bool:
    """Waits until the API answers, and returns True then; False when the stack is to stop before."""
    until = time.monotonic() + START_SECONDS
    while not stopping():
        try:
            with urllib.request.urlopen(f"{url}/healthz", timeout=2):
                return True
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            if time.monotonic() > until:
                raise CirisError("stack_failed", f"the API at {url} does not answer", hint=f"see {data / 'logs'}") from None
        time.sleep(POLL_SECONDS)
    return False


def _wait_for_solver(children: list[Child], settings: Settings, stopping: Callable[[], bool], note: Callable[[str], None]) -> bool:
    """Waits until the solve worker has loaded what jobs call, and notes if it says that it compiles. The time of a job begins with the job.

    It does not wait for what has to be started again first. It returns False when the stack is to stop before.
    """
    (solver,) = (child.process for child in children if child.name == "solve")
    assert solver is not None, "all children are started"
    database, name, said = Database(settings.database), leases.name_of(solver.pid), None
    while not stopping() and not any(child.dead for child in children):
        with suppress(*UNAVAILABLE), database.read() as session:
            before, said = said, workers.state(session, name) or said
            if said not in {None, *workers.COMING}:
                break
            if said is WorkerState.COMPILING and before is not said:
                note(COMPILES)
        time.sleep(POLL_SECONDS)
    database.close()
    return not stopping()


@contextmanager
def _reserved_port(settings: Settings, asked: int | None) -> Iterator[int]:
    """Reserves a port that no other program gets while the block runs.

    This process binds it without listening, and our API processes may bind it too.
    """
    with socket.socket(settings.family) as holder:
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # connections of the last stack may still linger
        for port in (asked,) if asked is not None else (settings.port, 0):
            with suppress(OSError, OverflowError):
                holder.bind((settings.host, port))
                break
        else:
            host = settings.host
            problem = f"no port of {host} can be bound" if asked is None else f"port {asked} of {host} cannot be bound"
            raise CirisError("port_taken", problem, field="--port", hint="choose another, or none; CIRIS_HOST is where it is looked for")
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0)
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        yield int(holder.getsockname()[1])


@contextmanager
def _socket_directory(data: Path) -> Iterator[Path]:
    """Yields the directory of the queue's socket: the data directory, or a temporary one where that path is too long for a socket."""
    if len(os.fsencode(data / SOCKET)) < MAX_SOCKET_PATH:
        yield data
    else:
        with tempfile.TemporaryDirectory(prefix="ciris-", dir="/tmp") as directory:
            yield Path(directory)


@contextmanager
def _data_directory(data: Path) -> Iterator[None]:
    """Holds the data directory while the block runs. Files that are made meanwhile, by children too, are for this user alone."""
    before = os.umask(0o077)
    try:
        with _locked(data):
            yield
    finally:
        os.umask(before)


def _locked(data: Path) -> IO[str]:
    """Makes the data directory where there is none, and returns its lock, which lasts until the file is closed.

    Raises:
        CirisError: data_directory, stack_running.
    """
    try:
        data.mkdir(parents=True, exist_ok=True)
        _keep_others_out(data)
        (data / "logs").mkdir(exist_ok=True)
        lock = (data / LOCK).open("w")
    except OSError as error:
        hint = "name a directory that you may write to, on a disk with room"
        raise CirisError("data_directory", f"{data} cannot be used: {error.strerror}", field="--data", hint=hint) from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        raise CirisError(
            "stack_running",
            f"a stack with the data directory {data} is running already",
            field="--data",
            hint="use that one, or name another directory",
        ) from None
    return lock


def _keep_others_out(data: Path) -> None:
    """Gives the data directory to this user alone. Earlier versions let others look into it.

    A directory that many share, or that holds other things and nothing of a stack's, stays as it is.
    """
    mode = stat.S_IMODE(data.stat().st_mode)
    if not mode & 0o077:
        return
    ours = not mode & stat.S_ISVTX and ((data / LOCK).exists() or not any(data.iterdir()))
    if ours and data.stat().st_uid == os.geteuid():
        data.chmod(0o700)
        log.warning("others could look into %s (mode %o); its mode is 700 now", data, mode)
    else:
        log.warning("others can look into %s (mode %o); give the service a directory of its own", data, mode)


@contextmanager
def _stop_signals() -> Iterator[Callable[[], bool]]:
    """Catches SIGINT and SIGTERM while the block runs. Yields a function that says whether one has arrived, so that the stack must stop."""
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(received)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _say_up(url: str) -> None:
    print(f"ciris is up at {url}", flush=True)


def _say_note(text: str) -> None:
    """Says it on standard error, so that the first line of the output still is the address."""
    print(f"note: {text}", file=sys.stderr, flush=True)


def main() -> None:
    """Runs ``python -m workers.stack``: the stack with the settings of the environment, until it gets a signal to stop."""
    parser = argparse.ArgumentParser(prog="python -m workers.stack", description="Runs ciris on this machine until Ctrl-C.")
    parser.add_argument("--port", type=int, help="the API's port; default: CIRIS_PORT, or any free one when that is taken")
    parser.add_argument("--data", type=Path, help="data directory; default: CIRIS_DATA_DIR")
    arguments = parser.parse_args()
    logs.configure("stack")
    try:
        settings = chosen(arguments.data)
        try:
            run_stack(settings, port=arguments.port, ready=_say_up, note=_say_note)
        except CirisError as error:
            raise settings.placed(error) from None
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
