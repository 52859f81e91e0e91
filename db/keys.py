"""This module makes and revokes API keys. ``ciris key`` runs it as ``python -m db.keys``.

A key ends when somebody revokes it, or at a time that is set when it is made. Both are ``revoked_at``, which is then in the future first.

A key is ``ciris_<id>_<secret>`` with 256 random bits of secret. Nobody can guess it, so a fast hash of it is safe to store. A key is
looked up by its id, so that others' keys cost nothing however many there are.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import re
import secrets
import sys
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from functools import partial

from sqlalchemy import delete, exists, func, or_, select, update
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import audit, command_line, pages, projects, unusable
from db.audit import COMMAND_LINE, Action
from db.models import DEFAULT_PROJECT, ApiKeyRow, JobRow
from db.pages import Page
from db.session import Database
from db.settings import Settings, chosen, settings
from db.states import JOB, unfinished
from db.types import utcnow

COUNTED_DAYS = 1
"""A revoked key counts against the limit of its project for this many days, so that making and revoking keys in turn has a limit too."""
KEPT_DAYS = 30
"""A revoked key is listed for this many days. Then the service forgets it."""
NOTED = timedelta(minutes=10)
"""The use of a key is noted again once this much time has passed, so that hardly any request writes."""
MOST_DAYS = 3650
"""A key may be made to expire after this many days at most."""
LISTED = 1000
"""At most this many names of keys are offered where one is chosen."""
KEYS_TOGETHER, JOBS_TOGETHER = 100, 1000
"""At most this many keys, and mentions of them in jobs, are forgotten in one transaction."""
_KEY = re.compile(r"ciris_([0-9a-f]{12})_[\w-]{43}", re.ASCII)


class Scope(StrEnum):
    """A scope says what a key allows. Each scope includes those before it."""

    READ = "read"
    """The key may look at scenes, jobs and regions, and ask about configurations."""
    SUBMIT = "submit"
    """The key may upload scenes, and create, cancel and retry jobs."""
    ADMIN = "admin"
    """The key may delete scenes, jobs and regions, and manage the keys of its project."""

    def includes(self, other: Scope) -> bool:
        """Says whether a key of this scope may do what needs the other scope."""
        order = list(Scope)
        return order.index(self) >= order.index(other)


def add(session: Session, name: str, scope: Scope, project: str = DEFAULT_PROJECT, days: float | None = None) -> str:
    """Makes a key of a project and returns it. Only this call ever shows it.

    Args:
        days: the key is refused after this many days; None for never.

    Raises:
        CirisError: project_not_found; key_name, for a name that cannot be used or that another key of the project has; too_many_keys.
    """
    projects.get(session, project)
    if not projects.NAME.fullmatch(name):
        raise CirisError("key_name", f"{name!r} is no name for a key", field="name", hint="choose up to 64 letters, digits and . _ - @")
    if _active(session, name, project):
        raise CirisError("key_name", f"there is a key {name!r} already", field="name", hint="revoke it, or choose another name")
    _check_limit(session, project)
    key_id = secrets.token_hex(6)
    key = f"ciris_{key_id}_{secrets.token_urlsafe(32)}"
    expires_at = None if days is None else utcnow() + timedelta(days=days)
    session.add(ApiKeyRow(id=key_id, project=project, name=name, digest=_digest(key), scope=scope, revoked_at=expires_at))
    return key


def revoke(session: Session, name: str, project: str = DEFAULT_PROJECT) -> None:
    """Revokes the project's key of this name. A running API refuses it within a second.

    Raises:
        CirisError: key_not_found.
    """
    rows = _active(session, name, project)
    if not rows:
        raise CirisError("key_not_found", f"there is no key {name!r}", field="name", hint="`ciris key ls` lists them")
    for row in rows:
        row.revoked_at = utcnow()


def newest(session: Session) -> Sequence[ApiKeyRow]:
    """Returns every key of every project, the newest first, the revoked ones too."""
    return session.scalars(select(ApiKeyRow).order_by(ApiKeyRow.created_at.desc(), ApiKeyRow.id)).all()


def page(session: Session, after: str | None = None, limit: int = 100) -> Page[ApiKeyRow]:
    """Returns one page of the keys of the session's project, the revoked ones too.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, ApiKeyRow, select(ApiKeyRow), after, limit)


def exist(session: Session) -> bool:
    """Says whether a key was ever made. So revoking the last key locks the service instead of opening it."""
    table = ApiKeyRow.__table__  # whatever the session's project
    return session.scalar(select(table.c.id).limit(1)) is not None


