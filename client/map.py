"""``ciris map`` grows the map of a scene: what is proved of all of the joint space."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np

from certifier.errors import CirisError, RegionError
from certifier.map.options import MapOptions
from certifier.model import Scene
from certifier.options import read
from certifier.seeding.limits import check_limits
from client import output
from client.cores import cores
from client.files import ProofFile, check_writable
from client.inputs import Given
from client.local import load, positions_of
from client.options import MAP
from client.output import Screen, print_json
from client.request import refuse_of_service, request

OK, NO, INTERRUPTED = 0, 1, 130
ENDS = {
    "size": "it ended because the verifier would not read a larger file",
    "worker_lost": "it ended because a process died; look whether the machine ran out of memory: fewer cores need less of it",
}
"""What to say of these ends; the others say themselves."""
NOT_YET = "add --local: the service has no jobs of this kind yet"


def grow(args: Namespace) -> int:
    """Grows a map in this process and children of it, and returns the command's exit status.

    Raises:
        CirisError: something that was given is wrong.
    """
    if not args.local:
        raise CirisError("option", "maps are grown on this machine only", field="--local", hint=NOT_YET)
    refuse_of_service(args)
    screen, asked = Screen(), request(args, MAP)
    check_writable(args.out)
    scene = load(args.scene)
    wanted = [_wanted(scene, q, f"options.at[{i}]") for i, q in enumerate(asked["options"].pop("at", []))]
    options = read(MapOptions, asked["options"], "options")
    at = scene.to_s(scene.in_windows(np.array(wanted).reshape(-1, scene.n)))
    from certifier.jobs.map import grow_map

    def tell(_: str, told: dict[str, Any]) -> None:
        screen.status(_said(told["coverage"], told["error"], told["cells"]), told["coverage"])

    found = grow_map(scene, options.coverage, asked.get("deadline_seconds"), cores(), tell, at, options.random_seed)
    screen.clear()
    path = ProofFile(args.out).write(scene.name, found.proof.to_bytes())
    share, error = found.coverage
    document = {
        "scene": {"name": scene.name, "hash": scene.hash},
        "coverage": {"value": share, "stderr": error},
        "cells": found.cells,
        "looked_at": found.looked,
        "seconds": found.seconds,
        "ended": found.reason,
        "given_up": found.refused,
        "at": [{"q": list(q), "state": state} for q, state in zip(wanted, found.wanted, strict=True)],
        "proof": str(path),
    }
    if args.json:
        print_json(document)
    else:
        print(f"{scene.name}: {_said(share, error, found.cells)}, {output.seconds(found.seconds)}")
        for q, state in zip(wanted, found.wanted, strict=True):
            print(f"q = {', '.join(f'{value:.6g}' for value in q)}: {output.plain(state)}")
        if found.refused:
            print(f"{found.refused} pieces of work were given up: the verifier refused what they found")
        if found.reason in ENDS:
            print(ENDS[found.reason])
        print(f"proof {path} (check it: ciris verify {path})")
    if found.reason == "interrupted":
        return INTERRUPTED
    return OK if share >= options.coverage and set(found.wanted) <= {"proved"} else NO


def _wanted(scene: Scene, given: Given, field: str) -> list[float]:
    """Returns joint positions that a map is to cover first, (n,).

    Raises:
        RegionError: they are not one for each joint, or not within its limits.
    """
    q = positions_of(scene, given, field)
    if len(q) != scene.n:
        raise RegionError("seed_wrong_length", f"it has {len(q)} numbers for {scene.n} joints", field=field, hint=scene.in_order)
    check_limits(scene, q, field)
    return q


def _said(share: float, error: float, cells: int) -> str:
    return f"{100 * share:.1f} % of the free configurations proved (standard error {100 * error:.1f} %), {cells} cells"
