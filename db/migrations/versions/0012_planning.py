"""Counts the changes of a scene's regions, numbers the regions, keeps a box around each, and keeps which of them overlap

The joint limits are the box of the regions stored before.

Revision: 0012, follows 0011.
"""

from __future__ import annotations

import io

import numpy as np
import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None

_regions = sa.table("regions", sa.column("id"), sa.column("manifest", sa.JSON), sa.column("box", sa.LargeBinary))


def upgrade() -> None:
    op.create_table(
        "libraries",
        sa.Column("scene_id", sa.String(length=64), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["scene_id"], ["scenes.id"], name=op.f("fk_libraries_scene_id")),
        sa.PrimaryKeyConstraint("scene_id", name=op.f("pk_libraries")),
    )
    with op.batch_alter_table("regions", schema=None) as batch_op:
        batch_op.add_column(sa.Column("number", sa.Integer(), nullable=False, server_default="0"))
        batch_op.add_column(sa.Column("linked", sa.Integer(), nullable=False, server_default="0"))
        batch_op.add_column(sa.Column("box", sa.LargeBinary(), nullable=True))
    op.execute(
        "UPDATE regions SET number = (SELECT count(*) FROM regions AS r WHERE r.scene_id = regions.scene_id "
        "AND (r.created_at < regions.created_at OR (r.created_at = regions.created_at AND r.id <= regions.id)))"
    )
    op.execute("INSERT INTO libraries (scene_id, version) SELECT scene_id, count(*) FROM regions GROUP BY scene_id")
    connection = op.get_bind()
    for row in connection.execute(sa.select(_regions.c.id, _regions.c.manifest)).all():
        space = row.manifest["space"]
        box = _npz(lower=space["s_lower"], upper=space["s_upper"])
        connection.execute(sa.update(_regions).where(_regions.c.id == row.id).values(box=box))
    with op.batch_alter_table("regions", schema=None) as batch_op:
        batch_op.alter_column("number", server_default=None)
        batch_op.alter_column("linked", server_default=None)
        batch_op.alter_column("box", existing_type=sa.LargeBinary(), nullable=False)
    op.create_table(
        "overlaps",
        sa.Column("later", sa.String(length=36), nullable=False),
        sa.Column("earlier", sa.String(length=36), nullable=False),
        sa.Column("depth", sa.Double(), nullable=False),
        sa.Column("witness", sa.JSON(none_as_null=True), nullable=False),
        sa.ForeignKeyConstraint(["earlier"], ["regions.id"], name=op.f("fk_overlaps_earlier"), ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["later"], ["regions.id"], name=op.f("fk_overlaps_later"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("later", "earlier", name=op.f("pk_overlaps")),
    )
    with op.batch_alter_table("overlaps", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_overlaps_earlier"), ["earlier"], unique=False)


def downgrade() -> None:
    op.drop_table("overlaps")
    with op.batch_alter_table("regions", schema=None) as batch_op:
        batch_op.drop_column("box")
        batch_op.drop_column("linked")
        batch_op.drop_column("number")
    op.drop_table("libraries")


def _npz(**arrays: list[float]) -> bytes:
    buffer = io.BytesIO()
    doubles = {name: np.array(array, dtype=float) for name, array in arrays.items()}
    np.savez(buffer, **doubles)  # type: ignore[arg-type]
    return buffer.getvalue()
