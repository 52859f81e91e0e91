"""This package decides how regions come to cover a scene: which seeds are next, how much is covered, and when it is enough."""
