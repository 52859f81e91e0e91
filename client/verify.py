"""``ciris verify``: a proof file checked on this machine, with nothing installed but numpy and python-flint."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from certifier.errors import CirisError
from certifier.verify.file import answer
from client.output import print_json

HOLDS, DOES_NOT = 0, 1


def verify(args: Namespace) -> int:
    found = answer(Path(args.proof).read_bytes())
    if args.json:
        print_json(found)
    elif found["holds"]:
        print("the proof holds:", *found["statement"], sep="\n  ")
    if found["holds"]:
        return HOLDS
    problem = CirisError.from_document(found["error"])
    print("error:", " ".join(f"{args.proof}: the proof does not hold: {problem}".split()), file=sys.stderr)
    return DOES_NOT
