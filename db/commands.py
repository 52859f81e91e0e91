"""This module keeps the database of the settings: ``ciris db`` runs it as ``python -m db.commands``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from db import backup, command_line, migrate, version


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs ``ciris db`` on the database that the settings name."""
    parser = command_line.Parser(prog="ciris db", description="Migrates, backs up and restores the database that the settings name.")
    parser.add_argument("--data", type=command_line.path, help="data directory; default: CIRIS_DATA_DIR")
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("upgrade", help="bring the tables to the newest revision")
    down = verbs.add_parser("downgrade", help="bring the tables to an older revision")
    down.add_argument("revision", help="base takes every table away")
    for verb, about in (("backup", "write every row into a new file"), ("restore", "fill an empty database from a backup")):
        verbs.add_parser(verb, help=about).add_argument("file", type=command_line.path)
    given = parser.parse_args(arguments)
    for line in command_line.on_url(given.data, lambda url: _run(url, given)):
        print(line)


def _run(url: str, given: argparse.Namespace) -> list[str]:
    """Does what the user asked, and returns the lines to print once it is done."""
    match given.verb:
        case "upgrade":
            before, now = migrate.upgrade(url)
            return [f"the database is at revision {now}" + (" already" if before == now else f"; before: {before or 'no tables'}")]
        case "downgrade":
            command_line.check_there(url)
            before = migrate.downgrade(url, given.revision)
            return [f"the database is at revision {given.revision}; before: {before}"]
        case "backup":
            command_line.check_there(url)
            revision = backup.backup(url, given.file)
            return [f"{given.file} has every row of revision {revision}; CIRIS_SECRET_KEY, or secret.key, is not in it"]
        case _:
            revision = backup.restore(url, given.file)
            newest = version.revisions()[-1]
            lines = [f"restored at revision {revision}" + ("" if revision == newest else "; `ciris db upgrade` brings it to " + newest)]
            if not backup.sealed(given.file):
                lines.append(
                    f"{given.file} is of an older version and has no digest: only its scenes and proofs could be compared with theirs"
                )
            return lines


if __name__ == "__main__":
    main()
