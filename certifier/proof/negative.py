"""These proofs say that a pair cannot be certified on a polytope.

Functionals exclude every certificate, or a configuration shows the bodies in contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.errors import CirisError
from certifier.model import Array, Pair, Scene
from certifier.proof.container import FORMAT, Arrays, head, malformed, pack, unpack
from certifier.proof.ground import Ground, ground_arrays, read_ground
from certifier.proof.separation import same_scene


@dataclass(frozen=True)
class DualProof:
    """Holds functionals that exclude every certificate of one pair on a polytope, in one frame (certifier.verify.dual says how).

    Attributes:
        frame: body whose frame the planes are expressed in.
        interior: (n,) a point of the ground's polytope, which is therefore not empty.
        moments: (V, N) for a's and for b's vertices, the functionals' values on the monomials in the order of certifier.verify.moments.
        equations: numbers of the K equations that are solved. The equations say that the entries of R vanish: the 4 (n + 1) entries, row
            by row, or only the n + 1 entries of b where a radius is involved.
        entries: (K, 3) int64 side, vertex and monomial of each moment whose change makes these K entries of R vanish.
        normal: Yaa (3, 3) and Ybb (n + 1, n + 1); empty where no radius is involved.
    """

    scene: Scene
    pair: Pair
    frame: str
    ground: Ground
    interior: Array
    moments: tuple[Array, Array]
    equations: tuple[int, ...]
    entries: np.ndarray
    normal: tuple[Array, Array]

    def to_bytes(self) -> bytes:
        """Returns the proof as a file."""
        header = {
            "format": FORMAT,
            "kind": "dual",
            "scene_hash": self.scene.hash,
            "pair": [self.pair.a, self.pair.b],
            "frame": self.frame,
            "equations": list(self.equations),
        }
        arrays = {"interior": self.interior, "moments0": self.moments[0], "moments1": self.moments[1], "entries": self.entries}
        arrays |= {"normal/aa": self.normal[0], "normal/bb": self.normal[1]}
        return pack(header, arrays | ground_arrays(self.ground, 0))

    @classmethod
    def from_bytes(cls, data: bytes, scene: Scene) -> DualProof:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no dual proof, or one about another scene.
        """
        header, unpacked = unpack(data, "dual")
        with malformed():
            fields, arrays = head(header, "pair", "frame", "equations"), Arrays(unpacked)
            same_scene(fields, scene)
            a, b = fields["pair"].two()
            entries = arrays.take("entries", "int64")
            if entries.shape[1:] != (3,):
                raise CirisError("document", f"it is {entries.shape}, not (K, 3)", field="entries.npy")
            proof = cls(
                scene=scene,
                pair=Pair(a.text(), b.text()),
                frame=fields["frame"].text(),
                ground=read_ground(arrays, 0),
                interior=arrays.floats("interior"),
                moments=(arrays.floats("moments0"), arrays.floats("moments1")),
                equations=tuple(k.count() for k in fields["equations"].items(4 * (scene.n + 1))),
                entries=entries,
                normal=(arrays.floats("normal/aa"), arrays.floats("normal/bb")),
            )
            arrays.end()
            return proof


@dataclass(frozen=True)
class WitnessProof:
    """Holds a configuration of a polytope at which the padded bodies of a pair touch.

    Attributes:
        C: (m, n) left-hand sides of the polytope's faces; the joint limits hold besides.
        d: (m,) right-hand sides of the polytope's faces.
        s: (n,) the configuration.
        weights: (V,) for each body, convex weights of its vertices. The bodies touch at the means that they give. The weights of a body
            are not all zero, and the verifier divides by their sum.
    """

    scene: Scene
    pair: Pair
    C: Array
    d: Array
    s: Array
    weights: tuple[Array, Array]

    def to_bytes(self) -> bytes:
        """Returns the proof as a file."""
        header = {"format": FORMAT, "kind": "witness", "scene_hash": self.scene.hash, "pair": [self.pair.a, self.pair.b]}
        return pack(header, {"C": self.C, "d": self.d, "s": self.s, "weights0": self.weights[0], "weights1": self.weights[1]})

    @classmethod
    def from_bytes(cls, data: bytes, scene: Scene) -> WitnessProof:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no witness, or one about another scene.
        """
        header, unpacked = unpack(data, "witness")
        with malformed():
            fields, arrays = head(header, "pair"), Arrays(unpacked)
            same_scene(fields, scene)
            a, b = fields["pair"].two()
            C, d, s, first, second = (arrays.floats(name) for name in ("C", "d", "s", "weights0", "weights1"))
            arrays.end()
            return cls(scene, Pair(a.text(), b.text()), C, d, s, (first, second))
