"""``ciris verify``: a proof file checked on this machine, with nothing installed but numpy and python-flint."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from certifier.proof_file import ProofError
from certifier.verify.file import verify_file
from client.output import print_json

HOLDS, DOES_NOT = 0, 1


def verify(args: Namespace) -> int:
    data = Path(args.proof).read_bytes()
    try:
        statement = verify_file(data)
    except ProofError as error:
        if args.json:
            print_json({"holds": False, "error": error.to_document()})
        print("error:", " ".join(f"{args.proof}: the proof does not hold: {error}".split()), file=sys.stderr)
        return DOES_NOT
    if args.json:
        scene = {"name": statement.scene.name, "hash": statement.scene.hash}
        guarantee = statement.guarantee.value
        print_json({"holds": True, "kind": statement.kind, "scene": scene, "statement": list(statement.lines), "guarantee": guarantee})
    else:
        print("the proof holds:", *statement.lines, sep="\n  ")
    return HOLDS
