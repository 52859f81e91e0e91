"""A command about the project of the caller's key."""

from __future__ import annotations

from argparse import Namespace

from ciris.documents import Document
from client.output import print_facts, print_json
from client.service import connect

OK = 0


def show(args: Namespace) -> int:
    with connect(args.url) as client:
        project = client.project()
    if args.json:
        print_json(project)
        return OK
    most, days = project["max_bytes"], project["keep_days"]
    print(f"project {project['name']}")
    print_facts(
        [
            ("your scope", project["scope"]),
            ("stored", f"{project['bytes'] / 1e6:.1f} MB" + ("" if most is None else f" of {most / 1e6:.1f} MB")),
            ("kept", "for ever" if days is None else f"jobs for {days:g} days after their end, regions and scenes for ever"),
            ("solvers", _solvers(project)),
        ]
    )
    return OK


def _solvers(project: Document) -> str:
    """Returns how long solvers have worked for the project this month, and what remains, in seconds as the limit is set."""
    used, most = project["solver_seconds"], project["max_solver_seconds"]
    if most is None:
        return f"{used:.0f} s this month"
    return f"{used:.0f} of {most:.0f} s this month; {max(most - used, 0.0):.0f} s left until {project['month_ends_at'][:10]}"
