"""This is the HTTP service: routes, schemas, problems, events and the dashboard's pages. It never loads Drake."""
