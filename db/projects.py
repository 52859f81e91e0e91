"""This module makes projects and sets their limits. ``ciris project`` runs it as ``python -m db.projects``.

A project is a team's part of the service. A key of it shows its scenes, jobs and regions, and nothing of other projects.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import audit, command_line, solver_time
from db.audit import COMMAND_LINE, Action
from db.models import ProjectRow
from db.session import insert_new

NAME = re.compile(r"\w[\w.@-]{0,63}")
"""Projects and keys have such names."""
MOST_BYTES = 2**62
MOST_SECONDS = 10**12
MOST_DAYS = 36_500
"""A project keeps things for at most this many days. An earlier version took more: then nothing expires."""


def add(session: Session, name: str) -> ProjectRow:
    """Makes a project.

    Raises:
        CirisError: project_name, for a name that cannot be used or is in use.
    """
    if not NAME.fullmatch(name):
        raise CirisError(
            "project_name", f"{name!r} is no name for a project", field="name", hint="choose up to 64 letters, digits and . _ - @"
        )
    if not insert_new(session, ProjectRow, [{"name": name}]):
        raise CirisError("project_name", f"there is a project {name!r} already", field="name", hint="choose another name")
    return get(session, name)


def get(session: Session, name: str) -> ProjectRow:
    """Returns the project of this name.

    Raises:
        CirisError: project_not_found.
    """
    row = session.get(ProjectRow, name)
    if row is None:
        raise CirisError("project_not_found", f"there is no project {name!r}", field="project", hint="`ciris project add NAME` makes one")
    return row


def all_of(session: Session) -> Sequence[ProjectRow]:
    """Returns every project, by name."""
    return session.scalars(select(ProjectRow).order_by(ProjectRow.name)).all()


def page(session: Session, after: str | None, limit: int) -> tuple[Sequence[ProjectRow], str | None]:
    """Returns a page of the projects, by name: those after the one of this name, and the name to go on after; None on the last page."""
    query = select(ProjectRow).order_by(ProjectRow.name).limit(limit + 1)
    rows = session.scalars(query if after is None else query.where(ProjectRow.name > after)).all()
    return rows[:limit], rows[limit - 1].name if len(rows) > limit else None


def limits(row: ProjectRow) -> dict[str, float | None]:
    """Returns a project's limits, by name; None for no limit."""
    return {"max_bytes": row.max_bytes, "keep_days": row.keep_days, "max_solver_seconds": row.max_solver_seconds}


def set_limits(session: Session, name: str, given: Mapping[str, float | None], who: str = COMMAND_LINE) -> ProjectRow:
    """Sets those limits of a project that are given, and notes who did so, with the values before and after.

    Args:
        given: limits as :func:`limits` names them; 0 or None takes one away.

    Raises:
        CirisError: project_not_found.
    """
    get(session, name)
    # Others refer to the row meanwhile, but nobody else changes it.
    row = session.get_one(ProjectRow, name, with_for_update={"key_share": True}, populate_existing=True)
    before = limits(row)
    for limit, value in given.items():
        setattr(row, limit, value or None)
    changed = [f"{limit} {_said(before[limit])} -> {_said(value)}" for limit, value in limits(row).items() if value != before[limit]]
    if changed:
        audit.note_of_service(session, name, who, Action.LIMITS_SET, ", ".join(changed))
    return row


def some_expires(session: Session) -> bool:
    """Says whether a project deletes what is old."""
    return session.scalar(select(ProjectRow.name).where(expires()).limit(1)) is not None


def expires() -> ColumnElement[bool]:
    """Returns the condition that a project deletes what is old."""
    return ProjectRow.keep_days <= MOST_DAYS


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs ``ciris project`` on the database that the settings name."""
    parser = command_line.Parser(prog="ciris project", description="The projects of the service whose database the settings name.")
    parser.add_argument("--data", type=command_line.path, help="data directory; default: CIRIS_DATA_DIR")
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("add", help="make a project").add_argument("name")
    verbs.add_parser("ls", help="list the projects with their limits").add_argument("--json", action="store_true")
    setting = verbs.add_parser("set", help="set a project's limits; 0 for none")
    setting.add_argument("name")
    setting.add_argument("--max-bytes", type=_bytes, help="the project may store this many bytes")
    setting.add_argument(
        "--keep-days", type=partial(_limit, most=MOST_DAYS), help="jobs without a region are deleted this many days after their end"
    )
    setting.add_argument(
        "--max-solver-seconds",
        type=partial(_limit, most=MOST_SECONDS),
        help="no new job is taken in a month in which solvers have worked for the project this long",
    )
    given = parser.parse_args(arguments)
    for line in command_line.on_database(given.data, partial(_run, given=given)):
        print(line)


def _limit(text: str, most: int) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not number >= 0:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0 on; 0 takes the limit away")
    if number > most:
        raise argparse.ArgumentTypeError(f"{text} is more than {most}; 0 takes the limit away")
    return number


def _bytes(text: str) -> int:
    number = _limit(text, MOST_BYTES)
    if number != int(number):
        raise argparse.ArgumentTypeError(f"{text} is not a whole number; 0 takes the limit away")
    return int(number)


def _run(session: Session, given: argparse.Namespace) -> list[str]:
    """Does what the user asked, and returns the lines to print once it is committed."""
    match given.verb:
        case "add":
            add(session, given.name)
            audit.note_of_service(session, given.name, COMMAND_LINE, Action.PROJECT_MADE, given.name)
            return []
        case "set":
            typed = {"max_bytes": given.max_bytes, "keep_days": given.keep_days, "max_solver_seconds": given.max_solver_seconds}
            row = set_limits(session, given.name, {limit: value for limit, value in typed.items() if value is not None})
            return command_line.listed([_described(session, row)], as_json=False)
        case _:
            return command_line.listed([_described(session, row) for row in all_of(session)], as_json=given.json)


def _said(limit: float | None) -> str:
    return "none" if limit is None else f"{limit:.15g}" if isinstance(limit, float) else str(limit)


def _described(session: Session, row: ProjectRow) -> dict[str, Any]:
    return {
        "name": row.name,
        **limits(row),
        "solver_seconds": round(solver_time.used(session, row.name), 1),
        "created_at": row.created_at.isoformat(timespec="seconds"),
    }


if __name__ == "__main__":
    main()
