"""The proof of a region consists of the proofs of all its pairs, and of what shows that the region is bounded and not empty."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from certifier.errors import CirisError
from certifier.model import Array, Scene
from certifier.proof.container import FORMAT, Arrays, head, header_of, malformed, pack, unpack
from certifier.proof.pair import PairProof
from certifier.proof.partition import PartitionProof
from certifier.proof.separation import SHARED, Pool, Separation, read_proofs

FORMS: dict[str, type[Separation]] = {form.KIND: form for form in (PairProof, PartitionProof)}
"""The forms that the proofs of a region's pairs take, by the kinds of their files."""


def read_part(data: bytes, scene: Scene) -> Separation:
    """Reads the file of one pair's proof, of any of these forms.

    Raises:
        ProofError: the file is no such proof, or one about another scene.
    """
    kind = header_of(data)["kind"]
    return FORMS.get(kind, PairProof).from_bytes(data, scene)


@dataclass(frozen=True)
class Archimedean:
    """Holds numbers that show P to be Archimedean (certifier.verify.archimedean says how).

    Attributes:
        N: bound with |s|^2 <= N on P.
        lower: (n,) l, the lower bounds of the box.
        upper: (n,) u, the upper bounds of the box.
        Y_lower: (n, m) multipliers of the faces that prove the lower bounds.
        Y_upper: (n, m) multipliers of the faces that prove the upper bounds.
        y: (m,) multipliers of the faces that prove the affine remainder to be nonnegative.
    """

    N: float
    lower: Array
    upper: Array
    Y_lower: Array
    Y_upper: Array
    y: Array


@dataclass(frozen=True)
class Implied:
    """Holds half-spaces that contain a polytope of m faces, with the multipliers that prove it.

    Attributes:
        C: (h, n) left-hand sides of the half-spaces.
        d: (h,) right-hand sides of the half-spaces.
        Y: (h, m) multipliers of the polytope's faces, a row for each half-space.
    """

    C: Array
    d: Array
    Y: Array


@dataclass(frozen=True)
class RegionProof:
    """Holds everything that is needed to check that a region is free of collision for every pair of its scene.

    Attributes:
        C: (m, n) left-hand sides of the region's half-spaces, joint limits included.
        d: (m,) right-hand sides of the region's half-spaces.
        interior: (n,) a point strictly inside the region.
        implied: half-spaces around the region that are redundant to it, but are faces of some ground.
        archimedean: numbers that show the region to be bounded.
        proofs: proofs that together cover every pair of the scene; the ground of each contains the region.
    """

    scene: Scene
    C: Array
    d: Array
    interior: Array
    implied: Implied
    archimedean: Archimedean
    proofs: tuple[Separation, ...] = field(repr=False)

    def to_bytes(self) -> bytes:
        """Returns the proof as a file, which stores grounds and volumes that several proofs share once."""
        pool = Pool(self.scene)
        headers = [pool.add(proof) for proof in self.proofs]
        arrays: dict[str, np.ndarray] = {"region/C": self.C, "region/d": self.d, "region/interior": self.interior}
        arrays |= {f"implied/{name}": value for name, value in vars(self.implied).items()}
        arrays |= {f"archimedean/{name}": np.asarray(value) for name, value in vars(self.archimedean).items()}
        header = {"format": FORMAT, "kind": "region", "scene": self.scene.to_document(), **pool.header(), "proofs": headers}
        return pack(header, arrays | pool.arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> RegionProof:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no region's proof.
        """
        header, unpacked = unpack(data, "region")
        with malformed():
            fields, arrays = head(header, *SHARED), Arrays(unpacked)
            scene, interior = Scene.from_document(header["scene"]), arrays.floats("region/interior")
            N, *bounds = (arrays.floats(f"archimedean/{field.name}") for field in dataclasses.fields(Archimedean))
            if N.shape != ():
                raise CirisError("document", f"it is {N.shape}, not a number", field="archimedean/N.npy")
            proof = cls(
                scene=scene,
                C=arrays.floats("region/C"),
                d=arrays.floats("region/d"),
                interior=interior,
                implied=Implied(*(arrays.floats(f"implied/{field.name}") for field in dataclasses.fields(Implied))),
                archimedean=Archimedean(N.item(), *bounds),
                proofs=read_proofs(scene, fields, arrays, interior, FORMS),
            )
            arrays.end()
            return proof
