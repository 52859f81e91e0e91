"""The proof of a region: the proofs of all its pairs, and what shows that the region is bounded and not empty."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from certifier.model import Array, Scene
from certifier.proof.container import FORMAT, floats, malformed, pack, unpack
from certifier.proof.pair import PairProof, Pool, Stored


@dataclass(frozen=True)
class Archimedean:
    """Numbers that show P to be Archimedean.

    Attributes:
        N: |s|^2 <= N on P.
        lower, upper: (n,) l and u, the box.
        Y_lower, Y_upper: (n, m) multipliers of the faces that prove the box.
        y: (m,) multipliers that prove the remainder.
    """

    N: float
    lower: Array
    upper: Array
    Y_lower: Array
    Y_upper: Array
    y: Array


@dataclass(frozen=True)
class Implied:
    """Half-spaces that contain a polytope of m faces, with the multipliers that prove it: (h, n), (h,), (h, m)."""

    C: Array
    d: Array
    Y: Array


@dataclass(frozen=True)
class RegionProof:
    """Everything needed to check that a region is free of collision for every pair of its scene.

    Attributes:
        C, d: (m, n), (m,) the region's half-spaces, joint limits included.
        interior: (n,) a point strictly inside.
        implied: half-spaces around the region that are redundant to it, but faces of some ground.
        proofs: they cover every pair of the scene; each ground contains the region.
    """

    scene: Scene
    C: Array
    d: Array
    interior: Array
    implied: Implied
    archimedean: Archimedean
    proofs: tuple[PairProof, ...] = field(repr=False)

    def to_bytes(self) -> bytes:
        """The proof as a file; grounds and volumes that several proofs share are stored once."""
        pool = Pool(self.scene)
        headers = [pool.add(proof) for proof in self.proofs]
        arrays: dict[str, np.ndarray] = {"region/C": self.C, "region/d": self.d, "region/interior": self.interior}
        arrays |= {f"implied/{name}": value for name, value in vars(self.implied).items()}
        arrays |= {f"archimedean/{name}": np.asarray(value) for name, value in vars(self.archimedean).items()}
        header = {"format": FORMAT, "kind": "region", "scene": self.scene.to_document(), **pool.header(), "proofs": headers}
        return pack(header, arrays | pool.arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> RegionProof:
        """Inverse of :meth:`to_bytes`.

        Raises:
            ProofError: not a region's proof.
        """
        header, arrays = unpack(data, "region")
        with malformed():
            scene = Scene.from_document(header["scene"])
            fields = ("N", "lower", "upper", "Y_lower", "Y_upper", "y")
            values = {name: floats(arrays[f"archimedean/{name}"]) for name in fields}
            return cls(
                scene=scene,
                C=floats(arrays["region/C"]),
                d=floats(arrays["region/d"]),
                interior=floats(arrays["region/interior"]),
                implied=Implied(*(floats(arrays[f"implied/{name}"]) for name in ("C", "d", "Y"))),
                archimedean=Archimedean(values.pop("N").item(), **values),
                proofs=Stored(scene, header, arrays).proofs(),
            )
