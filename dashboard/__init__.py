"""The dashboard is made of templates and static files; api/pages.py serves them."""
