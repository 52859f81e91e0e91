"""These commands ask the service about its regions: for a trajectory through them, which is nearest, whether a path stays inside, and
how they are connected.
"""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from certifier.errors import CirisError
from ciris.documents import Document
from ciris.synchronous.client import Client
from client import output, service
from client.inputs import configuration
from client.options import JOB
from client.output import Screen, print_json
from client.paths import named, path_of
from client.request import refuse_options, request

OK, NO = 0, 1
GROWABLE = {"start_uncovered", "goal_uncovered", "disconnected"}
"""For these reasons there may be a trajectory once more regions have been grown."""
REGION = re.compile(r"[0-9a-f]{4,8}|[0-9a-f]{8}-[0-9a-f-]*")
"""An id of a region, or its beginning."""


def nearest(args: Namespace) -> int:
    points = [configuration(text) for text in args.q]
    with service.connect(args.url) as client:
        answer = client.nearest(service.scene_name(client, args.scene), points)
    found = [point["nearest"] for point in answer["points"]]
    if args.json:
        print_json(answer)
    else:
        for q, near in zip(points, found, strict=True):
            print(f"{_place(q)}: {_near(near) if near else _no_region(answer)}")
    return NO if None in found else OK


def plan(args: Namespace) -> int:
    ends = [_end(args.start, "--from"), _end(args.goal, "--to")]
    limits = [_limit(args.speed, "--speed"), _limit(args.acceleration, "--acceleration")]
    asked = request(args, JOB)
    if not args.grow:
        refuse_options(args, JOB, "grow")
    with service.connect(args.url) as client:
        scene = service.scene_name(client, args.scene)
        answer = _planned(client, scene, ends, limits)
        if args.grow and answer["reason"] in GROWABLE:
            _grow_between(client, scene, ends, asked)
            answer = _planned(client, scene, ends, limits)
    if args.json:
        print_json(answer)
    elif answer["found"]:
        _print_pieces(answer["pieces"])
        print(f"{len(answer['q'])} configurations, {answer['length']:.4g} long in q, {answer['duration']:.4g} s; --json prints them")
        print(f"every point between them is in certified regions, guarantee {answer['guarantee']}")
    else:
        print(_why_not(answer))
    return OK if answer["found"] else NO


def path(args: Namespace) -> int:
    given = path_of(args)
    asked: dict[str, Any] = {**given.motion, "space": args.space or ("s" if "s" in given.motion else "q")}
    if len(asked.get("q", [0, 0])) < 2:
        raise CirisError("option", "a path has two waypoints or more", field="--q", hint="give it once for each waypoint")
    if given.times is not None and "knots" not in asked:
        asked["times"] = given.times
    with service.connect(args.url) as client:
        scene = service.scene_name(client, args.scene)
        try:
            answer = client.path({"scene": scene, **asked})
        except CirisError as error:
            error.field = named(error.field, args)
            raise
    stop = answer["uncovered"]
    if args.json:
        print_json(answer)
        return OK if answer["covered"] else NO
    _print_pieces(answer["pieces"])
    if stop is None:
        count = len({piece["region"] for piece in answer["pieces"]})
        print(f"covered: every point of the path is in certified regions, {count} of {answer['regions']}")
    else:
        print(f"not covered from {stop['time']:.6g} on, at q = {_place(stop['q'])}")
        print(f"next: {_near(stop['next']) if stop['next'] else _no_region(answer)}")
    return OK if answer["covered"] else NO


def graph(args: Namespace) -> int:
    screen = Screen()
    with service.connect(args.url) as client:
        answer = service.graph(client, service.scene_name(client, args.scene), screen)
    screen.clear()
    if args.json:
        print_json(answer)
        return OK
    print(f"regions: {answer['regions']}, overlaps: {len(answer['edges'])}, components: {answer['components']}")
    if answer["edges"]:
        rows = [(edge["a"], edge["b"], f"{edge['depth']:.3g}", _place(edge["q"])) for edge in answer["edges"]]
        output.print_table(("region", "overlaps", "depth", "witness q"), rows, right="depth")
    for gap in answer["gaps"]:
        print(f"gap of {gap['distance']:.3g} in s between {gap['a']} and {gap['b']}; {_advice(gap)}")
    return OK


