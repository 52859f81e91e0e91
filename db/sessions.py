"""A session is what a browser holds from signing in to signing out: a random token, of which the database has the hash.

A session of a key may do what the key may, for as long as the key may. A session of a person may do what the grant says by which the
person works in a project. Both are looked up with the session, so that nothing has to be done to sessions when a key or a grant ends.

A session never changes its project. Who chooses another one gets another token (:func:`choose`).
"""

from __future__ import annotations

import hashlib
import re
import secrets
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import delete, or_, select, update
from sqlalchemy.orm import Session

from db import grants, keys
from db.grants import Person
from db.keys import NOTED, Key, Scope
from db.models import GrantRow, SessionRow
from db.settings import settings
from db.types import utcnow

MOST_OF_ONE = 20
"""A key or a person has this many sessions at most. A new one ends the oldest."""
TOGETHER = 100
"""At most this many expired sessions are deleted in one transaction."""
_TOKEN = re.compile(r"[\w-]{43}", re.ASCII)
_DIGEST_LETTERS = 64


@dataclass(frozen=True)
class SignedIn:
    """Describes a session.

    Attributes:
        id: the hash of its token.
        key: the key that it was begun with; else there is a person.
        project: the project that the person has chosen, with the scope there; None where none is chosen, or the grant was withdrawn.
    """

    id: str
    key: Key | None
    person: Person | None
    project: tuple[str, Scope] | None
    expires_at: datetime
    last_used_at: datetime | None

    def opens(self, given: str) -> bool:
        """Says whether the session has not ended, and is the one of this token."""
        now = utcnow()
        return id_of(given) == self.id and now < self.expires_at and (self.key is None or self.key.lasts(now))

    def used_lately(self) -> bool:
        """Says whether its use need not be noted again yet."""
        return self.last_used_at is not None and utcnow() - self.last_used_at < NOTED


def id_of(token: str) -> str | None:
    """Returns the id of the session with this token, if there is one; None for what has not the form of a token."""
    return hashlib.sha256(token.encode()).hexdigest() if _TOKEN.fullmatch(token) else None


def begin(session: Session, who: Key | Person) -> str:
    """Begins a session of a key, or of a person who has chosen no project yet, and returns its token."""
    mine = SessionRow.key_id == who.id if isinstance(who, Key) else SessionRow.subject == who.subject
    newest = select(SessionRow.digest).where(mine).order_by(SessionRow.created_at.desc(), SessionRow.digest)
    session.execute(delete(SessionRow).where(SessionRow.digest.in_(session.scalars(newest.offset(MOST_OF_ONE - 1)).all())))
    named: dict[str, Any] = (
        {"key_id": who.id}
        if isinstance(who, Key)
        else {"subject": who.subject, "issuer": settings().oidc_issuer, "email": who.email, "groups": list(who.groups)}
    )
    token, digest = _new()
    session.add(SessionRow(digest=digest, expires_at=utcnow() + timedelta(hours=settings().session_hours), **named))
    return token


def choose(session: Session, token: str, project: str) -> str | None:
    """Ends the session of a person, and returns the token of one that works in this project until the same time.

    Returns None, and changes nothing, where there is no such session, or no grant for the person in the project.
    """
    found = get(session, token)
    if found is None or found.person is None:
        return None
    grant = next((row for row in grants.of_person(session, found.person) if row.project == project), None)
    if grant is None:
        return None
    other, digest = _new()
    changed = update(SessionRow).where(SessionRow.digest == found.id).values(digest=digest, grant_id=grant.id).returning(SessionRow.digest)
    return None if session.scalar(changed) is None else other  # another request may have chosen meanwhile


def end(session: Session, token: str) -> None:
    """Ends the session of a token, if there is one."""
    session.execute(delete(SessionRow).where(SessionRow.digest == id_of(token)))


def get(session: Session, token: str) -> SignedIn | None:
    """Returns the session of a token; None for one that has ended, and for anything else."""
    id = id_of(token)
    found = None if id is None else find(session, [id]).get(id)
    return found if found is not None and found.opens(token) else None


def find(session: Session, ids: Collection[str]) -> dict[str, SignedIn]:
    """Returns id -> session for those of these ids that a session has, one that has ended too."""
    digests = _sessions(ids)
    if not digests:
        return {}
    query = select(SessionRow, GrantRow).outerjoin(GrantRow, GrantRow.id == SessionRow.grant_id).where(SessionRow.digest.in_(digests))
    rows = session.execute(query).all()
    of_keys = {row.key_id for row, _ in rows if row.key_id is not None}
    known = keys.find(session, of_keys) if of_keys else {}
    return {row.digest: _signed_in(row, grant, known) for row, grant in rows}


def note_use(session: Session, ids: Collection[str], now: datetime) -> None:
    """Notes that these sessions, and the keys that they were begun with, were used now, where that was not noted lately."""
    digests = _sessions(ids)
    if not digests:
        return
    due = or_(SessionRow.last_used_at.is_(None), SessionRow.last_used_at <= now - NOTED)
    session.execute(update(SessionRow).where(SessionRow.digest.in_(digests), due).values(last_used_at=now))
    of_keys = session.scalars(select(SessionRow.key_id).where(SessionRow.digest.in_(digests), SessionRow.key_id.is_not(None))).all()
    keys.note_use(session, [id for id in of_keys if id is not None], now)


def forgettable(session: Session, now: datetime) -> Sequence[str]:
    """Returns the ids of some sessions that have expired."""
    return session.scalars(
        select(SessionRow.digest).where(SessionRow.expires_at < now).order_by(SessionRow.expires_at).limit(TOGETHER)
    ).all()


def forget(session: Session, ids: Sequence[str]) -> None:
    """Deletes these sessions."""
    session.execute(delete(SessionRow).where(SessionRow.digest.in_(ids)))


def _new() -> tuple[str, str]:
    """Returns a new token with its hash."""
    token = secrets.token_urlsafe(32)
    return token, hashlib.sha256(token.encode()).hexdigest()


def _sessions(ids: Collection[str]) -> list[str]:
    """Returns those of these ids that are of sessions; the others are of keys."""
    return [id for id in ids if len(id) == _DIGEST_LETTERS]


def _signed_in(row: SessionRow, grant: GrantRow | None, known: dict[str, Key]) -> SignedIn:
    person = None
    if row.subject is not None and row.issuer == settings().oidc_issuer:
        person = Person(row.subject, row.email, tuple(row.groups))
    project = None if grant is None else (grant.project, Scope(grant.scope))
    key = None if row.key_id is None else known.get(row.key_id)
    return SignedIn(row.digest, key, person, project, row.expires_at, row.last_used_at)
