"""Keys and projects are managed in a database of this machine, or with ``--url`` over HTTP."""

from __future__ import annotations

import os
from argparse import Namespace

from certifier.errors import CirisError
from ciris.synchronous.client import Client
from client.commands import in_database
from client.service import connect

DATABASES = ("CIRIS_DATABASE_URL", "CIRIS_DATA_DIR")
"""Variables that say which database is meant."""


def here(args: Namespace, module: str, words: list[str]) -> int:
    """Replaces this process by the command that acts on a database of this machine, or on that of CIRIS_DATABASE_URL.

    Raises:
        CirisError: option, where CIRIS_URL is all that says what is meant.
    """
    if os.environ.get("CIRIS_URL") and args.data is None and not any(map(os.environ.get, DATABASES)):
        hint = "add --url URL for a service, or --data DIR for a database on this machine"
        raise CirisError("option", "this command does not take its service from it", field="CIRIS_URL", hint=hint)
    args.module, args.words = module, lambda _: words
    return in_database(args)


def there(args: Namespace) -> Client:
    """Returns a client of the service at ``--url``.

    Raises:
        CirisError: bad_option, with an option that is about a database.
    """
    if args.data is not None:
        raise CirisError("bad_option", "does not go with --url", field="--data", hint="leave one of them out")
    return connect(args.url)
