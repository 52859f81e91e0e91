"""The verifier checks a proof file of any kind here, and says in plain words what it proves and how much that is worth."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.errors import CirisError, ProofError, unreadable
from certifier.model import Scene
from certifier.names import escaped
from certifier.outcome import Guarantee
from certifier.proof import limits
from certifier.proof.container import header_of, malformed
from certifier.proof.motion import MotionProof
from certifier.proof.negative import DualProof, WitnessProof
from certifier.proof.pair import PairProof
from certifier.proof.partition import PartitionProof
from certifier.proof.region import RegionProof
from certifier.proof.separation import Separation
from certifier.verify.decimals import exactly, rounded_down, rounded_up
from certifier.verify.dual import verify_dual
from certifier.verify.map import verify_map
from certifier.verify.motion import verify_motion
from certifier.verify.paddings import paddings
from certifier.verify.pair import PairStatement, verify_pair
from certifier.verify.region import verify_region
from certifier.verify.separations import Progress, verify_separation
from certifier.verify.witness import TOLERANCE, verify_witness
from certifier.words import with_units

LONGEST = 500
"""A text of an error is cut after this many characters."""


@dataclass(frozen=True)
class FileStatement:
    """States what a valid file proves.

    Attributes:
        kind: ``region``, ``map``, ``pair``, ``partition``, ``motion``, ``dual`` or ``witness``.
        lines: the statement in plain words, the guarantee last. It follows from the proof and from what the scene's hash covers.
    """

    kind: str
    scene: Scene
    lines: tuple[str, ...]
    guarantee: Guarantee


def verify_file(data: bytes, processes: int = 1, progress: Progress | None = None) -> FileStatement:
    """Checks a proof file of any kind that carries its scene, and returns what it proves.

    Args:
        processes: how many processes check what can be divided among them.
        progress: receives how many of how many parts they have checked.

    Raises:
        ProofError: the file is malformed, carries no scene, or its proof does not hold.
    """
    header = header_of(data)
    kind = header["kind"]
    if kind == "region":
        statement = verify_region(data, processes, progress)
        return FileStatement(kind, statement.scene, tuple(statement.lines()), Guarantee.EXACT)
    if kind == "map":
        mapped = verify_map(data, processes, progress)
        return FileStatement(kind, mapped.scene, tuple(mapped.lines()), Guarantee.EXACT)
    if kind not in _READERS:
        raise ProofError("proof_malformed", f"the file is a proof of kind {kind[:40]!r}, which is none", field="header.kind")
    if "scene" not in header:
        hint = "a file that the service hands out carries it"
        raise ProofError("proof_without_scene", "the file names its scene by its hash and does not carry it", hint=hint)
    with malformed():
        scene = Scene.from_document(header["scene"])
    found, guarantee = _READERS[kind](data, scene, processes, progress)
    about = (f"scene of hash {scene.hash}", *paddings(scene))
    return FileStatement(kind, scene, (*about, *found, guarantee_line(guarantee)), guarantee)


def answer(data: bytes, processes: int = 1, progress: Progress | None = None) -> dict[str, Any]:
    """Returns the statement of a proof file, or why there is none, as JSON-able data. The arguments are those of :func:`verify_file`.

    The keys are stable, and every text is printable. ``scene.name`` is what the file calls its scene; no proof is about that name.
    """
    try:
        statement = verify_file(data, processes, progress)
    except ProofError as error:
        return _refused(error)
    return {
        "holds": True,
        "kind": statement.kind,
        "scene": {"name": escaped(statement.scene.name), "hash": statement.scene.hash},
        "statement": [escaped(line) for line in statement.lines],
        "guarantee": statement.guarantee.value,
    }


def answer_about_region(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns the answer about a stored proof, which has to be about the very region that the payload names.

    A child process runs this function (certifier.isolation.child).

    Args:
        payload: ``proof`` in base 64; ``scene_hash``, ``C`` and ``d`` of the region.
    """
    data = base64.b64decode(payload["proof"])
    found = answer(data)
    if found["holds"]:
        proof = RegionProof.from_bytes(data)
        same = np.array_equal(proof.C, payload["C"]) and np.array_equal(proof.d, payload["d"])
        if proof.scene.hash != payload["scene_hash"] or not same:
            return _refused(ProofError("proof_region", "the proof is about another region"))
    return found


