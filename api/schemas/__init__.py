"""Requests and responses. Requests refuse unknown fields and numbers that are not finite; responses are built from database rows."""
