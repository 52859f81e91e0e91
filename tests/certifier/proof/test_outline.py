"""Outlines: the stream is the tree, cells fill the root box, rounds are put together as the search does it, and folding hides no leaf."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.model import Pair
from certifier.partition import bodies
from certifier.partition.certification import CellCertification
from certifier.proof.container import some_of
from certifier.proof.outline import FOLDED, Counts, Outline, Silhouette, Tree, outlines
from certifier.proof.partition import EMPTY, OPEN, PLANE, PartitionProof
from tests.certifier.scenes import ball, box, cube, planar_arm

N = 3
OWN = Silhouette(("one",), "link", 8, 0.0, own=True)
COARSE = Silhouette(("one", "two"), "base", 1, 0.2, own=False)
LEAVES = (PLANE, EMPTY, OPEN)


def random_tree(rng, depth, lower, upper, leaves=LEAVES):
    """A nested tree: (joint, value, lower part, upper part), or a kind of leaf and the choice of one with a plane."""
    if depth and rng.random() < 0.75:
        joint = int(rng.integers(N))
        value = float(rng.uniform(lower[joint], upper[joint]))
        below, above = upper.copy(), lower.copy()
        below[joint] = above[joint] = value
        return (joint, value, random_tree(rng, depth - 1, lower, below, leaves), random_tree(rng, depth - 1, above, upper, leaves))
    return (int(rng.choice(leaves)), int(rng.integers(4)))


def flat(*trees):
    """The streams of nested trees."""
    nodes, cuts, choices = [], [], []

    def add(node):
        nodes.append(node[0])
        if node[0] >= 0:
            cuts.append(node[1])
            add(node[2])
            add(node[3])
        elif node[0] == PLANE:
            choices.append(node[1])

    for tree in trees:
        add(tree)
    return Tree(np.array(nodes, dtype=np.int8), np.array(cuts, dtype=float), np.array(choices, dtype=np.int8))


def nested(nodes, cuts, choices):
    """What :func:`flat` was given, read from the streams as whoever draws them reads them."""
    nodes, cuts, choices = iter(nodes), iter(cuts), iter(choices)

    def read():
        kind = int(next(nodes))
        if kind >= 0:
            return (kind, float(next(cuts)), read(), read())
        return (kind, int(next(choices)) if kind == PLANE else 0)

    tree = read()
    assert [*nodes, *cuts, *choices] == []
    return tree


def without_choices(tree):
    """The tree, in which leaves without a plane have no choice."""
    return (*tree[:2], *map(without_choices, tree[2:])) if tree[0] >= 0 else (tree[0], tree[1] if tree[0] == PLANE else 0)


def leaves_of(tree, lower, upper):
    """The leaves with their boxes."""
    if tree[0] < 0:
        return [(tree[0], lower, upper)]
    below, above = upper.copy(), lower.copy()
    below[tree[0]] = above[tree[0]] = tree[1]
    return leaves_of(tree[2], lower, below) + leaves_of(tree[3], above, upper)


def outline(tree):
    return Outline((0, 1, 2), np.zeros(N), np.ones(N), ((OWN, COARSE), (OWN, COARSE)), tree)


def some_tree(seed, depth=6, leaves=LEAVES):
    rng = np.random.default_rng(seed)
    return without_choices(random_tree(rng, depth, np.zeros(N), np.ones(N), leaves))


def same(one, other):
    assert [stream.tolist() for stream in one] == [stream.tolist() for stream in other]
    assert [stream.dtype for stream in one] == [stream.dtype for stream in other]


SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=60)
@given(SEEDS)
def test_an_outline_is_its_tree_and_its_file(seed):
    tree = some_tree(seed)
    made = Outline.from_bytes(outline(flat(tree)).to_bytes())
    assert nested(*made.tree) == tree
    same(made.tree, flat(tree))
    assert (made.joints, made.sides, made.folded) == ((0, 1, 2), ((OWN, COARSE), (OWN, COARSE)), ())
    cells = leaves_of(tree, made.lower, made.upper)
    assert made.counts == tuple(sum(kind == leaf for kind, _, _ in cells) for leaf in LEAVES)
    assert sum(np.prod(upper - lower) for _, lower, upper in cells) == pytest.approx(1)


@settings(max_examples=60)
@given(st.lists(SEEDS, min_size=1, max_size=6))
def test_trees_one_after_the_other_are_told_apart(seeds):
    trees = [some_tree(seed, 4) for seed in seeds]
    for found, tree in zip(flat(*trees).split(), trees, strict=True):
        same(found, flat(tree))


@settings(max_examples=60)
@given(SEEDS)
def test_the_nodes_below_a_node_end_where_its_subtree_does(seed):
    tree = some_tree(seed)
    ends = flat(tree).ends().tolist()

    def check(node, place):
        end = place + 1
        for child in node[2:]:
            end = check(child, end)
        assert ends[place] == end
        return end

    assert check(tree, 0) == len(ends)


@settings(max_examples=60)
@given(SEEDS, st.integers(1, 60))
def test_folding_shows_the_top_of_the_tree_and_counts_what_it_hides(seed, most):
    tree = some_tree(seed, 8)
    whole = outline(flat(tree))
    shown = whole.shown(most)
    assert len(shown.tree.nodes) <= max(most, 1)
    assert shown.counts == whole.counts
    hidden = []

    def compare(part, full):
        if part[0] == FOLDED:
            assert full[0] >= 0
            kinds = [kind for kind, _, _ in leaves_of(full, np.zeros(N), np.ones(N))]
            hidden.append(Counts(*(kinds.count(kind) for kind in LEAVES)))
        else:
            assert part[:2] == full[:2]
            for one, other in zip(part[2:], full[2:], strict=True):
                compare(one, other)

    compare(nested(*shown.tree), tree)
    assert shown.folded == tuple(hidden)
    assert bool(hidden) == (len(whole.tree.nodes) > most)


def test_a_large_tree_is_folded_from_one_depth_on():
    tree = (PLANE, 0)
    for depth in range(17):
        tree = (depth % N, 0.5, tree, tree)
    shown = outline(flat(tree)).shown(200_000)
    assert len(shown.tree.nodes) == 2**17 - 1
    assert shown.folded == (Counts(2, 0, 0),) * 2**16
    assert shown.counts == Counts(2**17, 0, 0)


@settings(max_examples=60)
@given(SEEDS, st.lists(st.integers(1, 4), max_size=3))
def test_rounds_are_put_together_as_their_cells_were_dealt(seed, parts_of_rounds):
    """Every round is given the open cells of the one before: the first cell goes to the first part, the second to the second, and so on."""
    rng = np.random.default_rng(seed)
    whole = some_tree(rng.integers(2**32), 5)
    rounds, trees = [], [whole]
    for parts in parts_of_rounds:
        made = [some_tree(rng.integers(2**32), 3) for tree in trees for _ in opens(tree)]
        rounds.append([made[part::parts] for part in range(parts)])
        trees = list(itertools.chain(*rounds[-1]))
    later = [[outline(flat(*trees)) for trees in dealt] for dealt in rounds]
    assert nested(*outline(flat(whole)).gone_on(later).tree) == gone_on([whole], rounds)[0]


def opens(tree):
    """The open leaves of a tree, in order."""
    return [tree] if tree[0] == OPEN else [leaf for child in tree[2:] for leaf in opens(child)] if tree[0] >= 0 else []


def gone_on(trees, rounds):
    """The trees with what later rounds have made of their open cells."""
    if not rounds:
        return trees
    dealt, *later = rounds
    grown = iter(gone_on(list(itertools.chain(*dealt)), later))
    parts = [[next(grown) for _ in some] for some in dealt]
    cells = iter([parts[cell % len(parts)][cell // len(parts)] for cell in range(sum(map(len, parts)))])
    return [replaced(tree, cells) for tree in trees]


def replaced(tree, cells):
    """The tree with these in the places of its open leaves."""
    if tree[0] == OPEN:
        return next(cells)
    return (*tree[:2], *(replaced(child, cells) for child in tree[2:])) if tree[0] >= 0 else tree


def test_a_part_that_has_left_nothing_yet_leaves_its_cells_open():
    whole = (0, 0.5, (OPEN, 0), (1, 0.5, (OPEN, 0), (OPEN, 0)))
    done = outline(flat((PLANE, 1), (EMPTY, 0)))
    found = outline(flat(whole)).gone_on([[done, None]])
    assert nested(*found.tree) == (0, 0.5, (PLANE, 1), (1, 0.5, (OPEN, 0), (EMPTY, 0)))


@pytest.fixture
def passing(monkeypatch):
    """An arm whose tip passes a block as its two joints turn. A vertex may take one piece, so that it takes many cells."""
    monkeypatch.setattr(bodies, "PIECES", 1)
    block, tip = box("world/block", "world", (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), ball("arm/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
    scene = planar_arm(2, block, limit=2.5)
    return replace(scene, geometries=(*scene.geometries, tip), pairs=(Pair(tip.name, block.name),))


def test_the_outline_of_what_searches_leave_is_that_of_the_proof_in_the_end(passing):
    search, rounds = CellCertification(passing, cube(passing, 0.0, 0.6)), []
    results = [search.certify(0, 1)]
    while any(result.open_cells for result in results):
        rounds.append(results)
        parts = min(2, sum(result.open_cells for result in results))
        left = [result.subtrees for result in results]
        results = [search.go_on(0, 1, left, part, parts) for part in range(parts)]
    rounds.append(results)
    assert len(rounds) > 2
    begun, *later = [[Outline.from_bytes(result.outline) for result in some] for some in rounds]
    for number, some in enumerate(rounds):
        assert begun[0].gone_on(later[:number]).counts.open == sum(result.open_cells for result in some)
    grown, proved = begun[0].gone_on(later), search.put_together(0, [[result.subtrees for result in some] for some in rounds])
    proof = PartitionProof.from_bytes(proved.proof, passing)
    (found,) = outlines(proved.proof, passing)
    assert found.form == "partition"
    for one in (grown, found.cells):
        same(one.tree, Tree(proof.nodes, proof.cuts, proof.choices))
        assert len(one.joints) == proof.planes.shape[2] - 1
        assert [side[0].geometries for side in one.sides] == [volume.geometries for volume in proof.volumes]
        assert (one.lower <= -0.6).all()
        assert (one.upper >= 0.6).all()
    cells = leaves_of(nested(*grown.tree), grown.lower, grown.upper)
    assert sum(np.prod(upper - lower) for _, lower, upper in cells) == pytest.approx(np.prod(grown.upper - grown.lower))


def test_the_rest_of_a_proof_is_not_read(passing):
    proof = CellCertification(passing, cube(passing, 0.0, 0.2)).certify(0, 100).proof
    _, arrays = some_of(proof, lambda name: name.endswith("nodes"))
    assert arrays.keys() == {"proof/0/nodes"}
