"""Motions between the configurations that a cover shall connect, where its regions do not lead. They are kept like those of a planner."""

from __future__ import annotations

import base64
import json

import numpy as np

from certifier import stored
from certifier.model import Scene
from db import jobs, motions
from db.session import database
from db.settings import settings
from db.transaction import persistently
from jobs.kind import in_child
from planner.cover.state import CoverState, Moved

PLANNED = "planner.sampling.child:planned"
SPEED, ACCELERATION = 1.0, 2.0
"""Limits of every joint, in rad/s and rad/s² (or m/s and m/s²): those of a plan that gives none."""
SECONDS = 10.0
"""Each motion is searched for this long."""


def move(scene: Scene, scene_id: str, job_id: str) -> Moved:
    """Searches for motions from the first configuration to connect to all that are not in its component, and keeps what is proved."""

    def read() -> CoverState:
        with database().read() as session:
            growth = jobs.growth(session, job_id)
            assert growth is not None, "a cover has begun when it searches for motions"
            return stored.value(CoverState, growth)

    state = persistently(read)
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
        with database().write() as session:
            arrays = {name: found[name] for name in ("path", "q", "t")} | limits
            motions.add(session, scene_id, arrays, found["tube"], base64.b64decode(found["proof"]), settings().kept_motions)
        pairs.append((0, i))
    return Moved(tuple(pairs))
