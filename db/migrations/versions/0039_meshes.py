"""The meshes of a scene's models are kept, so that people see them beside the bodies that are certified

Revision: 0039, follows 0038.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0039"
down_revision = "0038"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "scene_meshes",
        sa.Column("scene_id", sa.String(64), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["scene_id"], ["scenes.id"], name=op.f("fk_scene_meshes_scene_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("scene_id", name=op.f("pk_scene_meshes")),
    )


def downgrade() -> None:
    op.drop_table("scene_meshes")
