"""Keeps what an iteration says about the cells of its pairs, and what a pair's search has left open

The state of the growth has another shape since this revision. A job that is under way during the migration ends with the error
``other_version``.

Revision: 0009, follows 0008.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

BEFORE = {"cells": "1", "begun": "{}", "ending": "[]"}
"""What the columns say of the iterations stored before."""


def upgrade() -> None:
    op.create_table(
        "partitions",
        sa.Column("job_id", sa.String(length=36), nullable=False),
        sa.Column("pair_index", sa.Integer(), nullable=False),
        sa.Column("iteration", sa.Integer(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_partitions_job_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("job_id", "pair_index", name=op.f("pk_partitions")),
    )
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.add_column(sa.Column("open_cells", sa.Integer(), nullable=True))
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        for name, before in BEFORE.items():
            kind = sa.Integer() if name == "cells" else sa.JSON(none_as_null=True)
            batch_op.add_column(sa.Column(name, kind, nullable=False, server_default=before))
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        for name in BEFORE:
            batch_op.alter_column(name, server_default=None)


def downgrade() -> None:
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        for name in BEFORE:
            batch_op.drop_column(name)
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.drop_column("open_cells")
    op.drop_table("partitions")
