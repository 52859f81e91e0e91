"""The settings of the service come from the environment (prefix ``CIRIS_``). They are read once, when first needed."""

from __future__ import annotations

import os
import socket
from dataclasses import dataclass
from functools import cache
from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlsplit

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, ValidationInfo
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from certifier.errors import CirisError
from db import machine

SPARE = 1
"""A solve worker has this many processes more than work at a time. They do pieces of new jobs, and accept regions (workers.spare)."""


def _data_dir() -> Path:
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "ciris"


def _memory_of_a_process(given: dict[str, Any]) -> int:
    return machine.memory_bytes() // (given.get("solve_processes", machine.cores()) + SPARE)


def _networks(given: object) -> object:
    """Takes addresses and networks with commas between them apart. An IPv4 network counts in its IPv6 form too."""
    if not isinstance(given, str):
        return given
    networks = [ip_network(word.strip()) for word in given.split(",") if word.strip()]
    mapped = [ip_network(f"::ffff:{one.network_address}/{96 + one.prefixlen}") for one in networks if one.version == 4]
    return (*networks, *mapped)


Networks = Annotated[tuple[IPv4Network | IPv6Network, ...], NoDecode, BeforeValidator(_networks)]


@dataclass(frozen=True)
class Host:
    """Names a host, in small letters, and one of its ports; None stands for the usual ones."""

    name: str
    port: int | None


def _hosts(given: object) -> object:
    """Takes hosts with commas between them apart, each with a port or without. An IPv6 address stands in brackets."""
    if not isinstance(given, str):
        return given
    parts = [urlsplit(f"//{word.strip()}") for word in given.split(",") if word.strip()]
    for part in parts:
        if part.hostname is None or part.port == 0 or part.netloc.rpartition("@")[1] or part.path or part.query or part.fragment:
            raise ValueError(f"{part.netloc or part.geturl()!r} is no host; write `name`, `name:8080`, `10.1.2.3` or `[fd00::1]:8080`")
    return tuple(Host((part.hostname or "").rstrip("."), part.port) for part in parts)


Hosts = Annotated[tuple[Host, ...], NoDecode, BeforeValidator(_hosts)]

DATABASES = {("sqlite", "pysqlite"), ("postgresql", "psycopg")}
"""The kinds of database that the service works with, and the drivers that it has."""


def _database_url(given: str) -> str:
    """Refuses what names no database. Its words repeat nothing of the URL, which may have a password in it."""
    if not given:
        return given
    forms = "write postgresql+psycopg://user:password@host:port/name or sqlite:////directory/file"
    try:
        parsed = make_url(given)
        kind = parsed.get_backend_name(), parsed.get_driver_name()
    except (ArgumentError, ValueError):
        raise ValueError(f"it is no URL of a database; {forms}") from None
    if kind not in DATABASES:
        raise ValueError(f"the service knows no database {parsed.drivername!r}; {forms}")
    if parsed.database in (None, "", ":memory:"):
        raise ValueError(f"it names no database; {forms}")
    return given


def sqlite_url(path: Path) -> str:
    """Returns the URL of an SQLite database. What a URL gives a meaning to, such as a question mark in the path, is escaped in it."""
    return str(URL.create("sqlite", database=str(path)))


LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})


def trustworthy(url: str) -> bool:
    """Says whether what comes from a URL can be believed: over TLS, or on this machine."""
    try:
        parts = urlsplit(url)
    except ValueError:
        return False
    return bool(parts.hostname) and (parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in LOOPBACK_NAMES))


def _issuer(given: str) -> str:
    if given and (not trustworthy(given) or "?" in given or "#" in given):
        raise ValueError(f"{given!r} is no issuer; write https://host or https://host/path as the provider writes it")
    return given


def _with_issuer(given: str, info: ValidationInfo) -> str:
    if info.data.get("oidc_issuer") and not given:
        raise ValueError("is not set, and CIRIS_OIDC_ISSUER is; give the name that the provider knows this service by")
    return given


DATABASE_FIELD = "CIRIS_DATABASE_URL"
"""Errors about the database name this setting."""


