"""The proofs that two volumes are separated on a polytope have this in common, whatever form they take.

A file holds one of them or, about a region, many, and stores the polytopes and the volumes that several share once. docs/proofs.md
describes it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np

from certifier.document import Node
from certifier.errors import CirisError, ProofError
from certifier.model import Array, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.container import FORMAT, Arrays, head, malformed, npy, pack, unpack
from certifier.proof.ground import Ground, read_ground

_T = TypeVar("_T")


class Common(NamedTuple):
    """Holds what every form of proof has; :class:`Separation` says what it is."""

    scene: Scene
    volumes: tuple[Volume, Volume]
    frame: str
    ground: Ground
    interior: Array


@dataclass(frozen=True)
class Separation:
    """Holds what every proof has that planes separate two volumes on a polytope.

    The proof covers every pair of the scene with one geometry in the first volume and the other in the second.

    Attributes:
        KIND: kind of a file that holds one such proof.
        HEADER: what the header of such a proof has besides its volumes, its frame and its ground.
        volumes: the volume on the positive side of the planes, and the one on the negative side.
        frame: body whose frame the planes are expressed in.
        interior: (n,) a point of the ground's polytope, which is therefore not empty. The proofs of a region have the region's own point.
    """

    KIND: ClassVar[str]
    HEADER: ClassVar[tuple[str, ...]]

    scene: Scene
    volumes: tuple[Volume, Volume]
    frame: str
    ground: Ground
    interior: Array

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Returns the pairs of the scene that the proof covers, in the scene's order."""
        return self.scene.pairs_between(self.volumes)

    @property
    def title(self) -> str:
        """Returns the names of the volumes' geometries, for errors."""
        return " and ".join(", ".join(volume.geometries) for volume in self.volumes)

    @property
    def all_volumes(self) -> tuple[Volume, ...]:
        """Returns the two volumes, and what else of the file's volumes the proof holds."""
        return self.volumes

    def own(self, number: Callable[[Volume], int]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Returns the members of HEADER and the arrays that are this form's own.

        Args:
            number: gives a volume its number among those of the file.
        """
        raise NotImplementedError

    @classmethod
    def read(cls, common: Common, header: dict[str, Node], volumes: Sequence[Volume], arrays: Arrays, prefix: str) -> Self:
        """Reads what :meth:`own` returns; the names of the arrays begin with the prefix and a slash.

        Args:
            volumes: those of the file, in the order of their numbers.

        Raises:
            CirisError: something is missing, or not of its kind.
        """
        raise NotImplementedError

    def to_bytes(self) -> bytes:
        """Returns the proof as a file."""
        pool = Pool(self.scene)
        headers = [pool.add(self)]
        header = {"format": FORMAT, "kind": self.KIND, "scene_hash": self.scene.hash, **pool.header(), "proofs": headers}
        return pack(header, {"interior": self.interior, **pool.arrays})

    @classmethod
    def from_bytes(cls, data: bytes, scene: Scene) -> Self:
        """Reads what :meth:`to_bytes` writes.

        Raises:
            ProofError: the file is no proof of this form, or one about another scene.
        """
        header, unpacked = unpack(data, cls.KIND)
        with malformed():
            fields, arrays = head(header, *SHARED), Arrays(unpacked)
            same_scene(fields, scene)
            proofs = read_proofs(scene, fields, arrays, arrays.floats("interior"), {cls.KIND: cls})
            arrays.end()
            if len(proofs) != 1:
                raise CirisError("document", f"a pair's file holds one proof, not {len(proofs)}", field="header.proofs")
            return proofs[0]


_P = TypeVar("_P", bound=Separation)


class Pool:
    """Collects the arrays of several proofs, and stores once what they share."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.arrays: dict[str, np.ndarray] = {}
        self._volumes: list[dict[str, Any]] = []
        self._known: dict[tuple[str | bytes, ...], int] = {}
        self._proofs = 0

    def add(self, proof: Separation) -> dict[str, Any]:
        """Takes the proof's arrays in and returns its header."""
        ground, prefix = self._ground(proof.ground), f"proof/{self._proofs}"
        self._proofs += 1
        volumes = [self._volume(v) for v in proof.volumes]
        own, arrays = proof.own(self._volume)
        self.arrays |= {f"{prefix}/{name}": array for name, array in arrays.items()}
        form = {} if proof.KIND == DEFAULT_FORM else {"form": proof.KIND}
        return {"volumes": volumes, "frame": proof.frame, "ground": ground, **form, **own}

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
DEFAULT_FORM = "pair"
"""A proof whose header names no form is of this one."""


def read_proofs(scene: Scene, header: dict[str, Node], arrays: Arrays, interior: Array, forms: Mapping[str, type[_P]]) -> tuple[_P, ...]:
    """Returns the proofs of a file. They share grounds and volumes, each of which belongs to at least one proof.

    Args:
        interior: (n,) what the file gives as a point of all grounds.
        forms: the forms that the proofs may take, by their kinds.

    Raises:
        CirisError: something is missing, superfluous, or not of its kind.
    """
    count = header["grounds"].count()
    if count > limits.GROUNDS:
        raise CirisError("document", f"there are {count} of them, at most {limits.GROUNDS} are read", field="header.grounds")
    grounds = [read_ground(arrays, i) for i in range(count)]
    volumes = [_volume(scene, arrays, i, node) for i, node in enumerate(header["volumes"].items(limits.VOLUMES))]
    proofs = []
    for i, node in enumerate(header["proofs"].items(limits.PROOFS)):
        form = _form(node, forms)
        fields = node.fields("volumes", "frame", "ground", *(["form"] if form.KIND != DEFAULT_FORM else []), *form.HEADER)
        first, second = (item(volume, volumes) for volume in fields["volumes"].two())
        common = Common(scene, (first, second), fields["frame"].text(), item(fields["ground"], grounds), interior)
        proofs.append(form.read(common, fields, volumes, arrays, f"proof/{i}"))
    used = {id(part) for proof in proofs for part in (proof.ground, *proof.all_volumes)}
    if not all(id(part) in used for part in (*grounds, *volumes)):
        raise CirisError("document", "a polytope or a volume of it belongs to no proof", field="header")
    return tuple(proofs)


def _form(node: Node, forms: Mapping[str, type[_P]]) -> type[_P]:
    """Returns the form of the proof with this header."""
    named = isinstance(node.value, dict) and "form" in node.value
    form = Node(node.value["form"], f"{node.where}.form").text() if named else DEFAULT_FORM
    if form not in forms:
        raise CirisError("document", f"{form[:40]!r} is no form of proof that belongs here", field=node.where)
    return forms[form]


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


def item(node: Node, items: Sequence[_T]) -> _T:
    """Returns the item whose number the node holds.

    Raises:
        CirisError: there is none.
    """
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
