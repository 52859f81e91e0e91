"""These models describe what people look at: a robot, contacts, slices through configuration space, and configurations of a region."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from api.schemas.planning import REGION, SCENE, Q, RegionId
from certifier.model import JointKind
from jobs.fields import NamedPoints, Positions, Real, Request, SceneName, integer

MAX_CONTACTS, MAX_SIZE, MAX_REGIONS, MAX_SAMPLES = 100, 200, 200, 500

SceneId = Annotated[str, Field(description="Id of the scene.", examples=["5a9e0c7b12de34f0"])]
Version = Annotated[int, Field(description="How often a region of the scene had been added or deleted.", examples=[12])]
Pose = Annotated[list[list[float]], Field(description="4 by 4, row by row, in metres.")]
Unit = Literal["rad", "m"]


class DrawnJoint(BaseModel):
    """Describes an edge of the kinematic tree. The pose of the child in the parent is X_PF X_FM(q) X_BM^-1."""

    name: str = Field(examples=["arm/shoulder"], description="Name of the joint.")
    kind: JointKind = Field(description="How the joint moves.")
    parent: str = Field(description="The body on the side of the world.")
    child: str = Field(description="The body on the side of the hand.")
    axis: list[float] = Field(description="(3,) axis in F; the joint slides by its position times the axis. Zeros for a weld.")
    X_PF: Pose
    X_BM: Pose
    index: int | None = Field(description="Place in q; null for a weld.")
    lower: float | None = Field(description="Lower limit, radians or metres; null for a weld.")
    upper: float | None = Field(description="Upper limit, radians or metres; null for a weld.")
    follows: bool = Field(default=False, description="Whether its place in q, and its limits, are those of a joint that it moves with.")


class DrawnGeometry(BaseModel):
    """Describes a convex body as it is certified: the hull of its vertices, and a ball of `radius` about every point of it."""

    name: str = Field(examples=["arm/upper/bar"], description="Name of the geometry.")
    body: str = Field(description="Name of the body that it is fixed to.")
    radius: float = Field(description="Metres; 0 for a polytope. The padding is not included.")
    vertices: list[list[float]] = Field(description="(v, 3), metres, in the frame of the body.")
    triangles: list[list[int]] = Field(
        description="Corners of the hull's triangles, anticlockwise seen from outside; none for 1 or 2 vertices."
    )
    substitution: str | None = Field(description="Says how the body differs from the robot file's, where it is a conservative replacement.")


class DrawnZone(BaseModel):
    """Describes the zone of a condition of the kind `inside`, as far as the robot can reach."""

    condition: str = Field(description="Name of the condition.", examples=["over-the-table"])
    of: str = Field(description="Name of the body in whose frame the zone is.")
    vertices: list[list[float]] = Field(description="(v, 3), metres, in that frame; none where nothing is in the zone.")
    triangles: list[list[int]] = Field(description="Corners of the zone's triangles, anticlockwise seen from outside.")


class DrawnCone(BaseModel):
    """Describes a condition of the kind `cone`: the direction `axis` of a body stays within an angle of the direction `along`."""

    condition: str = Field(description="Name of the condition.", examples=["upright"])
    body: str = Field(description="Name of the body whose direction stays in the cone.")
    axis: list[float] = Field(description="(3,), a direction in the frame of that body.")
    of: str = Field(description="Name of the body in whose frame the cone is.")
    along: list[float] = Field(description="(3,), the middle of the cone, in that frame.")
    angle: float = Field(description="Radians between the middle of the cone and its surface.")


class SceneModel(BaseModel):
    """Describes a scene as it is drawn: what is drawn is what is certified."""

    scene: SceneId
    name: str = Field(description="Name of the scene.")
    joints: list[DrawnJoint] = Field(description="The joints, parents before children.")
    bodies: list[str] = Field(description="Names of the bodies.")
    q_star: list[float] = Field(description="(n,), the configuration q*.")
    q_lower: list[float] = Field(description="(n,), lower limits.")
    q_upper: list[float] = Field(description="(n,), upper limits.")
    units: list[Unit] = Field(description="(n,), of each joint position.")
    padding: float = Field(description="Metres added around both geometries of every pair that has no padding of its own.")
    geometries: list[DrawnGeometry] = Field(description="The convex bodies that are certified.")
    pairs: list[tuple[int, int]] = Field(description="Indices of the geometries of every pair to certify, in the order of the pairs.")
    zones: list[DrawnZone] = Field(description="The zones in which geometries have to stay.")
    cones: list[DrawnCone] = Field(description="The cones in which directions of bodies have to stay.")
    has_meshes: bool = Field(description="Whether the models' own meshes were kept; `GET /v1/scenes/{id}/meshes` returns them.")


class DrawnMesh(BaseModel):
    """Describes a collision mesh as its file has it. It is what a certified body stands for, and nothing is proved about it."""

    geometry: str = Field(examples=["arm/upper/bar"], description="Name of the collision geometry in the model.")
    body: str = Field(examples=["arm/upper"], description="Name of the body that it is fixed to.")
    vertices: list[list[float]] = Field(
        examples=[[[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.1, 0.0]]],
        description="(k, 3), metres, in the frame of the body, rounded to micrometres.",
    )
    triangles: list[list[int]] = Field(
        examples=[[[0, 1, 2]]], description="(t, 3), corners of the triangles, by their places in `vertices`."
    )


class SceneMeshes(BaseModel):
    """Holds the collision meshes of a scene's models, to be drawn beside the bodies that are certified."""

    scene: SceneId
    meshes: list[DrawnMesh] = Field(
        description="The meshes, with few enough triangles to be drawn. None where the models have no mesh, where they have far too many "
        "triangles, and where the scene was added before the service kept meshes."
    )
    triangles: int = Field(description="Number of triangles that the meshes have in their files.", examples=[12480])
    moved: float = Field(
        description="How far a vertex is from where its file has it, at most, in metres. It is above 0 where meshes were made coarser, "
        "to have few enough triangles.",
        examples=[0.0],
    )


