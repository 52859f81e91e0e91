"""Proof files are addressed by the SHA-256 of their content. The same proof is stored once, even if several workers found it."""

from __future__ import annotations

import hashlib
from collections.abc import Collection

from sqlalchemy import delete, exists, or_
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db.models import MotionRow, PairRow, ProofRow, RegionRow, StepRow
from db.session import insert_new

TOGETHER = 500
"""Number of proofs that one statement deletes."""


def put(session: Session, files: Collection[bytes]) -> dict[bytes, str]:
    """Stores proofs that are not stored yet, and returns the digest of each."""
    digests = {data: digest(data) for data in files}
    insert_new(session, ProofRow, [{"digest": digest, "data": data} for data, digest in digests.items()])
    return digests


def digest(data: bytes) -> str:
    """Returns the digest under which a proof is stored."""
    return hashlib.sha256(data).hexdigest()


def get(session: Session, digest: str) -> bytes:
    """Returns the proof with this digest.

    Raises:
        CirisError: proof_not_found.
    """
    row = session.get(ProofRow, digest)
    if row is None:
        hint = "the database has lost it: restore a backup, or grow the region again"
        raise CirisError("proof_not_found", f"there is no proof {digest}", field="proof", hint=hint)
    return row.data


def drop_unused(session: Session, digests: Collection[str]) -> None:
    """Deletes those of these proofs that nothing refers to any more, in any project.

    Projects may share a proof. So the rows are looked for in the tables themselves, where a session's project does not count.
    """
    tables = (model.__table__ for model in (RegionRow, PairRow, StepRow, MotionRow))
    used = or_(*(exists().where(table.c.proof_digest == ProofRow.digest) for table in tables))
    session.flush()
    wanted = list(digests)
    for begin in range(0, len(wanted), TOGETHER):
        session.execute(delete(ProofRow).where(ProofRow.digest.in_(wanted[begin : begin + TOGETHER]), ~used))
