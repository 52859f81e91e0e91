"""These commands are a planner's questions: for a motion, for what is proved near by, whether a path is proved, how regions connect."""

from __future__ import annotations

import base64
import re
from argparse import Namespace
from collections.abc import Mapping, Sequence
from typing import Any

from certifier.errors import CirisError
from certifier.verify.decimals import at_least_mm
from certifier.words import counted, joint_positions, unit_names
from ciris.documents import Document
from ciris.synchronous.client import Client
from client import output, service
from client.files import ProofFile, check_writable
from client.inputs import Given, configuration, shown
from client.inputs import numbers as numbers_of
from client.options import JOB
from client.output import Screen, print_json
from client.paths import named, path_of
from client.request import refuse_options, request

OK, NO = 0, 1
GROWABLE = {"start_uncovered", "goal_uncovered", "disconnected"}
"""For these reasons there may be a trajectory once more regions have been grown."""
FIELDS = {
    "pose": "--to-pose",
    "line": "--tolerance",
    "start": "--from",
    "goal": "--to",
    "goals": "--to",
    "via": "--via",
    "speed": "--speed",
    "acceleration": "--acceleration",
}
"""Maps a field of the request to the argument that gives it."""


def nearest(args: Namespace) -> int:
    points = [configuration(text) for text in args.q]
    with service.connect(args.url) as client:
        scene = service.scene_name(client, args.scene)
        answer, units = client.nearest(scene, points), _units(client, scene, args)
    if args.json:
        print_json(answer)
    else:
        for q, point in zip(points, answer["points"], strict=True):
            near = point["nearest"]
            early = "" if point["complete"] else "; the search in the map ended early: a nearer point may be proved"
            print(f"{shown(q)}: {_near(near, units) if near else _nothing_near(answer)}{early}")
    return NO if any(point["nearest"] is None for point in answer["points"]) else OK


def plan(args: Namespace) -> int:
    start, goals = configuration(args.start, "--from"), [configuration(text, "--to") for text in args.goal]
    job = request(args, JOB)
    if not args.grow:
        refuse_options(args, JOB, "grow")
    elif not args.regions_only:
        raise CirisError("option", "--grow is about regions", field="--grow", hint="add --regions-only, or leave out --grow")
    proof = None
    if args.out is not None:
        check_writable(args.out)
        proof = ProofFile(args.out)
    asked: Document = {
        "start": start,
        **_goal(args, goals),
        "via": [configuration(text, "--via") for text in args.via],
        "regions_only": args.regions_only,
        "prove": args.out is not None,
    }
    for name in ("speed", "acceleration"):
        if getattr(args, name) is not None:
            asked[name] = _limit(getattr(args, name), f"--{name}")
    if args.seconds is not None:
        asked["seconds"] = args.seconds
    with service.connect(args.url) as client:
        scene = asked["scene"] = service.scene_name(client, args.scene)
        try:
            answer = _planned(client, asked)
            if args.grow and answer["reason"] in GROWABLE:
                _grow_between(client, scene, [start, *goals], job)
                answer = _planned(client, asked)
        except CirisError as error:
            error.field = error.field and _argument(error.field)
            raise
        units = _units(client, scene, args)
    written = None
    if proof is not None and answer["proof"] is not None:
        written = str(proof.write(answer["scene"], base64.b64decode(answer["proof"])))
    if args.json:
        print_json({**answer, "proof": written})
    elif answer["found"]:
        _print_pieces(answer["pieces"])
        length = f"{answer['length']:.4g} long in q ({unit_names(units.values())})"
        print(f"{counted(len(answer['q']), 'configuration')}, {length}, {answer['duration']:.4g} s; --json prints them")
        by = "lies in certified regions" if answer["motion"] is None else "is proved to be free of collision"
        print(f"all of the motion {by}, guarantee {answer['guarantee']}")
        if proof is not None and written is None:
            print("no proof file of exactly these numbers was found; the motion lies in the tube of the proved motion above")
        if written:
            print(f"proof: {written} (check it: ciris verify {written})")
    else:
        print(_why_not(answer, units))
    return OK if answer["found"] else NO


