"""A free set says of configurations and straight motions what exact fractions say of its cells, and refuses what is no free set."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ciris.free_set
from benchmarks.lookups import enlarged
from certifier.errors import CirisError, RegionError
from certifier.map import free_set
from certifier.proof import limits, partition
from ciris import FreeSet, lookups
from tests.free_sets import LIMIT, OBLIQUE, OPEN, PROVED, N, written

Leaf = tuple[list[Any], list[Any], bool]


def grids(last: int) -> st.SearchStrategy[Any]:
    """Joint positions on a grid, many of which are on cuts."""
    return st.lists(st.integers(-last, last).map(lambda k: k / 8), min_size=N, max_size=N)


trees = st.recursive(
    st.sampled_from([PROVED, PROVED, OPEN]),
    lambda parts: st.tuples(st.integers(0, N - 1), st.integers(-7, 7).map(lambda k: k / 4), parts, parts),
    max_leaves=12,
)
clauses = st.lists(st.lists(trees, min_size=1, max_size=3), min_size=1, max_size=3)


def within(tree: Any, lower: list[float], upper: list[float]) -> Any:
    """The tree without the cuts that miss their cells."""
    if isinstance(tree, int):
        return tree
    joint, cut, low, high = tree
    if not lower[joint] < cut < upper[joint]:
        return within(low, lower, upper)
    middle = [cut if i == joint else None for i in range(N)]
    below = [u if m is None else m for u, m in zip(upper, middle, strict=True)]
    above = [u if m is None else m for u, m in zip(lower, middle, strict=True)]
    return joint, cut, within(low, lower, below), within(high, above, upper)


def leaves(tree: Any, lower: list[Fraction], upper: list[Fraction]) -> list[Leaf]:
    if isinstance(tree, int):
        return [(lower, upper, tree == PROVED)]
    joint, cut, low, high = tree
    below, above = upper.copy(), lower.copy()
    below[joint] = above[joint] = Fraction(cut)
    return leaves(low, lower, below) + leaves(high, above, upper)


def free_at(cells: list[list[list[Leaf]]], q: list[Any], unit: int = 1) -> bool:
    """Whether every clause has a tree whose cells with q in them, their boundaries included, are all proved; q is in parts of a unit."""

    def proved(boxes: list[Leaf]) -> bool:
        return all(
            holds for lower, upper, holds in boxes if all(l * unit <= x <= u * unit for l, x, u in zip(lower, q, upper, strict=True))
        )

    return all(any(proved(boxes) for boxes in members) for members in cells)


def free_along(cells: list[list[list[Leaf]]], start: list[Fraction], end: list[Fraction]) -> bool:
    """The same at each time at which a motion crosses a boundary, and between these times. Whole numbers are quicker than fractions."""
    numbers = {*start, *end, *(v for members in cells for boxes in members for *box, _ in boxes for bounds in box for v in bounds)}
    whole = math.lcm(*(v.denominator for v in numbers))

    def in_parts(q: list[Fraction]) -> list[int]:
        return [int(x * whole) for x in q]

    a, b = in_parts(start), in_parts(end)
    cells = [[[(in_parts(lower), in_parts(upper), holds) for lower, upper, holds in boxes] for boxes in members] for members in cells]
    times = {Fraction(0), Fraction(1)}
    for x, y, i in zip(a, b, range(N), strict=True):
        ends = {bounds[i] for members in cells for boxes in members for *box, _ in boxes for bounds in box}
        times |= {Fraction(v - x, y - x) for v in ends if x != y and 0 <= Fraction(v - x, y - x) <= 1}
    ordered = sorted(times)
    looked_at = ordered + [(t + u) / 2 for t, u in itertools.pairwise(ordered)]
    return all(
        free_at(cells, [x * t.denominator + t.numerator * (y - x) for x, y in zip(a, b, strict=True)], t.denominator) for t in looked_at
    )


@settings(deadline=None, max_examples=150)
@given(clauses, st.lists(st.tuples(grids(16), grids(16)), min_size=1, max_size=4))
def test_it_says_what_exact_fractions_say(tmp_path_factory, drawn, motions) -> None:
    lower, upper = [-LIMIT] * N, [LIMIT] * N
    wanted = [[within(tree, lower, upper) for tree in members] for members in drawn]
    found = FreeSet.load(written(tmp_path_factory.mktemp("free") / "cell.npz", wanted))
    box = [Fraction(-2)] * N, [Fraction(2)] * N
    cells = [[leaves(tree, *box) for tree in members] for members in wanted]
    starts, ends = ([[Fraction(x) for x in motion[i]] for motion in motions] for i in (0, 1))
    first, last = (np.array(motions)[:, i] for i in (0, 1))
    assert found.contains(first).tolist() == [free_at(cells, q) for q in starts]
    expected = [free_along(cells, a, b) for a, b in zip(starts, ends, strict=True)]
    assert found.contains_motion(first, last).tolist() == expected
    for a, b, free in zip(first, last, expected, strict=True):
        parts = found.open_parts(a, b)
        assert (parts == ()) == free
        assert all(0 <= part.start <= part.end <= 1 for part in parts)
        proved = found.proved_parts(a, b)
        assert (proved.tolist() == [[0.0, 1.0]]) == free
        x, dx = ([Fraction(v) for v in vector.tolist()] for vector in (a, b - a))
        for part in proved.tolist():
            assert free_along(cells, *([v + Fraction(t) * dv for v, dv in zip(x, dx, strict=True)] for t in part))


def boxes_of(free_set: dict[str, Any], lower: np.ndarray, upper: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The boxes of the leaves of each tree, (L, n) twice, and which of them are proved."""
    joint, cut, parts = free_set["joint"], free_set["cut"], free_set["upper"]
    found = []
    for root in free_set["root"]:
        lows, highs, proved, waiting = [], [], [], [(root, lower, upper)]
        while waiting:
            node, low, high = waiting.pop()
            if joint[node] < 0:
                lows.append(low)
                highs.append(high)
                proved.append(joint[node] == PROVED)
                continue
            below, above = high.copy(), low.copy()
            below[joint[node]] = above[joint[node]] = cut[node]
            waiting += [(node + 1, low, below), (parts[node], above, high)]
        found.append((np.array(lows), np.array(highs), np.array(proved)))
    return found


