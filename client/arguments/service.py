"""Arguments of the commands that run the service and look after it, and of those about this machine."""

from __future__ import annotations

import argparse
import math
from typing import Any

from client.arguments.common import Parser, as_json, group, remote


def _limit(text: str) -> float:
    """Returns the number of a limit. The database or the service knows how large it may be."""
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0 on; 0 takes the limit away")
    return number


def _whom(args: argparse.Namespace) -> list[str]:
    """Returns the words that say whom a grant names."""
    return [f"--group={args.group}" if args.person is None else f"--person={args.person}"]


def add(verbs: Any) -> None:
    """Adds the commands."""
    up = verbs.add_parser("up", help="run the service on this machine until Ctrl-C")
    up.add_argument("--port", type=int, help="port of the API; default: CIRIS_PORT or 8643, or any free port when that one is taken")
    up.add_argument("--data", metavar="DIR", help="data directory; default: CIRIS_DATA_DIR")
    up.set_defaults(run="client.commands:up")

    database = Parser(add_help=False)
    database.add_argument("--data", metavar="DIR", help="data directory; default: CIRIS_DATA_DIR; not used where CIRIS_DATABASE_URL is set")
    project = group(
        verbs.add_parser(
            "project", help="make, list and limit projects: in this machine's database, or with --url over HTTP; show your own"
        )
    )
    by_operators = Parser(add_help=False)
    by_operators.add_argument("--url", help="URL of a service; then it needs an admin's key of the project default")
    new = project.add_parser("add", parents=[database, by_operators], help="make a project; its keys see nothing of other projects")
    new.add_argument("name", metavar="NAME", help="the new project's name")
    new.set_defaults(run="client.project:add")
    known = project.add_parser("ls", parents=[database, by_operators, as_json()], help="list the projects with their limits")
    known.set_defaults(run="client.project:ls")
    limits = project.add_parser("set", parents=[database, by_operators], help="set a project's limits; 0 for none")
    limits.add_argument("name", metavar="NAME", help="the project's name")
    limits.add_argument(
        "--max-bytes", type=_limit, metavar="N", help="refuse new scenes and jobs once the project stores N bytes; 0: no limit"
    )
    limits.add_argument(
        "--keep-days", type=_limit, metavar="DAYS", help="delete a job's data, except its regions, DAYS days after its end; 0: never"
    )
    limits.add_argument(
        "--max-solver-seconds",
        type=_limit,
        metavar="S",
        help="refuse new jobs in a calendar month (UTC) in which solvers have worked S seconds for the project; 0: no limit",
    )
    limits.set_defaults(run="client.project:set_limits")
    whom = Parser(add_help=False)
    whom.add_argument("name", metavar="NAME", help="the project's name")
    either = whom.add_mutually_exclusive_group(required=True)
    either.add_argument("--person", metavar="PERSON", help="a person, by the verified e-mail address, or by the provider's `sub`")
    either.add_argument("--group", metavar="GROUP", help="a group, as the identity provider names it")
    granted = project.add_parser("grant", parents=[whom, database], help="let people of the identity provider into a project")
    granted.add_argument(
        "--scope", choices=["read", "submit", "admin"], required=True, help="what they may do; each scope includes those before it"
    )
    granted.set_defaults(words=lambda args: ["grant", args.name, *_whom(args), f"--scope={args.scope}"])
    withdrawn = project.add_parser("revoke-grant", parents=[whom, database], help="withdraw a grant; it ends within a second")
    withdrawn.set_defaults(words=lambda args: ["revoke-grant", args.name, *_whom(args)])
    grants = project.add_parser("grants", parents=[database, as_json()], help="list who of the identity provider's people may do what")
    grants.add_argument("name", metavar="NAME", nargs="?", help="only those of this project")
    grants.set_defaults(words=lambda args: ["grants", *([] if args.name is None else [args.name]), *(["--json"] if args.json else [])])
    for verb in (granted, withdrawn, grants):
        verb.set_defaults(run="client.commands:in_database", module="db.grants")
    mine = project.add_parser(
        "show", parents=[remote(), as_json()], help="show a project of a service: its limits, and what remains of them"
    )
    mine.add_argument("name", metavar="NAME", nargs="?", help="any project, for admins of the project default; default: your own")
    mine.set_defaults(run="client.project:show")

    kept = group(verbs.add_parser("db", help="migrate, back up and restore this machine's database, or that of CIRIS_DATABASE_URL"))
    newest = kept.add_parser("upgrade", parents=[database], help="bring the tables to the newest revision; makes them where there are none")
    newest.set_defaults(words=lambda args: ["upgrade"])
    older = kept.add_parser(
        "downgrade",
        parents=[database],
        help="bring the tables to an older revision; what they cannot hold is lost: make a backup before",
    )
    older.add_argument("revision", metavar="REVISION", help="a revision, such as 0031; base takes every table away")
    older.set_defaults(words=lambda args: ["downgrade", args.revision])
    out = kept.add_parser("backup", parents=[database], help="write every row, proofs included, into a new file; the service may run")
    out.add_argument("file", metavar="FILE", help="the new file, an SQLite database")
    out.set_defaults(words=lambda args: ["backup", args.file])
    back = kept.add_parser("restore", parents=[database], help="fill a database that is empty from a backup")
    back.add_argument("file", metavar="FILE", help="a file of `ciris db backup`, of SQLite or of PostgreSQL")
    back.set_defaults(words=lambda args: ["restore", args.file])
    for verb in (newest, older, out, back):
        verb.set_defaults(run="client.commands:in_database", module="db.commands")

    key = group(verbs.add_parser("key", help="make, list and revoke API keys: in this machine's database, or with --url over HTTP"))
    over_http = Parser(add_help=False)
    over_http.add_argument("--url", help="URL of a service; then an admin's key of it manages the keys of its own project")
    made = key.add_parser("add", parents=[database, over_http], help="make a key and print it; it is shown only once")
    made.add_argument("name", metavar="NAME", help="the new key's name")
    made.add_argument(
        "--scope", choices=["read", "submit", "admin"], required=True, help="what the key allows; each scope includes those before it"
    )
    made.add_argument(
        "--project",
        metavar="NAME",
        help="the project that the key belongs to; with --url this needs an admin's key of the project default; default: "
        "the project named default, or with --url your own",
    )
    made.add_argument("--days", type=float, metavar="N", help="the key expires after N days; default: never")
    made.set_defaults(run="client.keys:add")
    listed = key.add_parser("ls", parents=[database, over_http, as_json()], help="list the keys, when each was last used, and no secrets")
    listed.set_defaults(run="client.keys:ls")
    revoked = key.add_parser("revoke", parents=[database, over_http], help="revoke a key; the service refuses it within a second")
    revoked.add_argument("name", metavar="NAME", help="the key's name")
    revoked.add_argument(
        "--project", metavar="NAME", help="the project that the key belongs to; default: the project named default; not with --url"
    )
    revoked.set_defaults(run="client.keys:revoke")

    bench = verbs.add_parser("bench", help="measure ciris, and Drake beside it if asked; see ciris bench BENCHMARK --help")
    kinds = ["pairs", "scene", "growth", "path", "agreement", "scaling", "service", "store", "survey", "robots", "arms", "query", "plan"]
    bench.add_argument("benchmark", choices=[*kinds, "cover", "map", "lookups", "recertify", "fleet", "docs"], help="what to measure")
    bench.add_argument("arguments", nargs=argparse.REMAINDER, metavar="...", help="the benchmark's own arguments")
    bench.set_defaults(run="client.bench:bench")

    doctor = verbs.add_parser(
        "doctor", parents=[remote(), as_json()], help="show what is installed, which solvers work, and what this machine can do"
    )
    doctor.set_defaults(run="client.commands:doctor")