@dataclass(frozen=True)
class Key:
    """Describes a key that was made; ``digest`` is its SHA-256, and from ``revoked_at`` on it is refused."""

    id: str
    project: str
    name: str
    digest: str
    scope: Scope
    revoked_at: datetime | None
    last_used_at: datetime | None

    def opens(self, given: str) -> bool:
        """Says whether what a caller sent is this key, and may be used."""
        return self.lasts(utcnow()) and hmac.compare_digest(self.digest, _digest(given))

    def lasts(self, now: datetime) -> bool:
        """Says whether the key is neither revoked nor expired."""
        return self.revoked_at is None or now < self.revoked_at

    def used_lately(self) -> bool:
        """Says whether its use need not be noted again yet."""
        return self.last_used_at is not None and utcnow() - self.last_used_at < NOTED


def id_of(given: str) -> str | None:
    """Returns the id in what a caller sent; None when it has not the form of a key."""
    parts = _KEY.fullmatch(given)
    return None if parts is None else parts[1]


def find(session: Session, ids: Collection[str]) -> dict[str, Key]:
    """Returns id -> key for those of these ids that a key has, a revoked one too."""
    who = (ApiKeyRow.id, ApiKeyRow.project, ApiKeyRow.name, ApiKeyRow.digest, ApiKeyRow.scope)
    rows = session.execute(select(*who, ApiKeyRow.revoked_at, ApiKeyRow.last_used_at).where(ApiKeyRow.id.in_(ids)))
    return {id: Key(id, project, name, digest, Scope(scope), *times) for id, project, name, digest, scope, *times in rows}


def note_use(session: Session, ids: Collection[str], now: datetime) -> None:
    """Notes that these keys were used now, where that was not noted lately."""
    due = or_(ApiKeyRow.last_used_at.is_(None), ApiKeyRow.last_used_at <= now - NOTED)
    session.execute(update(ApiKeyRow).where(ApiKeyRow.id.in_(ids), due).values(last_used_at=now))


def check(session: Session, given: str) -> Key | None:
    """Returns what is known of a valid key; None for anything else."""
    id = id_of(given)
    key = None if id is None else find(session, [id]).get(id)
    return key if key is not None and key.opens(given) else None


def forgettable(session: Session, now: datetime) -> Sequence[str]:
    """Returns the ids of some keys that ended ``KEPT_DAYS`` ago and have no job under way.

    The key that ended last is never among them: a service that has forgotten its last key would be open.
    """
    last = select(func.max(ApiKeyRow.revoked_at)).scalar_subquery()
    at_work = exists().where(JobRow.key_id == ApiKeyRow.id, JobRow.state.in_(unfinished(JOB)))
    old = (ApiKeyRow.revoked_at < now - timedelta(days=KEPT_DAYS), ApiKeyRow.revoked_at < last, ~at_work)
    return session.scalars(select(ApiKeyRow.id).where(*old).order_by(ApiKeyRow.revoked_at).limit(KEYS_TOGETHER)).all()


def forget(session: Session, ids: Sequence[str]) -> None:
    """Deletes those of these keys that no job names any more, and takes their ids out of some of the jobs that do."""
    named = session.scalars(select(JobRow.id).where(JobRow.key_id.in_(ids)).limit(JOBS_TOGETHER)).all()
    session.execute(update(JobRow).where(JobRow.id.in_(named)).values(key_id=None))
    session.execute(delete(ApiKeyRow).where(ApiKeyRow.id.in_(ids), ~exists().where(JobRow.key_id == ApiKeyRow.id)))


def check_bind(settings: Settings) -> None:
    """Refuses to serve an address that others can reach while no key was ever made and no identity provider is set.

    Raises:
        CirisError: no_keys, or no_database when the database cannot tell.
    """
    if settings.loopback or settings.oidc_issuer:
        return
    database = Database(settings.database)
    try:
        with database.read() as session:
            guarded = exist(session)
    except SQLAlchemyError:
        hint = "is it there, and migrated (`ciris db upgrade`)?"
        raise CirisError("no_database", "the database cannot be used", field="CIRIS_DATABASE_URL", hint=hint) from None
    finally:
        database.close()
    if not guarded:
        problem = f"others can reach {settings.host}, and no API key has been made that could keep them out"
        raise CirisError("no_keys", problem, field="CIRIS_HOST", hint="`ciris key add NAME --scope admin` makes one")


def names(session: Session) -> Sequence[str]:
    """Returns the names of keys of the project, in order, those of revoked keys too; LISTED at most."""
    return session.scalars(select(ApiKeyRow.name).distinct().order_by(ApiKeyRow.name).limit(LISTED)).all()


