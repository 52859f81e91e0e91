"""This package waits for the service without blocking: every method is a coroutine."""
