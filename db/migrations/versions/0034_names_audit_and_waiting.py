"""The named configurations of a scene belong to its names, and not to its content; jobs say when a solver began

Revision: 0034, follows 0033.
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0034"
down_revision = "0033"
branch_labels = None
depends_on = None

_SCENES = sa.table("scenes", sa.column("id", sa.String), sa.column("document", sa.JSON))
_NAMES = sa.table("scene_names", sa.column("scene_id", sa.String), sa.column("configurations", sa.JSON))


def _document(scene_id: str) -> dict[str, Any]:
    found: dict[str, Any] = op.get_bind().execute(sa.select(_SCENES.c.document).where(_SCENES.c.id == scene_id)).scalar_one()
    return found


def upgrade() -> None:
    op.create_index("ix_audit_created_at", "audit", ["created_at"])
    op.add_column("jobs", sa.Column("claimed_at", sa.DateTime(timezone=True), nullable=True))
    op.add_column("scene_names", sa.Column("configurations", sa.JSON, nullable=False, server_default="{}"))
    database = op.get_bind()
    for scene_id in database.scalars(sa.select(_SCENES.c.id)).all():
        document = _document(scene_id)
        if named := document.pop("configurations", None):
            database.execute(sa.update(_NAMES).where(_NAMES.c.scene_id == scene_id).values(configurations=named))
            database.execute(sa.update(_SCENES).where(_SCENES.c.id == scene_id).values(document=document))


def downgrade() -> None:
    database = op.get_bind()
    for scene_id, named in database.execute(sa.select(_NAMES.c.scene_id, _NAMES.c.configurations)).all():
        if named:
            document = _document(scene_id)
            both = {**named, **document.get("configurations", {})}
            whole = {**document, "configurations": both}
            database.execute(sa.update(_SCENES).where(_SCENES.c.id == scene_id).values(document=whole))
    op.drop_column("scene_names", "configurations")
    op.drop_column("jobs", "claimed_at")
    op.drop_index("ix_audit_created_at", "audit")
