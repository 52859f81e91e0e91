"""Trees of cells: as arrays and back, and open cells that are apart and leave nothing out."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.partition.subtrees import Subtrees, dealt, open_cells, put_together
from certifier.partition.tree import Node, OpenCell, Streams, joined, of_streams, to_streams
from certifier.proof.partition import EMPTY, OPEN, PLANE, STREAMS

N, K = 3, 2
VERTICES = (4, 2, 3, 1)
"""Of both volumes together, for every choice of volumes."""


def random_pieces(rng, depth=3):
    """The codes of a tree of pieces."""
    if depth and rng.random() < 0.4:
        return [int(rng.integers(K)), *random_pieces(rng, depth - 1), *random_pieces(rng, depth - 1)]
    return [int(rng.choice([PLANE, EMPTY]))]


def random_streams(rng, pieces, leaves):
    counts = rng.integers(0, 4, leaves)
    total = int(counts.sum())
    arrays = pieces, counts, rng.integers(0, 9, total), rng.random(total)
    return Streams(*(np.asarray(x, dtype=STREAMS[name]) for name, x in zip(Streams.__annotations__, arrays, strict=True)))


def random_tree(rng, lower, upper, depth):
    """A tree over the cell [lower, upper] with leaves of every kind."""
    if depth and rng.random() < 0.7:
        joint = int(rng.integers(N))
        value = float(rng.uniform(lower[joint], upper[joint]))
        below, above = upper.copy(), lower.copy()
        below[joint] = above[joint] = value
        return Node(joint, value, (random_tree(rng, lower, below, depth - 1), random_tree(rng, above, upper, depth - 1)))
    kind = int(rng.choice([PLANE, EMPTY, OPEN]))
    if kind == OPEN:
        return Node()
    if kind == EMPTY:
        return Node(EMPTY, streams=random_streams(rng, [], 1))
    choice = int(rng.integers(len(VERTICES)))
    pieces = [code for _ in range(VERTICES[choice]) for code in random_pieces(rng)]
    streams = random_streams(rng, pieces, sum(code < 0 for code in pieces))
    return Node(PLANE, plane=rng.normal(size=(5, 1 + K)), choice=choice, streams=streams)


def content(node):
    """What a node is, with all below it, as something to compare."""
    streams = node.streams and [
        (getattr(node.streams, name).tolist(), getattr(node.streams, name).dtype) for name in Streams.__annotations__
    ]
    plane = None if node.plane is None else node.plane.tolist()
    return node.kind, node.value, plane, node.choice, streams, [content(child) for child in node.children]


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 7))
def test_a_tree_survives_being_arrays(seed, depth):
    rng = np.random.default_rng(seed)
    trees = [random_tree(rng, -np.ones(N), np.ones(N), depth) for _ in range(seed % 3 + 1)]
    arrays = to_streams(trees, K)
    assert {name: array.dtype for name, array in arrays.items()} == STREAMS
    assert [content(tree) for tree in of_streams(arrays, VERTICES, len(trees))] == [content(tree) for tree in trees]


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 7))
def test_every_point_of_the_root_cell_is_in_one_leaf_and_open_cells_are_the_open_leaves(seed, depth):
    rng = np.random.default_rng(seed)
    lower, upper = -rng.uniform(0.5, 1.0, N), rng.uniform(0.5, 1.0, N)
    tree = random_tree(rng, lower, upper, depth)
    cells = tree.open_cells(lower, upper)
    assert len(cells) == sum(node.kind == OPEN for node in tree.preorder())
    for s in rng.uniform(lower, upper, (50, N)):
        leaf = tree
        while leaf.children:
            leaf = leaf.children[0] if s[leaf.kind] <= leaf.value else leaf.children[1]
        holding = [node for node, low, up in cells if (low <= s).all() and (s <= up).all()]
        assert holding == ([leaf] if leaf.kind == OPEN else [])


def test_the_lower_part_comes_first():
    tree = Node(1, 0.25, (Node(), Node(0, 0.5, (Node(), Node()))))
    assert [node.kind for node in tree.preorder()] == [1, OPEN, 0, OPEN, OPEN]
    cells = tree.open_cells(np.zeros(2), np.ones(2))
    assert [(low.tolist(), up.tolist()) for _, low, up in cells] == [
        ([0.0, 0.0], [1.0, 0.25]),
        ([0.0, 0.25], [0.5, 1.0]),
        ([0.5, 0.25], [1.0, 1.0]),
    ]


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_subtrees_of_rounds_in_parts_are_put_together_to_the_tree_that_was_grown(seed, most_parts):
    """Every round deals the open cells to parts and grows a random subtree in each; faces are added before the limits between rounds."""
    rng, faces = np.random.default_rng(seed), 9
    root = Node()
    given, rounds = [OpenCell(root, -np.ones(N), np.ones(N))], []
    parts = 1
    while given and len(rounds) < 4:
        files, following = [], []
        for part in range(parts):
            mine = dealt(given, part, parts)
            for node, lower, upper in mine:
                depth = 0 if len(rounds) == 3 else int(rng.integers(4))
                vars(node).update(vars(random_tree(rng, lower, upper, depth)))
                node.level = int(rng.integers(4))
            left = Subtrees.of(mine, faces)
            files.append(left.to_bytes(to_streams(left.roots, K)))
            following += left.open_cells
        rounds.append(files)
        read = open_cells(files)
        assert [(cell.node.level, cell.lower.tolist(), cell.upper.tolist()) for cell in read] == [
            (cell.node.level, cell.lower.tolist(), cell.upper.tolist()) for cell in following
        ]
        given, parts = following, int(rng.integers(1, most_parts + 1))
    together = put_together(rounds, faces, 2, VERTICES)
    assert content(together) == content(root)
    # The last two faces are the limits; others that came before them have moved them up.
    moved = put_together(rounds, faces + 5, 2, VERTICES)
    for node, other in zip(together.preorder(), moved.preorder(), strict=True):
        if node.streams is not None:
            assert other.streams.faces.tolist() == [face + 5 if face >= faces - 2 else face for face in node.streams.faces.tolist()]


def test_nothing_joined_is_empty_streams():
    assert [len(getattr(joined([]), name)) for name in Streams.__annotations__] == [0, 0, 0, 0]
