"""What stored maps prove of each pair, so that other maps of the project begin with it

Revision: 0042, follows 0041. No map begins by itself with one that was stored before; ``former`` may name it.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0042"
down_revision = "0041"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "map_pairs",
        sa.Column("job_id", sa.String(36), nullable=False),
        sa.Column("content", sa.String(16), nullable=False),
        sa.Column("cells", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_map_pairs_job_id_jobs"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("job_id", "content", name=op.f("pk_map_pairs")),
    )
    op.create_index(op.f("ix_map_pairs_content"), "map_pairs", ["content"])


def downgrade() -> None:
    op.drop_index(op.f("ix_map_pairs_content"), table_name="map_pairs")
    op.drop_table("map_pairs")
