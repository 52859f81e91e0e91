"""Functions run in child processes that may die, hang or take too much memory without harm."""
