"""Renames what is known of a pair's failure to weakness; a job's action now names only the iteration that it waits for

The state of the growth has another shape since this revision. A job that is under way during the migration ends with the error
``other_version``.

Revision: 0006, follows 0005.
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.alter_column("weak_points", new_column_name="weakness")
    _certifying(lambda action: {"kind": action["kind"], "iteration": action["iteration"]})


def downgrade() -> None:
    _certifying(lambda action: {**action, "hard": [], "failures": 1})
    with op.batch_alter_table("pairs", schema=None) as batch_op:
        batch_op.alter_column("weakness", new_column_name="weak_points")


def _certifying(changed: Any) -> None:
    """Changes the actions of the jobs that wait for a certification."""
    bind = op.get_bind()
    jobs = sa.table("jobs", sa.column("id", sa.String()), sa.column("action", sa.JSON()))
    for row in bind.execute(sa.select(jobs).where(jobs.c.action.is_not(None))).all():
        if row.action["kind"] == "certify":
            bind.execute(sa.update(jobs).where(jobs.c.id == row.id).values(action=changed(row.action)))
