"""The proofs of a region in one scene become proofs in another scene here, where their volumes hold the other scene's geometries.

A proof says that planes keep two volumes apart. It knows geometries only by what the volumes hold. So a pair of the new scene takes over
the proof of an old one whose volumes hold its two geometries, whatever their names are. Geometries with the same numbers do so. Others
may: an obstacle that moved within the box about all obstacles of the world is still in it, and so is one that became smaller.

Nothing is decided here. The verifier checks again, of every proof that is taken over, that its volumes hold what they name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from certifier.carry.robot import same_bodies
from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import Geometry, Scene, Volume
from certifier.proof.partition import PartitionProof
from certifier.proof.region import RegionProof
from certifier.proof.separation import Separation
from certifier.verify.coarse import check_coarse
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.volume import check_volume


@dataclass(frozen=True, eq=False)
class Carry:
    """Holds what the proof of a region in one scene is worth in another scene.

    Attributes:
        proofs: pair index of the new scene -> a proof that covers it, about the new scene. Several pairs may share one.
        starts: pair index -> the proof that a pair of the same names had in the old scene. It proves nothing of the new pair; its
            cells and planes are where to begin. Its bodies have the names of the new scene.
    """

    proofs: dict[int, Separation]
    starts: dict[int, PartitionProof]


def carry(old: RegionProof, new: Scene) -> Carry:
    """Returns what a region's proof is worth in a new scene.

    Raises:
        SceneError: ``other_robot``.
    """
    bodies = same_bodies(old.scene, new)
    taker = _Taker(old.scene, new, bodies)
    numbers = {pair: index for index, pair in enumerate(new.pairs)}
    proofs: dict[int, Separation] = {}
    starts: dict[int, PartitionProof] = {}
    for proof in old.proofs:
        taken = taker.taken(proof)
        if taken is not None:
            proofs = {numbers[pair]: taken for pair in taken.pairs} | proofs
    for proof in old.proofs:
        start = _placed(proof, bodies) if isinstance(proof, PartitionProof) else None
        if start is not None:
            starts |= {numbers[pair]: start for pair in proof.pairs if pair in numbers and numbers[pair] not in proofs}
    return Carry(proofs, starts)


def _placed(proof: PartitionProof, bodies: dict[str, str]) -> PartitionProof | None:
    """Returns a proof with the names that the bodies have in the new scene; None where the frame is gone. Its scene is the old one.

    Volumes whose bodies are gone keep the names of these: no volume of the new scene is like them.
    """

    def volume(old: Volume) -> Volume:
        return replace(old, body=bodies.get(old.body, old.body))

    if proof.frame not in bodies:
        return None
    first, second = (tuple(map(volume, some)) for some in proof.coarse)
    a, b = map(volume, proof.volumes)
    return replace(proof, frame=bodies[proof.frame], volumes=(a, b), coarse=(first, second))


class _Taker:
    """Takes proofs over into a new scene."""

    def __init__(self, old: Scene, new: Scene, bodies: dict[str, str]) -> None:
        self._old, self._new, self._bodies = old, new, bodies
        self._kinematics, self._exact = Kinematics.of(new), ExactKinematics.at(new, [])
        self._in_pairs = [new.geometry(name) for name in dict.fromkeys(name for pair in new.pairs for name in (pair.a, pair.b))]
        known = {_numbers(g, bodies.get(g.body)): g.name for g in old.geometries}
        alike = ((g, known.get(_numbers(g, g.body))) for g in self._in_pairs)
        self._twins: dict[str, list[Geometry]] = {}
        self._changed: list[Geometry] = []
        for geometry, twin in alike:
            if twin is None:
                self._changed.append(geometry)
            else:
                self._twins.setdefault(twin, []).append(geometry)
        # Of old geometries with the same numbers, the one that was found stands for all of them.
        self._named = {g.name: known[_numbers(g, bodies.get(g.body))] for g in old.geometries}

    def taken(self, proof: Separation) -> Separation | None:
        """Returns the proof about the new scene; None where it covers none of its pairs."""
        if proof.frame not in self._bodies:
            return None
        coarse = proof.coarse if isinstance(proof, PartitionProof) else ((), ())
        sides = [self._side(volume, others) for volume, others in zip(proof.volumes, coarse, strict=True)]
        first, second = sides
        if first is None or second is None:
            return None
        about = replace(proof, scene=self._new, frame=self._bodies[proof.frame], volumes=(first[0], second[0]))
        if isinstance(about, PartitionProof):
            about = replace(about, coarse=(first[1], second[1]))
        same = self._new.padding_between(about.volumes) == self._old.padding_between(proof.volumes)
        return about if about.pairs and same else None

    def _side(self, volume: Volume, coarse: Sequence[Volume]) -> tuple[Volume, tuple[Volume, ...]] | None:
        """Returns a volume and its coarse ones with the geometries of the new scene that all of them hold; None where they hold none."""
        if not all(one.body in self._bodies for one in (volume, *coarse)):
            return None
        own, *others = (replace(one, body=self._bodies[one.body]) for one in (volume, *coarse))
        twins = [twin.name for name in dict.fromkeys(self._named[name] for name in volume.geometries) for twin in self._twins.get(name, [])]
        names = (*twins, *self._held(own, others))
        if not names:
            return None
        return replace(own, geometries=names), tuple(replace(one, geometries=names) for one in others)

    def _held(self, volume: Volume, coarse: Sequence[Volume]) -> Iterator[str]:
        """Gives the names of changed geometries that the volume and its coarse ones hold."""
        root = self._kinematics.rigid_root(volume.body)
        for geometry in self._changed:
            if self._kinematics.rigid_root(geometry.body) != root or not self._may_hold(volume, geometry):
                continue
            named = (geometry.name,)
            try:
                check_volume(self._new, self._exact, replace(volume, geometries=named))
                for one in coarse:
                    check_coarse(self._new, self._exact, replace(one, geometries=named))
            except ProofError:
                continue
            yield geometry.name

    def _may_hold(self, volume: Volume, geometry: Geometry) -> bool:
        """Returns whether a volume's box along the axes holds that of a geometry, to rounding."""
        vertices = self._kinematics.points(volume.body, geometry.body, geometry.vertices, np.zeros((1, self._new.n)))[0]
        room = volume.radius - geometry.radius + 1e-6
        lower, upper = volume.vertices.min(axis=0) - room, volume.vertices.max(axis=0) + room
        return bool((vertices >= lower).all() and (vertices <= upper).all())


def _numbers(geometry: Geometry, body: str | None) -> tuple[object, ...]:
    return body, geometry.radius, geometry.vertices.shape, (geometry.vertices + 0.0).tobytes()