class ContactsRequest(Request):
    """Asks which pairs touch at configurations."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"scene": SCENE, "q": [[0.4, 0.3]]}]})

    scene: SceneName
    q: NamedPoints = Field(
        min_length=1, max_length=MAX_CONTACTS, description="(k, n), joint positions in radians or metres.", examples=[[[0.4, 0.3]]]
    )


class Contacts(BaseModel):
    """Says what touches at a configuration."""

    pairs: list[int] | None = Field(
        description="Indices of the pairs that are not shown to be apart there, padding included, in floating point. "
        "Null where a joint is outside the window that the scene covers.",
        examples=[[3]],
    )
    outside: list[str] = Field(description="The joints that are outside of their limits.", examples=[[]])
    trouble: list[str] = Field(
        description="In words, what is wrong there: joints beyond their limits, bodies that touch, and by how much which conditions of "
        "the scene are not kept.",
        examples=[["the condition 'upright' is not kept: the angle is 21.2 degrees, and 15 at most"]],
    )


class ContactsResponse(BaseModel):
    """Says what touches at each configuration."""

    scene: SceneId
    contacts: list[Contacts] = Field(description="In the order of the configurations.")


Range = Annotated[list[Real], Field(min_length=2, max_length=2)]


class SliceRequest(Request):
    """Asks for a slice through configuration space: two joints move, the others stay."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"scene": SCENE, "q": [0.4, 0.3], "x": "arm/shoulder", "y": "arm/elbow", "size": 50}]}
    )

    scene: SceneName
    q: Positions = Field(description="(n,), where the other joints stay, in radians or metres.", examples=[[0.4, 0.3]])
    x: str = Field(max_length=200, description="Name of the joint of the horizontal axis.", examples=["arm/shoulder"])
    y: str = Field(max_length=200, description="Name of the joint of the vertical axis.", examples=["arm/elbow"])
    size: Annotated[int, Field(ge=8, le=MAX_SIZE), BeforeValidator(integer)] = Field(
        100, description="Number of squares of the slice in each direction."
    )
    regions: list[str] | None = Field(
        None,
        max_length=MAX_REGIONS,
        description=f"Ids of the regions to draw; all of the scene where it is left out, at most the newest {MAX_REGIONS}.",
        examples=[[REGION]],
    )
    x_range: Range | None = Field(None, description="Where the horizontal axis begins and ends; default: at the joint's limits.")
    y_range: Range | None = Field(None, description="Where the vertical axis begins and ends; default: at the joint's limits.")

    @model_validator(mode="after")
    def _ranges_ascend(self) -> Self:
        for name, given in (("x_range", self.x_range), ("y_range", self.y_range)):
            if given is not None and given[0] >= given[1]:
                raise ValueError(f"{name} must ascend")
        return self


class SliceAxis(BaseModel):
    """Describes an axis of a slice."""

    joint: str = Field(description="Name of the joint.", examples=["arm/shoulder"])
    unit: Unit = Field(description="Unit of the bounds.")
    lower: float = Field(description="Where the axis begins.")
    upper: float = Field(description="Where the axis ends.")


class SlicedRegion(BaseModel):
    """Describes what a slice cuts out of a certified region."""

    region: RegionId
    polygon: list[tuple[float, float]] = Field(
        description="Outline in joint positions, anticlockwise, with points along the edges, which are straight in s and bent in q."
    )


class SliceResponse(BaseModel):
    """Describes a slice. The map is sampled at the middles of squares, in floating point; the outlines are those of certified regions."""

    scene: SceneId
    version: Version
    x: SliceAxis = Field(description="The horizontal axis.")
    y: SliceAxis = Field(description="The vertical axis.")
    size: int = Field(description="Number of squares each way.")
    rows: list[str] = Field(
        description="One string for each row of squares, the lowest first; one character for each square: `.` free, `#` in collision, "
        "`o` in one of the regions."
    )
    regions: list[SlicedRegion] = Field(description="The regions that the slice meets.")


class Extreme(BaseModel):
    """Names configurations of a region at which a joint is as far as it can be within the region."""

    joint: str = Field(description="Name of the joint.")
    unit: Unit = Field(description="Unit of the joint.")
    lower: Q
    upper: Q


class RegionConfigurations(BaseModel):
    """Holds configurations of a certified region, in joint positions."""

    center: Q
    seed: list[float] | None = Field(description="(n,), where growing began; null where the region has no seed.")
    extremes: list[Extreme] = Field(description="For each joint, in position order.")
    samples: list[list[float]] = Field(description="(k, n), nearly uniform in q; the same `seed` gives the same.")
