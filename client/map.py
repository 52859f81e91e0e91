"""``ciris map`` grows the map of a scene, here or by the service: what is proved of all of the joint space."""

from __future__ import annotations

import hashlib
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from certifier.errors import CirisError, ProofError, RegionError
from certifier.map.ends import ENDS
from certifier.map.options import MapOptions
from certifier.model import Scene
from certifier.options import read
from certifier.proof.map import MapProof
from certifier.seeding.limits import check_limits
from certifier.verify.file import read_file
from certifier.words import counted, joint_positions
from ciris.documents import Document
from ciris.synchronous.client import Client
from client import output, service
from client.cores import cores
from client.files import ProofFile, check_writable
from client.inputs import Given
from client.local import load, positions_of
from client.options import MAP
from client.output import Screen, print_json
from client.request import refuse_of_service, request
from client.verify import in_child

OK, NO, INTERRUPTED = 0, 1, 130
NO_SAMPLE = 1.0
"""The standard error of a coverage that no sample tells anything about."""


def grow(args: Namespace) -> int:
    """Grows a map, here or by the service, and returns the command's exit status.

    Raises:
        CirisError: something that was given is wrong, or what went wrong.
    """
    asked = request(args, MAP)
    check_writable(args.out)
    document, units = (_here if args.local else _by_service)(args, asked)
    if args.json:
        print_json(document)
    else:
        _print(document, units)
    if document["ended"] == "interrupted":
        return INTERRUPTED
    first = [one["state"] == "proved" for one in document["at"]] + [share == 1 for share in document["paths"]]
    return OK if document["outcome"] == "certified" and all(first) else NO


def _here(args: Namespace, asked: dict[str, Any]) -> tuple[dict[str, Any], Sequence[str]]:
    """Grows a map in this process and children of it, and returns what to tell of it, with the units of joint positions, (n,)."""
    refuse_of_service(args)
    screen = Screen()
    scene = load(args.scene)
    at = [_wanted(scene, q, f"options.at[{i}]") for i, q in enumerate(asked["options"].get("at", []))]
    given = enumerate(asked["options"].get("paths", []))
    paths = [[_wanted(scene, q, f"options.paths[{i}][{j}]") for j, q in enumerate(path)] for i, path in given]
    options = read(MapOptions, {**asked["options"], "at": at, "paths": paths}, "options")
    if options.asked:
        raise CirisError("option", "is only for jobs of the service", field="--asked", hint="leave out it or --local")
    from certifier.jobs.map import grow_map, in_s, ways_of

    former = None if args.former in (None, "none") else _former(args.former)

    def tell(_: str, told: dict[str, Any]) -> None:
        screen.status(_said(told["coverage"], told["error"], told["cells"]), told["coverage"])

    found = grow_map(
        scene,
        options.coverage,
        asked.get("deadline_seconds"),
        cores(),
        tell,
        in_s(scene, options.at),
        options.random_seed,
        former,
        ways_of(scene, options.paths),
    )
    screen.clear()
    path = ProofFile(args.out).write(scene.name, found.proof.to_bytes())
    share, error = found.coverage
    document = {
        "scene": {"name": scene.name, "hash": scene.hash},
        "outcome": "certified" if share >= options.coverage else "inconclusive",
        "coverage": {"value": share, "stderr": error},
        "cells": found.cells,
        "looked_at": found.looked,
        "seconds": found.seconds,
        "ended": found.reason,
        "given_up": found.refused,
        "at": [{"q": list(q), "state": state} for q, state in zip(at, found.wanted, strict=True)],
        "paths": _shares(found.proof, paths) if paths else [],
        "proof": str(path),
    }
    return document, scene.units


def _by_service(args: Namespace, asked: dict[str, Any]) -> tuple[dict[str, Any], Sequence[str]]:
    """Does as :func:`_here` by the service."""
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)
        former = {} if args.former is None else {"former": args.former}
        job = service.run(client, {"kind": "map", "scene": scene["asked"], **asked, **former}, Screen())
        return _written(client, job["id"], scene, args.out), [*service.units(scene).values()]


