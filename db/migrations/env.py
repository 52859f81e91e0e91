"""Alembic runs this module. All migrations of one call share one transaction, on SQLite too; db.migrate opens the connection."""

from __future__ import annotations

from alembic import context
from sqlalchemy import Connection

from db.migrate import connection_for_migrations
from db.models import Base
from db.settings import settings


def run(connection: Connection) -> None:
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        render_as_batch=True,
        transactional_ddl=True,
        user_module_prefix="db.types.",
    )
    with context.begin_transaction():
        context.run_migrations()


given: Connection | None = context.config.attributes.get("connection")
if given is not None:
    run(given)
elif getattr(context.config.cmd_opts, "autogenerate", False):
    with connection_for_migrations(settings().database) as connection:
        run(connection)
else:
    raise SystemExit("alembic only writes new migrations here; `ciris db` migrates")
