"""A pair's proof is held here as data, and is written to and read from its portable file.

A pair's proof on P = {s : C s <= d} is expressed in a frame F and in the coordinates u = (s - mid)/half of a box around P. It holds the
plane [a; b] = Z [1; u], a margin t and a bound kappa of |a|. For every vertex v of either volume it holds Gram factors L_j with

    +-(a'p_v + b den) - (r kappa + t) den - sigma (|L_0' rho|^2 + sum_j g_j |L_j' rho|^2)  ~  0.

The g_j are some of P's faces d_j - c_j's and of its box's faces, 1 + u_i and 1 - u_i. rho are the 2^k products of the chain's coordinates
u_i (plain monomials).

The factors are fixed-point numbers of 30 bits, with one exponent for each face. They have 48 bits where rounding to 30 would eat up the
margin.

Nothing here decides whether a proof holds: certifier.verify does. docs/proofs.md describes the file.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from certifier.document import Node
from certifier.errors import CirisError, ProofError
from certifier.model import Array, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.container import FORMAT, Arrays, head, malformed, npy, pack, unpack

_T = TypeVar("_T")

BITS = {"int32": 30, "int64": 48}
"""The mantissa of a Gram factor has this many bits, by its type."""


@dataclass(frozen=True)
class Ground:
    """A ground is the polytope that a proof is about, with its box.

    Attributes:
        C: (m, n) left-hand sides of the faces; the joint limits hold besides.
        d: (m,) right-hand sides of the faces.
        mid: (n,) centre of the box.
        half: (n,) half edges of the box.
        Y_lower: (n, m + 2n) multipliers of the faces, the upper and the lower joint limits that prove the box's lower bounds.
        Y_upper: (n, m + 2n) multipliers of the same that prove the box's upper bounds.
    """

    C: Array
    d: Array
    mid: Array
    half: Array
    Y_lower: Array
    Y_upper: Array

    @classmethod
    def of_box(cls, mid: Array, half: Array) -> Ground:
        """Returns a box as a polytope: its upper, then its lower faces, which are a rounding inside the exact ones."""
        eye, unit = np.eye(len(mid)), np.eye(2 * len(mid), 4 * len(mid))
        d = np.concatenate([np.nextafter(mid + half, -np.inf), -np.nextafter(mid - half, np.inf)])
        return cls(np.concatenate([eye, -eye]), d, mid, half, unit[len(mid) :], unit[: len(mid)])


@lru_cache(maxsize=16)
def lower_triangle(length: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the row and the column of every entry of a lower triangle of that many rows, row by row."""
    return np.tril_indices(length)


@dataclass(frozen=True)
class Side:
    """Holds the Gram factors of one volume's vertices: factor = mantissa 2^exponent, as lower triangles row by row.

    Attributes:
        chain: position indices of the joints between F and the body, ascending; rho's coordinates are in this order.
        mantissa: (V, f + 1, L (L + 1) / 2) int32 or int64, with L = 2^k, for 1 and the f faces used.
        exponent: (f + 1,) int32, for 1 and the f faces used.
    """

    chain: tuple[int, ...]
    mantissa: np.ndarray
    exponent: np.ndarray

    @classmethod
    def rounded(cls, chain: tuple[int, ...], factor: Array, kind: str = "int32") -> Side:
        """Rounds factors, (V, f + 1, L, L) lower triangular, of Gram matrices in plain monomials; ``kind`` is a key of BITS."""
        exponent = np.frexp(np.abs(factor).max(axis=(0, 2, 3)))[1].astype(np.int32) - BITS[kind]
        rows, columns = lower_triangle(factor.shape[-1])
        mantissa = np.rint(np.ldexp(factor[:, :, rows, columns], -exponent[:, None])).astype(kind)
        return cls(chain, mantissa, exponent)

    @property
    def factors(self) -> Array:
        """Returns the lower triangular factors, (V, f + 1, L, L)."""
        length = 2 ** len(self.chain)
        rows, columns = lower_triangle(length)
        L = np.zeros((*self.mantissa.shape[:2], length, length))
        L[:, :, rows, columns] = np.ldexp(self.mantissa.astype(float), self.exponent[:, None])
        return L


