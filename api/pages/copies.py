"""What a page shows is described here as others may ask for it: by a command, by curl, or in Python."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from urllib.parse import quote, urlencode

Copies = dict[str, list[str]]
"""What ``dashboard/source/common/copies.tsx`` shows: the commands, the paths of the interface, and lines of Python, without the address of
the service, which the browser knows best."""

OF_COMMANDS = ("state", "scene", "label", "search")
OF_INTERFACE = (*OF_COMMANDS, "ended", "kind")
OF_PYTHON = ("state", "scene", "labels", "search")
"""By what the command, the interface and the Python client may choose among jobs."""


def one(command: str, path: str, python: str) -> Copies:
    """Describes a page that shows one thing, or all of a kind."""
    return {"commands": [command], "paths": [path], "python": [python]}


def of_two(what: str, ids: tuple[str, str]) -> Copies:
    """Describes a page that has two of a kind side by side, such as two regions."""
    return {
        "commands": [f"ciris {what} show {shlex.quote(id)}" for id in ids],
        "paths": [f"/v1/{what}s/{quote(id)}" for id in ids],
        "python": [f"print(service.{what}({json.dumps(id)}))" for id in ids],
    }


def of_jobs(filters: Mapping[str, str]) -> Copies:
    """Describes the list of jobs as it is filtered. A comment names the filters that a form does not know.

    Args:
        filters: those of the page by their names in the interface: ``ended`` for a group of states, ``label`` for a search for one.
    """
    command = ["ciris job ls", *(f"--{name} {shlex.quote(value)}" for name, value in filters.items() if name in OF_COMMANDS)]
    query = urlencode({name: value for name, value in filters.items() if name in OF_INTERFACE})
    given = {
        "labels" if name == "label" else name: dict([value.split("=", 1)]) if name == "label" else value for name, value in filters.items()
    }
    arguments = ", ".join(f"{name}={json.dumps(value)}" for name, value in given.items() if name in OF_PYTHON)
    return {
        "commands": [*_without(filters, OF_COMMANDS), " ".join(command)],
        "paths": [*_without(filters, OF_INTERFACE), f"/v1/jobs{'?' + query if query else ''}"],
        "python": [*_without(given, OF_PYTHON), f"for job in service.jobs({arguments}):", "    print(job.id, job.state, job.reason)"],
    }


def of_regions(filters: Mapping[str, str]) -> Copies:
    """Describes the list of regions as it is filtered."""
    scene = filters.get("scene")
    lacking = _without(filters, ("scene",))
    return {
        "commands": [*lacking, f"ciris region ls{f' --scene {shlex.quote(scene)}' if scene else ''}"],
        "paths": [*lacking, f"/v1/regions{'?' + urlencode({'scene': scene}) if scene else ''}"],
        "python": [*lacking, f"regions = service.regions({json.dumps(scene) if scene else ''})"],
    }


def _without(filters: Mapping[str, object], known: tuple[str, ...]) -> list[str]:
    lacking = [name for name in filters if name not in known]
    return [f"# It cannot choose by {', '.join(lacking)}."] if lacking else []
