"""A job that makes a region of a changed scene from a region of the scene before it changed."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from certifier.carry.robot import same_bodies
from certifier.growth.options import RecertifyOptions
from certifier.model import Scene
from certifier.names import MAX_NAME
from db import regions, scenes
from db.session import Database
from jobs.fields import model_of
from jobs.growing import Growing
from jobs.request import JobRequest


class RecertifyRequest(JobRequest, model_of(RecertifyOptions)):  # type: ignore[misc]
    """Asks which part of another scene's region still holds in this scene, for instance after this scene has changed.

    Proofs of pairs with the same numbers are taken over; the others are made again, cell by cell. What cannot be certified is cut off.
    """

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "recertify", "scene": "iiwa-shelf", "region": "1f9b2a7c-5b0e-4b58-9c39-2f1d6a3c8e10"}]}
    )

    kind: Literal["recertify"] = Field(description="The kind of the job.")
    region: str = Field(
        max_length=MAX_NAME,
        description="Id of the region, or its first characters. Its scene must have the same joints, limits and q* as `scene`. "
        "The seed that it was grown from, and what it had to contain, stay inside.",
    )


class Recertify(Growing):
    """Makes a region of a scene from a region of the scene before it changed."""

    name = "recertify"
    request = RecertifyRequest
    forms: ClassVar = {"": ("Certification", RecertifyOptions)}

    def options(self, body: RecertifyRequest, scene: Scene, db: Database) -> dict[str, Any]:
        with db.read() as session:
            row = regions.get(session, body.region)
            region, digest, manifest, old = row.id, row.proof_digest, row.manifest, row.scene_id
        same_bodies(scenes.load(db, old), scene)
        polytope = {"C": manifest["halfspace_normals"], "d": manifest["halfspace_offsets"], "q": _kept(scene, manifest)}
        return {"kind": "recertify", "seed": {**polytope, "region": region, "proof": digest}, "random_seed": body.random_seed}


def _kept(scene: Scene, manifest: dict[str, Any]) -> list[list[float]]:
    """Returns the joint positions that stay inside of a region that is certified again: its seed, and what it had to contain."""
    seed = manifest["provenance"].get("options", {}).get("seed", {})
    if "region" in seed:
        return [list(map(float, q)) for q in seed["q"]]
    return [manifest["seed"] or scene.to_q(manifest["interior_point"]).tolist(), *(seed.get("contain") or [])]
