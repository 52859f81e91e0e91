"""``ciris free-set`` checks a map's proof in a child process of this machine, and writes its cells for quick lookups (ciris.free_set)."""

from __future__ import annotations

import base64
from argparse import Namespace
from pathlib import Path
from typing import Any

from certifier.errors import CirisError
from certifier.isolation.child import run_in_child
from certifier.names import escaped
from client import output
from client.cores import cores
from client.files import ProofFile, check_writable, file_name
from client.verify import MEMORY_BYTES, TIMEOUT_S, readable


def write(args: Namespace) -> int:
    """Writes the free set of a map, and returns the command's exit status.

    Raises:
        CirisError: the map cannot be read or does not hold, no configuration of it is free, or the file cannot be written.
    """
    out = args.out or f"{file_name(Path(args.proof).stem)}.free.npz"
    check_writable(out)
    with readable(Path(args.proof)) as path:
        found = _found(path, args.proof)
    written = ProofFile(out).write(found["name"], base64.b64decode(found.pop("free_set")))
    if args.json:
        output.print_json({**found, "file": str(written)})
    else:
        print(escaped(f"{found['name']}: the proof holds, {found['cells']} cells; {found['nodes']} nodes of trees for lookups"))
        print(f"free set {written} (read it: ciris.FreeSet.load)")
    return 0


def _found(path: Path, name: str) -> dict[str, Any]:
    """Returns what certifier.map.free_set says of the file at a path, of which users know the name."""
    payload = {"path": str(path.absolute()), "processes": cores()}
    try:
        found: dict[str, Any] = run_in_child("certifier.map.free_set:of_file", payload, timeout_s=TIMEOUT_S, memory_bytes=MEMORY_BYTES)
    except CirisError as error:
        error.field = escaped(name)
        raise
    return found