def test_thousands_of_cells_say_what_all_of_their_boxes_say(tmp_path: Path) -> None:
    first, second = (0, 0.3, (1, -0.2, OPEN, PROVED), (2, 0.1, OPEN, OPEN)), (2, 0.6, OPEN, (0, 0.9, PROVED, OPEN))
    with np.load(written(tmp_path / "small.npz", [[first, second], [(1, 1.0, PROVED, (0, 0.2, OPEN, PROVED))]])) as arrays:
        large = enlarged(dict(arrays), 20_000)
    assert 20_000 <= (large["joint"] == PROVED).sum() < 21_000
    found = FreeSet.of_bytes(free_set.as_file(large), "large")
    rng, limits = np.random.default_rng(0), np.full(N, LIMIT)
    trees = boxes_of(large, -limits, limits)
    assert all(np.prod(high - low, axis=1).sum() == pytest.approx((2 * LIMIT) ** N) for low, high, _ in trees)

    def proved(tree: int, q: np.ndarray) -> np.ndarray:
        low, high, holds = trees[tree]
        near = (low <= q.max(axis=0)).all(axis=1) & (q.min(axis=0) <= high).all(axis=1)
        low, high, holds = low[near], high[near], holds[near]
        return np.array([holds[(low <= x).all(axis=1) & (x <= high).all(axis=1)].all() for x in q])

    low, high, _ = trees[2]
    q = (low + (high - low) * rng.random(low.shape))[rng.permutation(len(low))[:600]]
    expected = (proved(0, q) | proved(1, q)) & proved(2, q)
    assert 100 < expected.sum() < 500
    assert found.contains(q).tolist() == [bool(found.contains(x)) for x in q] == expected.tolist()

    starts = q[expected]
    ends = np.clip(starts + 0.01 * rng.normal(size=starts.shape), -LIMIT, LIMIT)
    free = found.contains_motion(starts, ends)
    assert 0 < free.sum() < len(free)
    for a, b, holds in zip(starts[:100], ends[:100], free[:100].tolist(), strict=True):
        on_way = a + np.linspace(0, 1, 200)[:, None] * (b - a)
        apart = (proved(0, on_way) | proved(1, on_way)) & proved(2, on_way)
        assert not holds or apart.all()
        for begin, end in found.proved_parts(a, b):
            between = a + np.linspace(begin, end, 20)[:, None] * (b - a)
            assert ((proved(0, between) | proved(1, between)) & proved(2, between)).all()


