"""This command has the service grow regions until they cover a scene, or connect configurations."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from client import output, service
from client.options import COVER
from client.output import Screen, print_json
from client.request import request

OK, NO = 0, 1


def cover(args: Namespace) -> int:
    """Starts a cover, waits for its end, and prints its results. Its exit status is 0 where all goals are reached."""
    asked, screen = request(args, COVER), Screen()
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)
        job = service.run(client, {"kind": "cover", "scene": scene["asked"], **asked}, screen)
        found = client.cover(job["id"])
    if args.json:
        print_json({"job": job["id"], "scene": scene["name"], **found})
    else:
        _print(found)
    return OK if found["outcome"] == "certified" else NO


def _components(sizes: Sequence[int]) -> str:
    return f"{len(sizes)}, with {', '.join(map(str, sizes))} region{'' if [*sizes] == [1] else 's'}" if sizes else "-"


def _print(found: dict[str, Any]) -> None:
    coverage = found["coverage"]
    facts = [
        ("ended", found["reason"]),
        ("covered", "-" if coverage is None else f"{output.share(coverage)} of the free configurations"),
        ("regions", f"{len(found['regions'])} of this cover, {sum(found['components'] or [])} of the scene"),
        ("components", _components(found["components"] or [])),
        *((f"connect[{i}]", "in no region" if part is None else f"in component {part}") for i, part in enumerate(found["connect"] or [])),
        *((f"path[{i}]", f"covered up to {output.percent(part)}") for i, part in enumerate(found["paths"] or [])),
        *(("obstacle", text) for text in found["obstacles"] or []),
        ("time", output.seconds(found["seconds"])),
    ]
    output.print_facts(facts)
