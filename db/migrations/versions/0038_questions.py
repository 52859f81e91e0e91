"""Configurations that somebody asked about and nothing proved are kept, so that a map may begin with them

Revision: 0038, follows 0037.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0038"
down_revision = "0037"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "questions",
        sa.Column("scene_id", sa.String(64), nullable=False),
        sa.Column("digest", sa.String(32), nullable=False),
        sa.Column("q", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("asked_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("project", sa.String(64), nullable=False),
        sa.ForeignKeyConstraint(["project"], ["projects.name"], name=op.f("fk_questions_project")),
        sa.ForeignKeyConstraint(["scene_id"], ["scenes.id"], name=op.f("fk_questions_scene_id")),
        sa.PrimaryKeyConstraint("scene_id", "digest", name=op.f("pk_questions")),
    )
    op.create_index("ix_questions_project_asked_at", "questions", ["project", "asked_at"])


def downgrade() -> None:
    op.drop_table("questions")
