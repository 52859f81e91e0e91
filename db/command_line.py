"""This module runs commands that act on the database of the settings: ``ciris key``, ``ciris project`` and ``ciris db``."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NoReturn

from sqlalchemy.engine import make_url
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import unusable
from db.session import Database
from db.settings import DATABASE_FIELD, Settings, chosen


def on_database(data: Path | None, change: Callable[[Session], list[str]]) -> list[str]:
    """Makes a change in one transaction, and returns the lines that it has to say.

    No database is made: the directory may be misspelt. None is migrated: processes of an older version may use it.
    """

    def changed(url: str) -> list[str]:
        check_there(url)
        with closing(Database(url)) as database, database.write() as session:
            return change(session)

    return on_url(data, changed)


def on_url(data: Path | None, act: Callable[[str], list[str]]) -> list[str]:
    """Does something with the database of the settings, and returns the lines that it has to say.

    An error of the user's ends the process with status 2 and leaves the database as it was.

    Args:
        data: the data directory; None for that of the settings.
    """
    try:
        settings = settings_with(data)
        try:
            return act(settings.database)
        except unusable.ERRORS as error:
            raise settings.placed(unusable.refusal(error, settings.database)) from None
        except CirisError as error:
            raise settings.placed(error) from None
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def settings_with(data: Path | None) -> Settings:
    """Returns the settings of the environment, with this data directory; None for that of the settings.

    Raises:
        CirisError: bad_option, where the settings name a database that is in no data directory; setting.
    """
    settings = chosen(data)
    if data is not None and settings.database_url:
        hint = f"leave one of them out: the database would be that of {DATABASE_FIELD}"
        raise CirisError("bad_option", f"does not go with {DATABASE_FIELD}", field="--data", hint=hint)
    return settings


def check_there(url: str) -> None:
    """Refuses an SQLite database that is not there. A server says by itself that it lacks one.

    Raises:
        CirisError: no_database.
    """
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite" and not os.path.exists(parsed.database or ""):
        hint = "is it spelt so? `ciris up` and `ciris db upgrade` make one"
        raise CirisError("no_database", f"there is none at {parsed.database}", field="database", hint=hint)


def path(text: str) -> Path:
    """Returns the path that an argument names."""
    if not text:
        raise argparse.ArgumentTypeError("an empty text names nothing")
    if text != os.fsencode(text).decode(errors="replace"):
        raise argparse.ArgumentTypeError(f"{text!a} is no UTF-8, which SQLite's files need to be called in")
    return Path(text)


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with arguments."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {message} (see {self.prog} --help)\n")


def listed(rows: Sequence[dict[str, Any]], *, as_json: bool) -> list[str]:
    """Returns rows as lines for people, without what they lack, or as one JSON document."""
    if as_json:
        return [json.dumps(rows, indent=1)]
    return ["  ".join(f"{name} {value}" for name, value in row.items() if value is not None and value != "") for row in rows]
