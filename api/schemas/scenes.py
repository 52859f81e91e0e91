"""These models describe scenes, their pairs and what to know about them."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from api.schemas.common import Document, Page
from certifier.conditions import of_condition
from certifier.model import JointKind, Scene
from certifier.names import MAX_NAME
from certifier.verify.uncovered import LISTED
from db.models import SceneRow
from db.scenes import Known
from jobs.fields import Request


class SceneSummary(BaseModel):
    """Describes a scene in a list."""

    id: str = Field(description="Id of the scene.")
    name: str = Field(description="The name that was asked for, or the one that the scene was last added or staged under.")
    names: list[str] = Field(
        description="The names that mean this scene now, `NAME@staged` among them. A name means the scene that was last added under it or "
        "promoted, so a scene may have none or several."
    )
    hash: str = Field(description="SHA-256 of everything in the scene that a proof depends on.")
    joints: int = Field(description="Number of joint positions.")
    geometries: int = Field(description="Number of convex geometries.")
    pairs: int = Field(description="Number of pairs to certify.")
    warnings: int = Field(description="Number of warnings; `/lint` has them.")
    created_at: datetime = Field(description="When it was first added.")

    @classmethod
    def of(cls, row: SceneRow, names: list[str]) -> Self:
        document = row.document
        return cls(
            id=row.id,
            name=row.name,
            names=names,
            hash=row.hash,
            joints=len(document["q_star"]),
            geometries=sum(not of_condition(geometry["name"]) for geometry in document["geometries"]),
            pairs=sum(not any(map(of_condition, pair[:2])) for pair in document["pairs"]),
            warnings=len(document["warnings"]),
            created_at=row.created_at,
        )


class ScenePage(Page):
    """Holds one page of scenes, newest first."""

    scenes: list[SceneSummary] = Field(description="The scenes of this page.")


class JointInfo(BaseModel):
    """Describes a joint that has a position, in radians or metres."""

    name: str = Field(description="Name of the joint.")
    kind: JointKind = Field(description="How the joint moves.")
    lower: float = Field(description="Lower limit, in radians or metres.")
    upper: float = Field(description="Upper limit, in radians or metres.")
    q_star: float = Field(description="Centre of the parametrisation: s = tan((q - q_star) / 2), or q - q_star for a prismatic joint.")


class UncoveredBodies(BaseModel):
    """Says how many pairs of geometries of two bodies no proof is about, and why."""

    a: str = Field(description="Name of the first body.")
    b: str = Field(description="Name of the second body.")
    pairs: int = Field(description="Number of pairs of their geometries.")
    why: Literal["neighbours", "filtered", "ignored"] = Field(
        description="A joint joins the bodies, a collision filter of the model leaves the pairs out, or the scene file ignores them."
    )
    reason: str | None = Field(description="The reason in the scene file; null for pairs that it does not ignore.")


class NotCovered(BaseModel):
    """Says which pairs of geometries can move against each other and are in no proof about the scene."""

    pairs: int = Field(description="Number of such pairs.")
    neighbours: int = Field(description="Number of those of bodies that a joint joins.")
    filtered: int = Field(description="Number of those that a collision filter of the model leaves out.")
    ignored: int = Field(description="Number of those that the scene file ignores.")
    bodies: list[UncoveredBodies] = Field(description=f"The pairs by their bodies, {LISTED} entries at most.")
    summary: str = Field(description="A sentence for people.", examples=["6 pairs of neighbouring links are not covered"])


_UPRIGHT: dict[str, Any] = {"name": "upright", "cone": {"body": "arm/hand", "axis": [0, 0, 1], "along": [0, 0, 1], "degrees": 15}}
_STATEMENT = "the direction (0, 0, 1) of 'cup/cup' stays within 15 degrees of (0, 0, 1) of 'world'"


class ConditionInfo(BaseModel):
    """Describes what the scene asks for beside that no bodies touch. All proofs about the scene are about it as well."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "upright", "kind": "cone", "statement": _STATEMENT}]})

    name: str = Field(description="Its name.", examples=["upright"])
    kind: str = Field(description="`cone`, `inside`, `ball`, `distance`, `range` or `slides`.", examples=["cone"])
    statement: str = Field(
        description="What holds, in words.",
        examples=[_STATEMENT],
    )


