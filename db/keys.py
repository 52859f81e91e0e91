"""This module makes and revokes API keys. ``ciris key`` runs it as ``python -m db.keys``.

A key is ``ciris_<id>_<secret>`` with 256 random bits of secret. Nobody can guess it, so a fast hash of it is safe to store.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import audit, command_line, pages, projects
from db.audit import COMMAND_LINE, Action
from db.models import DEFAULT_PROJECT, ApiKeyRow
from db.pages import Page
from db.session import Database
from db.settings import Settings
from db.types import utcnow

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


def add(session: Session, name: str, scope: Scope, project: str = DEFAULT_PROJECT) -> str:
    """Makes a key of a project and returns it. Only this call ever shows it.

    Raises:
        CirisError: project_not_found; key_name, for a name that cannot be used or that another key of the project has.
    """
    projects.get(session, project)
    if not projects.NAME.fullmatch(name):
        raise CirisError("key_name", f"{name!r} is no name for a key", field="name", hint="choose up to 64 letters, digits and . _ - @")
    if _active(session, name, project):
        raise CirisError("key_name", f"there is a key {name!r} already", field="name", hint="revoke it, or choose another name")
    key_id = secrets.token_hex(6)
    key = f"ciris_{key_id}_{secrets.token_urlsafe(32)}"
    session.add(ApiKeyRow(id=key_id, project=project, name=name, digest=_digest(key), scope=scope))
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
    """Describes a key that was made; ``digest`` is its SHA-256."""

    id: str
    project: str
    name: str
    digest: str
    scope: Scope
    revoked: bool


@dataclass(frozen=True)
class Ring:
    """A ring holds every key that was made, by its id, as of one moment."""

    keys: dict[str, Key]

    def misses(self, key: str) -> bool:
        """Says whether this could be a key that was made after that moment: it has the form of a key, and an id that the ring lacks."""
        parts = _KEY.fullmatch(key)
        return parts is not None and parts[1] not in self.keys

    def check(self, key: str) -> Key | None:
        """Returns what is known of a valid key; None for anything else."""
        parts = _KEY.fullmatch(key)
        known = self.keys.get(parts[1]) if parts else None
        if known is None or known.revoked or not hmac.compare_digest(known.digest, _digest(key)):
            return None
        return known


def ring(session: Session) -> Ring:
    """Returns the keys as they are now."""
    columns = (ApiKeyRow.id, ApiKeyRow.project, ApiKeyRow.name, ApiKeyRow.digest, ApiKeyRow.scope, ApiKeyRow.revoked_at.is_not(None))
    rows = session.execute(select(*columns))
    return Ring({id: Key(id, project, name, digest, Scope(scope), revoked) for id, project, name, digest, scope, revoked in rows})


def check_bind(settings: Settings) -> None:
    """Refuses to serve an address that others can reach while no key was ever made.

    Raises:
        CirisError: no_keys, or no_database when the database cannot tell.
    """
    if settings.loopback:
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


def _active(session: Session, name: str, project: str) -> Sequence[ApiKeyRow]:
    mine = (ApiKeyRow.project == project, ApiKeyRow.name == name)
    return session.scalars(select(ApiKeyRow).where(*mine, ApiKeyRow.revoked_at.is_(None))).all()


def _digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs ``ciris key`` on the database that the settings name."""
    parser = command_line.Parser(prog="ciris key", description="The API keys of the service whose database the settings name.")
    parser.add_argument("--data", type=Path, help="data directory; default: CIRIS_DATA_DIR")
    verbs = parser.add_subparsers(dest="verb", required=True)
    adding = verbs.add_parser("add", help="make a key and print it, once")
    adding.add_argument("name")
    adding.add_argument("--scope", type=Scope, choices=list(Scope), required=True)
    verbs.add_parser("ls", help="list the keys, without what is secret").add_argument("--json", action="store_true")
    revoking = verbs.add_parser("revoke", help="end a key within a second")
    revoking.add_argument("name")
    for verb in (adding, revoking):
        verb.add_argument("--project", default=DEFAULT_PROJECT, help="the project that the key belongs to; default: %(default)s")
    given = parser.parse_args(arguments)
    for line in command_line.on_database(given.data, partial(_run, given=given)):
        print(line)


def _run(session: Session, given: argparse.Namespace) -> list[str]:
    """Does what the user asked, and returns the lines to print once it is committed."""
    match given.verb:
        case "add":
            key = add(session, given.name, given.scope, given.project)
            audit.note(session, given.project, COMMAND_LINE, Action.KEY_MADE, f"{given.name} ({given.scope})")
            return [key]
        case "revoke":
            revoke(session, given.name, given.project)
            audit.note(session, given.project, COMMAND_LINE, Action.KEY_REVOKED, given.name)
            return []
        case _:
            return command_line.listed([_described(row) for row in newest(session)], as_json=given.json)


def _described(row: ApiKeyRow) -> dict[str, str | None]:
    """Returns what may be shown of a key."""
    created_at = row.created_at.isoformat(timespec="seconds")
    revoked_at = None if row.revoked_at is None else row.revoked_at.isoformat(timespec="seconds")
    return {
        "name": row.name,
        "scope": row.scope,
        "project": row.project,
        "id": row.id,
        "created_at": created_at,
        "revoked_at": revoked_at,
    }


if __name__ == "__main__":
    main()
