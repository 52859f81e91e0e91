"""This package uses certified regions: it finds which of them contain a configuration, and how far inside it is."""