def named(session: Session, name: str) -> str:
    """Returns the id of the project's newest key of this name.

    Raises:
        CirisError: key_not_found.
    """
    query = select(ApiKeyRow.id).where(ApiKeyRow.name == name).order_by(ApiKeyRow.created_at.desc()).limit(1)
    found = session.scalar(query)
    if found is None:
        raise CirisError("key_not_found", f"there is no key {name!r}", field="key", hint="`ciris key ls` lists them")
    return found


def _active(session: Session, name: str, project: str) -> Sequence[ApiKeyRow]:
    mine = (ApiKeyRow.project == project, ApiKeyRow.name == name)
    return session.scalars(select(ApiKeyRow).where(*mine, or_(ApiKeyRow.revoked_at.is_(None), ApiKeyRow.revoked_at > utcnow()))).all()


def _check_limit(session: Session, project: str) -> None:
    """Refuses another key of a project that has as many as it may. Those that ended lately count."""
    limit = settings().max_keys_per_project
    counts = or_(ApiKeyRow.revoked_at.is_(None), ApiKeyRow.revoked_at > utcnow() - timedelta(days=COUNTED_DAYS))
    if len(session.scalars(select(ApiKeyRow.id).where(ApiKeyRow.project == project, counts).limit(limit)).all()) >= limit:
        raise CirisError(
            "too_many_keys",
            f"the project {project} has {limit} keys, the most that it may have; a revoked key counts for a day more",
            field="name",
            hint="revoke keys that nobody uses and try again a day later, or have CIRIS_MAX_KEYS_PER_PROJECT raised",
        )


def _digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs ``ciris key`` on the database that the settings name."""
    parser = command_line.Parser(prog="ciris key", description="The API keys of the service whose database the settings name.")
    parser.add_argument("--data", type=command_line.path, help="data directory; default: CIRIS_DATA_DIR")
    verbs = parser.add_subparsers(dest="verb", required=True)
    adding = verbs.add_parser("add", help="make a key and print it, once")
    adding.add_argument("name")
    adding.add_argument("--scope", type=Scope, choices=list(Scope), required=True)
    adding.add_argument("--days", type=_days, help="the key expires after this many days; default: never")
    verbs.add_parser("ls", help="list the keys, without what is secret").add_argument("--json", action="store_true")
    revoking = verbs.add_parser("revoke", help="end a key within a second")
    revoking.add_argument("name")
    for verb in (adding, revoking):
        verb.add_argument("--project", default=DEFAULT_PROJECT, help="the project that the key belongs to; default: %(default)s")
    given = parser.parse_args(arguments)
    for line in command_line.on_database(given.data, partial(_run, given=given)):
        print(line)
    if given.verb != "add":  # a list may be empty because it is of another database than was meant
        print(f"database: {unusable.named(chosen(given.data).database)}", file=sys.stderr)


def _run(session: Session, given: argparse.Namespace) -> list[str]:
    """Does what the user asked, and returns the lines to print once it is committed."""
    match given.verb:
        case "add":
            key = add(session, given.name, given.scope, given.project, given.days)
            audit.note_of_service(session, given.project, COMMAND_LINE, Action.KEY_MADE, made(given.name, given.scope, given.days))
            return [key]
        case "revoke":
            revoke(session, given.name, given.project)
            audit.note_of_service(session, given.project, COMMAND_LINE, Action.KEY_REVOKED, given.name)
            return []
        case _:
            return command_line.listed([_described(row) for row in newest(session)], as_json=given.json)


def made(name: str, scope: Scope, days: float | None) -> str:
    """Returns what the audit log says of a new key."""
    return f"{name} ({scope})" if days is None else f"{name} ({scope}, for {days:g} days)"


def ends(row: ApiKeyRow) -> tuple[datetime | None, datetime | None]:
    """Returns when a key will expire and when it ended, of which one at most is known."""
    return (row.revoked_at, None) if row.revoked_at is not None and row.revoked_at > utcnow() else (None, row.revoked_at)


def _days(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number <= MOST_DAYS:
        raise argparse.ArgumentTypeError(f"{text} is not a number of days above 0, of at most {MOST_DAYS}")
    return number


def _described(row: ApiKeyRow) -> dict[str, str | None]:
    """Returns what may be shown of a key."""
    expires_at, revoked_at = ends(row)
    times = {"created_at": row.created_at, "last_used_at": row.last_used_at, "expires_at": expires_at, "revoked_at": revoked_at}
    said = {name: None if at is None else at.isoformat(timespec="seconds") for name, at in times.items()}
    return {"name": row.name, "scope": row.scope, "project": row.project, "id": row.id, **said}


if __name__ == "__main__":
    main()
