"""A grant says what a person or a group whom the identity provider names may do in a project.

``ciris project grant`` runs this module as ``python -m db.grants``. A person with several grants in one project has the widest of them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from uuid import uuid4

from sqlalchemy import and_, or_, select
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import audit, command_line, projects, unusable
from db.audit import COMMAND_LINE, Action
from db.keys import Scope
from db.models import GrantRow
from db.settings import chosen

MOST_LETTERS = 255
"""A person or a group is named by at most this many letters."""


class Kind(StrEnum):
    """Says whom a grant names."""

    PERSON = "person"
    GROUP = "group"


@dataclass(frozen=True)
class Person:
    """Describes who signed in, in the identity provider's words.

    Attributes:
        subject: the provider's name for the person, which never changes.
        email: the e-mail address in small letters; None unless the provider has verified it.
    """

    subject: str
    email: str | None
    groups: tuple[str, ...]

    @property
    def name(self) -> str:
        """Returns what people call the person."""
        return self.email or self.subject


def add(session: Session, project: str, kind: Kind, name: str, scope: Scope) -> None:
    """Lets a person or a group into a project, with this scope from now on.

    Raises:
        CirisError: project_not_found.
    """
    projects.get(session, project)
    row = _find(session, project, kind, name)
    if row is None:
        session.add(GrantRow(id=str(uuid4()), project=project, kind=kind, name=name, scope=scope))
    else:
        row.scope = scope


def revoke(session: Session, project: str, kind: Kind, name: str) -> None:
    """Withdraws a grant. Within a second a running API refuses those who work by it.

    Raises:
        CirisError: project_not_found, grant_not_found.
    """
    projects.get(session, project)
    row = _find(session, project, kind, name)
    if row is None:
        problem = f"the project {project} has no grant for the {kind} {name!r}"
        raise CirisError("grant_not_found", problem, field=f"--{kind}", hint="`ciris project grants` lists them")
    session.delete(row)


def of_person(session: Session, person: Person) -> list[GrantRow]:
    """Returns the widest grant of a person in each project, by project.

    A name with an @ is an e-mail address, and no subject: at some providers people choose their subjects.
    """
    names = [name for name in (person.email, None if "@" in person.subject else person.subject) if name]
    theirs = or_(
        and_(GrantRow.kind == Kind.PERSON, GrantRow.name.in_(names)),
        and_(GrantRow.kind == Kind.GROUP, GrantRow.name.in_(person.groups)),
    )
    widest: dict[str, GrantRow] = {}
    for row in session.scalars(select(GrantRow).where(theirs).order_by(GrantRow.project, GrantRow.kind, GrantRow.name)):
        known = widest.get(row.project)
        if known is None or not Scope(known.scope).includes(Scope(row.scope)):
            widest[row.project] = row
    return list(widest.values())


def all_of(session: Session, project: str | None) -> Sequence[GrantRow]:
    """Returns the grants of a project, or of all of them, by project and name."""
    query = select(GrantRow) if project is None else select(GrantRow).where(GrantRow.project == project)
    return session.scalars(query.order_by(GrantRow.project, GrantRow.kind, GrantRow.name)).all()


def _find(session: Session, project: str, kind: Kind, name: str) -> GrantRow | None:
    return session.scalar(select(GrantRow).where(GrantRow.project == project, GrantRow.kind == kind, GrantRow.name == name))


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs ``ciris project grant``, ``revoke-grant`` and ``grants`` on the database that the settings name."""
    parser = command_line.Parser(prog="ciris project", description="Who of the identity provider's people may do what in which project.")
    parser.add_argument("--data", type=command_line.path, help="data directory; default: CIRIS_DATA_DIR")
    verbs = parser.add_subparsers(dest="verb", required=True)
    adding = verbs.add_parser("grant", help="let a person or a group into a project")
    revoking = verbs.add_parser("revoke-grant", help="withdraw a grant")
    for verb in (adding, revoking):
        verb.add_argument("project")
        whom = verb.add_mutually_exclusive_group(required=True)
        whom.add_argument("--person", type=_name)
        whom.add_argument("--group", type=_name)
    adding.add_argument("--scope", type=Scope, choices=list(Scope), required=True)
    listing = verbs.add_parser("grants", help="list the grants")
    listing.add_argument("project", nargs="?")
    listing.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    for line in command_line.on_database(given.data, partial(_run, given=given)):
        print(line)
    print(f"database: {unusable.named(chosen(given.data).database)}", file=sys.stderr)


def _run(session: Session, given: argparse.Namespace) -> list[str]:
    """Does what the user asked, and returns the lines to print once it is committed."""
    if given.verb == "grants":
        if given.project is not None:
            projects.get(session, given.project)
        return command_line.listed([_described(row) for row in all_of(session, given.project)], as_json=given.json)
    kind, name = (Kind.GROUP, given.group) if given.person is None else (Kind.PERSON, _person(given.person))
    if given.verb == "grant":
        add(session, given.project, kind, name, given.scope)
        audit.note(session, given.project, COMMAND_LINE, Action.GRANT_MADE, f"{kind} {name} ({given.scope})")
    else:
        revoke(session, given.project, kind, name)
        audit.note(session, given.project, COMMAND_LINE, Action.GRANT_REVOKED, f"{kind} {name}")
    return []


def _person(given: str) -> str:
    """Returns a person's name as it is compared: an e-mail address in small letters, or a subject as it is."""
    return given.lower() if "@" in given else given


def _name(text: str) -> str:
    if not text.isprintable() or not 0 < len(text) <= MOST_LETTERS:
        raise argparse.ArgumentTypeError(f"{text!a} names nobody; write 1 to {MOST_LETTERS} printable letters")
    return text


def _described(row: GrantRow) -> dict[str, str]:
    return {
        "project": row.project,
        row.kind: row.name,
        "scope": row.scope,
        "created_at": row.created_at.isoformat(timespec="seconds"),
    }


if __name__ == "__main__":
    main()
