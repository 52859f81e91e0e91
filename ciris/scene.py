"""A scene as the service describes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from certifier.words import counted
from ciris.answers import NotCovered
from ciris.documents import Document, asked_as, named
from ciris.reading import read
from ciris.space import InSpace, Space, frozen


@dataclass(frozen=True, eq=False, repr=False)
class Scene(InSpace):
    """A robot and what stands around it, as the service knows them."""

    id: str
    name: str
    hash: str
    """SHA-256 of everything in the scene that a proof depends on."""
    space: Space
    """What the coordinates s mean."""
    geometries: int
    pairs: int
    """Number of the pairs of bodies that must not touch."""
    warnings: int
    """Number of the warnings; ``service.warnings(scene)`` returns them."""
    not_covered: NotCovered
    """The pairs of geometries that no proof about the scene is about."""
    padding: float
    """Metres added around both geometries of every pair that has no padding of its own."""
    asked: str
    """What requests call it: ``NAME@ID``, so that its named configurations are those of the name; or the id alone, if that was given."""
    configurations: Mapping[str, Mapping[str, float]]
    """The named configurations: positions of joints by their names, in radians or metres."""

    def __eq__(self, other: object) -> bool:
        """Scenes are equal that the service knows by the same id, which is made from their content."""
        return isinstance(other, Scene) and other.id == self.id

    def __hash__(self) -> int:
        return hash(self.id)

    def __repr__(self) -> str:
        has = (counted(len(self.joints), "joint"), counted(self.geometries, "geometry", "geometries"), counted(self.pairs, "pair"))
        return f"Scene({self.name!r}, {self.id}: {', '.join(has)})"

    @classmethod
    def of(cls, document: Document, given: str | None = None) -> Scene:
        """Reads the service's description, ``GET /v1/scenes/{scene}``.

        Args:
            given: the name or id that was asked for; None for a scene that was added under its name.
        """
        joints = document["positions"]
        q_star, lower, upper = (frozen([joint[name] for joint in joints]) for name in ("q_star", "lower", "upper"))
        revolute = frozen([joint["kind"] == "revolute" for joint in joints], bool)
        space = Space(tuple(joint["name"] for joint in joints), q_star, lower, upper, revolute)
        names = ("id", "name", "hash", "geometries", "pairs", "warnings", "padding", "configurations")
        asked = asked_as(document, given)
        return cls(
            space=space, asked=asked, not_covered=read(NotCovered, document["not_covered"]), **{name: document[name] for name in names}
        )


def scene_name(scene: str | Scene) -> str:
    """Returns what the service calls a scene.

    Raises:
        CirisError: argument, for anything but a name, an id or a scene.
    """
    return named(scene.asked if isinstance(scene, Scene) else scene, "scene", "its name, its id or a ciris.Scene")
