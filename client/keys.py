"""Commands about API keys: in this machine's database, or with ``--url`` over HTTP, where they act on the project of the caller's key."""

from __future__ import annotations

from argparse import Namespace

from certifier.errors import CirisError
from client import output
from client.managing import here, there

OK = 0


def add(args: Namespace) -> int:
    if args.url is None:
        days = [] if args.days is None else [f"--days={args.days}"]
        return here(args, "db.keys", ["add", args.name, f"--scope={args.scope}", *days, *_project(args)])
    with there(args) as client:
        print(client.add_key(args.name, args.scope, args.days, args.project)["key"])
    return OK


def ls(args: Namespace) -> int:
    if args.url is None:
        return here(args, "db.keys", ["ls", *(["--json"] if args.json else [])])
    with there(args) as client:
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
        return here(args, "db.keys", ["revoke", args.name, *_project(args)])
    if args.project is not None:
        hint = "leave one of them out; keys are revoked by admins of their own project"
        raise CirisError("bad_option", "does not go with --url", field="--project", hint=hint)
    with there(args) as client:
        client.revoke_key(args.name)
    return OK


def _project(args: Namespace) -> list[str]:
    return [] if args.project is None else [f"--project={args.project}"]
