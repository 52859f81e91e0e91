"""Who holds a piece of work, or decides about a job, says since when

Revision: 0041, follows 0040. What is held on the way up says it from the next claim on.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0041"
down_revision = "0040"
branch_labels = None
depends_on = None

_COLUMNS = {"pairs": "lease_since", "steps": "lease_since", "jobs": "coordinator_since"}


def upgrade() -> None:
    for table, column in _COLUMNS.items():
        op.add_column(table, sa.Column(column, sa.DateTime(timezone=True), nullable=True))


def downgrade() -> None:
    for table, column in _COLUMNS.items():
        op.drop_column(table, column)
