"""Settings of the service, from the environment (prefix ``CIRIS_``), built once and lazily."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


def _data_dir() -> Path:
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "ciris"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
    """Address the API binds to."""
    allow_remote: bool = False
    """Let the API bind to an address that others can reach, though it asks nobody for a key (inside a container, behind a proxy)."""
    port: int = 8643
    """Port the API binds to; the embedded stack takes a free one when it is taken and was not asked for."""
    solve_processes: int = Field(default_factory=_cores, ge=1)
    """Processes that solve pairs, one thread each."""

    batch_seconds: float = 0.5
    """Pairs are sent together until their forecasts sum to this many seconds."""
    lease_seconds: float = 60.0
    """How long a claim lasts without being renewed; its holder renews it four times as often."""
    max_attempts: int = 3
    """How often a pair or step is begun before it counts as poison and ends as an error."""
    sweep_seconds: float = 2.0
    """Pause between two rounds of the sweeper."""
    resend_seconds: float = 10.0
    """Work that nobody has claimed this long after it was sent, with the queue empty, is sent again."""
    step_timeout_seconds: float = 3600.0
    """Limit of one seeding or polytope step."""
    verify_timeout_seconds: float = 600.0
    """Limit of one check of a stored proof on request."""
    child_memory_bytes: int = 16 << 30
    """Limit of the address space of the process that runs a seeding, a polytope step or a check on request."""

    @property
    def database(self) -> str:
        """The database's URL, with the default filled in."""
        return self.database_url or f"sqlite:///{self.data_dir.expanduser().absolute() / 'ciris.sqlite3'}"


@cache
def settings() -> Settings:
    """The process's settings; ``settings.cache_clear()`` makes the next call read the environment again."""
    return Settings()
