"""Ids of events never come again on SQLite, also when the newest are deleted

Revision: 0022, follows 0021.
"""

from __future__ import annotations

from alembic import op

revision = "0022"
down_revision = "0021"
branch_labels = None
depends_on = None


def upgrade() -> None:
    _make_anew(sqlite_autoincrement=True)


def downgrade() -> None:
    _make_anew(sqlite_autoincrement=False)


def _make_anew(*, sqlite_autoincrement: bool) -> None:
    """Copies the table into one that counts otherwise. The count begins at the largest id that there is."""
    if op.get_bind().dialect.name == "sqlite":
        kind = {"sqlite_autoincrement": sqlite_autoincrement}
        with op.batch_alter_table("events", recreate="always", table_kwargs=kind):
            pass
