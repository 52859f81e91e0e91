"""Keys are listed and forgotten, and shares of work counted, without reading the keys and jobs of other projects

Revision: 0033, follows 0032.
"""

from __future__ import annotations

from alembic import op

revision = "0033"
down_revision = "0032"
branch_labels = None
depends_on = None

_KEYS = (["project", "created_at", "id"], ["project", "name"], ["revoked_at"])
_BY_STATE, _BY_PROJECT_TOO = ["state"], ["state", "project", "key_id"]


def _name(table: str, columns: list[str]) -> str:
    return "_".join(["ix", table, *columns])


def _replace(before: list[str], after: list[str]) -> None:
    op.drop_index(_name("jobs", before), "jobs")
    op.create_index(_name("jobs", after), "jobs", after)


def upgrade() -> None:
    for columns in _KEYS:
        op.create_index(_name("api_keys", columns), "api_keys", columns)
    _replace(_BY_STATE, _BY_PROJECT_TOO)


def downgrade() -> None:
    _replace(_BY_PROJECT_TOO, _BY_STATE)
    for columns in _KEYS:
        op.drop_index(_name("api_keys", columns), "api_keys")
