"""Scenes, jobs, regions and keys belong to projects, those of before to the project ``default``; what can be deleted has indices

The way down is refused once another project has a scene, because its keys' holders and those of ``default`` would see each other's.

Revision: 0016, follows 0015.
"""

from __future__ import annotations

from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None

INDICES = {
    "scenes": None,
    "api_keys": None,
    "jobs": ("ix_jobs_created_at_id", ["created_at", "id"]),
    "regions": ("ix_regions_created_at", ["created_at"]),
}
PROVED = ("pairs", "regions", "steps")

_steps = sa.table("steps", sa.column("id"), sa.column("kind"), sa.column("state"), sa.column("report", sa.JSON), sa.column("proof_digest"))


def upgrade() -> None:
    projects = op.create_table(
        "projects",
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("max_bytes", sa.BigInteger(), nullable=True),
        sa.Column("keep_days", sa.Double(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_projects")),
    )
    op.create_table(
        "audit",
        sa.Column("id", sa.String(length=36), nullable=False),
        sa.Column("project", sa.String(length=64), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("action", sa.String(length=32), nullable=False),
        sa.Column("what", sa.Text(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["project"], ["projects.name"], name=op.f("fk_audit_project")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit")),
    )
    with op.batch_alter_table("audit", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_audit_project_created_at_id"), ["project", "created_at", "id"], unique=False)
    op.get_bind().execute(projects.insert().values(name="default", created_at=datetime.now(UTC)))
    for table, index in INDICES.items():
        with op.batch_alter_table(table, schema=None) as batch_op:
            batch_op.add_column(sa.Column("project", sa.String(length=64), nullable=False, server_default="default"))
            batch_op.create_foreign_key(op.f(f"fk_{table}_project"), "projects", ["project"], ["name"])
            if table == "scenes":
                batch_op.drop_constraint(op.f("uq_scenes_hash"), type_="unique")
                batch_op.create_unique_constraint(op.f("uq_scenes_project_hash"), ["project", "hash"])
            if index is not None:
                batch_op.drop_index(op.f(index[0]))
                batch_op.create_index(op.f(f"ix_{table}_project_created_at_id"), ["project", "created_at", "id"], unique=False)
        with op.batch_alter_table(table, schema=None) as batch_op:
            batch_op.alter_column("project", server_default=None)
    _renew_names(["project", "name", "version"])
    with op.batch_alter_table("libraries", schema=None) as batch_op:
        batch_op.drop_constraint(op.f("fk_libraries_scene_id"), type_="foreignkey")
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.add_column(sa.Column("proof_digest", sa.String(length=64), nullable=True))
        batch_op.create_foreign_key(op.f("fk_steps_proof_digest"), "proofs", ["proof_digest"], ["digest"])
    connection = op.get_bind()
    motions = sa.select(_steps.c.id, _steps.c.report).where(_steps.c.kind == "motion", _steps.c.state == "done")
    for row in connection.execute(motions).all():
        connection.execute(sa.update(_steps).where(_steps.c.id == row.id).values(proof_digest=row.report["proof"]))
    for table in PROVED:
        present = sa.text("proof_digest IS NOT NULL")
        op.create_index(op.f(f"ix_{table}_proof_digest"), table, ["proof_digest"], sqlite_where=present, postgresql_where=present)


def downgrade() -> None:
    if op.get_bind().scalar(sa.text("SELECT count(*) FROM scenes WHERE project <> 'default'")):
        raise RuntimeError("several projects have scenes, which the earlier version cannot keep apart; restore a backup instead")
    for table in PROVED:
        op.drop_index(op.f(f"ix_{table}_proof_digest"), table)
    with op.batch_alter_table("steps", schema=None) as batch_op:
        batch_op.drop_constraint(op.f("fk_steps_proof_digest"), type_="foreignkey")
        batch_op.drop_column("proof_digest")
    op.execute("DELETE FROM libraries WHERE scene_id NOT IN (SELECT id FROM scenes)")
    with op.batch_alter_table("libraries", schema=None) as batch_op:
        batch_op.create_foreign_key(op.f("fk_libraries_scene_id"), "scenes", ["scene_id"], ["id"])
    _renew_names(["name", "version"])
    for table, index in reversed(INDICES.items()):
        with op.batch_alter_table(table, schema=None) as batch_op:
            if table == "scenes":
                batch_op.drop_constraint(op.f("uq_scenes_project_hash"), type_="unique")
                batch_op.create_unique_constraint(op.f("uq_scenes_hash"), ["hash"])
            if index is not None:
                batch_op.drop_index(op.f(f"ix_{table}_project_created_at_id"))
                batch_op.create_index(op.f(index[0]), index[1], unique=False)
            batch_op.drop_constraint(op.f(f"fk_{table}_project"), type_="foreignkey")
            batch_op.drop_column("project")
    op.drop_table("audit")
    op.drop_table("projects")


def _renew_names(key: list[str]) -> None:
    """Makes the table of the names anew with this primary key, and keeps its rows."""
    with op.batch_alter_table("scene_names", schema=None) as batch_op:
        batch_op.drop_index(op.f("ix_scene_names_scene_id"))
        batch_op.drop_constraint(op.f("pk_scene_names"), type_="primary")
        batch_op.drop_constraint(op.f("fk_scene_names_scene_id"), type_="foreignkey")
    op.rename_table("scene_names", "scene_names_before")
    project = [
        sa.Column("project", sa.String(length=64), nullable=False),
        sa.ForeignKeyConstraint(["project"], ["projects.name"], name=op.f("fk_scene_names_project")),
    ]
    op.create_table(
        "scene_names",
        *(project if "project" in key else []),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("scene_id", sa.String(length=64), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["scene_id"], ["scenes.id"], name=op.f("fk_scene_names_scene_id")),
        sa.PrimaryKeyConstraint(*key, name=op.f("pk_scene_names")),
    )
    with op.batch_alter_table("scene_names", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_scene_names_scene_id"), ["scene_id"], unique=False)
    named = "name, version, scene_id, created_at"
    both = (f"project, {named}", f"'default', {named}") if "project" in key else (named, named)
    op.execute(f"INSERT INTO scene_names ({both[0]}) SELECT {both[1]} FROM scene_names_before")
    op.drop_table("scene_names_before")
