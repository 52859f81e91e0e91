"""Certified collision-free polytopes of robot configuration space (C-IRIS): numbers only, no database, no HTTP."""
