"""Makes an iteration end after a number of failures, and store which of its pairs are hard

Revision: 0004, follows 0003.
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.add_column(sa.Column("hard", sa.JSON(none_as_null=True), nullable=False, server_default="[]"))
        batch_op.add_column(sa.Column("failures", sa.Integer(), nullable=True))
    op.execute(sa.text("UPDATE iterations SET failures = 1 WHERE stop_at_first_failure"))
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.drop_column("stop_at_first_failure")
    _rewrite(_with_failures)


def downgrade() -> None:
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.add_column(sa.Column("stop_at_first_failure", sa.Boolean(), nullable=False, server_default=sa.false()))
    op.execute(sa.text("UPDATE iterations SET stop_at_first_failure = (failures IS NOT NULL)"))
    with op.batch_alter_table("iterations", schema=None) as batch_op:
        batch_op.drop_column("failures")
        batch_op.drop_column("hard")
    _rewrite(_with_first_failure)


def _with_failures(action: dict[str, Any]) -> None:
    action["hard"], action["failures"] = [], 1 if action.pop("stop_at_first_failure") else None


def _with_first_failure(action: dict[str, Any]) -> None:
    action["stop_at_first_failure"] = action.pop("failures") is not None
    del action["hard"]


def _rewrite(change: Any) -> None:
    """Changes what unfinished jobs store of the certification that they wait for."""
    jobs = sa.table("jobs", sa.column("id", sa.String()), sa.column("action", sa.JSON()), sa.column("growth", sa.JSON()))
    bind = op.get_bind()
    for row in bind.execute(sa.select(jobs).where(jobs.c.action.is_not(None))).all():
        action, growth = row.action, row.growth
        if action["kind"] == "certify":
            change(action)
        if growth and growth.get("current"):
            change(growth["current"])
        bind.execute(sa.update(jobs).where(jobs.c.id == row.id).values(action=action, growth=growth))
