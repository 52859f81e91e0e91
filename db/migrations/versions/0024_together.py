"""Iterations say which pairs are certified as one

A job that is under way during the migration goes on with all of its pairs by themselves.

Revision: 0024, follows 0023.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0024"
down_revision = "0023"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("iterations") as iterations:
        iterations.add_column(sa.Column("together", sa.JSON(), nullable=False, server_default="{}"))
    with op.batch_alter_table("iterations") as iterations:
        iterations.alter_column("together", server_default=None)


def downgrade() -> None:
    with op.batch_alter_table("iterations") as iterations:
        iterations.drop_column("together")
