"""``ciris certify-path`` certifies a motion, in this process or by the service, and prints what has become of it."""

from __future__ import annotations

import base64
import math
from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from certifier.conditions import condition_named
from certifier.errors import CirisError
from certifier.motion.padding import padding_of
from certifier.verify.decimals import at_least_mm, rounded_down
from certifier.words import counted, joint_positions
from ciris.documents import Document
from ciris.synchronous.client import Client
from client import output, service
from client.files import ProofFile, check_writable
from client.options import JOB
from client.output import Screen, print_json
from client.paths import GivenPath, named, path_of
from client.request import refuse_options, request

OK, NO = 0, 1


def certify_path(args: Namespace) -> int:
    """Certifies the motion that the arguments give, in this process or by the service, and returns the command's exit status.

    Raises:
        CirisError: the motion, its file or the scene cannot be used, or there is no service.
    """
    if args.job and args.local:
        raise CirisError("option", "a job needs a service", field="--job", hint="leave out --local")
    if not args.job:
        refuse_options(args, JOB, "job")
    path = path_of(args)
    kept = None
    if args.out is not None:
        check_writable(args.out)
        kept = ProofFile(args.out)
    try:
        document, units, proof = (_here if args.local else _by_service)(args, path)
    except CirisError as error:
        error.field = named(error.field, args)
        raise
    written = None if kept is None or proof is None else str(kept.write(document["scene"]["name"], proof))
    document = _timed({**document, "proof": written}, path)
    if args.json:
        print_json(document)
    else:
        _print(document, units)
    return OK if document["outcome"] == "certified" else NO


def _here(args: Namespace, path: GivenPath) -> tuple[dict[str, Any], Sequence[str], bytes | None]:
    """Returns the document of the verdict of this process, the units of joint positions, (n,), and the proof where there is one."""
    from client.local import load, positions_of

    scene = load(args.scene)
    given = path.motion
    if "q" in given:
        given = {"q": [positions_of(scene, q, f"q[{i}]") for i, q in enumerate(given["q"])]}
    from certifier.jobs.motion import certify
    from certifier.motion.given import motion_of
    from certifier.proof.motion import Space

    motion = motion_of(scene, given, Space(args.space) if args.space else None)
    verdict = certify(scene, motion, args.tube, padding_of(args.padding), args.clearance)
    return verdict.document(), scene.units, verdict.proof


def _by_service(args: Namespace, path: GivenPath) -> tuple[dict[str, Any], Sequence[str], bytes | None]:
    """Does as :func:`_here` by the service. The proof comes only where it was asked for."""
    padding_of(args.padding)
    with service.connect(args.url) as client:
        scene = service.scene_name(client, args.scene)
        asked = {"scene": scene, **path.motion, **{name: getattr(args, name) for name in ("space", "tube", "padding", "clearance")}}
        if args.job:
            document, proof = _by_job(client, {**asked, "kind": "certify-path", **request(args, JOB)}, args.out is not None)
        else:
            document = client.certify_path({**asked, "prove": args.out is not None})
            proof = None if document["proof"] is None else base64.b64decode(document["proof"])
        units = [] if args.json else [*service.units(client.scene(scene)).values()]
    return document, units, proof


def _by_job(client: Client, request: Document, prove: bool) -> tuple[dict[str, Any], bytes | None]:
    """Returns the document of the verdict of a job, which may take as long as it needs, and the proof where it was asked for."""
    job = service.run(client, request, Screen())["id"]
    document = client.motion(job)
    return document, client.motion_proof(job) if prove and document["proof"] else None


def _timed(document: dict[str, Any], path: GivenPath) -> dict[str, Any]:
    """Returns the document with the file's own time, ``t``, at each place on the motion; None where the file has no times."""
    places = {name: document[name] for name in ("certified_to", "nearest", "stop") if document[name]}
    for place in places.values():
        start = place["piece"]
        place["t"] = None if path.times is None else path.times[start] + place["time"] * (path.times[start + 1] - path.times[start])
    return {**document, **places}


def _print(document: dict[str, Any], units: Sequence[str]) -> None:
    stop, certified, tube, degree = (document[name] for name in ("stop", "certified_to", "tube", "degree"))
    if stop:
        broken = condition_named(stop["a"], stop["b"])
        fails = "is not kept" if document["outcome"] == "refuted" else "could not be decided"
        what = f"the condition '{broken}' {fails}" if broken else f"{stop['a']} and {stop['b']} {_how(document)}"
        print(f"{what} {_place(stop, degree)}")
        print(f"q = {joint_positions(stop['q'], units)}")
        print(f"all pairs are certified up to {_place(certified, degree)}" if certified else "nothing is certified before that")
    pieces = document["waypoints"] - 1
    what = f"{pieces + 1} waypoints, straight" if degree == 1 else f"{counted(pieces, 'piece')} of degree {degree}"
    facts = [
        ("motion", f"{document['scene']['name']}, {what} in {document['space']}"),
        ("outcome", f"{output.plain(document['outcome'])}, guarantee {document['guarantee']}"),
    ]
    if document["padding"]:
        facts.append(("padding", f"{document['padding']:.9g} m around every body, beyond the scene's"))
    if not stop:
        facts += _distances(document, units)
    facts.append(("", document["not_covered_summary"]))
    if tube:
        facts.append(("tube", f"every joint up to {rounded_down(tube)} rad ({rounded_down(math.degrees(tube))} deg) or m off the motion"))
    facts.append(("time", f"{output.seconds(document['seconds'])}, {counted(document['intervals'], 'interval')}"))
    if document["proof"]:
        facts.append(("proof", f"{document['proof']} (check it: ciris verify {document['proof']})"))
    elif certified:
        facts.append(("proof", "verified and not kept; --out FILE keeps it"))
    output.print_facts(facts)


def _how(document: dict[str, Any]) -> str:
    """Returns what the two bodies do where a motion first could not be certified."""
    apart = f"are {at_least_mm(document['stop']['distance'])} apart"
    if document["outcome"] == "refuted":
        return f"{apart}, less than the padding asks for," if document["padding"] else "touch"
    return f"{apart}, too close to tell," if document["outcome"] == "too_close" else f"{apart} where the search ended,"


def _distances(document: dict[str, Any], units: Sequence[str]) -> list[tuple[str, str]]:
    """Returns how far apart the bodies of a motion that is certified are."""
    nearest, where = document["nearest"], " in the tube" if document["tube"] else ""
    if nearest is None:
        shown = f"at least {at_least_mm(document['proved_distance'])}, padded{where}; they may be much farther apart (--clearance)"
        return [("proved distance", shown)]
    closest = f"{nearest['a']} - {nearest['b']}, {1000 * nearest['distance']:.6g} mm apart {_place(nearest, document['degree'])}"
    return [
        ("clearance", f"at least {at_least_mm(document['clearance'])}, padded, proved{where}"),
        ("closest", closest),
        ("", f"q = {joint_positions(nearest['q'], units)}"),
    ]


def _place(place: dict[str, Any], degree: int) -> str:
    """Returns a place on the motion for people."""
    at = "" if place["t"] is None else f", t = {place['t']:.9g}"
    part, piece = f"{place['time']:.12g}", place["piece"]
    if degree > 1:
        return f"at the part {part} of the time of piece {piece}{at}; pieces count from 0"
    return f"{part} of the way from waypoint {piece} to {piece + 1}{at}"
