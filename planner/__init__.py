"""What certified regions are good for: which of them hold a configuration, and how far inside."""
