"""``ciris clearance`` proves how far apart the bodies are in all of a region, in a child process of this machine."""

from __future__ import annotations

import base64
from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from certifier.names import escaped
from certifier.verify.decimals import at_least_mm
from certifier.words import joint_positions
from client import output
from client.files import ProofFile, check_writable
from client.verify import in_child

TIGHT, NOT_TIGHT = 0, 1


def clearance(args: Namespace) -> int:
    """Prints the clearance of a region whose proof file is given, and returns the command's exit status: 0 where it is tight.

    Raises:
        CirisError: the file cannot be read, or is no region's proof that holds.
    """
    kept = None
    if args.out is not None:
        check_writable(args.out)
        kept = ProofFile(args.out)
    found = in_child("certifier.jobs.clearance:clearance_in_child", args.proof)
    proof, units = found.pop("proof"), found.pop("units")
    written = None if kept is None or proof is None else str(kept.write(found["scene"]["name"], base64.b64decode(proof)))
    if args.json:
        output.print_json({**found, "proof": written})
    else:
        _print(found, units, written, proved_by_region=proof is None)
    return TIGHT if found["tight"] else NOT_TIGHT


def _print(found: dict[str, Any], units: Sequence[str], written: str | None, proved_by_region: bool) -> None:
    nearest = found["nearest"]
    facts = [
        ("region", f"of {found['scene']['name']} ({found['scene']['hash'][:16]})"),
        ("clearance", f"at least {at_least_mm(found['clearance'])}, padded, proved at every configuration of the region"),
        ("", found["not_covered_summary"]),
        ("closest", f"{nearest['a']} - {nearest['b']}, {1000 * nearest['distance']:.6g} mm apart"),
        ("", f"q = {joint_positions(nearest['q'], units)}"),
    ]
    if not found["tight"]:
        facts.append(("note", "the two numbers are farther apart than 10 % and 0.1 mm; nothing larger could be proved"))
    if written:
        facts.append(("proof", f"{written}, of the region with more padding (check it: ciris verify {written})"))
    else:
        facts.append(("proof", "that of the region" if proved_by_region else "verified and not kept; --out FILE keeps it"))
    output.print_facts([(name, escaped(text)) for name, text in facts])
