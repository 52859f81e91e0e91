"""Commands about projects: in this machine's database, or with ``--url`` over HTTP; and the one that shows a project of a service."""

from __future__ import annotations

from argparse import Namespace

from ciris.documents import Document, given
from client.managing import here, there
from client.output import print_facts, print_json, print_table
from client.service import connect

OK = 0
LIMITS = ("max_bytes", "keep_days", "max_solver_seconds")
NUMBERS = (*LIMITS, "solver_seconds")


def add(args: Namespace) -> int:
    if args.url is None:
        return here(args, "db.projects", ["add", args.name])
    with there(args) as client:
        client.add_project(args.name)
    return OK


def ls(args: Namespace) -> int:
    if args.url is None:
        return here(args, "db.projects", ["ls", *(["--json"] if args.json else [])])
    with there(args) as client:
        projects = client.projects()
    if args.json:
        print_json(projects)
    else:
        rows = [(project["name"], *map(_number, (project[name] for name in NUMBERS)), project["created_at"][:19]) for project in projects]
        print_table(("name", *NUMBERS, "created"), rows, right=" ".join(NUMBERS))
    return OK


def set_limits(args: Namespace) -> int:
    limits = given(**{name: getattr(args, name) for name in LIMITS})
    if args.url is None:
        return here(args, "db.projects", ["set", args.name, *(f"--{name.replace('_', '-')}={value!r}" for name, value in limits.items())])
    with there(args) as client:
        project = client.set_limits(args.name, **limits)
    print("  ".join(f"{name} {_number(value)}" for name, value in project.items() if name in LIMITS and value is not None))
    return OK


def show(args: Namespace) -> int:
    with connect(args.url) as client:
        project = client.project(args.name)
    if args.json:
        print_json(project)
        return OK
    most, days = project["max_bytes"], project["keep_days"]
    print(f"project {project['name']}")
    print_facts(
        [
            *([("your scope", project["scope"])] if "scope" in project else []),
            ("stored", f"{project['bytes'] / 1e6:.1f} MB" + ("" if most is None else f" of {most / 1e6:.1f} MB")),
            ("kept", "for ever" if days is None else f"jobs for {_days(days)} after their end, regions and scenes for ever"),
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


def _days(number: float) -> str:
    return f"{number:g} {'day' if number == 1 else 'days'}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.15g}"
