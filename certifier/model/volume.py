"""Volumes: convex bodies that stand for geometries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.model.bodies import Geometry
from certifier.model.joints import Array
from certifier.model.scene import Scene


@dataclass(frozen=True)
class Volume:
    """A volume is a convex body conv(vertices) + ball(radius), fixed to a link. It contains, and stands for, every geometry that it names.

    Attributes:
        geometries: names of the geometries.
        body: body in whose frame the vertices are. It is the geometries' own body, or their bodies are welded to it.
        vertices: (V, 3) metres.
        radius: metres; the scene's padding is added to it.
    """

    geometries: tuple[str, ...]
    body: str
    vertices: Array
    radius: float

    @classmethod
    def of(cls, geometry: Geometry) -> Volume:
        """Returns the volume that is the geometry itself."""
        return cls((geometry.name,), geometry.body, geometry.vertices, geometry.radius)

    def is_geometry_of(self, scene: Scene) -> bool:
        """Returns whether the volume is exactly the one geometry that it names."""
        geometry = scene.geometry(self.geometries[0])
        return (
            len(self.geometries) == 1
            and self.body == geometry.body
            and self.radius == geometry.radius
            and np.array_equal(self.vertices, geometry.vertices)
        )
