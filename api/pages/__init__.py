"""These are the dashboard's pages. They fill the templates of dashboard/ with what the functions of the JSON routes return."""
