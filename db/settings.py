"""Settings of the service, from the environment (prefix ``CIRIS_``), built once and lazily."""

from __future__ import annotations

import os
import socket
from functools import cache
from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


def _data_dir() -> Path:
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "ciris"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _memory_of_a_process() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // _cores()


LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})


class Settings(BaseSettings):
    """Every setting of the service; ``CIRIS_DATA_DIR=/srv/ciris`` sets ``data_dir``, and so on."""

    model_config = SettingsConfigDict(env_prefix="CIRIS_", extra="forbid")

    data_dir: Path = Field(default_factory=_data_dir)
    """Where the embedded stack keeps its database, its queue, its logs and stack.json."""
    database_url: str = ""
    """SQLAlchemy URL; empty: SQLite in ``data_dir``. PostgreSQL: postgresql+psycopg://user:password@host/name."""
    redis_url: str = ""
    """Celery's broker; empty: the embedded stack starts its own."""

    host: str = "127.0.0.1"
    """Address the API binds to; one that others can reach needs an API key to have been made."""
    port: int = 8643
    """Port the API binds to; the embedded stack takes a free one when it is taken and was not asked for."""
    requests_per_second: float = Field(default=100.0, gt=0)
    """How many requests one key (or one address without a key) may make for long; for a short while, twice as many."""
    api_processes: int = Field(default_factory=lambda: min(2, _cores()), ge=1)
    """Processes of the API in the embedded stack, all on one port."""
    requests_file: Path | None = None
    """For one of several API processes on one port: where it counts its requests, in a directory with the others' files."""
    solve_processes: int = Field(default_factory=_cores, ge=1)
    """Processes that solve pairs, one thread each."""

    batch_seconds: float = 0.5
    """Pairs are certified together until their forecasts sum to this many seconds."""
    lease_seconds: float = 60.0
    """How long a claim lasts without being renewed; its holder renews it four times as often."""
    max_attempts: int = 3
    """How often the process of a pair or step dies, alone, before that counts as poison and ends as an error."""
    sweep_seconds: float = 2.0
    """Pause between two rounds of the sweeper."""
    heartbeat_file: Path | None = None
    """A file that a worker touches every ten seconds while it is well, for health checks."""
    verify_timeout_seconds: float = 600.0
    """Limit of one check of a stored proof on request."""
    webhook_private: bool = False
    """Let webhooks go to addresses that are not public, as in a network of one's own."""
    time_limit_seconds: float = Field(default=3600.0, gt=0)
    """Hard limit of one batch of pairs or one step; its process is then killed. A job with a pair that would need longer is refused."""
    child_memory_bytes: int = 16 << 30
    """Limit of the address space of the process that runs a seeding or a check on request."""
    pair_memory_bytes: int = Field(default_factory=_memory_of_a_process)
    """A job with a pair that would need more memory is refused. Default: this machine's memory, divided by its cores."""
    max_jobs_per_key: int = Field(default=1000, ge=1)
    """How many jobs of one API key may be unfinished (of all callers together where the service asks for no key)."""

    @property
    def family(self) -> socket.AddressFamily:
        """That of the API's address."""
        return socket.AF_INET6 if ":" in self.host else socket.AF_INET

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach the API."""
        return self.host in LOOPBACK_NAMES

    @property
    def database(self) -> str:
        """The database's URL, with the default filled in."""
        return self.database_url or f"sqlite:///{self.data_dir.expanduser().absolute() / 'ciris.sqlite3'}"


@cache
def settings() -> Settings:
    """The process's settings; ``settings.cache_clear()`` makes the next call read the environment again."""
    return Settings()
