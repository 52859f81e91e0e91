"""Model files are read strictly here, a module for each format."""
