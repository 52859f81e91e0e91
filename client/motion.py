"""``ciris certify-path`` certifies a motion in this process and prints what has become of it."""

from __future__ import annotations

import math
from argparse import Namespace
from typing import Any

import numpy as np

from certifier.errors import CirisError, RegionError
from certifier.proof.motion import Space
from certifier.verify.decimals import at_least_mm, rounded_down
from client import output
from client.files import ProofFile, check_writable
from client.inputs import configuration
from client.local import load
from client.output import print_json
from client.paths import PathFile, path_file

OK, NO = 0, 1


def certify_path(args: Namespace) -> int:
    """Certifies the motion that the arguments give, and returns the command's exit status.

    Raises:
        CirisError: the motion, its file or the scene cannot be used.
    """
    path, field = _path(args), "--path" if args.path else "--q"
    if not args.local:
        raise CirisError("option", "the command asks no service about motions", field="--local", hint="add --local")
    kept = None
    if args.out is not None:
        check_writable(args.out)
        kept = ProofFile(args.out)
    scene = load(args.scene)
    from certifier.jobs.motion import certify
    from certifier.motion.given import given

    motion = given(scene, path.waypoints, path.coordinates, Space(args.space) if args.space else None, field)
    verdict = certify(scene, motion, args.tube)
    written = None if kept is None or verdict.proof is None else str(kept.write(scene.name, verdict.proof))
    document = _timed({**verdict.document(), "proof": written}, path)
    if args.json:
        print_json(document)
    else:
        _print(document, verdict.proof is not None and not written)
    return OK if document["outcome"] == "certified" else NO


def _path(args: Namespace) -> PathFile:
    """Returns the waypoints of the arguments."""
    if bool(args.q) == bool(args.path):
        hint = "give them with --q, once for each, or as a file with --path"
        raise CirisError("option", "a motion needs its waypoints, from one place", field="--path", hint=hint)
    if args.path:
        return path_file(args.path)
    waypoints = [configuration(text, f"--q {i}") for i, text in enumerate(args.q)]
    if len({len(waypoint) for waypoint in waypoints}) > 1:
        raise RegionError(
            "motion_shape", "the waypoints have different numbers of joints", field="--q", hint="give one number for each joint"
        )
    return PathFile(Space.Q, np.array(waypoints), None)


def _timed(document: dict[str, Any], path: PathFile) -> dict[str, Any]:
    """Returns the document with the file's own time, ``t``, at each place on the motion; None where the file has no times."""
    places = {name: document[name] for name in ("certified_to", "stop") if document[name]}
    for place in places.values():
        start = place["piece"]
        place["t"] = None if path.times is None else float(path.times[start] + place["time"] * (path.times[start + 1] - path.times[start]))
    return {**document, **places}


def _print(document: dict[str, Any], unwritten: bool) -> None:
    stop, certified, tube = document["stop"], document["certified_to"], document["tube"]
    if stop:
        how = "touch" if document["outcome"] == "refuted" else f"are {at_least_mm(stop['distance'])} apart, too close to go on,"
        print(f"{stop['a']} and {stop['b']} {how} {_place(stop)}")
        print(f"q = {', '.join(f'{value:.6g}' for value in stop['q'])}")
        print(f"all pairs are certified up to {_place(certified)}" if certified else "nothing is certified before that")
    facts = [
        ("motion", f"{document['scene']['name']}, {document['waypoints']} waypoints, straight in {document['space']}"),
        ("outcome", f"{output.plain(document['outcome'])}, guarantee {document['guarantee']}"),
    ]
    if not stop:
        facts.append(("margin", f"at least {output.margin(document['margin'])}, padded"))
    if tube:
        facts.append(("tube", f"every joint up to {rounded_down(tube)} rad ({rounded_down(math.degrees(tube))} deg) or m off the motion"))
    facts.append(("time", f"{output.seconds(document['seconds'])}, {document['intervals']} intervals"))
    if document["proof"]:
        facts.append(("proof", f"{document['proof']} (check it: ciris verify {document['proof']})"))
    elif unwritten:
        facts.append(("proof", "verified and not kept; --out FILE keeps it"))
    output.print_facts(facts)


def _place(place: dict[str, Any]) -> str:
    """Returns a place on the motion for people."""
    at = "" if place["t"] is None else f", t = {place['t']:.9g}"
    return f"{place['time']:.12g} of the way from waypoint {place['piece']} to {place['piece'] + 1}{at}"
