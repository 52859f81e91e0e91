"""Jobs say how many bytes were asked for with them

Revision: 0023, follows 0022.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0023"
down_revision = "0022"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("jobs", sa.Column("bytes", sa.BigInteger(), nullable=False, server_default="0"))
    labels = "SELECT coalesce(sum(length(name) + length(value)), 0) FROM job_labels WHERE job_labels.job_id = jobs.id"
    op.execute(sa.text(f"UPDATE jobs SET bytes = 1000 + length(CAST(options AS TEXT)) + ({labels})"))
    op.create_index("ix_jobs_project_bytes", "jobs", ["project", "bytes"])


def downgrade() -> None:
    op.drop_index("ix_jobs_project_bytes", "jobs")
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_column("bytes")
