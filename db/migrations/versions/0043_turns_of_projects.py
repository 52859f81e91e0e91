"""The time of solvers that projects have used lately, by which they take turns

Revision: 0043, follows 0042. On the way up nobody has used any.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0043"
down_revision = "0042"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("solver_time", sa.Column("lately", sa.Double(), nullable=False, server_default=sa.text("0")))
    op.add_column("solver_time", sa.Column("counted_at", sa.DateTime(timezone=True), nullable=True))
    with op.batch_alter_table("solver_time") as batch:
        batch.alter_column("lately", existing_type=sa.Double(), existing_nullable=False, server_default=None)


def downgrade() -> None:
    op.drop_column("solver_time", "counted_at")
    op.drop_column("solver_time", "lately")
