"""Proof files are addressed by the SHA-256 of their content. The same proof is stored once, whoever found it."""

from __future__ import annotations

import hashlib
from collections.abc import Collection

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db.models import ProofRow
from db.session import insert_new


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