def answer_about_file(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns the answer about a file. A child process runs this function.

    Args:
        payload: the ``path`` of the file; perhaps ``processes``, how many may check it, and ``progress``, the path of a file in which
            two lines say how many of how many parts they have checked.

    Raises:
        CirisError: no_file, when the file cannot be read.
    """
    return answer(read_file(payload["path"]), payload.get("processes", 1), _teller(payload["progress"]) if "progress" in payload else None)


def read_file(path: str) -> bytes:
    """Returns the bytes of a proof file, and one more than the verifier takes of a file that is too large.

    Raises:
        CirisError: no_file, when the file cannot be read.
    """
    try:
        with open(path, "rb") as file:
            return file.read(limits.FILE_BYTES + 1)
    except OSError as error:
        raise CirisError("no_file", unreadable(error), hint="name a proof file") from None


def _teller(path: str) -> Progress:
    """Returns a function that writes progress to a file, ten times a second at most."""
    told = 0.0

    def tell(done: int, total: int) -> None:
        nonlocal told
        if done == total or time.monotonic() > told + 0.1:
            told = time.monotonic()
            with open(path, "w") as file:
                file.write(f"{done}\n{total}\n")

    return tell


def _refused(error: ProofError) -> dict[str, Any]:
    document = {key: text and _cut(escaped(text)) for key, text in error.to_document().items()}
    return {"holds": False, "error": document}


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."


def guarantee_line(guarantee: Guarantee) -> str:
    """Returns a line that says what a guarantee means."""
    meaning = {
        Guarantee.EXACT: "exact (rigorous arithmetic; the parsed model taken at its word)",
        Guarantee.NUMERIC: f"numeric (to {TOLERANCE:g} m)",
    }
    return f"guarantee: {meaning[guarantee]}"


def _pair(data: bytes, scene: Scene, *_: Any) -> tuple[list[str], Guarantee]:
    proof = PairProof.from_bytes(data, scene)
    return _apart(proof, verify_pair(proof)), Guarantee.EXACT


def _partition(data: bytes, scene: Scene, processes: int, progress: Progress | None) -> tuple[list[str], Guarantee]:
    proof = PartitionProof.from_bytes(data, scene)
    return _apart(proof, verify_separation(proof, processes, progress)), Guarantee.EXACT


def _apart(proof: Separation, statement: PairStatement) -> list[str]:
    polytope = f"a polytope of {len(proof.ground.d)} half-spaces within the joint limits, which is not empty,"
    lines = [f"at every configuration of {polytope} these padded bodies are at least {rounded_down(statement.gap)} m apart:"]
    return lines + [f"  '{pair.a}' and '{pair.b}'" for pair in statement.pairs]


def _motion(data: bytes, scene: Scene, *_: Any) -> tuple[list[str], Guarantee]:
    return verify_motion(MotionProof.from_bytes(data, scene)).lines(), Guarantee.EXACT


def _dual(data: bytes, scene: Scene, *_: Any) -> tuple[list[str], Guarantee]:
    proof = DualProof.from_bytes(data, scene)
    statement = verify_dual(proof)
    ground = proof.ground
    lines = [
        f"'{statement.pair.a}' and '{statement.pair.b}' have no certificate of this form,",
        "which does not mean that no plane separates them:",
        f"  a plane affine in s, in the frame of '{statement.frame}';",
        "  multipliers that are sums of squares of the chains' multi-affine functions (docs/proofs.md);",
        *(["  a normal bounded by the matrix inequality of docs/proofs.md;"] if statement.rounded else []),
        *(
            [f"  a margin above {rounded_up(statement.slack)} of its largest coefficient in u, which goes from -1 to 1 over the box;"]
            if statement.slack
            else []
        ),
        f"  for the faces, the {len(ground.d)} half-spaces of the polytope and the ends of a box:",
        *(
            f"    '{joint.name}': s from {exactly(mid)} - {exactly(half)} to {exactly(mid)} + {exactly(half)}"
            for joint, mid, half in zip(scene.moving, ground.mid, ground.half, strict=True)
        ),
    ]
    return lines, Guarantee.EXACT


def _witness(data: bytes, scene: Scene, *_: Any) -> tuple[list[str], Guarantee]:
    statement = verify_witness(WitnessProof.from_bytes(data, scene))
    s, q = ([exactly(x) for x in values] for values in (statement.s, scene.to_q(statement.s)))
    touching = f"'{statement.pair.a}' and '{statement.pair.b}', padded, touch at a configuration of the polytope"
    return [f"{touching}: s = {', '.join(s)}", f"  to rounding, q = {with_units(q, scene.units)}"], Guarantee.NUMERIC


_READERS: dict[str, Callable[[bytes, Scene, int, Progress | None], tuple[list[str], Guarantee]]] = {
    "pair": _pair,
    "partition": _partition,
    "motion": _motion,
    "dual": _dual,
    "witness": _witness,
}
