"""This package holds the routes, one module for each kind of thing. The name of a route's function is its OpenAPI operation id."""