@dataclass(frozen=True)
class PairProof:
    """Holds a plane that separates two volumes on a polytope, with the sums of squares that prove it.

    The proof covers every pair of the scene with one geometry in the first volume and the other in the second.

    Attributes:
        volumes: the volume on the positive side of the plane, and the one on the negative side.
        frame: body whose frame the plane is expressed in.
        interior: (n,) a point of the ground's polytope, which is therefore not empty. The proofs of a region have the region's own point.
        plane: Z, (4, n + 1).
        t: margin.
        kappa: bound of |a(u)| on the box (0 where no radius is involved).
        faces: the f faces used: j for the ground's face j, m + i for 1 + u_i, m + n + i for 1 - u_i.
        sides: the Gram factors of the two volumes.
    """

    scene: Scene
    volumes: tuple[Volume, Volume]
    frame: str
    ground: Ground
    interior: Array
    plane: Array
    t: float
    kappa: float
    faces: tuple[int, ...]
    sides: tuple[Side, Side]

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Returns the pairs of the scene that the proof covers, in the scene's order."""
        first, second = (set(volume.geometries) for volume in self.volumes)
        found = {i: p for name in first for i, p in self.scene.pairs_of(name) if (p.b if p.a == name else p.a) in second}
        return tuple(found[i] for i in sorted(found))

    @property
    def needs_box_alone(self) -> bool:
        """Returns whether the proof uses no face of the polytope but those of the box."""
        return all(j >= len(self.ground.d) for j in self.faces)

    def on_its_box(self) -> PairProof:
        """Returns the same proof, stated on all of its box. The proof must need no other face than the box's."""
        ground = Ground.of_box(self.ground.mid, self.ground.half)
        shift = len(ground.d) - len(self.ground.d)
        return replace(self, ground=ground, faces=tuple(j + shift for j in self.faces))

    def to_bytes(self) -> bytes:
        """Returns the proof as a file."""
        pool = Pool(self.scene)
        headers = [pool.add(self)]
        header = {"format": FORMAT, "kind": "pair", "scene_hash": self.scene.hash, **pool.header(), "proofs": headers}
        return pack(header, {"interior": self.interior, **pool.arrays})

    @classmethod
    def from_bytes(cls, data: bytes, scene: Scene) -> PairProof:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no pair's proof, or one about another scene.
        """
        header, unpacked = unpack(data, "pair")
        with malformed():
            fields, arrays = head(header, *SHARED), Arrays(unpacked)
            same_scene(fields, scene)
            proofs = read_proofs(scene, fields, arrays, arrays.floats("interior"))
            arrays.end()
            if len(proofs) != 1:
                raise CirisError("document", f"a pair's file holds one proof, not {len(proofs)}", field="header.proofs")
            return proofs[0]


class Pool:
    """Collects the arrays of several proofs, and stores once what they share."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.arrays: dict[str, np.ndarray] = {}
        self._volumes: list[dict[str, Any]] = []
        self._known: dict[tuple[str | bytes, ...], int] = {}
        self._proofs = 0

    def add(self, proof: PairProof) -> dict[str, Any]:
        """Takes the proof's arrays in and returns its header."""
        ground, prefix = self._ground(proof.ground), f"proof/{self._proofs}"
        self._proofs += 1
        self.arrays |= {f"{prefix}/plane": proof.plane, f"{prefix}/scalars": np.array([proof.t, proof.kappa])}
        for i, side in enumerate(proof.sides):
            self.arrays |= {f"{prefix}/mantissa{i}": side.mantissa, f"{prefix}/exponent{i}": side.exponent}
        return {
            "volumes": [self._volume(volume) for volume in proof.volumes],
            "frame": proof.frame,
            "ground": ground,
            "faces": list(proof.faces),
            "chains": [list(side.chain) for side in proof.sides],
        }

    def header(self) -> dict[str, Any]:
        """Returns the number of grounds and the volumes, for the file's header."""
        return {"grounds": sum(name.endswith("/mid") for name in self.arrays), "volumes": self._volumes}

    def _ground(self, ground: Ground) -> int:
        return self._once("ground", {}, vars(ground))

    def _volume(self, volume: Volume) -> int:
        header: dict[str, Any] = {"geometries": list(volume.geometries)}
        arrays = {}
        if not volume.is_geometry_of(self._scene):
            header["body"] = volume.body
            arrays = {"vertices": volume.vertices, "radius": np.array(volume.radius)}
        index = self._once("volume", header, arrays)
        if index == len(self._volumes):
            self._volumes.append(header)
        return index

    def _once(self, kind: str, header: dict[str, Any], arrays: dict[str, np.ndarray]) -> int:
        """Returns the number of these arrays among those of their kind; new ones are stored first."""
        key: tuple[str | bytes, ...] = (kind, json.dumps(header), *(npy(a) for a in arrays.values()))
        if key not in self._known:
            self._known[key] = index = sum(known[0] == kind for known in self._known)
            self.arrays |= {f"{kind}/{index}/{name}": value for name, value in arrays.items()}
        return self._known[key]


