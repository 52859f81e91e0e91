"""Jobs say which process had forked their coordinator, and how many coordinators died by themselves

A coordinator that is at work during the migration counts as one whose worker ended.

Revision: 0025, follows 0024.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0025"
down_revision = "0024"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("coordinator_parent", sa.Text(), nullable=True))
        jobs.add_column(sa.Column("coordinator_deaths", sa.Integer(), nullable=False, server_default="0"))
    with op.batch_alter_table("jobs") as jobs:
        jobs.alter_column("coordinator_deaths", server_default=None)


def downgrade() -> None:
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_column("coordinator_deaths")
        jobs.drop_column("coordinator_parent")
