"""A region of a scene that has changed, by real workers and by this process alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from certifier.jobs import local
from certifier.model import WORLD, Scene
from certifier.verify.region import verify_region
from db import proofs, regions
from db.models import RegionRow
from db.session import database
from tests.certifier.scenes import box, planar_arm
from tests.workers.options import box_around
from tests.workers.service import ended, events_of, pairs_of, submit

pytestmark = pytest.mark.usefixtures("service")


SCENE = planar_arm(2, box("world/post", WORLD, (0.3, 0.3, 0.3), (1.5, 1.4, 0.0)))
SEED = [0.0, 0.0]


def moved(center: tuple[float, float, float]) -> Scene:
    """The scene with its post at another place."""
    return planar_arm(2, box("world/post", WORLD, (0.3, 0.3, 0.3), center))


def region_of(region_id: str) -> tuple[RegionRow, bytes]:
    with database().read() as session:
        row = regions.get(session, region_id)
        return row, proofs.get(session, row.proof_digest)


def options_of(row: RegionRow) -> dict[str, object]:
    C, d = row.manifest["halfspace_normals"], row.manifest["halfspace_offsets"]
    return {"kind": "recertify", "seed": {"C": C, "d": d, "q": [SEED], "region": row.id, "proof": row.proof_digest}}


@pytest.fixture
def grown() -> tuple[RegionRow, bytes]:
    """A region of the scene, with its proof."""
    job = ended(submit(SCENE, box_around(SEED, 0.2) | {"cells": 300}))
    return region_of(job.region_id or "")


@pytest.mark.slow
def test_a_region_of_a_changed_scene_is_the_same_by_the_service_and_without_it(grown: tuple[RegionRow, bytes]) -> None:
    row, proof = grown
    changed = moved((1.6, 0.8, 0.0))
    job = ended(submit(changed, options_of(row)))
    assert (job.kind, job.state, job.outcome, job.error) == ("recertify", "succeeded", "certified", None)
    again, again_proof = region_of(job.region_id or "")
    assert len(verify_region(again_proof).gaps) == len(changed.pairs)
    alone = local.recertify(changed, proof, [SEED])
    assert alone.proof == again_proof
    said, here = (manifest["provenance"]["recertified"] for manifest in (again.manifest, alone.manifest))
    assert said == here | {"region": row.id}
    assert (said["scene"], bool(said["cut"])) == (SCENE.hash, True)
    assert 0 < said["kept"]["value"] < 1


@pytest.mark.slow
def test_what_did_not_change_is_carried_over_and_a_seed_in_contact_revokes_the_region(grown: tuple[RegionRow, bytes]) -> None:
    row, _ = grown
    job = ended(
        submit(replace(SCENE, geometries=(*SCENE.geometries, box("world/far", WORLD, (0.1, 0.1, 0.1), (9.0, 0.0, 0.0)))), options_of(row))
    )
    assert {pair.stage for pair in pairs_of(job.id)} == {"carried"}
    assert {pair["stage"] for event in events_of(job.id) if event.kind == "pairs" for pair in event.data["pairs"]} == {"carried"}
    gone = ended(submit(moved((1.0, 0.0, 0.0)), options_of(row)))
    assert (gone.state, gone.outcome, gone.region_id) == ("failed", "refuted", None)
    assert gone.error is not None
    assert gone.error["code"] == "revoked"
    assert "touch at q = (0.0, 0.0) deg" in gone.error["message"]
