"""These programs measure our certifier beside Drake's, verdict by verdict, and how it grows; ``ciris bench`` (docs/benchmarks.md)."""
