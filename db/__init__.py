"""This is the database: tables, sessions, state tables, migrations and one module of queries for each aggregate."""