def _goal(args: Namespace, goals: list[Given]) -> Document:
    """Returns the fields of a request that say where the motion ends."""
    if bool(goals) == (args.to_pose is not None):
        raise CirisError("option", "the motion has to end somewhere", field="--to", hint="give either --to or --to-pose")
    if args.to_pose is None:
        for name in ("frame", "line", "tolerance"):
            if getattr(args, name):
                raise CirisError("option", "it is about a pose", field=f"--{name}", hint="give --to-pose, or leave it out")
        return {"goal": goals[0]} if len(goals) == 1 else {"goals": goals}
    numbers = numbers_of(args.to_pose, "--to-pose")
    if len(numbers) != 6 and not (args.line and len(numbers) == 3):
        hint = "give x, y and z in metres, then roll, pitch and yaw in radians; x, y and z are enough with --line"
        raise CirisError("option", f"a pose has 6 numbers, not {len(numbers)}", field="--to-pose", hint=hint)
    if args.frame is None:
        raise CirisError("option", "it is not said of which frame the pose is", field="--frame", hint="name a body, such as tool0")
    asked: Document = {"pose": {"frame": args.frame, "position": numbers[:3], "rpy": numbers[3:] or None}}
    if args.line:
        names = ("metres", "radians")
        asked["line"] = dict(zip(names, numbers_of(args.tolerance, "--tolerance"), strict=False)) if args.tolerance else {}
    elif args.tolerance:
        raise CirisError("option", "it is about a line", field="--tolerance", hint="give --line, or leave it out")
    return asked


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
        units = _units(client, scene, args)
    stop = answer["uncovered"]
    if args.json:
        print_json(answer)
        return OK if answer["covered"] else NO
    _print_pieces(answer["pieces"])
    if stop is None:
        print("covered: every point of the path is proved to be free of collision")
    else:
        print(f"not covered from {stop['time']:.6g} on, at q = {_place(stop['q'], units)}")
        print(f"next: {_near(stop['next'], units) if stop['next'] else _no_region(answer)}")
    return OK if answer["covered"] else NO


def graph(args: Namespace) -> int:
    screen = Screen()
    with service.connect(args.url) as client:
        scene = service.scene_name(client, args.scene)
        answer, units = service.graph(client, scene, screen), _units(client, scene, args)
    screen.clear()
    if args.json:
        print_json(answer)
        return OK
    print(f"regions: {answer['regions']}, overlaps: {len(answer['edges'])}, components: {answer['components']}")
    if answer["edges"]:
        rows = [(edge["a"], edge["b"], f"{edge['depth']:.3g}", _place(edge["q"], units)) for edge in answer["edges"]]
        output.print_table(("region", "overlaps", "depth", "witness q"), rows, right="depth")
    for gap in answer["gaps"]:
        said = "the map proves the straight motion across it" if gap["map"] else _advice(gap, units)
        print(f"gap of {gap['distance']:.3g} in s between {gap['a']} and {gap['b']}; {said}")
    return OK


def _planned(client: Client, asked: Document) -> Document:
    """Returns the answer of the service. It is asked again as long as pairs of regions are compared that may join the ends."""
    screen = Screen()
    answer = client.plan(asked)
    while answer["reason"] == "disconnected" and not answer["complete"]:
        screen.status("comparing regions")
        answer = client.plan(asked)
    screen.clear()
    return answer


def _grow_between(client: Client, scene: str, ends: Sequence[Any], asked: Document) -> None:
    """Has the service grow regions until both ends are in one component, or until it cannot go on.

    Args:
        asked: what the job is asked for besides.
    """
    try:
        service.run(client, {"kind": "cover", "scene": scene, "options": {"connect": ends}, **asked}, Screen())
    except CirisError as error:
        error.field = error.field and error.field.replace("options.connect[0]", "start").replace("options.connect[1]", "goal")
        raise


def _limit(text: str | None, field: str) -> float | list[float] | None:
    """Returns the limit of all joints, or of each."""
    if text is None:
        return None
    values = numbers_of(text, field)
    return values[0] if len(values) == 1 else values


