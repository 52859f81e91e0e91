"""Celery workers certify pairs in parallel, coordinate jobs and sweep up. The embedded stack runs all of it on one machine."""
