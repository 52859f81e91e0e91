"""Iterations say of each pair when its partition was begun: those of a group that is divided begin anew

A job that is under way during the migration ends with `other_version`, and can be retried.

Revision: 0030, follows 0029.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0030"
down_revision = "0029"
branch_labels = None
depends_on = None

_ITERATIONS = sa.table("iterations", sa.column("job_id", sa.String(36)), sa.column("index", sa.Integer()), sa.column("action", sa.JSON()))
_PAIRS = sa.table("pairs", sa.column("job_id", sa.String(36)), sa.column("iteration", sa.Integer()), sa.column("pair_index", sa.Integer()))


def _each(change: Callable[[Any, list[int]], Any]) -> None:
    """Changes ``begun`` of each iteration, one at a time: a document holds a polytope, and there may be many."""
    bind, own = op.get_bind(), _ITERATIONS.c
    for job_id, index in bind.execute(sa.select(own.job_id, own.index)).all():
        this = (own.job_id == job_id, own.index == index)
        action = bind.execute(sa.select(own.action).where(*this)).scalar_one()
        of_it = (_PAIRS.c.job_id == job_id, _PAIRS.c.iteration == index)
        pairs = bind.execute(sa.select(_PAIRS.c.pair_index).where(*of_it).distinct()).scalars()
        bind.execute(sa.update(_ITERATIONS).where(*this).values(action=action | {"begun": change(action["begun"], list(pairs))}))


def upgrade() -> None:
    _each(lambda begun, pairs: {} if begun is None else {str(pair): begun for pair in pairs})


def downgrade() -> None:
    _each(lambda begun, pairs: min(begun.values(), default=None))
