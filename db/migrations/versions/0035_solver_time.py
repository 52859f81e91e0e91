"""A project's use of solvers is counted by calendar month, and may have a limit

Revision: 0035, follows 0034.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0035"
down_revision = "0034"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("projects", sa.Column("max_solver_seconds", sa.Double(), nullable=True))
    op.create_table(
        "solver_time",
        sa.Column("project", sa.String(64), nullable=False),
        sa.Column("month", sa.String(7), nullable=False),
        sa.Column("seconds", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(["project"], ["projects.name"], name=op.f("fk_solver_time_project")),
        sa.PrimaryKeyConstraint("project", "month", name=op.f("pk_solver_time")),
    )


def downgrade() -> None:
    op.drop_table("solver_time")
    op.drop_column("projects", "max_solver_seconds")
