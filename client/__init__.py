"""This package holds the `ciris` command line."""
