"""A proof's deletion looks regions and motions up, and does not read them all: SQLite did not use their indexes with a condition

Revision: 0029, follows 0028.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0029"
down_revision = "0028"
branch_labels = None
depends_on = None

TABLES = ("regions", "motions")


def upgrade() -> None:
    for table in TABLES:
        op.drop_index(f"ix_{table}_proof_digest", table)
        op.create_index(f"ix_{table}_proof_digest", table, ["proof_digest"])


def downgrade() -> None:
    present = sa.text("proof_digest IS NOT NULL")
    for table in TABLES:
        op.drop_index(f"ix_{table}_proof_digest", table)
        op.create_index(f"ix_{table}_proof_digest", table, ["proof_digest"], sqlite_where=present, postgresql_where=present)