def _planned(client: Client, scene: str, ends: Sequence[Any], limits: Sequence[Any]) -> dict[str, Any]:
    """Returns the answer of the service. It is asked again as long as pairs of regions are compared that may join the ends."""
    screen = Screen()
    answer = client.plan(scene, *ends, *limits)
    while answer["reason"] == "disconnected" and not answer["complete"]:
        screen.status("comparing regions")
        answer = client.plan(scene, *ends, *limits)
    screen.clear()
    return answer


def _grow_between(client: Client, scene: str, ends: Sequence[Any], asked: Document) -> None:
    """Has the service grow regions until both ends are in one component, or until it cannot go on.

    Args:
        asked: what the job is asked for besides.
    """
    names = [name for name, end in zip(("--from", "--to"), ends, strict=True) if isinstance(end, str)]
    if names:
        raise CirisError("option", "regions grow between configurations, not regions", field=names[0], hint="give joint positions")
    try:
        service.run(client, {"kind": "cover", "scene": scene, "options": {"connect": ends}, **asked}, Screen())
    except CirisError as error:
        error.field = error.field and error.field.replace("options.connect[0]", "start").replace("options.connect[1]", "goal")
        raise


def _end(text: str, field: str) -> list[float] | str:
    """Returns the configuration that a text is, or the text where it is no number and may be the id of a region."""
    try:
        return configuration(text, field)
    except CirisError:
        if REGION.fullmatch(text):
            return text
        raise


def _limit(text: str | None, field: str) -> float | list[float] | None:
    """Returns the limit of all joints, or of each."""
    if text is None:
        return None
    values = configuration(text, field)
    return values[0] if len(values) == 1 else values


def _why_not(answer: dict[str, Any]) -> str:
    """Returns in words why there is no trajectory."""
    gap, stop = answer["gap"], answer["uncovered"]
    match answer["reason"]:
        case "start_uncovered" | "goal_uncovered":
            end = "--from" if answer["reason"] == "start_uncovered" else "--to"
            return f"{end} is in no certified region; nearest: {_near(answer['nearest']) if answer['nearest'] else _no_region(answer)}"
        case "disconnected":
            sides = f"{gap['start_regions']} of {answer['regions']} regions are connected with --from, {gap['goal_regions']} with --to"
            between = f"between {gap['start']} and {gap['goal']}"
            return f"{sides}\ngap of {gap['distance']:.3g} in s {between}; {_advice(gap)}"
        case _:
            where = f", the last one not at {stop['time']:.6g} s, q = {_place(stop['q'])}" if stop else ""
            return f"regions lead from --from to --to, but no trajectory was proved to be in them{where}"


def _print_pieces(pieces: Sequence[dict[str, Any]]) -> None:
    rows = [(f"{piece['begin']:.6g}", f"{piece['end']:.6g}", piece["region"], piece["guarantee"]) for piece in pieces]
    if rows:
        output.print_table(("from", "to", "region", "guarantee"), rows, right="from to")


def _near(near: dict[str, Any]) -> str:
    if near["distance"] == 0:
        return f"inside {near['region']} ({near['guarantee']})"
    return f"{near['distance']:.3g} in s from {near['region']} ({near['guarantee']}), whose nearest point is {_place(near['q'])}"


def _advice(gap: dict[str, Any]) -> str:
    """Returns what to do about a gap between regions."""
    return "no free configuration was found near its middle" if gap["q"] is None else f"try the seed {_place(gap['q'])}"


def _no_region(answer: dict[str, Any]) -> str:
    return "the scene has no regions" if answer["regions"] == 0 else "no region to compare with, or a joint is outside its limits"


def _place(q: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in q)
