"""The planes of one proof are read here from its file, for drawing, without inflating the rest of it. They are read, not checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.model import Array
from certifier.proof.container import some_of
from certifier.proof.outline import ProofOutline
from certifier.proof.partition import PartitionProof


@dataclass(frozen=True, eq=False)
class Planes:
    """Holds the planes of a proof, [a; b](s) = Z [1; s_J]. Points p of the first volume have a'p + b > 0, those of the second a'p + b < 0.

    Attributes:
        frame: body whose frame a, b and p are expressed in, in metres.
        joints: J, position indices, ascending.
        Z: (leaves with a plane, 4, 1 + k), in the order of the nodes.
    """

    frame: str
    joints: tuple[int, ...]
    Z: Array


def planes(data: bytes, number: int, outline: ProofOutline) -> Planes:
    """Returns the planes of the proof with this number in a file about a region, or about a pair.

    Args:
        outline: that of the same proof.

    Raises:
        ProofError: the file is no such file, or beyond the limits.
    """
    wanted = {f"proof/{number}/{name}" for name in ("plane", "planes")}
    header, arrays = some_of(data, lambda name: name in wanted or name.endswith(("/mid", "/half")))
    proof = header["proofs"][number]
    if outline.form == PartitionProof.KIND:
        return Planes(proof["frame"], outline.cells.joints, arrays[f"proof/{number}/planes"][:, :4])
    mid, half = (arrays[f"ground/{proof['ground']}/{name}"] for name in ("mid", "half"))
    Z = arrays[f"proof/{number}/plane"]
    moved = Z[:, 1:] / half  # The plane is affine in u = (s - mid) / half.
    return Planes(proof["frame"], tuple(range(len(mid))), np.column_stack([Z[:, 0] - moved @ mid, moved])[None])
