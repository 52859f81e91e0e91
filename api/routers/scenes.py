"""A client uploads a scene as a bundle, and reads what the service understood of it."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, replace
from threading import Lock
from typing import Annotated, BinaryIO

from cachetools import LRUCache, cached
from fastapi import APIRouter, File, Path, Query, Response, UploadFile, status
from sqlalchemy.orm import Session

from api import drawing
from api.access import READ, Admin, Db, Submitter
from api.children import AT_ONCE, Children
from api.delivery import unchanging
from api.reading import ReadingRoute
from api.room import KeptRoom, Room
from api.schemas.common import Cursor, Listed, SceneGiven, WithDependents
from api.schemas.drawing import SceneMeshes, SceneModel
from api.schemas.scenes import (
    ConstrainRequest,
    IgnoredPair,
    LintReport,
    PairForecast,
    Promoted,
    SceneDetail,
    ScenePage,
    ScenePairs,
    SceneSummary,
    Substitution,
)
from api.schemas.service import Dependents
from api.writing import writing
from certifier.errors import SceneError
from certifier.model import Scene
from certifier.names import MAX_NAME
from certifier.pair.forecast import forecast
from certifier.scene.bundle import Bundled, BundleLimits, load_bundle
from certifier.scene.conditions import constrained, read_conditions, swept_in
from certifier.verify import uncovered
from db import audit, machine, meshes, retention, scenes, staging
from db.audit import Action
from db.models import Document, SceneRow
from db.scenes import STAGED
from db.session import Database

KEPT = 8
"""Number of scenes that an API process keeps beside their bundles, those that came last: a command sends the bundle of its scene file
every time."""

router = APIRouter(prefix="/v1/scenes", tags=["scenes"], dependencies=[READ], route_class=ReadingRoute)


@router.post("", status_code=status.HTTP_201_CREATED)
async def create_scene(
    bundle: Annotated[
        UploadFile, File(description="A zip of the scene file and every file that it refers to.", json_schema_extra={"format": "binary"})
    ],
    db: Db,
    children: Children,
    room: KeptRoom,
    caller: Submitter,
    response: Response,
    stage: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=MAX_NAME,
            description="Stage the scene as the next version of this name, in the place of one that is staged already.",
        ),
    ] = None,
) -> SceneDetail:
    """Uploads a scene.

    The body is multipart/form-data with one part, `bundle`: a zip of at most 64 MiB, which unpacks to at most 256 MiB and 1000 files. It
    holds the scene file and every file that this refers to: models (URDF, SDFormat, MJCF) and their meshes. All paths stay inside of the
    zip. A plain zip of a directory is enough where exactly one file is called `scene.yaml`, or else only one YAML file has `directives`.
    Otherwise a file `bundle.json` says which one is the scene: `{"scene": "cell/left.yaml"}`. docs/scenes.md describes the scene file.
    `ciris scene add` makes such a zip and sends it. Of a zip that has no scene file and one model (URDF, SDFormat or MJCF), or in which
    `bundle.json` names a model, the service drafts a scene, as `ciris scene init` does.

    A separate process reads the zip, so a bad file cannot harm the service. The same content is the same scene, whose id does not change.
    From now on its name means this scene, also where it meant another one.

    With `stage=NAME`, the name keeps its meaning, and `NAME@staged` means this scene. The name in the scene file does not count then.
    Every request takes `NAME@staged` where it takes a scene. `POST /v1/scenes/NAME/promote` makes NAME mean the staged scene.
    """
    scene = await children.run(_add_scene, db, room, caller.project, bundle.file, stage)
    response.headers["Location"] = f"/v1/scenes/{scene.id}"
    return scene


def _add_scene(db: Database, room: Room, project: str, file: BinaryIO, stage: str | None) -> SceneDetail:
    room.check(db, project)
    bundled = _read(file.read())
    scene = bundled.scene
    besides = uncovered.document(scene)
    with db.write() as session:
        row = scenes.add(session, scene) if stage is None else staging.stage(session, stage, scene)
        if bundled.meshes is not None:
            meshes.keep(session, row.id, bundled.meshes)
        return _detail(session, row, row.name if stage is None else row.name + STAGED, scene, besides)


@cached(LRUCache(KEPT), key=lambda data: hashlib.sha256(data).digest(), lock=Lock())
def _read(data: bytes) -> Bundled:
    """Returns what a bundle holds. Equal bundles hold equal scenes, and a child process reads each once."""
    most = BundleLimits()
    memory = min(most.memory_bytes, machine.memory_bytes() // (AT_ONCE + 1))
    return load_bundle(data, replace(most, memory_bytes=memory))


@router.get("")
def list_scenes(db: Db, after: Cursor = None, limit: Listed = 100) -> ScenePage:
    """Lists the scenes, newest first."""
    with db.read() as session:
        page = scenes.page(session, after, limit)
        names = scenes.names(session, [row.id for row in page.rows])
    return ScenePage(scenes=[SceneSummary.of(row, names[row.id]) for row in page.rows], next=page.next)


@router.get("/{scene_id}")
@unchanging
def get_scene(scene_id: SceneGiven, db: Db) -> SceneDetail:
    """Returns one scene, by its id or by its name. A name means the scene that was last added under it or promoted."""
    with db.read() as session:
        found = scenes.find(session, scene_id)
    scene = scenes.load(db, found)
    besides = uncovered.document(scene)
    with db.read() as session:
        return _detail(session, scenes.get(session, found), scene_id, scene, besides)


def _detail(session: Session, row: SceneRow, given: str, scene: Scene, besides: Document) -> SceneDetail:
    """Returns what there is to say of a scene, by the name or id that was given."""
    known = scenes.known(session, given)
    return SceneDetail.whole(row, scenes.names(session, [row.id])[row.id], scene, known, besides)


@router.get("/{scene_id}/model")
@unchanging
def get_scene_model(scene_id: SceneGiven, db: Db) -> SceneModel:
    """Returns the scene as it is drawn: its kinematic tree, and the convex bodies that are certified."""
    with db.read() as session:
        found = scenes.find(session, scene_id)
        has_meshes = meshes.has(session, found)
    return drawing.model(found, scenes.load(db, found), has_meshes)


@router.get("/{scene_id}/meshes")
@unchanging
def get_scene_meshes(scene_id: SceneGiven, db: Db) -> SceneMeshes:
    """Returns the collision meshes of the scene's models as their files have them, to see how far a certified body reaches beyond its mesh.

    They are for looking at, and no proof is about them. `GET /v1/scenes/{id}/model` has the bodies that are certified.
    """
    with db.read() as session:
        found = scenes.find(session, scene_id)
        document = meshes.of(session, found)
    return SceneMeshes(scene=found, **(document or {"meshes": [], "triangles": 0, "moved": 0.0}))


@router.get("/{scene_id}/pairs")
@unchanging
def get_scene_pairs(scene_id: SceneGiven, db: Db) -> ScenePairs:
    """Returns the pairs to certify, with the reference frame chosen for each pair and a forecast of its cost."""
    with db.read() as session:
        scene_id = scenes.find(session, scene_id)
    scene = scenes.load(db, scene_id)
    names = [joint.name for joint in scene.moving]
    pairs = []
    for index, cost in enumerate(forecast(scene)):
        chains = {"chain_a": [names[i] for i in cost.chain_a], "chain_b": [names[i] for i in cost.chain_b]}
        padding = scene.padding_of(scene.pairs[index])
        pairs.append(PairForecast.model_validate({"index": index, "padding": padding, **asdict(cost), **chains}))
    return ScenePairs(pairs=pairs)


@router.get("/{scene_id}/lint")
@unchanging
def get_scene_lint(scene_id: SceneGiven, db: Db) -> LintReport:
    """Returns what a reader should know about the scene before trusting a certificate for it."""
    with db.read() as session:
        document = scenes.get(session, scene_id).document
    return LintReport(
        warnings=document["warnings"],
        substitutions=[
            Substitution(geometry=g["name"], substitution=g["substitution"], inflation=g["inflation"])
            for g in document["geometries"]
            if g["substitution"] is not None
        ],
        ignored=[IgnoredPair(a=i["pair"][0], b=i["pair"][1], reason=i["reason"]) for i in document["ignored"]],
    )


@router.get("/{scene_id}/dependents")
def get_scene_dependents(scene_id: SceneGiven, db: Db) -> Dependents:
    """Returns what is deleted with a scene: its jobs, and their regions and proofs."""
    with db.read() as session:
        return Dependents(**asdict(retention.of_scene(session, scene_id)))


@router.post("/{scene_id}/constrain", status_code=status.HTTP_201_CREATED)
async def constrain_scene(
    scene_id: SceneGiven, body: ConstrainRequest, db: Db, children: Children, room: KeptRoom, caller: Submitter, response: Response
) -> SceneDetail:
    """Makes another scene out of one: the same, with more conditions.

    Everything that is asked of the new scene keeps its conditions. The scene that it comes from stays as it is. From now on the name means
    the new scene, also where it meant another one.
    """
    scene = await children.run(_constrain, db, room, caller.project, scene_id, body)
    response.headers["Location"] = f"/v1/scenes/{scene.id}"
    return scene


def _constrain(db: Database, room: Room, project: str, scene_id: str, body: ConstrainRequest) -> SceneDetail:
    room.check(db, project)
    scenes.check_name(body.name, "name")
    with db.read() as session:
        found, known = scenes.find(session, scene_id), scenes.known(session, scene_id)
        named = scenes.meaning(session, body.name)
    if named is not None and named.scene_id == found:
        message = f"{body.name!r} is the name of the scene without these conditions"
        raise SceneError("scene_name", message, field="name", hint="give the new scene a name of its own")
    base = scenes.load(db, found)
    more = constrained(base, read_conditions(body.conditions), swept_in(base))
    scene = replace(more, name=body.name, configurations=known.agreed)
    besides = uncovered.document(scene)
    with db.write() as session:
        row = scenes.add(session, scene)
        meshes.hand_on(session, found, row.id)
        return _detail(session, row, body.name, scene, besides)


@router.post("/{scene_name}/promote")
@writing
def promote_scene(
    scene_name: Annotated[str, Path(max_length=MAX_NAME, description="The name that gets the new meaning.", examples=["planar-2dof"])],
    caller: Submitter,
    db: Db,
    without_regions: Annotated[
        bool, Query(description="Whether to promote a scene without regions where the present scene has some; refused otherwise.")
    ] = False,
) -> Promoted:
    """Makes a name mean the scene that is staged as its next version, for every request from now on.

    Ask `/v1/planning/graph` about `NAME@staged` first, until `complete` is true. Otherwise the first plans wait for it.
    """
    with db.write() as session:
        done = staging.promote(session, scene_name, without_regions=without_regions)
        audit.note(session, caller.project, str(caller), Action.SCENE_PROMOTED, f"{scene_name} = {done.scene}")
    return Promoted(**asdict(done))


@router.delete("/{scene_id}", status_code=status.HTTP_204_NO_CONTENT)
@writing
def delete_scene(scene_id: SceneGiven, caller: Admin, db: Db, dependents: WithDependents = "keep") -> None:
    """Deletes a scene with its names. Where jobs or regions depend on it, the request has to say that they are deleted, too."""
    with db.write() as session:
        retention.delete_scene(session, scene_id, dependents=dependents == "delete")
        audit.note(session, caller.project, str(caller), Action.SCENE_DELETED, scene_id)
