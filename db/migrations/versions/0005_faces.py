"""Stores the number of faces of regions and iterations, so that lists need not read their arrays

Revision: 0005, follows 0004.
"""

from __future__ import annotations

import io

import numpy as np
import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

KEYS = {"regions": ("id",), "iterations": ("job_id", "index")}


def upgrade() -> None:
    bind = op.get_bind()
    for name, keys in KEYS.items():
        with op.batch_alter_table(name, schema=None) as batch_op:
            batch_op.add_column(sa.Column("faces", sa.Integer(), nullable=False, server_default="0"))
        columns = [sa.column(key, sa.Integer() if key == "index" else sa.String()) for key in keys]
        table = sa.table(name, *columns, sa.column("arrays", sa.LargeBinary()), sa.column("faces", sa.Integer()))
        for row in bind.execute(sa.select(*columns)).all():
            where = [table.c[key] == value for key, value in zip(keys, row, strict=True)]
            arrays = bind.execute(sa.select(table.c.arrays).where(*where)).scalar_one()
            with np.load(io.BytesIO(arrays), allow_pickle=False) as stored:
                faces = len(stored["d"])
            bind.execute(sa.update(table).where(*where).values(faces=faces))
        with op.batch_alter_table(name, schema=None) as batch_op:
            batch_op.alter_column("faces", server_default=None)


def downgrade() -> None:
    for name in KEYS:
        with op.batch_alter_table(name, schema=None) as batch_op:
            batch_op.drop_column("faces")
