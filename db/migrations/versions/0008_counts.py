"""Keeps the counts of a job's open and running pairs in its row, and the state of its growth in a table of its own

So claims and savings need not read the pairs that they leave alone. Jobs that are under way go on.

Revision: 0008, follows 0007.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "growths",
        sa.Column("job_id", sa.String(length=36), nullable=False),
        sa.Column("document", sa.JSON(none_as_null=True), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_growths_job_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("job_id", name=op.f("pk_growths")),
    )
    op.execute(sa.text("INSERT INTO growths (job_id, document) SELECT id, growth FROM jobs WHERE growth IS NOT NULL"))
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        batch_op.drop_column("growth")
        for name in ("open_pairs", "running_pairs", "next_pair"):
            batch_op.add_column(sa.Column(name, sa.Integer(), nullable=False, server_default="0"))
    for state in ("open", "running"):
        count = f"SELECT count(*) FROM pairs WHERE pairs.job_id = jobs.id AND pairs.state = '{state}'"
        op.execute(sa.text(f"UPDATE jobs SET {state}_pairs = ({count})"))
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_pairs_job_id_state"))
        batch_op.drop_index(batch_op.f("ix_pairs_state_lease_until"))
        batch_op.create_index(batch_op.f("ix_pairs_job_id_state_deaths_id"), ["job_id", "state", "deaths", "id"], unique=False)
        batch_op.create_index(batch_op.f("ix_pairs_state_lease_token"), ["state", "lease_token"], unique=False)


def downgrade() -> None:
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_pairs_state_lease_token"))
        batch_op.drop_index(batch_op.f("ix_pairs_job_id_state_deaths_id"))
        batch_op.create_index(batch_op.f("ix_pairs_state_lease_until"), ["state", "lease_until"], unique=False)
        batch_op.create_index(batch_op.f("ix_pairs_job_id_state"), ["job_id", "state"], unique=False)
    with op.batch_alter_table("jobs", schema=None) as batch_op:
        for name in ("next_pair", "running_pairs", "open_pairs"):
            batch_op.drop_column(name)
        batch_op.add_column(sa.Column("growth", sa.JSON(none_as_null=True), nullable=True))
    op.execute(sa.text("UPDATE jobs SET growth = (SELECT document FROM growths WHERE growths.job_id = jobs.id)"))
    op.drop_table("growths")
