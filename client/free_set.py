"""``ciris free-set`` checks a map's proof in a child process of this machine, and writes its cells for quick lookups (ciris.free_set)."""

from __future__ import annotations

import base64
from argparse import Namespace
from pathlib import Path

from certifier.names import escaped
from certifier.words import counted
from client import output
from client.files import ProofFile, check_writable, file_name
from client.verify import in_child


def write(args: Namespace) -> int:
    """Writes the free set of a map, and returns the command's exit status.

    Raises:
        CirisError: the map cannot be read or does not hold, no configuration of it is free, or the file cannot be written.
    """
    out = args.out or f"{file_name(Path(args.proof).stem)}.free.npz"
    check_writable(out)
    found = in_child("certifier.map.free_set:of_file", args.proof)
    written = ProofFile(out).write(found["name"], base64.b64decode(found.pop("free_set")))
    if args.json:
        output.print_json({**found, "file": str(written)})
    else:
        size = f"{counted(found['cells'], 'cell')}; {counted(found['nodes'], 'node')} of trees for lookups"
        print(escaped(f"{found['name']}: the proof holds, {size}"))
        print(f"free set {written} (read it: ciris.FreeSet.load)")
    return 0
