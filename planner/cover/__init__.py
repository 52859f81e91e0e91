"""This package decides how regions cover a scene: which seeds are next, how much is covered, and when it is enough."""
