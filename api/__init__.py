"""The HTTP service: routes, schemas, problems, events and the dashboard's pages. Never loads Drake."""
