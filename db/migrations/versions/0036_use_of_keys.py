"""The time at which a key was last used is kept, and a key may end at a time that is set when it is made

Revision: 0036, follows 0035. Until that time, ``revoked_at`` of the key is in the future. Programs of before take such a key for
a revoked one.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0036"
down_revision = "0035"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("api_keys", sa.Column("last_used_at", sa.DateTime(timezone=True), nullable=True))


def downgrade() -> None:
    op.drop_column("api_keys", "last_used_at")
