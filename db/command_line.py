"""This module runs commands that act on the database of the settings: ``ciris key`` and ``ciris project``."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import migrate
from db.session import Database
from db.settings import Settings


def on_database(data: Path | None, change: Callable[[Session], list[str]]) -> list[str]:
    """Migrates the database if that is needed, makes a change in one transaction, and returns the lines that it has to say.

    An error of the user's ends the process with status 2 and leaves the database as it was.
    """
    settings = Settings() if data is None else Settings(data_dir=data)
    migrate.upgrade(settings.database)
    database = Database(settings.database)
    try:
        with database.write() as session:
            return change(session)
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    finally:
        database.close()


def listed(rows: Sequence[dict[str, Any]], *, as_json: bool) -> list[str]:
    """Returns rows as lines for people, without what they lack, or as one JSON document."""
    if as_json:
        return [json.dumps(rows, indent=1)]
    return ["  ".join(f"{name} {value}" for name, value in row.items() if value is not None and value != "") for row in rows]
