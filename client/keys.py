"""Commands about API keys: in this machine's database, or with ``--url`` over HTTP, where they act on the project of the caller's key."""

from __future__ import annotations

import os
from argparse import Namespace

from certifier.errors import CirisError
from ciris.synchronous.client import Client
from client import output
from client.commands import in_database
from client.service import connect

OK = 0
DATABASES = ("CIRIS_DATABASE_URL", "CIRIS_DATA_DIR")
"""Variables that say which database is meant."""


def add(args: Namespace) -> int:
    if args.url is None:
        days = [] if args.days is None else [f"--days={args.days}"]
        return _here(args, ["add", args.name, f"--scope={args.scope}", *days, *_project(args)])
    with _there(args) as client:
        print(client.add_key(args.name, args.scope, args.days)["key"])
    return OK


def ls(args: Namespace) -> int:
    if args.url is None:
        return _here(args, ["ls", *(["--json"] if args.json else [])])
    with _there(args) as client:
        keys = client.keys()
    if args.json:
        output.print_json(keys)
    else:
        times = ("created_at", "last_used_at", "expires_at", "revoked_at")
        rows = [(key["name"], key["scope"], key["id"], *((key[time] or "")[:19] for time in times)) for key in keys]
        output.print_table(("name", "scope", "id", "created", "last used", "expires", "revoked"), rows)
    return OK


def revoke(args: Namespace) -> int:
    if args.url is None:
        return _here(args, ["revoke", args.name, *_project(args)])
    with _there(args) as client:
        client.revoke_key(args.name)
    return OK


def _project(args: Namespace) -> list[str]:
    return [] if args.project is None else [f"--project={args.project}"]


def _here(args: Namespace, words: list[str]) -> int:
    """Acts on a database of this machine, or on that of CIRIS_DATABASE_URL.

    Raises:
        CirisError: option, where CIRIS_URL is all that says which keys are meant.
    """
    if os.environ.get("CIRIS_URL") and args.data is None and not any(map(os.environ.get, DATABASES)):
        hint = "add --url URL for the keys of a service, or --data DIR for those of a database on this machine"
        raise CirisError("option", "this command does not take its service from it", field="CIRIS_URL", hint=hint)
    args.module, args.words = "db.keys", lambda _: words
    return in_database(args)


def _there(args: Namespace) -> Client:
    """Returns a client of the service at ``--url``.

    Raises:
        CirisError: bad_option, with an option that is about the database.
    """
    for option in ("data", "project"):
        if getattr(args, option, None) is not None:
            hint = "leave one of them out; the keys of a service are those of the project of your own key"
            raise CirisError("bad_option", "does not go with --url", field=f"--{option}", hint=hint)
    return connect(args.url)
