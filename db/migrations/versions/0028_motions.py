"""Motions that were planned and proved are kept

Revision: 0028, follows 0027.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from db.types import Npz, Utc

revision = "0028"
down_revision = "0027"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "motions",
        sa.Column("id", sa.String(36), nullable=False),
        sa.Column("project", sa.String(64), nullable=False),
        sa.Column("scene_id", sa.String(64), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("arrays", Npz(), nullable=False),
        sa.Column("tube", sa.Double(), nullable=False),
        sa.Column("proof_digest", sa.String(64), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["project"], ["projects.name"], name=op.f("fk_motions_project_projects")),
        sa.ForeignKeyConstraint(["scene_id"], ["scenes.id"], name=op.f("fk_motions_scene_id_scenes")),
        sa.ForeignKeyConstraint(["proof_digest"], ["proofs.digest"], name=op.f("fk_motions_proof_digest_proofs")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_motions")),
        sa.UniqueConstraint("scene_id", "number", name=op.f("uq_motions_scene_id_number")),
    )
    present = sa.text("proof_digest IS NOT NULL")
    op.create_index("ix_motions_proof_digest", "motions", ["proof_digest"], sqlite_where=present, postgresql_where=present)
    with op.batch_alter_table("libraries") as libraries:
        libraries.add_column(sa.Column("motions", sa.Integer(), nullable=False, server_default="0"))
    with op.batch_alter_table("libraries") as libraries:
        libraries.alter_column("motions", server_default=None)


def downgrade() -> None:
    op.drop_table("motions")
    with op.batch_alter_table("libraries") as libraries:
        libraries.drop_column("motions")
