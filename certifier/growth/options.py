"""The options say what a growth job may be asked for."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from certifier.errors import RegionError
from certifier.options import option, read
from certifier.seeding.options import IRIS

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
MOST_CELLS = 6000
MOST_GIVEN = 10_000_000
"""Nobody may ask for more cells of a pair."""


@dataclass(frozen=True)
class RecertifyOptions:
    """The options say how a region of a changed scene is certified again."""

    random_seed: int = option(0, "Seed of every random choice.", least=0, greatest=2**63 - 1)


@dataclass(frozen=True)
class CertifyOptions(RecertifyOptions):
    """The options say how a given polytope is certified."""

    cells: int = option(
        1,
        "Number of cells of the polytope that are tried for each pair, each with its own plane. With 1, each pair has one plane on all of "
        "the polytope.",
        least=1,
        greatest=MOST_GIVEN,
    )


@dataclass(frozen=True)
class GrowthOptions:
    """The options say what a job asks for. The ``text`` of each says what it means.

    Attributes:
        kind: ``grow`` a region from a seed, ``certify`` a given polytope as it is, or ``recertify`` a region of the scene
            before it changed.
        seed: the document of :class:`certifier.seeding.propose.SeedOptions`; for ``certify`` its ``C``, ``d`` and optional ``center``; for
            ``recertify`` the ``C`` and ``d`` of the region, joint limits included, and ``q``, the joint positions (k, n) that stay inside.
    """

    kind: Literal["grow", "certify", "recertify"] = "grow"
    seed: dict[str, Any] = field(default_factory=dict)
    contraction: Literal["whole", "targeted", "uniform"] | None = option(
        None,
        "`whole` keeps the first polytope, certifies it cell by cell, and cuts off only what cannot be certified. The other two shrink it "
        "until every pair has one plane that moves with the joints: `targeted` adds faces where pairs fail; `uniform` moves every face "
        "inwards by the same amount.",
        otherwise="`whole` where IRIS makes the first polytope, else `targeted`",
    )
    cells: int | None = option(
        None,
        "Cells of a pair in each stage. Cells still undecided when this budget is spent are removed by new faces.",
        otherwise=str(MOST_CELLS),
        least=1,
        greatest=MOST_GIVEN,
    )
    stages: int | None = option(
        None,
        "Number of stages after which growth ends. Each stage gives a larger region than the one before.",
        otherwise="it ends when a stage gains little",
        least=1,
        greatest=100,
    )
    contractions: int | None = option(
        None,
        "Number of targeted contractions. Each begins to cut at another distance; the largest region counts.",
        otherwise="2 for arms with at most six joints between two bodies, else 1",
        least=1,
        greatest=len(NEAR),
    )
    bisection_steps: int = option(6, "Steps of uniform contraction's bisection, one certification each.", least=0, greatest=60)
    pushes: int | None = option(
        None,
        "How often the faces are pushed out after the contractions. After a push that fails, the next one is shorter.",
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
    tolerance: float = option(0.02, "Relative growth of the ellipsoid's volume that is still worth a push or a round.", above=0, below=10)
    backoff: int = option(
        2, "How often a polytope step that fails to certify is halved towards the last certified polytope.", least=0, greatest=20
    )
    random_seed: int = option(
        0,
        "Seed of every random choice, those of Drake's IRIS too. Another seed gives another region.",
        least=0,
        greatest=2**63 - 1,
    )

    @property
    def by_cells(self) -> bool:
        """Returns whether pairs are certified cell by cell, and not by the program (11) on all of P."""
        if self.kind != "grow":
            return self.kind == "recertify" or (self.cells or 1) > 1
        if self.contraction is not None:
            return self.contraction == "whole"
        return self.seed.get("method") in (None, *IRIS)

    def to_document(self) -> dict[str, Any]:
        """Returns the options as JSON-able data."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> GrowthOptions:
        """Does the inverse of :meth:`to_document`.

        Raises:
            RegionError: an option is unknown or out of range; the error names it.
        """
        options = read(cls, document, "options")
        if options.kind not in ("grow", "certify", "recertify"):
            raise RegionError("option_value", "kind must be 'grow', 'certify' or 'recertify'", field="options.kind")
        if options.contraction == "uniform" and options.seed.get("contain"):
            message = "uniform contraction does not keep points inside"
            raise RegionError("option_value", message, field="options.contraction", hint="leave out the points, or contract otherwise")
        return options
