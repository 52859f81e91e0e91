"""The routes, one module for each kind of thing. A route's function name is its OpenAPI operation id."""
