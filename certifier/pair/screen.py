"""Before a program is solved, the screen looks at a pair's bodies at some configurations of P: the centre and samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Volume
from certifier.pair.frames import Frame
from certifier.polytopes.closest import first_within

SCREEN_SAMPLES = 64
NEAREST_JOINTS = 4
"""In scenes of up to this many joints a refutation shows the contact that is nearest to the centre."""
GAP_SAMPLES = 16
APART = 0.15
"""Volumes of several geometries are tried where their gap at the samples is at least this part of the way that their vertices sweep."""


@dataclass(frozen=True)
class Contact:
    """A contact is a configuration at which two padded bodies touch.

    Attributes:
        s: (n,) the configuration.
        weights: for either body, (V,) convex weights of its vertices; the bodies touch at the mean points that these weights give.
    """

    s: Array
    weights: tuple[Array, Array]


class Screen:
    """Looks at pairs of bodies at the configurations of one polytope.

    Args:
        center: (n,) a point inside the polytope.
        samples: (S, n) points inside the polytope.

    Attributes:
        configurations: (1 + S, n) the centre, then the samples.
    """

    def __init__(self, kinematics: Kinematics, polytope: Polytope, center: Array, samples: Array) -> None:
        self._kinematics, self._polytope = kinematics, polytope
        self.configurations = np.concatenate([center[None], samples])
        self._first = self.configurations[:SCREEN_SAMPLES]
        if kinematics.scene.n <= NEAREST_JOINTS:
            gauge = ((self._first - center) @ polytope.C.T / (polytope.d - polytope.C @ center)).max(axis=1)
            self._first = self._first[np.argsort(gauge)]

    def contact(self, volumes: tuple[Volume, Volume], frame: Frame) -> Contact | None:
        """Returns a contact at the centre or at one of the first samples; None if there is none."""
        return self._contact(volumes, frame, self._first)

    def contact_near(self, volumes: tuple[Volume, Volume], frame: Frame, points: Array) -> Contact | None:
        """Returns a contact at the centre, at any sample, or at one of the points (w, n) in the polytope; None if there is none."""
        return self._contact(volumes, frame, np.concatenate([self.configurations, points[self._polytope.contains(points)]]))

    def apart(self, volumes: tuple[Volume, Volume], frame: Frame) -> bool:
        """Returns whether, at each of a few samples, the padded volumes' distance is large against what they sweep in the frame."""
        A, B = (self._points(volume, frame, self.configurations[:GAP_SAMPLES]) for volume in volumes)
        least = APART * sum(float(np.linalg.norm(np.ptp(points, axis=0), axis=1).max()) for points in (A, B))
        least += self._reach(volumes)
        return first_within(A, B, least) is None

    def _contact(self, volumes: tuple[Volume, Volume], frame: Frame, s: Array) -> Contact | None:
        a, b = volumes
        found = first_within(self._points(a, frame, s), self._points(b, frame, s), self._reach(volumes))
        return None if found is None else Contact(s[found[0]], found[1].weights)

    def _reach(self, volumes: tuple[Volume, Volume]) -> float:
        return sum(volume.radius for volume in volumes) + 2 * self._kinematics.scene.padding_between(volumes)

    def _points(self, volume: Volume, frame: Frame, s: Array) -> Array:
        return self._kinematics.points(frame.body, volume.body, volume.vertices, s)
