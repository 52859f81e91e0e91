"""Keeps outlines of what searches leave, and counts the pieces of a job's last iteration

A job that was under way, or has ended, before this revision has no outlines, and says nothing of how far it is in its iteration.

Revision: 0014, follows 0013.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("subtrees", schema=None) as batch_op:
        batch_op.add_column(sa.Column("outline", sa.LargeBinary(), nullable=True))
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.add_column(sa.Column("pieces", sa.Integer(), nullable=True))


def downgrade() -> None:
    op.execute("DELETE FROM subtrees WHERE LENGTH(data) = 0")
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.drop_column("pieces")
    with op.batch_alter_table("subtrees", schema=None) as batch_op:
        batch_op.drop_column("outline")
