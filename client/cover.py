"""This command has the service grow regions until they cover a scene, or connect configurations."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from certifier.errors import CirisError
from client import output, service
from client.inputs import configuration
from client.output import Screen, print_json
from client.paths import path_file

OK, NO = 0, 1


def cover(args: Namespace) -> int:
    """Starts a cover, waits for its end, and prints its results. Its exit status is 0 where all goals are reached."""
    options: dict[str, Any] = {
        "seeds": [configuration(q, "--seed") for q in args.seed],
        "connect": [configuration(q, "--connect") for q in args.connect],
        "paths": [_waypoints(path) for path in args.path],
        "connected": args.connected,
    }
    names = ("coverage", "regions", "at_once", "region_seconds", "cells", "stages", "random_seed")
    options |= {name: value for name in names if (value := getattr(args, name)) is not None}
    if args.deadline is not None and not 0 < args.deadline < math.inf:
        raise CirisError("option", f"must be a number of seconds above 0, not {args.deadline:g}", field="--deadline")
    screen = Screen()
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)
        request = {"kind": "cover", "scene": scene["id"], "options": options}
        job = service.run(client, request if args.deadline is None else {**request, "deadline_seconds": args.deadline}, screen)
        found = client.cover(job["id"])
    if args.json:
        print_json({"job": job["id"], "scene": scene["name"], **found})
    else:
        _print(found)
    return OK if found["outcome"] == "certified" else NO


def _waypoints(path: str) -> list[list[float]]:
    """Returns the waypoints of a file, which have to be joint positions."""
    read = path_file(path)
    if "q" not in read.motion:
        message = f"{path} has no waypoints in q; a path to cover is straight in q between them"
        raise CirisError("option", message, field="--path", hint="give waypoints in q")
    return read.motion["q"].tolist()


def _components(sizes: Sequence[int]) -> str:
    return f"{len(sizes)}, with {', '.join(map(str, sizes))} regions" if sizes else "-"


def _print(found: dict[str, Any]) -> None:
    coverage = found["coverage"]
    facts = [
        ("ended", found["reason"]),
        ("covered", "-" if coverage is None else f"{output.share(coverage)} of the free configurations"),
        ("regions", f"{len(found['regions'])} of this cover, {sum(found['components'] or [])} of the scene"),
        ("components", _components(found["components"] or [])),
        *((f"connect[{i}]", "in no region" if part is None else f"in component {part}") for i, part in enumerate(found["connect"] or [])),
        *((f"path[{i}]", f"covered up to {100 * part:.4g} %") for i, part in enumerate(found["paths"] or [])),
        *(("obstacle", text) for text in found["obstacles"] or []),
        ("time", output.seconds(found["seconds"])),
    ]
    output.print_facts(facts)