def test_open_parts_say_where_and_between_which_bodies(tmp_path: Path) -> None:
    narrow = (0, -0.5, PROVED, (0, 0.5, OPEN, PROVED))
    found = FreeSet.load(written(tmp_path / "cell.npz", [[PROVED], [narrow]]))
    (part,) = found.open_parts([-1.0, 0, 0], [1.0, 0, 0])
    assert (part.start, part.end) == (pytest.approx(0.25, abs=1e-8), pytest.approx(0.75, abs=1e-8))
    assert part.pairs == (("a1", "b1"),)
    assert found.open_parts([-1.0, 0, 0], [-0.6, 0, 0]) == ()
    np.testing.assert_allclose(found.proved_parts([-1.0, 0, 0], [1.0, 0, 0]), [[0, 0.25], [0.75, 1]], atol=1e-8)
    assert found.proved_parts([0.0, 0, 0], [0.4, 0, 0]).shape == (0, 2)
    assert found.contains([[-1.0, 0, 0], [0.0, 0, 0], [0.5, 0, 0], [0.5 + 1e-8, 0, 0]]).tolist() == [True, False, False, True]


def test_nothing_beyond_the_limits_is_free(tmp_path: Path) -> None:
    found = FreeSet.load(written(tmp_path / "cell.npz", [[PROVED]]))
    assert found.contains([[2.0, 0, 0], [np.nextafter(2.0, 3), 0, 0]]).tolist() == [True, False]
    assert not found.contains_motion([0, 0, 0], [0, 2.1, 0])
    assert not found.contains_motion(np.full(N, 1e308), np.full(N, -1e308))
    with pytest.raises(RegionError, match=r"b is 2\.1 rad, beyond its limits .its limits are -2 and 2 rad.") as error:
        found.open_parts([0, 0, 0], [0, 2.1, 0])
    assert (error.value.code, error.value.field) == ("outside_limits", "end")


def test_a_motion_may_cross_many_cells(tmp_path: Path) -> None:
    cuts = np.linspace(-1.9, 1.9, 200).tolist()
    comb: Any = PROVED
    for i, cut in reversed(list(enumerate(cuts))):
        comb = (0, cut, OPEN if i % 2 else PROVED, comb)
    found = FreeSet.load(written(tmp_path / "cell.npz", [[comb], [comb, PROVED]]))
    for start, end in (([-2.0, 0, 0], [2.0, 0, 0]), ([2.0, 0, 0], [-2.0, 0, 0])):
        parts = found.open_parts(start, end)
        assert len(parts) == 100
        assert all(part.pairs == (("a0", "b0"),) for part in parts)
        assert sum(part.end - part.start for part in parts) == pytest.approx(100 * (cuts[1] - cuts[0]) / 4, abs=1e-6)


normals = st.lists(st.integers(-4, 4).map(lambda k: k / 4), min_size=N, max_size=N).filter(any)
oblique_trees = st.recursive(
    st.sampled_from([PROVED, OPEN, OPEN]),
    lambda parts: st.one_of(
        st.tuples(st.integers(0, N - 1), st.integers(-7, 7).map(lambda k: k / 4), parts, parts),
        st.tuples(st.just(OBLIQUE), st.integers(-8, 8).map(lambda k: k / 8), st.just(PROVED), parts, normals),
    ),
    max_leaves=10,
)