class Settings(BaseSettings):
    """Holds every setting of the service. ``CIRIS_DATA_DIR=/srv/ciris`` sets ``data_dir``, and so on."""

    model_config = SettingsConfigDict(env_prefix="CIRIS_", extra="forbid")

    data_dir: Path = Field(default_factory=_data_dir)
    """The embedded stack keeps its database, its queue, its logs and stack.json in this directory."""
    database_url: Annotated[str, AfterValidator(_database_url)] = ""
    """SQLAlchemy URL of the database; empty: SQLite in ``data_dir``. PostgreSQL: postgresql+psycopg://user:password@host/name.
    With TLS, ``?sslmode=verify-full&sslrootcert=FILE`` follows."""
    redis_url: str = ""
    """URL of Celery's broker; empty: the embedded stack starts its own. With TLS: rediss://:password@host:6380/0?ssl_ca_certs=FILE."""

    host: str = "127.0.0.1"
    """The API binds to this address. One that others can reach needs at least one API key to have been made."""
    port: int = 8643
    """The API binds to this port. The embedded stack takes a free one if this one is taken, unless the user asked for a port."""
    requests_per_second: float = Field(default=100.0, gt=0)
    """One key (or one address without a key) may make this many requests a second for long, and twice as many for a short while."""
    trusted_proxies: Networks = (ip_network("127.0.0.0/8"), ip_network("::1/128"))
    """The API believes ``X-Forwarded-For`` and ``X-Forwarded-Proto`` of these addresses and networks only, written with commas between
    them. It takes the last address of the header that is not one of them for the caller's; empty: it believes nobody.
    """
    api_processes: int = Field(default_factory=lambda: min(2, machine.cores()), ge=1)
    """The embedded stack runs this many processes of the API, all on one port."""
    requests_file: Path | None = None
    """File in which one of several API processes on one port counts its requests; the others' files are in the same directory."""
    solve_processes: int = Field(default_factory=machine.cores, ge=1)
    """This many processes work at a time, one thread each, and one more does pieces of new jobs. Default: the cores that they may use
    (db.machine)."""

    batch_seconds: float = 0.5
    """Pairs are certified together until their forecasts sum to this many seconds."""
    lease_seconds: float = 60.0
    """A claim lasts this long unless its holder renews it. The holder renews it four times as often."""
    max_attempts: int = 3
    """When the process of a pair or step has died alone this often, the pair or step counts as poison and ends as an error."""
    sweep_seconds: float = 2.0
    """The sweeper pauses this long between two rounds."""
    heartbeat_file: Path | None = None
    """A worker touches this file every ten seconds while it is well, for health checks."""
    verify_timeout_seconds: float = 600.0
    """One check of a stored proof on request may take this many seconds."""
    secret_key: str = Field(default="", repr=False)
    """Base64 of 32 bytes that the secrets of webhooks are encrypted with. Several with commas between: the first one encrypts. Empty: the
    service takes no webhooks. The embedded stack makes a key and keeps it in ``data_dir``."""
    webhook_hosts: Hosts = ()
    """Webhooks may go to these hosts although their addresses are private, written with commas between them. A port after a colon allows
    that port; without one these are 443 and 80. Other hosts need public addresses, and one of these two ports."""
    time_limit_seconds: float = Field(default=3600.0, gt=0)
    """A batch of pairs or a step may take this many seconds; then its process is killed. A job with a pair that needs longer is refused."""
    child_memory_bytes: int = 16 << 30
    """The process that runs a seeding or a check on request may have an address space of this many bytes."""
    pair_memory_bytes: int = Field(default_factory=_memory_of_a_process)
    """A job with a pair that needs more bytes of memory than this is refused. Default: the memory there is, divided by the processes of a
    solve worker."""
    max_jobs_per_project: int = Field(default=2000, ge=1)
    """One project may have this many unfinished jobs, so that nobody gets more by making keys."""
    max_jobs_per_key: int = Field(default=1000, ge=1)
    """One API key may have this many unfinished jobs. Where the service asks for no key, all callers share the limit."""
    max_keys_per_project: int = Field(default=500, ge=1)
    """One project may have this many API keys. Those that were revoked within the last day count."""

    session_hours: float = Field(default=12.0, gt=0, le=24 * 90)
    """People who signed in on the pages have to sign in again after this many hours."""
    oidc_issuer: Annotated[str, AfterValidator(_issuer)] = ""
    """URL of the OpenID Connect provider where people sign in, as its tokens name it; empty: people sign in with API keys only."""
    oidc_client_id: Annotated[str, AfterValidator(_with_issuer)] = Field(default="", validate_default=True)
    """The provider knows this service by this name."""
    oidc_client_secret: str = Field(default="", repr=False)
    """The secret that the provider made for it; empty where it made none, as for public clients."""
    oidc_groups_claim: str = "groups"
    """The provider lists a person's groups under this name."""

    kept_motions: int = Field(default=500, ge=0)
    """Number of proved motions of a scene that are kept to answer later questions. The oldest ones go."""
    kept_questions: int = Field(default=0, ge=0, le=10_000)
    """Number of configurations of a scene that are kept because somebody asked about them and nothing proved them, for maps to begin with.
    With 0, nothing is kept."""

    @property
    def family(self) -> socket.AddressFamily:
        """Returns the address family of the API's address."""
        return socket.AF_INET6 if ":" in self.host else socket.AF_INET

    @property
    def loopback(self) -> bool:
        """Says whether only this machine can reach the API."""
        return self.host in LOOPBACK_NAMES

    @property
    def database(self) -> str:
        """Returns the database's URL, with the default filled in."""
        return self.database_url or sqlite_url(self.data_dir.expanduser().absolute() / "ciris.sqlite3")

    def placed(self, error: CirisError) -> CirisError:
        """Returns an error about the database with the setting in it that names the database here."""
        if error.field == DATABASE_FIELD and not self.database_url:
            error.field = "--data"
        return error


@cache
def settings() -> Settings:
    """Returns the process's settings. ``settings.cache_clear()`` makes the next call read the environment again.

    Raises:
        CirisError: setting.
    """
    return chosen()


def chosen(data_dir: Path | None = None) -> Settings:
    """Returns the settings of the environment, with another data directory where one is given.

    Raises:
        CirisError: setting, which names the first variable whose value cannot be used.
    """
    try:
        return Settings() if data_dir is None else Settings(data_dir=data_dir)
    except ValidationError as error:
        first = error.errors(include_input=False, include_url=False)[0]
        name = f"CIRIS_{first['loc'][0]}".upper()
        message = str(first["msg"]).removeprefix("Value error, ")
        hint = "correct it, or take it out of the environment"
        raise CirisError("setting", f"{message[:1].lower()}{message[1:]}", field=name, hint=hint) from None
