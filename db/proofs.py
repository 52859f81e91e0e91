"""Proof files, addressed by the SHA-256 of their content: the same proof is stored once, whoever found it."""

from __future__ import annotations

import hashlib

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db.models import ProofRow
from db.session import insert_new


def put(session: Session, data: bytes) -> str:
    """Stores a proof, unless it is there, and returns its digest."""
    digest = hashlib.sha256(data).hexdigest()
    insert_new(session, ProofRow, digest=digest, data=data)
    return digest


def get(session: Session, digest: str) -> bytes:
    """The proof with this digest.

    Raises:
        CirisError: proof_not_found.
    """
    row = session.get(ProofRow, digest)
    if row is None:
        raise CirisError("proof_not_found", f"there is no proof {digest}")
    return row.data
