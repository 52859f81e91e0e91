"""Alembic's environment: env.py and one module of versions/ for each change of the schema."""