def of_job(args: Namespace) -> int:
    """Writes the map that a job of the service has grown, and returns the command's exit status.

    Raises:
        CirisError: there is no such job, it grows no map, or a file cannot be written.
    """
    for path in (args.out, args.free_set):
        check_writable(path)
    with service.connect(args.url) as client:
        job = client.job(args.job)
        scene = client.scene(job["scene"])
        document = _written(client, job["id"], scene, args.out)
        if args.free_set is not None:
            Path(args.free_set).write_bytes(client.free_set(job["id"]))
    if args.json:
        print_json(document)
    else:
        _print(document, [*service.units(scene).values()])
    return OK if document["proof"] is not None else NO


def _written(client: Client, job: str, scene: Document, out: str | None) -> dict[str, Any]:
    """Writes the proof of the map of a job, if it is stored, and returns what to tell of the map."""
    found = client.map(job)
    stored = found["stored"]
    path = None if stored is None else ProofFile(out).write(scene["name"], client.map_proof(job))
    return {
        "scene": {"name": scene["name"], "hash": scene["hash"]},
        "job": job,
        "outcome": found["outcome"],
        "coverage": found["coverage"],
        "cells": found["cells"],
        "looked_at": found["looked_at"],
        "seconds": found["seconds"],
        "ended": found["ended"],
        "given_up": found["given_up"],
        "former": found["former"],
        "at": [] if stored is None else stored["at"],
        "paths": [] if stored is None else stored["paths"],
        "proof": None if path is None else str(path),
    }


def _print(document: dict[str, Any], units: Sequence[str]) -> None:
    coverage, proof = document["coverage"], document["proof"]
    said = "nothing proved" if coverage is None else _said(coverage["value"], coverage["stderr"], document["cells"])
    print(f"{document['scene']['name']}: {said}, {output.seconds(document['seconds'])}")
    for one in document["at"]:
        print(f"q = {joint_positions(one['q'], units)}: {output.plain(one['state'])}")
    for i, share in enumerate(document["paths"]):
        print(f"path[{i}]: {output.percent(share)} of it proved")
    if document["given_up"]:
        pieces = counted(document["given_up"], "piece")
        print(f"{pieces} of work {'was' if document['given_up'] == 1 else 'were'} given up: the verifier refused what was found")
    if document.get("former"):
        print(f"begun with the map of job {document['former'][:8]} (anew: --former none)")
    if document["ended"] in ENDS:
        print(f"ended: {ENDS[document['ended']]}")
    elif document["ended"] is None:
        print("it has not ended, or has failed: ciris job show says why")
    if proof is not None:
        print(f"proof {proof} (check it: ciris verify {proof})")


def _shares(proof: MapProof, paths: list[list[list[float]]]) -> list[float]:
    """Returns how much of each motion a map proves, as a share of its length."""
    from certifier.map.free_set import as_file, free_set
    from ciris.free_set import FreeSet

    try:
        free = FreeSet.of_bytes(as_file(free_set(proof)), "the free set")
    except ProofError:
        return [0.0] * len(paths)  # nothing is proved yet
    return [free.share_of(path) for path in paths]


def _former(path: str) -> MapProof:
    """Returns the map of a proof file, which a child process has verified.

    Raises:
        CirisError: the file cannot be read, is no map, or does not hold.
    """
    checked, data = in_child("certifier.map.free_set:checked", path), read_file(path)
    if hashlib.sha256(data).hexdigest() != checked["sha256"]:
        raise CirisError("proof_malformed", "it has changed since it was checked", field=path, hint="name a file that nobody writes to")
    return MapProof.from_bytes(data)


def _wanted(scene: Scene, given: Given, field: str) -> list[float]:
    """Returns joint positions that a map is to cover first, (n,).

    Raises:
        RegionError: they are not one for each joint, or not within its limits.
    """
    q = positions_of(scene, given, field)
    if len(q) != scene.n:
        raise RegionError(
            "seed_wrong_length", f"it has {counted(len(q), 'number')} for {counted(scene.n, 'joint')}", field=field, hint=scene.in_order
        )
    check_limits(scene, q, field)
    return q


def _said(share: float, error: float, cells: int) -> str:
    if error == NO_SAMPLE:
        return f"no configuration was found that is free of collision, {counted(cells, 'cell')}"
    return f"{100 * share:.1f} % of the free configurations proved (standard error {100 * error:.1f} %), {counted(cells, 'cell')}"
