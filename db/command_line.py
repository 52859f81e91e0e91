"""This module runs commands that act on the database of the settings: ``ciris key`` and ``ciris project``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NoReturn

from sqlalchemy.engine import make_url
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import migrate
from db.session import Database
from db.settings import Settings


def on_database(data: Path | None, change: Callable[[Session], list[str]]) -> list[str]:
    """Migrates the database if that is needed, makes a change in one transaction, and returns the lines that it has to say.

    An error of the user's ends the process with status 2 and leaves the database as it was. No database is made: the directory may be
    misspelt.
    """
    settings = Settings() if data is None else Settings(data_dir=data)
    try:
        check_there(settings.database)
        migrate.upgrade(settings.database)
        with closing(Database(settings.database)) as database, database.write() as session:
            return change(session)
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def check_there(url: str) -> None:
    """Refuses an SQLite database that is not there. A server says by itself that it lacks one.

    Raises:
        CirisError: no_database.
    """
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite" and not Path(parsed.database or "").exists():
        hint = "is it spelt so? `ciris up` and `python -m db.migrate` make one"
        raise CirisError("no_database", f"there is none at {parsed.database}", field="database", hint=hint)


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with arguments."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {message} (see {self.prog} --help)\n")


def listed(rows: Sequence[dict[str, Any]], *, as_json: bool) -> list[str]:
    """Returns rows as lines for people, without what they lack, or as one JSON document."""
    if as_json:
        return [json.dumps(rows, indent=1)]
    return ["  ".join(f"{name} {value}" for name, value in row.items() if value is not None and value != "") for row in rows]
