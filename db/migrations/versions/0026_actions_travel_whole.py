"""Iterations hold the action that asked for them as one document; the options of the papers' algorithm are a group

A job that is under way during the migration ends with `other_version`, and can be retried.

Revision: 0026, follows 0025.
"""

from __future__ import annotations

import io
from collections.abc import Callable
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


_PAPER = ("contraction", "contractions", "bisection_steps", "pushes", "max_rounds", "tolerance", "backoff")
_JOBS = sa.table("jobs", sa.column("id", sa.String(36)), sa.column("kind", sa.String(16)), sa.column("options", sa.JSON()))


def _grouped(options: dict[str, Any]) -> dict[str, Any]:
    """Returns the options of a growth with those of the papers' algorithm in their group, where it was asked for."""
    seed, kept = dict(options.get("seed", {})), {name: value for name, value in options.items() if name not in _PAPER}
    if seed.get("method") != "box":
        seed.pop("half_width", None)
    contraction = options.get("contraction") or ("targeted" if seed.get("method") in ("box", "limits", "polytope") else "whole")
    asked = {name: options[name] for name in _PAPER if options.get(name) is not None} | {"contraction": contraction}
    return {**kept, "seed": seed, "paper": None if contraction == "whole" else asked}


def _flat(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if name != "paper"} | (options.get("paper") or {})


def _each_growth(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    for row in op.get_bind().execute(sa.select(_JOBS).where(_JOBS.c.kind == "grow")).all():
        op.get_bind().execute(sa.update(_JOBS).where(_JOBS.c.id == row.id).values(options=change(row.options)))


def upgrade() -> None:
    _each_growth(_grouped)
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
    _each_growth(_flat)
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
