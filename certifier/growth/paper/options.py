"""The options of the papers' algorithm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from certifier.options import option

EFFORT = (
    (4, {"contractions": 2, "pushes": 10, "max_rounds": 3}),
    (6, {"contractions": 2, "pushes": 2, "max_rounds": 0}),
    (math.inf, {"contractions": 1, "pushes": 0, "max_rounds": 0}),
)
"""The defaults depend on the most joints that any pair has between its bodies.

With up to 4 joints growing then takes seconds, and with up to 6 a minute. With more joints it ends at the first region, which itself
takes a minute.
"""
NEAR = (1.0, 0.6, 0.3)
"""For each contraction in turn: failures closer than this shrink a joint's range; others get a cutting face."""


@dataclass(frozen=True)
class PaperOptions:
    """The options say how the papers' algorithm contracts the first polytope, and makes the region larger after that."""

    contraction: Literal["targeted", "uniform"] = option(
        "targeted", "`targeted` adds faces where pairs fail; `uniform` moves every face inwards by the same amount."
    )
    contractions: int | None = option(
        None,
        "Number of targeted contractions. Each begins to cut at another distance. The largest region is the result.",
        otherwise="2 for arms with at most six joints between two bodies, else 1",
        least=1,
        greatest=len(NEAR),
    )
    bisection_steps: int = option(6, "Steps of the bisection in uniform contraction, with one certification each.", least=0, greatest=60)
    pushes: int | None = option(
        None,
        "How often to push the faces out after the contractions. After a push that fails, the next one is shorter.",
        otherwise="10 for arms with at most four joints between two bodies, 2 for at most six, else 0",
        least=0,
        greatest=1000,
    )
    max_rounds: int | None = option(
        None,
        "Most rounds of the polytope step (12) after the pushes.",
        otherwise="3 for arms with at most four joints between two bodies, else 0",
        argument="rounds",
        python="max_rounds",
        least=0,
        greatest=1000,
    )
    tolerance: float = option(0.02, "Pushes and rounds end when the ellipsoid's volume grows by less than this part.", above=0, below=10)
    backoff: int = option(
        2, "How often to halve a polytope step that cannot be certified, towards the last certified polytope.", least=0, greatest=20
    )