class ConstrainRequest(Request):
    """Asks for a scene like another one, with more conditions."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "upright-cell", "conditions": [_UPRIGHT]}]})

    name: str = Field(min_length=1, max_length=MAX_NAME, description="Name of the new scene.", examples=["upright-cell"])
    conditions: list[dict[str, Any]] = Field(
        min_length=1,
        max_length=100,
        description="The conditions, each as in a scene file: a `name`, and one of `cone`, `inside`, `distance` and `range` "
        "(docs/conditions.md).",
        examples=[[_UPRIGHT]],
    )


class SceneDetail(SceneSummary):
    """Describes a scene with its joints, in position order."""

    positions: list[JointInfo] = Field(description="The joints that have a position.")
    bodies: list[str] = Field(description="Names of the bodies.")
    padding: float = Field(description="Metres added around both geometries of every pair that has no padding of its own.")
    not_covered: NotCovered = Field(description="The pairs of geometries that no proof about the scene is about.")
    conditions: list[ConditionInfo] = Field(description="What holds beside collisions wherever something is proved.")
    configurations: dict[str, dict[str, float]] = Field(
        description="The configurations that the scene has under the name that was asked for: positions of joints by their names, "
        "in radians or metres. For an id they are those of all of its names that agree. A request takes the names of configurations in the "
        "place of joint positions, with commas between them; `q_star` stands for q* of the joints that the others leave open.",
        examples=[{"arm/manipulator/home": {"arm/shoulder": 0.4, "arm/elbow": 0.3}}],
    )
    provenance: Document = Field(description="What the scene was read from, and by which versions.")

    @classmethod
    def whole(cls, row: SceneRow, names: list[str], scene: Scene, known: Known, not_covered: Document) -> Self:
        document = row.document
        moving = sorted((j for j in document["joints"] if j["index"] is not None and not j.get("follows")), key=lambda j: j["index"])
        positions = [
            JointInfo(name=j["name"], kind=j["kind"], lower=j["lower"], upper=j["upper"], q_star=centre)
            for j, centre in zip(moving, document["q_star"], strict=True)
        ]
        return cls(
            **{**SceneSummary.of(row, names).model_dump(), "name": known.name},
            positions=positions,
            bodies=[body for body in document["bodies"] if not of_condition(body)],
            conditions=[ConditionInfo(name=one.name, kind=one.kind, statement=str(one)) for one in scene.conditions],
            padding=document["padding"],
            configurations=known.agreed,
            not_covered=NotCovered.model_validate(not_covered),
            provenance=document["provenance"],
        )


class Promoted(BaseModel):
    """Says what a name means since its staged scene was promoted, and what it meant before."""

    scene: str = Field(description="Id of the scene that the name means.")
    regions: int = Field(description="Number of its regions.")
    before: str | None = Field(description="Id of the scene that the name meant before; null where that was deleted.")
    regions_before: int = Field(description="Number of the regions of that scene.")


class PairInfo(BaseModel):
    """Names two geometries that must not touch."""

    index: int = Field(description="Index of the pair among the scene's.")
    a: str = Field(description="Name of the first geometry.")
    b: str = Field(description="Name of the second geometry.")


class PairForecast(PairInfo):
    """Describes a pair and what its program will cost.

    Each side, `a` and `b`, has a chain of joints, a Gram matrix and a space of polynomials.
    """

    padding: float = Field(description="Metres added around both geometries.")
    frame: str = Field(description="The body in whose frame the separating plane is expressed.")
    chain_a: list[str] = Field(description="Names of the joints between the frame and `a`.")
    chain_b: list[str] = Field(description="Names of the joints between the frame and `b`.")
    gram_a: int = Field(description="Number of rows of the side's Gram matrices: 2^k for k joints in its chain.")
    gram_b: int = Field(description="Number of rows of the Gram matrices of `b`'s side.")
    joints: int = Field(
        description="Number of joints with which the first plane tried moves: all of both chains, or 0 for a plane at rest."
    )
    N_a: int = Field(description="Dimension of the side's space of polynomials.")
    N_b: int = Field(description="Dimension of the space of polynomials of `b`'s side.")
    rationals: int = Field(description="Number of polynomial identities: one for each vertex of both bodies.")
    seconds: float = Field(description="Rough time to certify the pair, in seconds, on one thread.")
    memory_bytes: int = Field(description="Memory, in bytes, of the largest program that may be tried for the pair.")


class ScenePairs(BaseModel):
    """Holds the pairs that a certification goes through."""

    pairs: list[PairForecast] = Field(description="The pairs, in the scene's order.")


class Substitution(BaseModel):
    """Describes a shape that was replaced by a larger one around it."""

    geometry: str = Field(description="Name of the geometry.")
    substitution: str = Field(description="What stands for what.")
    inflation: float = Field(description="Upper bound, in metres, on how far the replacement reaches outside the shape.")


class IgnoredPair(BaseModel):
    """Names two geometries that are not certified, and says why."""

    a: str = Field(description="Name of the first geometry.")
    b: str = Field(description="Name of the second geometry.")
    reason: str = Field(description="Why the pair is not certified.")


class LintReport(BaseModel):
    """Says what a reader should know about the scene before trusting a certificate for it."""

    warnings: list[str] = Field(description="Sentences about what was read in another way than one might expect.")
    substitutions: list[Substitution] = Field(description="Shapes that were replaced by larger ones.")
    ignored: list[IgnoredPair] = Field(description="Pairs that the scene file ignores; `not_covered` of the scene has all.")