SHARED = ("grounds", "volumes", "proofs")
"""These members of a header are those that :class:`Pool` writes and :func:`read_proofs` reads."""


def read_proofs(scene: Scene, header: dict[str, Node], arrays: Arrays, interior: Array) -> tuple[PairProof, ...]:
    """Returns the proofs of a file. They share grounds and volumes, each of which belongs to at least one proof.

    Args:
        interior: (n,) what the file gives as a point of all grounds.

    Raises:
        CirisError: something is missing, superfluous, or not of its kind.
    """
    count = header["grounds"].count()
    if count > limits.GROUNDS:
        raise CirisError("document", f"there are {count} of them, at most {limits.GROUNDS} are read", field="header.grounds")
    grounds = [read_ground(arrays, i) for i in range(count)]
    volumes = [_volume(scene, arrays, i, node) for i, node in enumerate(header["volumes"].items(limits.VOLUMES))]
    proofs = tuple(
        _proof(scene, arrays, f"proof/{i}", node, grounds, volumes, interior)
        for i, node in enumerate(header["proofs"].items(limits.PROOFS))
    )
    used = {id(part) for proof in proofs for part in (proof.ground, *proof.volumes)}
    if not all(id(part) in used for part in (*grounds, *volumes)):
        raise CirisError("document", "a polytope or a volume of it belongs to no proof", field="header")
    return proofs


def _volume(scene: Scene, arrays: Arrays, i: int, node: Node) -> Volume:
    header = node.fields("geometries", optional=("body",))
    names = tuple(name.text() for name in header["geometries"].items())
    if "body" in header:
        vertices, radius = arrays.floats(f"volume/{i}/vertices"), arrays.floats(f"volume/{i}/radius")
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not 0 < len(vertices) <= limits.CORNERS or radius.shape != ():
            raise CirisError("document", f"it has no vertices, more than {limits.CORNERS} or no radius", field=node.where)
        return Volume(names, header["body"].text(), vertices, radius.item())
    if len(names) != 1:
        raise CirisError("document", "a volume without a body is one geometry", field=node.where)
    return Volume.of(scene.geometry(names[0]))


def _proof(
    scene: Scene, arrays: Arrays, prefix: str, node: Node, grounds: list[Ground], volumes: list[Volume], interior: Array
) -> PairProof:
    header = node.fields("volumes", "frame", "ground", "faces", "chains")
    scalars = arrays.floats(f"{prefix}/scalars")
    if scalars.shape != (2,):
        raise CirisError("document", f"it is {scalars.shape}, not (2,)", field=f"{prefix}/scalars.npy")
    first, second = (_item(i, volumes) for i in header["volumes"].two())
    side_a, side_b = (
        Side(
            tuple(joint.count() for joint in chain.items(scene.n)),
            arrays.take(f"{prefix}/mantissa{i}", *BITS),
            arrays.take(f"{prefix}/exponent{i}", "int32"),
        )
        for i, chain in enumerate(header["chains"].two())
    )
    return PairProof(
        scene=scene,
        volumes=(first, second),
        frame=header["frame"].text(),
        ground=_item(header["ground"], grounds),
        interior=interior,
        plane=arrays.floats(f"{prefix}/plane"),
        t=scalars[0].item(),
        kappa=scalars[1].item(),
        faces=tuple(j.count() for j in header["faces"].items()),
        sides=(side_a, side_b),
    )


def _item(node: Node, items: list[_T]) -> _T:
    """Returns the item whose number the node holds."""
    number = node.count()
    if number >= len(items):
        raise CirisError("document", f"there is no number {number}, only {len(items)}", field=node.where)
    return items[number]


def digest(data: bytes) -> str:
    """Returns the SHA-256 of a proof file."""
    return hashlib.sha256(data).hexdigest()


def same_scene(header: dict[str, Node], scene: Scene) -> None:
    """Raises ProofError, proof_scene, for the header of a proof about another scene."""
    if header["scene_hash"].text() != scene.hash:
        raise ProofError("proof_scene", "the proof is about another scene")


def ground_arrays(ground: Ground, i: int) -> dict[str, np.ndarray]:
    """Returns the arrays of a file's ground i."""
    return {f"ground/{i}/{name}": value for name, value in vars(ground).items()}


def read_ground(arrays: Arrays, i: int) -> Ground:
    """Returns ground i of a file."""
    return Ground(*(arrays.floats(f"ground/{i}/{field.name}") for field in dataclasses.fields(Ground)))
