"""This module says of a database that cannot be used which one it is, what is wrong with it, and what to do."""

from __future__ import annotations

from sqlalchemy.engine import make_url
from sqlalchemy.exc import DatabaseError, InterfaceError, SQLAlchemyError, TimeoutError

from certifier.errors import CirisError
from db.disk import lacks_room

ERRORS = (DatabaseError, InterfaceError, TimeoutError)
"""What a database that cannot be used raises."""
_NO_DATABASE = ("SQLITE_NOTADB", "SQLITE_CORRUPT")


def named(url: str) -> str:
    """Returns the file of an SQLite database, or the name and server of another one, without what is secret."""
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite":
        return parsed.database or "in memory"
    host = (parsed.host or "this machine").rpartition("@")[2]  # a password with an @ that is not escaped ends up here
    return f"{parsed.database} on {host}" + ("" if parsed.port is None else f":{parsed.port}")


def refusal(error: SQLAlchemyError, url: str) -> CirisError:
    """Returns the error that says why the database cannot be used. A link's own words may have the password in them."""
    cause = getattr(error, "orig", None) or error
    if lacks_room(error):
        return CirisError("no_room", "the disk is full, or cannot be written", field="database", hint="free some room; nothing was changed")
    if (getattr(cause, "sqlite_errorname", None) or "").startswith(_NO_DATABASE):
        hint = "name another data directory, or move the file away and restore a backup (`ciris db restore`)"
        return CirisError("no_database", f"{named(url)} is no database of SQLite, or a broken one", field="CIRIS_DATABASE_URL", hint=hint)
    if make_url(url).get_backend_name() == "sqlite":
        hint = "may you read and write that file and its directory, and does nobody else hold it?"
        return CirisError("no_database", f"{named(url)} cannot be used: {cause}", field="CIRIS_DATABASE_URL", hint=hint)
    problem = f"the database {named(url)} cannot be used: {type(cause).__name__}"
    return CirisError("no_database", problem, field="CIRIS_DATABASE_URL", hint="does its server run, and are name and password right?")
