"""Answers advise a seed where two regions come near to each other. It is checked here, in floating point and without Drake."""

from __future__ import annotations

from functools import partial

import numpy as np

from certifier.model import Scene
from certifier.pair.collisions import in_collision
from planner.advice import seed_near
from planner.library import Library
from planner.overlap import Gap


def seed_between(scene: Scene, library: Library, gap: Gap) -> list[float] | None:
    """Returns joint positions (n,) midway between two regions, or near there, at which a region may grow; None where none was found."""
    found = seed_near(scene, library, partial(in_collision, scene), np.stack([gap.s_a, gap.s_b]))
    return None if found is None else found.tolist()
