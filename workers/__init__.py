"""Celery workers: certifying pairs in parallel, coordinating jobs, sweeping up; and the embedded stack that runs all of it."""
