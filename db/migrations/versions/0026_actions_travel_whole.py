"""Iterations hold the action that asked for them as one document

A job that is under way during the migration ends with `other_version`, and can be retried.

Revision: 0026, follows 0025.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import sqlalchemy as sa
from alembic import op

revision = "0026"
down_revision = "0025"
branch_labels = None
depends_on = None

_SAME = ("label", "failures", "reuse", "parts", "together")
_MOVED = ("hard", "cells", "begun", "ending")


def _table(*names: str) -> sa.TableClause:
    kinds: dict[str, sa.types.TypeEngine[Any]] = {
        "job_id": sa.String(36),
        "index": sa.Integer(),
        "arrays": sa.LargeBinary(),
        "label": sa.Text(),
    }
    kinds |= {"failures": sa.Integer(), "cells": sa.Integer(), "begun": sa.Integer()}
    return sa.table("iterations", *(sa.column(name, kinds.get(name, sa.JSON())) for name in ("job_id", "index", *names)))


def _rows(table: sa.TableClause) -> list[sa.Row[Any]]:
    return list(op.get_bind().execute(sa.select(table)))


def _fill(table: sa.TableClause, row: sa.Row[Any], **values: object) -> None:
    op.get_bind().execute(sa.update(table).where(table.c.job_id == row.job_id, table.c.index == row.index).values(values))


def upgrade() -> None:
    with op.batch_alter_table("iterations") as iterations:
        iterations.add_column(sa.Column("action", sa.JSON(), nullable=False, server_default="{}"))
    table = _table("arrays", "action", *_SAME, *_MOVED)
    for row in _rows(table):
        with np.load(io.BytesIO(row.arrays), allow_pickle=False) as arrays:
            C, d = arrays["C"].tolist(), arrays["d"].tolist()
        kept = {name: getattr(row, name) for name in (*_SAME, *_MOVED)}
        _fill(table, row, action={"iteration": row.index, "polytope": {"C": C, "d": d}, "pairs": [], **kept})
    with op.batch_alter_table("iterations") as iterations:
        iterations.alter_column("action", server_default=None)
        for name in ("arrays", *_MOVED):
            iterations.drop_column(name)


def downgrade() -> None:
    with op.batch_alter_table("iterations") as iterations:
        iterations.add_column(sa.Column("arrays", sa.LargeBinary(), nullable=False, server_default=""))
        iterations.add_column(sa.Column("hard", sa.JSON(), nullable=False, server_default="[]"))
        iterations.add_column(sa.Column("cells", sa.Integer(), nullable=False, server_default="1"))
        iterations.add_column(sa.Column("begun", sa.Integer(), nullable=True))
        iterations.add_column(sa.Column("ending", sa.JSON(), nullable=False, server_default="[]"))
    table = _table("arrays", "action", *_MOVED)
    for row in _rows(table):
        buffer = io.BytesIO()
        np.savez(buffer, C=np.array(row.action["polytope"]["C"]), d=np.array(row.action["polytope"]["d"]))
        _fill(table, row, arrays=buffer.getvalue(), **{name: row.action[name] for name in _MOVED})
    with op.batch_alter_table("iterations") as iterations:
        for name in ("arrays", "hard", "cells", "ending"):
            iterations.alter_column(name, server_default=None)
        iterations.drop_column("action")