def _why_not(answer: dict[str, Any], units: Mapping[str, str]) -> str:
    """Returns in words why there is no motion."""
    gap, stop, reason = answer["gap"], answer["uncovered"], answer["reason"]
    if limit := answer["limit"]:
        unit = units[limit["joint"]]
        bounds = " ".join(f"{word} {limit[side]:.10g}" for word, side in (("from", "lower"), ("to", "upper")) if limit[side] is not None)
        return f"{_field(limit['where'])}: joint {limit['joint']} is at {limit['value']:.10g} {unit}, and its limits are {bounds} {unit}"
    if touching := answer["collision"]:
        free = f"; free near by: {_place(touching['free'], units)}" if touching["free"] else ""
        what = touching["condition"] or f"{touching['a']} and {touching['b']} overlap by {at_least_mm(touching['depth'])}"
        return f"{_field(touching['where'])}: {what}{free}"
    if reached := answer["reached"]:
        nearest = f"the nearest that was found is off by {1000 * reached['metres']:.3g} mm and {reached['radians']:.3g} rad"
        return f"--to-pose: no configuration reaches it; {nearest}, at q = {_place(reached['q'], units)}"
    if stop_at := answer["line"]:
        why = {
            "line_limit": f"joint {stop_at['joint']} is at its limit",
            "line_singular": "the arm cannot move the frame on: it is stretched, axes are in line, or it has too few joints",
            "line_tolerance": "the tolerance needs segments that are too short; --tolerance allows more",
            "line_collision": f"{stop_at['a']} and {stop_at['b']} touch",
        }[reason]
        return f"the line ends at the part {stop_at['part']:.3g} of it: {why}"
    match reason:
        case "no_motion":
            return "no motion was found in time; --seconds gives more time"
        case "not_certified":
            return "a motion was found, but none that could be certified: it passes by something too closely"
        case "start_uncovered" | "goal_uncovered":
            end = "--from" if reason == "start_uncovered" else "--to"
            return (
                f"{end} is in no certified region; nearest: {_near(answer['nearest'], units) if answer['nearest'] else _no_region(answer)}"
            )
        case "disconnected":
            sides = f"{gap['start_regions']} of {answer['regions']} regions are connected with --from, {gap['goal_regions']} with --to"
            between = f"between {gap['start']} and {gap['goal']}"
            return f"{sides}\ngap of {gap['distance']:.3g} in s {between}; {_advice(gap, units)}"
        case _:
            where = f", the last one not at {stop['time']:.6g} s, q = {_place(stop['q'], units)}" if stop else ""
            return f"regions lead from --from to --to, but no trajectory was proved to be in them{where}"


def _argument(field: str) -> str:
    """Returns the argument that gave a field of the request."""
    return "--frame" if field == "pose.frame" else FIELDS.get(re.split(r"[\[.]", field)[0], field)


def _field(where: str) -> str:
    """Returns the argument that gave a field of the request, with its number among several."""
    name, bracket, number = where.partition("[")
    return f"{FIELDS.get(name, name)}{bracket}{number}"


def _print_pieces(pieces: Sequence[dict[str, Any]]) -> None:
    rows = [(f"{piece['begin']:.6g}", f"{piece['end']:.6g}", _proof_of(piece), piece["guarantee"]) for piece in pieces]
    if rows:
        output.print_table(("from", "to", "proved by", "guarantee"), rows, right="from to")


def _proof_of(piece: dict[str, Any]) -> str:
    """Returns what proves a piece of a motion."""
    if piece.get("map"):
        return f"map of job {piece['map']}"
    return f"motion {piece['motion']}" if piece["motion"] else f"region {piece['region']}"


def _near(near: dict[str, Any], units: Mapping[str, str]) -> str:
    what = f"the map of job {near['map']}" if near["map"] else near["region"]
    if near["distance"] == 0:
        return f"inside {what} ({near['guarantee']})"
    return f"{near['distance']:.3g} in s from {what} ({near['guarantee']}), whose nearest point is {_place(near['q'], units)}"


def _nothing_near(answer: dict[str, Any]) -> str:
    if answer["regions"] == 0 and answer["map"] is None:
        return "the scene has no regions and no map"
    return "nothing was found, or a joint is outside its limits"


def _advice(gap: dict[str, Any], units: Mapping[str, str]) -> str:
    """Returns what to do about a gap between regions."""
    return "no free configuration was found near its middle" if gap["q"] is None else f"try the seed {_place(gap['q'], units)}"


def _no_region(answer: dict[str, Any]) -> str:
    return "the scene has no regions" if answer["regions"] == 0 else "no region to compare with, or a joint is outside its limits"


def _place(q: Sequence[float], units: Mapping[str, str]) -> str:
    return joint_positions(q, units.values())


def _units(client: Client, scene: str, args: Namespace) -> dict[str, str]:
    """Returns the units of joint positions by the joints' names, in position order, for what people read."""
    return {} if args.json else service.units(client.scene(scene))
