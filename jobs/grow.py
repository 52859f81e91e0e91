"""A job that grows a certified region around a configuration."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from certifier.growth.options import GrowthOptions
from certifier.model import Scene
from certifier.seeding.options import SeedOptions
from db.session import Database
from jobs.checks import blocked, check_length, check_positions
from jobs.fields import model_of
from jobs.growing import Growing
from jobs.request import JobRequest


class GrowOptions(model_of(GrowthOptions)):  # type: ignore[misc]
    """Says how to grow the region, and when growing stops."""


class Seed(model_of(SeedOptions)):  # type: ignore[misc]
    """Says where growing begins and how the first polytope is found."""


class GrowRequest(JobRequest):
    """Asks for a certified region that grows around a configuration."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "grow", "scene": "iiwa-shelf", "seed": {"q": [0, 0.3, 0, -1.8, 0, 0.9, 0]}}]}
    )

    kind: Literal["grow"] = Field(description="The kind of the job.")
    seed: Seed = Field(description="Where growing begins.")
    options: GrowOptions = Field(default_factory=GrowOptions, description="How the region grows.")


class Grow(Growing):
    """Grows a certified polytope from a seed, as large as the options allow."""

    name = "grow"
    request = GrowRequest
    forms: ClassVar = {"seed": ("Starting region", SeedOptions), "options": ("Growth", GrowthOptions)}

    def options(self, body: GrowRequest, scene: Scene, db: Database) -> dict[str, Any]:
        seed = SeedOptions.from_document(body.seed.model_dump(exclude_none=True))
        for i, row in enumerate(seed.C or ()):
            check_length(scene, row, f"seed.C[{i}]", "polytope_shape")
        if seed.q is not None:
            check_positions(scene, seed.q, "seed.q")
        return GrowthOptions.from_document({"kind": "grow", "seed": seed.to_document(), **body.options.model_dump()}).to_document()

    def warnings(self, options: dict[str, Any], scene: Scene) -> list[str]:
        q, contain = (options["seed"].get(name) for name in ("q", "contain"))
        if q is None or not contain:
            return []
        return blocked(scene, {"seed.q": q, **{f"seed.contain[{i}]": point for i, point in enumerate(contain)}})
