"""Names of scenes are versions: a name means the scene that was last added under it

A scene that was added under several names, or again after another one, before this revision has the name of its first addition only.

Revision: 0015, follows 0014.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "scene_names",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("scene_id", sa.String(length=64), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["scene_id"], ["scenes.id"], name=op.f("fk_scene_names_scene_id")),
        sa.PrimaryKeyConstraint("name", "version", name=op.f("pk_scene_names")),
    )
    with op.batch_alter_table("scene_names", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_scene_names_scene_id"), ["scene_id"], unique=False)
    op.execute(
        "INSERT INTO scene_names (name, version, scene_id, created_at) "
        "SELECT name, ROW_NUMBER() OVER (PARTITION BY name ORDER BY created_at, id), id, created_at FROM scenes"
    )


def downgrade() -> None:
    op.drop_table("scene_names")
