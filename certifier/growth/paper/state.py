"""The state of the papers' algorithm between two actions."""

from __future__ import annotations

from dataclasses import dataclass, field

from certifier.growth.paper.options import NEAR, PaperOptions
from certifier.growth.state import GrowthState
from certifier.model import Array, Polytope


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
class PaperState(GrowthState):
    """Holds what the papers' algorithm knows besides.

    Attributes:
        given: the proposal is a box or a polytope of the user's; beyond it nothing is known.
        suspects: pairs that failed last, to be certified first.
        contractions, pushes, rounds: how many of each were begun.
        near: for the contraction under way: a failure nearer than this calls for a shorter range.
        reach: for the contraction or push under way: how far the faces were pushed out first.
    """

    given: bool = False
    suspects: tuple[int, ...] = ()
    contractions: int = 0
    pushes: int = 0
    rounds: int = 0
    near: float = NEAR[0]
    reach: float = 1.0
    cuts: Cuts = Cuts()
    bisection: Bisection | None = None
    round: Round | None = None

    @property
    def asked(self) -> PaperOptions:
        """Returns the options of this algorithm."""
        assert self.options.paper is not None, "a growth without these options has another state"
        return self.options.paper
