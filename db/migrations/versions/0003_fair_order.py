"""Adds what a fair order of work needs: priority and served seconds of jobs, and how often a row killed its process

Rows hold no ids of messages any more.

Revision: 0003, follows 0002.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.add_column(sa.Column("priority", sa.Integer(), nullable=False, server_default="0"))
        batch_op.add_column(sa.Column("served", sa.Double(), nullable=False, server_default="0"))
    for table in ("pairs", "steps"):
        with op.batch_alter_table(table, schema=None) as batch_op:
            batch_op.add_column(sa.Column("deaths", sa.Integer(), nullable=False, server_default="0"))
            batch_op.add_column(sa.Column("parent", sa.Text(), nullable=True))
            batch_op.drop_column("task_id")
            batch_op.drop_column("sent_at")
            batch_op.create_index(batch_op.f(f"ix_{table}_job_id_state"), ["job_id", "state"], unique=False)
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.add_column(sa.Column("due_at", sa.DateTime(timezone=True), nullable=False, server_default="2026-01-01"))


def downgrade() -> None:
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.drop_column("due_at")
    for table in ("steps", "pairs"):
        with op.batch_alter_table(table, schema=None) as batch_op:
            batch_op.drop_index(batch_op.f(f"ix_{table}_job_id_state"))
            batch_op.add_column(sa.Column("sent_at", sa.DateTime(timezone=True), nullable=True))
            batch_op.add_column(sa.Column("task_id", sa.String(length=36), nullable=True))
            batch_op.drop_column("parent")
            batch_op.drop_column("deaths")
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.drop_column("served")
        batch_op.drop_column("priority")
