"""These are the limits of a proof file. With them, checking takes time and memory linear in its size (docs/proofs.md, "Limits")."""

from __future__ import annotations

from certifier import positions

FILE_BYTES = 256 << 20
UNPACKED_BYTES = 256 << 20
RATIO = 100
"""The file's members together have at most this many times its own size, plus FREE_BYTES."""
FREE_BYTES = 1 << 20
HEADER_BYTES = 16 << 20
MEMBERS = 65_535
MEMBER_NAME = 64
DIMENSION = 1 << 24
"""Each dimension of an array is at most this long, whether or not the array has entries."""

JOINTS = 10_000
POSITIONS = 64
PATH = 64
"""At most this many joints, welds among them, are between the world and a body. Exact numbers gain bits with every joint."""
GEOMETRIES = 20_000
VERTICES = 4_096
"""A geometry has at most this many vertices."""
MAGNITUDE = positions.MAGNITUDE
"""No length, in metres, and no joint position, limit or q*, in metres or radians, is larger than this."""
SPEEDS = 2.0**-10, 2.0**10
"""Least and largest length of the axis of a slide that follows another joint: how far it moves for a metre of that one."""
PAIRS = 20_000
"""This limit holds for the pairs to prove, and again for those that are ignored."""

PROOFS = 8_000
GROUNDS = 1_000
VOLUMES = 16_000
CORNERS = 8
"""A volume that is none of the scene's geometries has at most this many vertices."""
CONTAINED = 4_000_000
"""All such volumes together stand for geometries with at most this many vertices."""
FACES = 4_096
"""A polytope has at most this many half-spaces, and implies at most this many more."""
MULTIPLIERS = 2
"""A proof of a half-space has at most this many multipliers that are not 0 for each joint; one for each suffices (Caratheodory)."""

CHAIN = 7
"""At most this many joints are between the frame of a proof over a partition and a body: each makes four control values of one."""
PLAY = 14
"""A plane of such a proof moves with at most this many joints; its normal is bounded at 2^PLAY corners."""
COARSE = 10
"""Either volume of such a proof has at most this many coarse volumes, so that a byte names any two."""
NODES = 1 << 22
"""The tree of cuts of a proof over a partition has at most this many nodes."""
PIECES = 1 << 24
"""All trees of pieces of such a proof together have at most this many nodes."""
TREE = 1 << 16
"""The tree of pieces of one vertex in one cell has at most this many nodes."""
CUT_DEPTH = 512
"""A cell is cut at most this many times."""
PIECE_DEPTH = 64
"""A piece is halved at most this many times, because every halving rounds."""
FACTORS = 1 << 22
"""The Gram matrices of one vertex have at most this many entries."""
EXPONENT = 256
"""The exponent of two in a Gram factor has at most this magnitude."""
MOMENTS = 1 << 18
"""One body in a dual proof has at most this many moments."""
LOCALISED = 1 << 23
"""The localising matrices of one body in a dual proof have at most this many entries."""

INTERVALS = 1 << 20
"""The proof of a motion has at most this many intervals."""
DEGREE = 15
"""Its pieces are polynomials of at most this degree."""
SWEPT = 1 << 32
"""Its intervals together have at most this many vertices. A joint on the way counts as JOINT_COST of them, and every joint of the scene as
the square of the degree."""
JOINT_COST = 16