def room_in(tree: Any, q: np.ndarray, s: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How deep configurations (k, N) are in a proved part of a tree, and in an open one; below 0 outside. Depths are those of q or s."""
    deep = np.minimum((q - box[0]).min(axis=1), (box[1] - q).min(axis=1))
    if isinstance(tree, int):
        nowhere = np.full(len(q), -np.inf)
        return (deep, nowhere) if tree == PROVED else (nowhere, deep)
    joint, cut, low, high, *normal = tree
    if normal:
        before = cut - s @ np.array(normal[0])
        proved, open_ = room_in(high, q, s, box)
        return np.maximum(proved, np.minimum(deep, before)), np.minimum(open_, -before)
    middle = box[0, joint] < cut < box[1, joint]
    below, above = box.copy(), box.copy()
    below[1, joint] = above[0, joint] = cut
    parts = [room_in(part, q, s, part_box) for part, part_box in ((low, below), (high, above))] if middle else []
    if not middle:
        return room_in(low, q, s, box)
    return np.maximum(*(part[0] for part in parts)), np.maximum(*(part[1] for part in parts))


def inside_limits(tree: Any, box: np.ndarray) -> Any:
    """The tree without the cuts in joints that miss their cells."""
    if isinstance(tree, int):
        return tree
    joint, cut, low, high, *normal = tree
    if normal:
        return joint, cut, low, inside_limits(high, box), *normal
    if not box[0, joint] < cut < box[1, joint]:
        return inside_limits(low, box)
    below, above = box.copy(), box.copy()
    below[1, joint] = above[0, joint] = cut
    return joint, cut, inside_limits(low, below), inside_limits(high, above)


@settings(deadline=None, max_examples=200)
@given(oblique_trees, st.lists(st.tuples(grids(15), grids(15)), min_size=1, max_size=4), st.lists(st.booleans(), min_size=N, max_size=N))
def test_oblique_cuts_are_half_spaces_of_s(tmp_path_factory, drawn, motions, revolute) -> None:
    """Of a motion, as many configurations are looked at as its answer leaves no room for."""
    box = np.array([[-LIMIT] * N, [LIMIT] * N])
    tree = inside_limits(drawn, box)
    found = FreeSet.load(written(tmp_path_factory.mktemp("free") / "cell.npz", [[tree]], revolute=np.array(revolute)))
    t = np.linspace(0.0, 1.0, 401)[:, None]
    for start, end in np.array(motions):
        q = start + t * (end - start)
        proved, open_ = room_in(tree, q, found.to_s(q), box)
        holds = found.contains(q)
        assert not (holds & (open_ > 1e-6) & (proved < -1e-6)).any()
        assert holds[proved > 1e-6].all()
        along = found.contains_motion(start, end)
        assert holds.all() or not along
        parts = found.proved_parts(start, end)
        for first, last in parts:
            assert (proved[(t[:, 0] > first) & (t[:, 0] < last)] > -1e-6).all()
        reach = np.zeros(len(t), bool)
        for first, last in parts:
            reach |= (t[:, 0] >= first - 1e-4) & (t[:, 0] <= last + 1e-4)
        assert along == (parts.tolist() == [[0.0, 1.0]])
        # One oblique cut is passed at most twice; what lies between three ranges may be left out (ciris.lookups).
        if not (np.diff((proved > 0).astype(int)) != 0).sum() > 2:
            assert reach[proved > 1e-2].all()


@settings(deadline=None, max_examples=200)
@given(st.lists(st.lists(oblique_trees, min_size=1, max_size=2), min_size=1, max_size=2), grids(15), st.sampled_from([np.inf, 1.0]))
def test_before_oblique_cuts_the_nearest_is_free_and_no_sample_is_much_nearer(tmp_path_factory, drawn, q, closer_than) -> None:
    box = np.array([[-LIMIT] * N, [LIMIT] * N])
    wanted = [[inside_limits(tree, box) for tree in members] for members in drawn]
    found = FreeSet.load(written(tmp_path_factory.mktemp("free") / "cell.npz", wanted))
    closest = found.nearest(q, closer_than=closer_than)
    around = np.random.default_rng(0).uniform(-LIMIT, LIMIT, (20_000, N))
    samples = np.concatenate([around, q + 0.2 * around, q + 0.02 * around])
    samples = samples[found.contains(samples)]
    nearest_sample = np.linalg.norm(found.to_s(samples) - found.to_s(q), axis=1).min(initial=np.inf)
    if closest.q is None:
        assert nearest_sample >= closer_than - 2e-3 or not closest.complete
    else:
        assert found.contains(closest.q)
        assert closest.distance == pytest.approx(np.linalg.norm(found.to_s(closest.q) - found.to_s(q)), abs=1e-12)
        assert closest.distance < closer_than
        assert closest.distance <= nearest_sample + 2e-3 or not closest.complete


def test_what_an_oblique_cut_proves_is_nearer(tmp_path: Path) -> None:
    tree = (0, -1.5, PROVED, (OBLIQUE, 0.0, PROVED, OPEN, [1.0, 0.0, 0.0]))
    found = FreeSet.load(written(tmp_path / "cell.npz", [[tree]]))
    closest = found.nearest([0.5, 0.0, 0.0])
    assert found.contains(closest.q)
    assert closest.q == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)
    assert closest.distance == pytest.approx(np.tan(0.25), abs=1e-4)


def test_a_file_from_before_there_were_oblique_cuts_is_read(tmp_path: Path) -> None:
    path = written(tmp_path / "cell.npz", [[(0, 0.0, PROVED, OPEN)]], head={"format": 1})
    with np.load(path) as arrays:
        np.savez(path, **{name: array for name, array in arrays.items() if name != "normals"})
    assert FreeSet.load(path).contains([[-1.0, 0, 0], [1.0, 0, 0]]).tolist() == [True, False]


def nearest_free(cells: list[list[list[Leaf]]], found: FreeSet, q: np.ndarray) -> float:
    """The distance in s from q to the nearest cell of all trees that is free; boundaries between cells are looked at as well."""
    s, least = found.to_s(q), np.inf
    ends = [
        sorted({float(x) for members in cells for boxes in members for low, high, _ in boxes for x in (low[j], high[j])}) for j in range(N)
    ]
    # Between two neighbouring ends, all configurations have the same answer.
    for slab in itertools.product(*(itertools.pairwise(each) for each in ends)):
        low, high = np.array(slab).T
        if free_at(cells, [Fraction(x) for x in ((low + high) / 2).tolist()]):
            least = min(least, float(np.linalg.norm(found.to_s(np.clip(q, low, high)) - s)))
    return least


@settings(deadline=None, max_examples=300)
@given(clauses, st.lists(grids(20), min_size=1, max_size=4), st.sampled_from([np.inf, 1.0, 0.3]))
def test_the_nearest_is_free_and_nothing_free_is_nearer(tmp_path_factory, drawn, configurations, closer_than) -> None:
    lower, upper = [-LIMIT] * N, [LIMIT] * N
    wanted = [[within(tree, lower, upper) for tree in members] for members in drawn]
    found = FreeSet.load(written(tmp_path_factory.mktemp("free") / "cell.npz", wanted))
    cells = [[leaves(tree, [Fraction(-2)] * N, [Fraction(2)] * N) for tree in members] for members in wanted]
    for q in np.array(configurations):
        closest, expected = found.nearest(q, closer_than=closer_than), nearest_free(cells, found, q)
        assert closest.complete
        if closest.q is None:
            assert closest.distance is None
            assert expected >= closer_than - 1e-7
        else:
            assert found.contains(closest.q)
            assert found.contains(found.to_q(found.to_s(closest.q)))
            assert closest.distance < closer_than
            assert closest.distance == pytest.approx(np.linalg.norm(found.to_s(closest.q) - found.to_s(q)), rel=1e-12)
            assert closest.distance == pytest.approx(expected, abs=1e-7)
            assert closest.distance > 0 or (closest.q == q).all()


def grown(rng: np.random.Generator, lower: np.ndarray, upper: np.ndarray, depth: int) -> Any:
    """A tree with random cuts, two fifths of whose cells are open."""
    if depth == 0:
        return OPEN if rng.random() < 0.4 else PROVED
    joint = int(rng.integers(N))
    cut = rng.uniform(lower[joint], upper[joint])
    on = np.arange(N) == joint
    return joint, cut, grown(rng, lower, np.where(on, cut, upper), depth - 1), grown(rng, np.where(on, cut, lower), upper, depth - 1)


def test_the_nearest_of_thousands_of_cells_is_free_and_no_sample_is_nearer(tmp_path: Path) -> None:
    rng, limits = np.random.default_rng(0), np.full(N, LIMIT)
    clauses = [[grown(rng, -limits, limits, 9) for _ in range(count)] for count in (1, 1, 1, 1, 2, 1)]
    found = FreeSet.load(written(tmp_path / "cell.npz", clauses))
    q = rng.uniform(-LIMIT, LIMIT, (100_000, N))
    s = found.to_s(q[found.contains(q)])
    assert 0.02 < len(s) / len(q) < 0.2
    asked = rng.uniform(-1.2 * LIMIT, 1.2 * LIMIT, (200, N))
    closest = [found.nearest(each) for each in asked]
    for each, near in zip(asked, closest, strict=True):
        assert near.complete
        assert found.contains(near.q)
        assert near.distance <= np.linalg.norm(s - found.to_s(each), axis=1).min()
    hard = int(np.argmax([near.boxes for near in closest]))
    assert closest[hard].boxes > 50
    early = found.nearest(asked[hard], boxes=20)
    assert not early.complete
    assert found.contains(early.q)
    assert early.distance >= closest[hard].distance


def test_bad_questions_are_named(tmp_path: Path) -> None:
    found = FreeSet.load(written(tmp_path / "cell.npz", [[PROVED]]))
    for ask, code in (
        (lambda: found.contains([0, 0]), "wrong_length"),
        (lambda: found.contains([0, np.nan, 0]), "points"),
        (lambda: found.contains_motion([[0, 0, 0]], [0, 0, 0]), "motion"),
        (lambda: found.open_parts([[0, 0, 0]], [[0, 0, 0]]), "motion"),
        (lambda: found.nearest([[0, 0, 0]]), "wrong_length"),
        (lambda: found.nearest([0, 0, 4]), "outside_window"),
    ):
        with pytest.raises(RegionError) as error:
            ask()
        assert error.value.code == code


@settings(deadline=None, max_examples=150)
@given(
    st.sampled_from(["joint", "cut", "upper", "root", "first", "tree", "q_lower"]),
    st.integers(0, 20),
    st.sampled_from([-(2**31), -(2**15), -3, -1, 0, 1, 2, 5, 2**15 - 1, 2**31 - 1]),
    st.booleans(),
)
def test_arrays_that_lead_elsewhere_are_refused_or_harmless(tmp_path_factory, name, at, value, short) -> None:
    tree = (0, 0.0, (1, 0.5, PROVED, OPEN), PROVED)
    path = written(tmp_path_factory.mktemp("free") / "cell.npz", [[tree, tree], [PROVED]])
    with np.load(path) as arrays:
        kept = dict(arrays)
    if short:
        kept[name] = kept[name][: at % len(kept[name])]
    else:
        largest = np.iinfo(np.int16 if name == "joint" else np.int32)
        kept[name][at % len(kept[name])] = np.clip(value, largest.min, largest.max)
    np.savez(path, **kept)
    with suppress(CirisError):
        found = FreeSet.load(path)
        found.contains(np.zeros((2, N)))
        found.contains_motion([[-1.0, -1, -1]], [[1.0, 1, 1]])


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 10**6), st.integers(0, 255), st.booleans())
def test_a_damaged_file_is_named_or_says_the_same(tmp_path_factory, at, value, short) -> None:
    path = written(tmp_path_factory.mktemp("free") / "cell.npz", [[(0, 0.0, (1, 0.5, PROVED, OPEN), PROVED)], [PROVED]])
    with np.load(path) as arrays:
        np.savez_compressed(path, **arrays)
    data = bytearray(path.read_bytes())
    data[at % len(data)] = value
    path.write_bytes(data[: at % len(data)] if short else data)
    try:
        found = FreeSet.load(path)
    except CirisError as error:
        told = error.code
    else:
        told = found.contains([[-1.0, 1, 0], [1.0, 1, 0]]).tolist()
    assert told in ("free_set", [False, True])


@pytest.mark.parametrize(
    "changes",
    [
        {"first": np.array([0, 2**31 - 1, 2 - 2**31, 3], np.int32)},
        {"joint": np.array([65535] * 3)},
        {"root": np.array([0, 0, 0], np.int32)},
        {"q_lower": np.full(N, np.nan)},
        {"q_lower": np.full(N, 3.0)},
        {"more": np.zeros(1)},
        {"head": {"joints": [1, 2, 3]}},
        {"head": {"clauses": []}},
        {"normals": np.zeros((1, N))},
    ],
    ids=lambda changes: "-".join(changes),
)
def test_what_loops_would_read_beyond_its_end_is_refused(tmp_path: Path, changes: dict[str, Any]) -> None:
    path = written(tmp_path / "cell.npz", [[PROVED], [PROVED], [PROVED]], **changes)
    with pytest.raises(CirisError) as error:
        FreeSet.load(path)
    assert error.value.code == "free_set"


def test_nodes_that_two_others_share_are_no_tree(tmp_path: Path) -> None:
    joint, upper = np.array([0, 0, PROVED, OPEN], np.int16), np.array([2, 3, 0, 0], np.int32)
    path = written(tmp_path / "cell.npz", [[PROVED]], joint=joint, upper=upper, cut=np.zeros(4))
    with pytest.raises(CirisError, match="damaged"):
        FreeSet.load(path)


def test_the_file_means_the_same_to_those_who_write_and_read_it() -> None:
    wanted = (free_set.FORMAT, free_set.PROVED, free_set.OPEN, partition.OBLIQUE, limits.CUT_DEPTH)
    assert wanted == (ciris.free_set.FORMAT, lookups.PROVED, lookups.OPEN, lookups.OBLIQUE, lookups.DEPTH)


def test_what_is_no_free_set_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, empty = tmp_path / "text", tmp_path / "empty.npz"
    text.write_text("nothing")
    np.savez(empty, head=np.array("{}"))
    newer = written(tmp_path / "newer.npz", [[PROVED]], head={"format": 3})
    for path, code in ((tmp_path / "missing.npz", "no_file"), (text, "free_set"), (empty, "free_set"), (newer, "free_set")):
        with pytest.raises(CirisError) as error:
            FreeSet.load(path)
        assert (error.value.code, error.value.field) == (code, str(path))
    monkeypatch.setitem(sys.modules, "numba", None)
    monkeypatch.delitem(sys.modules, "ciris.lookups")
    monkeypatch.delattr(ciris, "lookups")
    with pytest.raises(CirisError, match="numba is not installed"):
        FreeSet.load(empty)


def test_no_place_for_what_is_compiled_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "cell.npz", [[PROVED]])
    program = (
        "import numba.core.caching as caching\n"
        "for locator in caching.CacheImpl._locator_classes: locator.from_function = classmethod(lambda *_: None)\n"
        f"import ciris\ntry: ciris.FreeSet.load({str(path)!r})\n"
        "except ciris.CirisError as error: print(error.code, error.hint)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("no_cache set NUMBA_CACHE_DIR")
