"""PostgreSQL's index of leases holds the running pairs only, so that no search for other pairs reads it

Revision: 0031, follows 0030.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0031"
down_revision = "0030"
branch_labels = None
depends_on = None

_NAME = "ix_pairs_state_lease_token"


def _replace(where: sa.TextClause | None) -> None:
    op.drop_index(_NAME, "pairs")
    op.create_index(_NAME, "pairs", ["state", "lease_token"], postgresql_where=where)


def upgrade() -> None:
    _replace(sa.text("state = 'running'"))


def downgrade() -> None:
    _replace(None)
