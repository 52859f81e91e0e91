"""Says of a job, instead of each step, when its next region may be accepted, and of a region how large it is in q

Revision: 0011, follows 0010.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.add_column(sa.Column("accept_after", sa.DateTime(timezone=True), nullable=False, server_default="2026-01-01"))
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.alter_column("accept_after", server_default=None)
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.drop_column("due_at")
    with op.batch_alter_table("regions", schema=None) as batch_op:
        batch_op.add_column(sa.Column("q_volume", sa.JSON(none_as_null=True), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("regions", schema=None) as batch_op:
        batch_op.drop_column("q_volume")
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.add_column(sa.Column("due_at", sa.DateTime(timezone=True), nullable=False, server_default="2026-01-01"))
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.drop_column("accept_after")
