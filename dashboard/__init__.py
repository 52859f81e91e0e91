"""The dashboard: templates and static files; api/pages.py serves them."""
