"""``ciris recertify`` makes a region of a changed scene from one of the scene before it changed."""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path
from typing import Any

from certifier.errors import CirisError, unreadable
from client import output
from client.files import ProofFile, check_writable
from client.inputs import configuration
from client.output import Screen, print_json

OK = 0


def recertify(args: Namespace) -> int:
    """Certifies a region again, writes its proof and prints what is kept. Returns the command's exit status.

    Raises:
        CirisError: why nothing is left of it, or what is wrong with the input.
    """
    screen, keep = Screen(), [configuration(q) for q in args.q or []]
    if args.deadline is not None and not 0 < args.deadline < math.inf:
        raise CirisError("option", f"must be a number of seconds above 0, not {args.deadline:g}", field="--deadline")
    check_writable(args.out)
    from client import local

    grown = local.recertify(_proof(Path(args.region)), args.scene, keep or None, args.deadline, screen, args.watch)
    path = ProofFile(args.out).write(grown.manifest["scene"]["name"], grown.proof)
    if args.json:
        print_json({**grown.manifest, "seconds": grown.seconds, "proof": str(path)})
        return OK
    extra = [("time", output.seconds(grown.seconds)), ("ended", grown.remark), ("proof", f"{path} (check it: ciris verify {path})")]
    output.print_region(grown.manifest, [*_facts(grown.manifest["provenance"]["recertified"]), *extra])
    return OK


def _proof(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise CirisError("no_file", unreadable(error), field="REGION", hint="--local needs the proof file of a region") from None


def _facts(said: dict[str, Any]) -> list[tuple[str, str]]:
    """Returns what people hear of the region before and of its proofs."""
    cut = [f"{pair['a']} - {pair['b']}" for pair in said["cut"]]
    return [
        ("kept", f"{output.share(said['kept'])} of the region before"),
        ("proofs", f"{len(said['carried'])} pairs carried over, {len(said['proved'])} proved again"),
        *(("cut" if not i else "", f"something was cut off for {pair}") for i, pair in enumerate(cut)),
    ]
