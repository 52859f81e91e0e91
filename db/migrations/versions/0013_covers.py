"""Says of a job which cover it grows a region for, and as which of its regions

Revision: 0013, follows 0012.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.add_column(sa.Column("parent_id", sa.String(length=36), nullable=True))
        batch_op.add_column(sa.Column("number", sa.Integer(), nullable=True))
        batch_op.create_foreign_key(op.f("fk_jobs_parent_id"), "jobs", ["parent_id"], ["id"])
        batch_op.create_unique_constraint(op.f("uq_jobs_parent_id_number"), ["parent_id", "number"])


def downgrade() -> None:
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.drop_constraint(op.f("uq_jobs_parent_id_number"), type_="unique")
        batch_op.drop_constraint(op.f("fk_jobs_parent_id"), type_="foreignkey")
        batch_op.drop_column("number")
        batch_op.drop_column("parent_id")
