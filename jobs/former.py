"""The region that a job certifies again is read here, with what its proof is worth in the job's scene."""

from __future__ import annotations

from functools import lru_cache

from certifier.growth.options import GrowthOptions
from certifier.jobs.former import Former
from certifier.model import Scene
from certifier.proof.region import RegionProof
from db import proofs
from db.session import database
from db.transaction import persistently


def former_of(scene: Scene, options: GrowthOptions) -> Former | None:
    """Returns the region of the scene before it changed; None where the job certifies none again.

    Raises:
        CirisError: ``proof_not_found``, where the region was deleted meanwhile.
    """
    if options.kind != "recertify":
        return None
    return _former(scene, options.seed["proof"], options.seed["region"])


@lru_cache(maxsize=1)
def _former(scene: Scene, digest: str, region: str) -> Former:
    """Reads the proof of a region. It takes long, so a process keeps the last one: all pairs of a job ask for it, and its region."""

    def read() -> bytes:
        with database().read() as session:
            return proofs.get(session, digest)

    return Former.of(RegionProof.from_bytes(persistently(read)), digest, scene, region)
