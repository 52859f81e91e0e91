"""The state is what the growth of a region knows between two actions.

It is JSON-able, so that a job can be resumed from its database rows alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from certifier.growth.obstacles import Obstacle
from certifier.growth.options import NEAR, GrowthOptions
from certifier.model import Array, Polytope


@dataclass(frozen=True, eq=False)
class Start:
    """Holds the proposal that growing starts from.

    Attributes:
        rows: the proposal's faces, then the joint limits, all scaled to |c| = 1.
        seed: (n,) the seed in s.
        keep: (k, n) points that stay inside, the first of them well inside.
        given: the proposal is a box or a polytope of the user's; beyond it nothing is known.
        hindrance: the reason to give if no region can be grown; "" where none is known.
    """

    rows: Polytope
    seed: Array
    keep: Array
    given: bool
    hindrance: str = ""


@dataclass(frozen=True, eq=False)
class Best:
    """Holds the largest certified polytope so far.

    Attributes:
        iteration: the one that completed it.
        center: (n,) a point inside.
    """

    iteration: int
    polytope: Polytope
    center: Array
    ellipsoid_volume: float


@dataclass(frozen=True)
class Cuts:
    """The cuts say how far a targeted contraction or a push that is under way has come.

    Attributes:
        holds: pair index -> iteration whose proof, on a larger polytope, holds on the present one.
        attempts: pair index -> how often faces were added for it.
    """

    holds: dict[int, int] = field(default_factory=dict)
    attempts: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Bisection:
    """A bisection is a uniform contraction that is under way, with delta = (1 - scale) times the radius of the largest ball.

    Attributes:
        center, radius: of the largest ball; center is (n,).
        steps: certifications left.
        scale: of the present trial.
        holds: pair index -> an iteration that certified it, and the scale of that iteration.
        certified: the largest scale that was certified; None before there is one.
        failed: the last scale that was not certified; None before there is one.
    """

    center: Array
    radius: float
    steps: int
    scale: float
    holds: dict[int, tuple[int, float]] = field(default_factory=dict)
    certified: float | None = None
    failed: float | None = None


@dataclass(frozen=True, eq=False)
class Round:
    """A round is a polytope step that is being certified.

    Attributes:
        base, base_center, target, target_center: the step goes from base to target, row for row, and from one centre to the other.
        growth: relative growth of the inscribed ellipsoid's volume, if all of the step is certified.
        halvings: how often the step was halved.
    """

    base: Polytope
    base_center: Array
    target: Polytope
    target_center: Array
    growth: float
    halvings: int = 0


@dataclass(frozen=True, eq=False)
class Whole:
    """Holds the progress of certifying the whole proposal.

    Attributes:
        reach: the faces of the region before were moved out to this many times their distance from the seed. In the first stage these are
            the proposal's faces, and reach is at most 1 (certifier.growth.whole).
        kept: the share of the proposal that the best region kept when this stage began.
        polytope: what the cuts so far keep; faces are added before the joint limits, which are its last 2n rows, and none is dropped.
        mid, half, Y_lower, Y_upper: of the :class:`ProvedBox` that is the root cell of all partitions of this stage.
        holds: pair index -> iteration whose proof, on a larger polytope, holds on the present one.
        begun: the iteration with which this stage began; None before it.
        open_cells: pair index -> how many cells of its partition are open.
        spent: pair index -> how many cells were looked at.
        cuts: pair index -> in how many rounds something was cut off for it; pairs without a cut are left out.
        since, passed: the shares of the time until the deadline that had passed when this stage began, and now; 0 without a deadline.
        stage: the number of the stage, from 1 on.
        together: pair index -> the other pairs that share its certificate.
    """

    reach: float
    kept: float
    polytope: Polytope
    mid: Array
    half: Array
    Y_lower: Array
    Y_upper: Array
    holds: dict[int, int] = field(default_factory=dict)
    begun: int | None = None
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
        suspects: pairs that failed last, to be certified first.
        contractions, pushes, rounds: how many of each were begun.
        near: for the contraction under way: a failure nearer than this calls for a shorter range.
        reach: for the contraction or push under way: how far the faces were pushed out first.
        obstacles: pair index -> what was cut off for it; pairs for which nothing was are left out.
    """

    options: GrowthOptions
    next: int = 0
    best: Best | None = None
    suspects: tuple[int, ...] = ()
    start: Start | None = None
    contractions: int = 0
    pushes: int = 0
    rounds: int = 0
    near: float = NEAR[0]
    reach: float = 1.0
    whole: Whole | None = None
    cuts: Cuts = Cuts()
    bisection: Bisection | None = None
    round: Round | None = None
    obstacles: dict[int, Obstacle] = field(default_factory=dict)
