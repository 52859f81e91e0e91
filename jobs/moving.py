"""Motions between the configurations that a cover shall connect, where its regions do not lead. They are kept like those of a planner."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from certifier.model import Array, Scene
from db import motions
from db.session import Database, database
from db.settings import settings
from jobs.kind import in_child
from jobs.scouting import state_of
from planner.cover.state import Moved
from planner.trajectory.plan import ACCELERATION, SPEED

PLANNED = "planner.sampling.child:planned"
SECONDS = 10.0
"""Each motion is searched for this long."""


def move(scene: Scene, scene_id: str, job_id: str) -> Moved:
    """Searches for motions from the first configuration to connect to all that are not in its component, and keeps what is proved."""
    state = state_of(job_id)
    assert state.last is not None, "a cover looks before it searches for motions"
    kept = scene.hash, json.dumps(scene.to_document())
    limits = {"speed": np.full(scene.n, SPEED), "acceleration": np.full(scene.n, ACCELERATION)}
    pairs: list[tuple[int, int]] = []
    for i, goal in enumerate(state.options.connect):
        if i == 0 or (state.last.connect[i] is not None and state.last.connect[i] == state.last.connect[0]):
            continue
        asked = {"points": np.array([state.options.connect[0]]), "goals": [np.array(goal)], "seconds": SECONDS, **limits}
        found = in_child(PLANNED, asked, kept)
        if "reason" in found:
            continue
        keep(database(), scene_id, found, limits | {"direct": np.array([True])})
        pairs.append((0, i))
    return Moved(tuple(pairs))


def keep(db: Database, scene_id: str, found: dict[str, Any], limits: dict[str, Array]) -> str:
    """Keeps a motion that planner.sampling.child.planned has found, and returns its id.

    Args:
        limits: ``speed`` and ``acceleration`` (n,), which it keeps; and ``direct``, whether it was asked for from start to goal alone.
    """
    arrays = {name: found[name] for name in ("path", "q", "t")} | limits
    with db.write() as session:
        return motions.add(session, scene_id, arrays, found["tube"], base64.b64decode(found["planes"]), settings().kept_motions).id
