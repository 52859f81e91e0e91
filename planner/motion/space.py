"""The coordinates in which a motion is given."""

from __future__ import annotations

from enum import StrEnum


class Space(StrEnum):
    """Names the coordinates in which a motion is straight between two waypoints, or a polynomial of time."""

    Q = "q"
    """Joint positions, in radians or metres."""
    S = "s"
    """Tangent-space coordinates."""
