"""The time of solvers by API key, so that keys of a project take turns by what they used lately

Revision: 0045, follows 0044. On the way up, what a project has used counts for no key. On the way down, its rows of a month become one.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0045"
down_revision = "0044"
branch_labels = None
depends_on = None

_NAME = "pk_solver_time"
_SUMS = sa.text("SELECT project, month, sum(seconds) AS seconds FROM solver_time GROUP BY project, month")
_TABLE = sa.table("solver_time", *(sa.column(name) for name in ("project", "month", "seconds", "lately")))


def upgrade() -> None:
    op.add_column("solver_time", sa.Column("key_id", sa.String(36), nullable=False, server_default=sa.text("''")))
    with op.batch_alter_table("solver_time") as batch:
        batch.alter_column("key_id", existing_type=sa.String(36), existing_nullable=False, server_default=None)
        batch.drop_constraint(_NAME, type_="primary")
        batch.create_primary_key(_NAME, ["project", "key_id", "month"])


def downgrade() -> None:
    sums = [{**row, "lately": 0.0} for row in op.get_bind().execute(_SUMS).mappings()]
    op.execute(sa.text("DELETE FROM solver_time"))
    with op.batch_alter_table("solver_time") as batch:
        batch.drop_constraint(_NAME, type_="primary")
        batch.drop_column("key_id")
        batch.create_primary_key(_NAME, ["project", "month"])
    op.bulk_insert(_TABLE, sums)
