"""The state is what the growth of a region knows between two actions.

It is JSON-able, so that a job can be resumed from its database rows alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from certifier.growth.obstacles import Obstacle
from certifier.growth.options import GrowthOptions
from certifier.model import Array, Polytope


@dataclass(frozen=True, eq=False)
class Start:
    """Holds the proposal that growing starts from.

    Attributes:
        rows: the proposal's faces, then the joint limits, all scaled to |c| = 1.
        seed: (n,) the seed in s.
        keep: (k, n) points that stay inside, the first of them well inside.
        hindrance: the reason to give if no region can be grown; "" where none is known.
        again: the proposal is a region of the scene before it changed.
    """

    rows: Polytope
    seed: Array
    keep: Array
    hindrance: str = ""
    again: bool = False


@dataclass(frozen=True, eq=False)
class Best:
    """Holds the largest certified polytope so far.

    Attributes:
        iteration: the one that completed it.
        center: (n,) a point inside.
        box: whether it is the box about the seed, which is certified before there is a proposal.
    """

    iteration: int
    polytope: Polytope
    center: Array
    ellipsoid_volume: float
    box: bool = False


@dataclass(frozen=True, eq=False)
class Whole:
    """Holds the progress of certifying the whole proposal.

    Attributes:
        kept: the share of the proposal that the best region kept when this stage began.
        polytope: what the cuts so far keep; faces are added before the joint limits, which are its last 2n rows, and none is dropped.
        mid, half, Y_lower, Y_upper: of the :class:`ProvedBox` that is the root cell of all partitions of this stage.
        holds: pair index -> iteration whose proof, on a larger polytope, holds on the present one.
        begun: pair index -> the iteration of this stage in which its partition was begun; pairs without one are left out.
        open_cells: pair index -> how many cells of its partition are open.
        spent: pair index -> how many cells were looked at.
        cuts: pair index -> in how many rounds something was cut off for it; pairs without a cut are left out.
        since, passed: the shares of the time until the deadline that had passed when this stage began, and now; 0 without a deadline.
        stage: the number of the stage, from 1 on.
        together: pair index -> the other pairs that share its certificate.
    """

    kept: float
    polytope: Polytope
    mid: Array
    half: Array
    Y_lower: Array
    Y_upper: Array
    holds: dict[int, int] = field(default_factory=dict)
    begun: dict[int, int] = field(default_factory=dict)
    open_cells: dict[int, int] = field(default_factory=dict)
    spent: dict[int, int] = field(default_factory=dict)
    cuts: dict[int, int] = field(default_factory=dict)
    since: float = 0.0
    passed: float = 0.0
    stage: int = 1
    together: dict[int, tuple[int, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GrowthState:
    """Holds all that certifier.growth.machine knows between two actions.

    Attributes:
        next: number of the next iteration.
        obstacles: pair index -> what was cut off for it; pairs for which nothing was are left out.
    """

    options: GrowthOptions
    next: int = 0
    best: Best | None = None
    start: Start | None = None
    whole: Whole | None = None
    obstacles: dict[int, Obstacle] = field(default_factory=dict)
