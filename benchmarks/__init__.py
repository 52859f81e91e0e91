"""Measurements side by side with Drake, and the named instances that tests and measurements share. Nothing else imports this package."""
