"""These models describe regions."""

from __future__ import annotations

from datetime import datetime
from typing import Self

from pydantic import BaseModel, Field

from api.schemas.common import Document, Page
from api.schemas.scenes import NotCovered
from certifier.outcome import Guarantee
from db.models import RegionRow


class Share(BaseModel):
    """Says how much of the proposal that a region was grown from the region keeps, by volume in joint positions q."""

    value: float | None = Field(
        description="Part of the proposal's collision-free configurations that the region contains; null where no sample is free."
    )
    stderr: float | None = Field(description="Standard error of `value`, which is found by sampling.")
    collision_free: float = Field(description="Part of the proposal's samples that is collision-free.")
    samples: int = Field(description="Number of the proposal's samples, uniform in q.")


class QVolume(BaseModel):
    """Says how large a region is, in joint positions."""

    value: float = Field(description="Volume in q, in `unit`.")
    stderr: float = Field(description="Standard error of `value`, which is found by sampling.")
    unit: str = Field(description="`rad^k` for k joints that turn, `m^k` for k joints that slide, or both, as in `rad^2 m`.")
    box_side: float | None = Field(description="Degrees: a box with this side in every joint has this volume. Null where a joint slides.")
    least_width: float | None = Field(
        None,
        description="Degrees: in some direction of joint space, no straight motion inside of the region is longer. A region may be thin "
        "there and have a large `box_side`. Null where a joint slides, and for a region that an earlier version stored.",
    )


class RegionSummary(BaseModel):
    """Describes a certified region in a list."""

    id: str = Field(description="Id of the region.")
    job: str = Field(description="Id of the job that grew it.")
    scene: str = Field(description="Id of its scene.")
    iteration: int = Field(description="The iteration of the job that it is of.")
    guarantee: Guarantee = Field(description="What its certificate is worth.")
    faces: int = Field(description="Number of rows of C, joint limits included.")
    ellipsoid_volume: float = Field(description="Volume of the inscribed ellipsoid, in s.")
    q_volume: QVolume | None = Field(description="How large the region is; null for one that an earlier version stored.")
    share: Share | None = Field(description="How much of the proposal the region keeps; null for a region that was not grown.")
    proof: str = Field(description="SHA-256 of the proof file.")
    created_at: datetime = Field(description="When it was stored.")

    @classmethod
    def of(cls, row: RegionRow) -> Self:
        return cls(
            id=row.id,
            job=row.job_id,
            scene=row.scene_id,
            iteration=row.iteration,
            guarantee=Guarantee(row.guarantee),
            faces=row.faces,
            ellipsoid_volume=row.ellipsoid_volume,
            **row.summary,
            proof=row.proof_digest,
            created_at=row.created_at,
        )


class RegionPage(Page):
    """Holds one page of regions, newest first."""

    regions: list[RegionSummary] = Field(description="The regions of this page.")


class RegionDetail(RegionSummary):
    """Describes a certified region, with its manifest."""

    manifest: Document = Field(description="Everything that is known about the region; docs/architecture.md lists the keys.")
    not_covered: NotCovered = Field(description="The pairs of geometries that the region's proof is not about, as the manifest has them.")

    @classmethod
    def whole(cls, row: RegionRow, manifest: Document) -> Self:
        return cls(**RegionSummary.of(row).model_dump(), manifest=manifest, not_covered=NotCovered.model_validate(manifest["not_covered"]))


class Verification(BaseModel):
    """Says whether a region's stored proof holds, and what it proves."""

    region: str = Field(description="Id of the region.")
    holds: bool = Field(description="True where the verifier has accepted all of the proof.")
    statement: list[str] = Field([], description="What was proved, in plain words, line by line; empty when the proof does not hold.")
    guarantee: Guarantee = Field(Guarantee.NONE, description="What the proof is worth.")
    error: Document | None = Field(None, description="Why the proof does not hold: code, message, field, hint; null when it holds.")
    seconds: float = Field(description="How long the check took.")
