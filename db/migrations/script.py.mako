"""${message}

Revision: ${up_revision}, follows ${down_revision}, ${create_date}.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

import db.types
${imports if imports else ""}
revision = ${repr(up_revision)}
down_revision = ${repr(down_revision)}
branch_labels = None
depends_on = None


def upgrade() -> None:
    ${upgrades if upgrades else "pass"}


def downgrade() -> None:
    ${downgrades if downgrades else "pass"}
