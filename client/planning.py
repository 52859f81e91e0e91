"""These commands ask the service about its regions: which is nearest, whether a path stays inside, how they hang together."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from certifier.errors import CirisError
from client import output, service
from client.inputs import configuration
from client.output import Screen, print_json
from client.paths import named, path_of

OK, NO = 0, 1


def nearest(args: Namespace) -> int:
    points = [configuration(text) for text in args.q]
    with service.connect(args.url) as client:
        answer = client.nearest(service.known_scene(client, args.scene)["id"], points)
    found = [point["nearest"] for point in answer["points"]]
    if args.json:
        print_json(answer)
    else:
        for q, near in zip(points, found, strict=True):
            print(f"{_place(q)}: {_near(near) if near else _no_region(answer)}")
    return NO if None in found else OK


def path(args: Namespace) -> int:
    given = path_of(args)
    asked: dict[str, Any] = {**given.document(), "space": args.space or ("s" if "s" in given.motion else "q")}
    if len(asked.get("q", [0, 0])) < 2:
        raise CirisError("option", "a path has two waypoints or more", field="--q", hint="give it once for each waypoint")
    if given.times is not None and "knots" not in asked:
        asked["times"] = given.times.tolist()
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)["id"]
        try:
            answer = client.path({"scene": scene, **asked})
        except CirisError as error:
            error.field = named(error.field, args)
            raise
    stop = answer["uncovered"]
    if args.json:
        print_json(answer)
        return OK if answer["covered"] else NO
    rows = [(f"{piece['begin']:.6g}", f"{piece['end']:.6g}", piece["region"], piece["guarantee"]) for piece in answer["pieces"]]
    if rows:
        output.print_table(("from", "to", "region", "guarantee"), rows, right="from to")
    if stop is None:
        print(f"covered: every point of the path is in certified regions, {len({row[2] for row in rows})} of {answer['regions']}")
    else:
        print(f"not covered from {stop['time']:.6g} on, at q = {_place(stop['q'])}")
        print(f"next: {_near(stop['next']) if stop['next'] else _no_region(answer)}")
    return OK if answer["covered"] else NO


def graph(args: Namespace) -> int:
    screen = Screen()
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)["id"]
        answer = client.graph(scene)
        while not answer["complete"]:
            screen.status(f"comparing regions: {len(answer['edges'])} overlaps so far")
            answer = client.graph(scene)
    screen.clear()
    if args.json:
        print_json(answer)
        return OK
    print(f"regions: {answer['regions']}, overlaps: {len(answer['edges'])}, components: {answer['components']}")
    if answer["edges"]:
        rows = [(edge["a"], edge["b"], f"{edge['depth']:.3g}", _place(edge["q"])) for edge in answer["edges"]]
        output.print_table(("region", "overlaps", "depth", "witness q"), rows, right="depth")
    for gap in answer["gaps"]:
        print(f"gap of {gap['distance']:.3g} in s between {gap['a']} and {gap['b']}; try the seed {_place(gap['q'])}")
    return OK


def _near(near: dict[str, Any]) -> str:
    if near["distance"] == 0:
        return f"inside {near['region']} ({near['guarantee']})"
    return f"{near['distance']:.3g} in s from {near['region']} ({near['guarantee']}), whose nearest point is {_place(near['q'])}"


def _no_region(answer: dict[str, Any]) -> str:
    return "the scene has no regions" if answer["regions"] == 0 else "no region to compare with, or a joint is outside its limits"


def _place(q: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in q)
