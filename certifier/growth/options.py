"""The options say what a growth job may be asked for."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from certifier.errors import RegionError
from certifier.growth.paper.options import PaperOptions
from certifier.options import option, read
from certifier.seeding.options import OF_PAPER

MOST_CELLS = 20_000
ENOUGH = 0.95
"""Growth ends with a region that keeps this share of the proposal: a further stage takes as long as the one before, and gains little."""
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
        "Most cells of the polytope for each pair, each with its own plane. With 1, each pair has one plane on all of the polytope.",
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
    cells: int | None = option(
        None,
        "Most cells of a pair in each stage. After that, new faces cut off the cells that are still undecided.",
        otherwise=str(MOST_CELLS),
        least=1,
        greatest=MOST_GIVEN,
    )
    stages: int | None = option(
        None,
        "Growth ends after this many stages. Each stage gives a larger region than the one before.",
        otherwise=f"it ends when a region keeps {ENOUGH} of the proposal, or a stage gains little",
        least=1,
        greatest=100,
    )
    paper: PaperOptions | None = option(
        None,
        "Grow with the papers' algorithm instead: it shrinks the first polytope until every pair has one plane that moves with the joints, "
        "and then pushes the faces out.",
    )
    random_seed: int = option(
        0,
        "Seed of every random choice, also in Drake's IRIS. Another seed gives another region.",
        least=0,
        greatest=2**63 - 1,
    )

    @property
    def by_cells(self) -> bool:
        """Returns whether pairs are certified cell by cell, and not by the program (11) on all of P."""
        return (self.cells or 1) > 1 if self.kind == "certify" else self.paper is None

    def to_document(self) -> dict[str, Any]:
        """Returns the options as JSON-able data."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> GrowthOptions:
        """Does the inverse of :meth:`to_document`.

        Raises:
            RegionError: an option is unknown or out of range, or does not go with another one; the error names it.
        """
        options = read(cls, document, "options")
        if options.kind not in ("grow", "certify", "recertify"):
            raise RegionError("option_value", "kind must be 'grow', 'certify' or 'recertify'", field="options.kind")
        method, paper = options.seed.get("method"), options.paper
        if paper is None and method in OF_PAPER:
            hint = "add --paper (`paper` in requests), or choose another method"
            raise RegionError("option_value", f"only the papers' algorithm begins with the method {method}", field="seed.method", hint=hint)
        for name in ("cells", "stages"):
            if paper is not None and getattr(options, name) is not None:
                problem = f"the papers' algorithm has no use for {name}"
                raise RegionError("option_value", problem, field=f"options.{name}", hint="leave it out")
        if paper is not None and paper.contraction == "uniform" and options.seed.get("contain"):
            message, hint = "uniform contraction does not keep points inside", "leave out the points, or contract otherwise"
            raise RegionError("option_value", message, field="options.paper.contraction", hint=hint)
        return options
