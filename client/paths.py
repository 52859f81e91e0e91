"""This module takes a planner's path from the command line or from a file."""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from certifier.errors import CirisError, RegionError
from client.inputs import configuration

FIELD = "--path"


@dataclass(frozen=True)
class GivenPath:
    """Holds a motion as nested lists, which need no numpy.

    Attributes:
        motion: waypoints as ``q`` or ``s``, (K, n), rows of ``q`` perhaps as names of configurations; ``bezier``, (P, m + 1, n);
            or ``knots`` and ``control_points``. Whether they fit a scene is not known here.
        times: when the robot is at each waypoint, (K,), or where pieces begin and end, (P + 1,), in the file's unit, ascending; None
            where the file does not say.
    """

    motion: dict[str, Any]
    times: Sequence[float] | None


def path_of(args: Namespace) -> GivenPath:
    """Returns the motion that ``--q`` or ``--path`` gives.

    Raises:
        RegionError: as :func:`client.path_files.path_file`, or waypoints of different lengths.
        CirisError: there is neither of them, or both.
    """
    if bool(args.q) == bool(args.path):
        hint = "give them with --q, once for each, or as a file with --path"
        raise CirisError("option", "a motion needs its waypoints, from one place", field=FIELD, hint=hint)
    if args.path:
        from client.path_files import path_file  # which needs numpy

        return path_file(args.path)
    waypoints = [configuration(text, f"--q {i}") for i, text in enumerate(args.q)]
    if len({len(waypoint) for waypoint in waypoints if not isinstance(waypoint, str)}) > 1:
        raise RegionError(
            "motion_shape", "the waypoints have different numbers of joints", field="--q", hint="give one number for each joint"
        )
    return GivenPath({"q": waypoints}, None)


def named(field: str | None, args: Namespace) -> str | None:
    """Returns the place of an error in a request about a motion by the option that gave it, as the command's user knows it."""
    option = FIELD if args.path else "--q"
    return field and re.sub(r"^[qs](?=\[|$)", option, re.sub(r"^(?=bezier|knots|control_points)", f"{option} ", field))
