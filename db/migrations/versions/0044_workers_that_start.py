"""Workers that start or compile

Revision: 0044, follows 0043. No table changes: workers tell of two states that processes of the version before do not know.
"""

from __future__ import annotations

from alembic import op

revision = "0044"
down_revision = "0043"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    op.execute("DELETE FROM workers WHERE state IN ('starting', 'compiling')")
