"""What the parsers of several commands have in common."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from certifier.names import escaped

SCENE = "path of a scene file, or the name or id of a scene that the service knows; NAME@staged is the staged version of a name"
OF_ONE = "the id, or its first characters"
WATCH = "print a line for every pair when it is decided"


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong. The parsed arguments have the parser of their command as ``parser``."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)
        self.set_defaults(parser=self)

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {escaped(message.removeprefix('argument '))} (see {self.prog} --help)\n")


class Version(argparse.Action):
    """Prints the version. Only then is it looked up, which takes as long as many a question to a service."""

    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, help="show program's version number and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print("ciris", version("ciris"))
        parser.exit()


def group(parser: argparse.ArgumentParser) -> Any:
    """Returns where the commands below a command are added."""
    return parser.add_subparsers(required=True, metavar="COMMAND", parser_class=Parser)


def remote() -> Parser:
    """Returns the parent of commands that ask a service."""
    parser = Parser(add_help=False)
    parser.add_argument("--url", help="URL of the service; default: CIRIS_URL, or the service that `ciris up` runs here")
    return parser


def as_json() -> Parser:
    """Returns the parent of commands that can print a JSON document."""
    parser = Parser(add_help=False)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    return parser


def dependents() -> Parser:
    """Returns the parent of commands that delete what others depend on."""
    parser = Parser(add_help=False)
    parser.add_argument(
        "--dependents",
        action="store_true",
        help="also delete its dependents; without this option, the command lists them and deletes nothing if there are any",
    )
    return parser


def add_proving(parser: argparse.ArgumentParser, verb: str, out: str) -> None:
    """Adds the arguments of a command that proves something, in a service or in this process.

    Args:
        verb: what the command does.
        out: help text of ``--out``.
    """
    parser.add_argument("--out", metavar="FILE", help=out)
    parser.add_argument("--watch", action="store_true", help=WATCH)
    parser.add_argument("--local", action="store_true", help=f"{verb} in this process, without a service")
