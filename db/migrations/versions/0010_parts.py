"""Keeps what searches leave of the parts of a pair, and divides the pairs of an iteration into parts

The state of the growth has another shape since this revision. A job that is under way during the migration ends with the error
``other_version``, and what its searches had left is deleted.

Revision: 0010, follows 0009.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.drop_table("partitions")
    op.create_table(
        "subtrees",
        sa.Column("job_id", sa.String(length=36), nullable=False),
        sa.Column("pair_index", sa.Integer(), nullable=False),
        sa.Column("iteration", sa.Integer(), nullable=False),
        sa.Column("part", sa.Integer(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_subtrees_job_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("job_id", "pair_index", "iteration", "part", name=op.f("pk_subtrees")),
    )
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.add_column(sa.Column("part", sa.Integer(), nullable=False, server_default="0"))
        batch_op.drop_constraint(op.f("uq_pairs_job_id_iteration_pair_index"), type_="unique")
        batch_op.create_unique_constraint(op.f("uq_pairs_job_id_iteration_pair_index_part"), ["job_id", "iteration", "pair_index", "part"])
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.alter_column("part", server_default=None)
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.drop_column("begun")
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.add_column(sa.Column("begun", sa.Integer(), nullable=True))
        batch_op.add_column(sa.Column("parts", sa.JSON(none_as_null=True), nullable=False, server_default="{}"))
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.alter_column("parts", server_default=None)


def downgrade() -> None:
    op.execute("DELETE FROM pairs WHERE part > 0")
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.drop_column("parts")
        batch_op.drop_column("begun")
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.add_column(sa.Column("begun", sa.JSON(none_as_null=True), nullable=False, server_default="{}"))
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.alter_column("begun", server_default=None)
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.drop_constraint(op.f("uq_pairs_job_id_iteration_pair_index_part"), type_="unique")
        batch_op.drop_column("part")
        batch_op.create_unique_constraint(op.f("uq_pairs_job_id_iteration_pair_index"), ["job_id", "iteration", "pair_index"])
    op.drop_table("subtrees")
    op.create_table(
        "partitions",
        sa.Column("job_id", sa.String(length=36), nullable=False),
        sa.Column("pair_index", sa.Integer(), nullable=False),
        sa.Column("iteration", sa.Integer(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_partitions_job_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("job_id", "pair_index", name=op.f("pk_partitions")),
    )
