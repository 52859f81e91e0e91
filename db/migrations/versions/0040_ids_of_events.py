"""Ids of events that a project's people see say nothing of how many events other projects have

Revision: 0040, follows 0039. Who has kept an id of ``/v1/events`` from before, and asks for what came after it, gets what comes next.
"""

from __future__ import annotations

import secrets

import sqlalchemy as sa
from alembic import op

revision = "0040"
down_revision = "0039"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("projects", sa.Column("events_key", sa.LargeBinary(), nullable=True))
    projects = sa.table("projects", sa.column("name", sa.String()), sa.column("events_key", sa.LargeBinary()))
    connection = op.get_bind()
    for name in connection.scalars(sa.select(projects.c.name)).all():
        connection.execute(projects.update().where(projects.c.name == name).values(events_key=secrets.token_bytes(16)))
    with op.batch_alter_table("projects") as batch:
        batch.alter_column("events_key", existing_type=sa.LargeBinary(), nullable=False)


def downgrade() -> None:
    op.drop_column("projects", "events_key")
