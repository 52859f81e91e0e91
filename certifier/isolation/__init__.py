"""Functions run here in child processes, which may die, hang or take too much memory without harm."""
