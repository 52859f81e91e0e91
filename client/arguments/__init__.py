"""The parser of the ``ciris`` command, from which docs/commands.md is made too (``python -m tests.docs.commands``)."""

from __future__ import annotations

import argparse

from client.arguments import jobs, planning, regions, scenes, service
from client.arguments.common import Parser, Version, group

EPILOG = """exit status: 0 success; 1 a negative answer (not certified, a proof that does not hold, a point outside);
2 bad input or no service; 130 interrupted. An error is one line on standard error. With --json a command prints one
JSON document on standard output; everything else goes to standard error.

SCENE is the path of a scene file (.yaml), or the name or id of a scene that the service knows.

In the place of joint positions stand names of configurations of the scene as well: --q home, or --q left_home,right_home."""


def parser() -> Parser:
    """Returns the parser."""
    ciris = Parser(
        prog="ciris",
        description="Certified collision-free regions of robot configuration space.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    ciris.add_argument("--version", action=Version)
    verbs = group(ciris)
    for commands in (scenes, regions, planning, jobs, service):
        commands.add(verbs)
    return ciris
