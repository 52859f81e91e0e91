"""The dashboard is made of templates, and of static files that dashboard/source/ is built into; api/pages/ serves them."""
