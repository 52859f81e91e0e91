"""What a proof file may have: with these the time and the memory that checking takes are linear in its size (docs/proofs.md, "Limits")."""

from __future__ import annotations

FILE_BYTES = 256 << 20
UNPACKED_BYTES = 256 << 20
RATIO = 100
"""The file's members are together at most so many times its own size, and FREE_BYTES."""
FREE_BYTES = 1 << 20
HEADER_BYTES = 16 << 20
MEMBERS = 65_535
MEMBER_NAME = 64
DIMENSION = 1 << 24
"""Of an array, whether or not it has entries."""

JOINTS = 10_000
POSITIONS = 64
PATH = 64
"""Joints, welds among them, between the world and a body. Exact numbers gain bits with every one."""
GEOMETRIES = 20_000
VERTICES = 4_096
"""Of a geometry."""
MAGNITUDE = 1e6
"""Of every length, in metres, and of every joint position, limit and q*, in metres or radians."""
PAIRS = 20_000
"""Of the pairs to prove, and of those that are ignored."""

PROOFS = 8_000
GROUNDS = 1_000
VOLUMES = 16_000
CORNERS = 8
"""Vertices of a volume that is none of the scene's geometries."""
CONTAINED = 500_000
"""Vertices of geometries that such volumes stand for, all volumes together."""
FACES = 4_096
"""Half-spaces of a polytope, and those that it implies."""
MULTIPLIERS = 2
"""Multipliers that are not 0 in one proof of a half-space, for each joint; one for each suffices (Caratheodory)."""

FACTORS = 1 << 22
"""Entries of the Gram matrices of one vertex."""
EXPONENT = 256
"""Of two, in the exponents of Gram factors."""
MOMENTS = 1 << 18
"""Of one body in a dual proof."""
LOCALISED = 1 << 23
"""Entries of the localising matrices of one body in a dual proof."""
