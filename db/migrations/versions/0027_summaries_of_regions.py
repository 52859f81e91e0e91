"""Regions hold what lists show of their manifests as one document

Revision: 0027, follows 0026.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0027"
down_revision = "0026"
branch_labels = None
depends_on = None

_NAMES = ("q_volume", "share")
_JSON = sa.JSON(none_as_null=True)
_REGIONS = sa.table("regions", sa.column("id", sa.String(36)), sa.column("summary", _JSON), *(sa.column(name, _JSON) for name in _NAMES))


def upgrade() -> None:
    with op.batch_alter_table("regions") as regions:
        regions.add_column(sa.Column("summary", _JSON, nullable=False, server_default="{}"))
    connection = op.get_bind()
    for row in connection.execute(sa.select(_REGIONS)).all():
        summary = {name: getattr(row, name) for name in _NAMES}
        connection.execute(sa.update(_REGIONS).where(_REGIONS.c.id == row.id).values(summary=summary))
    with op.batch_alter_table("regions") as regions:
        regions.alter_column("summary", server_default=None)
        for name in _NAMES:
            regions.drop_column(name)


def downgrade() -> None:
    with op.batch_alter_table("regions") as regions:
        for name in _NAMES:
            regions.add_column(sa.Column(name, _JSON, nullable=True))
    connection = op.get_bind()
    for row in connection.execute(sa.select(_REGIONS)).all():
        values = {name: row.summary.get(name) for name in _NAMES}
        connection.execute(sa.update(_REGIONS).where(_REGIONS.c.id == row.id).values(values))
    with op.batch_alter_table("regions") as regions:
        regions.drop_column("summary")
