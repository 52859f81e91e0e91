"""Jobs grow maps: rounds are divided into steps, and what they find is kept until the map's proof is stored

Revision: 0032, follows 0031.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0032"
down_revision = "0031"
branch_labels = None
depends_on = None

_NAME = "uq_steps_job_id_turn_kind"


def upgrade() -> None:
    with op.batch_alter_table("steps") as steps:
        steps.add_column(sa.Column("number", sa.Integer(), nullable=False, server_default="0"))
        steps.add_column(sa.Column("data", sa.LargeBinary(), nullable=True))
        steps.drop_constraint(_NAME, type_="unique")
        steps.create_unique_constraint(op.f(f"{_NAME}_number"), ["job_id", "turn", "kind", "number"])
    with op.batch_alter_table("steps") as steps:
        steps.alter_column("number", server_default=None)
    op.create_table(
        "map_pieces",
        sa.Column("job_id", sa.String(36), nullable=False),
        sa.Column("round", sa.Integer(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_map_pieces_job_id_jobs"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("job_id", "round", "number", name=op.f("pk_map_pieces")),
    )


def downgrade() -> None:
    op.drop_table("map_pieces")
    op.execute(sa.text("DELETE FROM steps WHERE number > 0"))
    with op.batch_alter_table("steps") as steps:
        steps.drop_constraint(f"{_NAME}_number", type_="unique")
        steps.create_unique_constraint(op.f(_NAME), ["job_id", "turn", "kind"])
        steps.drop_column("data")
        steps.drop_column("number")
