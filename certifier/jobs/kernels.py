"""All compiled functions that jobs call are loaded here, before a job begins.

Numba compiles a function when it is called for the first time, and keeps it in ``NUMBA_CACHE_DIR`` or beside its source. Compiling
all that a growth calls takes the processor two minutes, which would be part of the time that a job has. From where they are kept, they
are loaded in a second or two.
"""

from __future__ import annotations

from multiprocessing import get_context
from typing import Any

import numpy as np

from certifier.conditioned import with_conditions
from certifier.conditions import Cone
from certifier.growth.options import GrowthOptions
from certifier.jobs import local, motion
from certifier.jobs.map import grow_map
from certifier.map.free_set import free_set
from certifier.model import WORLD, Polytope
from certifier.seeding.arm import AT, HAND, NEAR, arm
from certifier.seeding.iris import iris
from certifier.seeding.options import SeedOptions
from certifier.seeding.proposal import Proposal

PART = 0.6
"""The faces of the proposal are moved to this part of their distance from the seed: all that is left is certified at once."""

UPRIGHT = Cone("upright", HAND, (0.0, 0.0, 1.0), WORLD, (0.0, 0.0, 1.0), 1.0)
CELLS = 100
"""The condition is certified with at most this many cells of each pair. So what proves a plane that is known before is called."""

COVERED = 0.05
"""The map of the arm ends when it covers this share."""


def warm_up() -> dict[str, Any]:
    """Grows regions of a small arm, in both ways, certifies a condition, and grows a map. Another process certifies a motion.

    Drake is not loaded. Returns the map's free set (certifier.map.free_set).

    Motions are certified by children of workers, so it is enough that what they call is kept.
    """
    motions = get_context("fork").Process(target=motion.warm_up, daemon=True)
    motions.start()
    scene = arm()
    center, contain = scene.to_s(np.array([AT])), scene.to_s(np.array([NEAR]))
    C, d, account = iris(scene, np.concatenate([center, contain]), SeedOptions(q=AT, contain=(NEAR,), delta=0.5))
    nearer = C @ center[0] + PART * (d - C @ center[0])
    proposal = Proposal(C, nearer, center[0], contain, {**account, "seconds": 0.0})
    for asked in ({"stages": 1}, {"paper": {"pushes": 1}}):
        local.grow(scene, GrowthOptions.from_document({"seed": {"q": AT}, **asked}), propose=lambda _: proposal)
    local.certify(with_conditions(scene, [UPRIGHT]), Polytope(C, nearer), cells=CELLS)
    grown = grow_map(scene, coverage=COVERED).proof
    grow_map(scene, coverage=COVERED, former=grown)
    motions.join()
    return free_set(grown)
