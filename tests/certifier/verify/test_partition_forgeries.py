"""Files over partitions that break one rule of docs/proofs.md each: refused for it, and accepted by a verifier that does not check it.

The check is taken away by name: the one condition in the verifier's source is replaced, and nothing else. test_partition.py has what no
verifier could read, such as streams that are too short.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.model import WORLD, Volume
from certifier.proof import limits
from certifier.proof.container import with_scene
from certifier.proof.partition import EMPTY, PLANE, PartitionProof
from certifier.verify import coarse, file, partition, separations, streams
from certifier.verify.file import verify_file
from tests.certifier.verify.partitions import Producer
from tests.certifier.verify.test_partition import arm, proof


@dataclass(frozen=True)
class Forgery:
    """A file that breaks a rule.

    Attributes:
        name: the rule.
        make: the proof in the file.
        reason: what the error says, as a regular expression.
        where: the function with the check, and the object that holds the function.
        check: the condition in its source; and what takes its place.
    """

    name: str
    make: Callable[[], PartitionProof]
    reason: str
    where: tuple[Any, str]
    check: str
    instead: str = "False"


def with_entry(array: np.ndarray, *entries: Any) -> np.ndarray:
    return np.concatenate([array, np.array(entries, dtype=array.dtype).reshape(-1, *array.shape[1:])])


def with_value(array: np.ndarray, at: Any, value: Any) -> np.ndarray:
    other = array.copy()
    other[at] = value
    return other


@cache
def one_leaf() -> PartitionProof:
    """A true proof of one cell without multipliers."""
    true = Producer(arm(), arm().pairs[1], WORLD, [-0.2, -0.1], 0.1).proof()
    assert true is not None
    assert true.nodes.tolist() == [PLANE]
    assert not true.counts.any()
    return true


def cut(at: Callable[[PartitionProof], float]) -> PartitionProof:
    """The one cell cut in two, with the same plane on both sides."""
    true = one_leaf()
    return replace(
        true,
        nodes=np.array([0, PLANE, PLANE], np.int8),
        cuts=np.array([at(true)]),
        planes=np.repeat(true.planes, 2, axis=0),
        choices=np.repeat(true.choices, 2),
        pieces=np.tile(true.pieces, 2),
        counts=np.tile(true.counts, 2),
    )


def half_a_tree() -> PartitionProof:
    """The cell cut in two, of which only the lower part has a plane: the upper one is not there."""
    true = one_leaf()
    return replace(true, nodes=np.array([0, PLANE], np.int8), cuts=true.ground.mid[:1])


def one_plane_more() -> PartitionProof:
    """A plane with its choice, its pieces and their counts, which no node reads."""
    true = one_leaf()
    two = {name: np.concatenate([getattr(true, name)] * 2) for name in ("planes", "choices", "pieces", "counts")}
    return replace(true, **two)


def one_choice_more() -> PartitionProof:
    true = one_leaf()
    return replace(one_plane_more(), planes=true.planes)


def emptied(multipliers: list[float]) -> PartitionProof:
    """A cell cut in two, of which the upper one is EMPTY, with these multipliers of the upper and the lower end of the first joint."""
    true = cut(lambda true: float(true.ground.mid[0]))
    half = len(true.pieces) // 2
    return replace(
        true,
        nodes=np.array([0, PLANE, EMPTY], np.int8),
        planes=true.planes[:1],
        choices=true.choices[:1],
        pieces=true.pieces[:half],
        counts=with_entry(true.counts[:half], len(multipliers)),
        faces=np.array([0, true.scene.n][: len(multipliers)], np.int16),
        multipliers=np.array(multipliers, np.float32),
    )


def another_kind_of_piece() -> PartitionProof:
    true = proof("band")
    return replace(true, pieces=with_value(true.pieces, np.flatnonzero(true.pieces == EMPTY)[0], EMPTY - 1))


def a_face_from_behind() -> PartitionProof:
    """The last row of C by the number -1."""
    true = proof("corners")
    last = len(true.ground.d) - 1
    assert (true.faces == last).any()
    return replace(true, faces=with_value(true.faces, true.faces == last, -1))


def a_choice_from_behind() -> PartitionProof:
    """The last pair of volumes by the number -1."""
    true = proof("ball")
    last = len(true.chosen) - 1
    assert (true.choices == last).any()
    return replace(true, choices=with_value(true.choices, true.choices == last, -1))


def shorter_normal() -> PartitionProof:
    """A ball is measured by a kappa that is half of the normal's length."""
    true = proof("tip")
    return replace(true, planes=with_value(true.planes, np.s_[:, 4], true.planes[:, 4] / 2))


def moved_plane() -> PartitionProof:
    """The plane of one cell 10 m away: the first body is on its other side."""
    true = one_leaf()
    return replace(true, planes=with_value(true.planes, (0, 3, 0), true.planes[0, 3, 0] - 10 * np.linalg.norm(true.planes[0, :3, 0])))


def smaller_volume() -> PartitionProof:
    """The first volume is half as large as the bar that it should hold."""
    true = proof("cells")
    first, second = true.volumes
    middle = first.vertices.mean(axis=0)
    return replace(true, volumes=(replace(first, vertices=middle + 0.5 * (first.vertices - middle)), second))


def smaller_ball() -> PartitionProof:
    true = proof("ball")
    (ball,), none = true.coarse
    return replace(true, coarse=((replace(ball, radius=0.9 * ball.radius),), none))


def unused(count: int, name: str) -> tuple[Volume, ...]:
    """Balls about the world's origin that hold a geometry behind its joints."""
    return tuple(Volume((name,), WORLD, np.zeros((1, 3)), 10.0 + i) for i in range(count))


def with_coarse(count: int, name: str) -> PartitionProof:
    """More coarse volumes for the first volume; no leaf chooses them."""
    true = proof("ball")
    (ball,), none = true.coarse
    assert none == ()
    return replace(true, coarse=((ball, *unused(count, name)), none))


def other_axes() -> PartitionProof:
    """A ball's geometry is one that does not move against it: it is no coarse volume."""
    true = proof("ball")
    (ball,), none = true.coarse
    fixed = Volume(ball.geometries, "arm/link2", np.zeros((1, 3)), 10.0)
    return replace(true, coarse=((ball, fixed), none))


def smaller_box() -> PartitionProof:
    """The cells cover half of the polytope."""
    true = one_leaf()
    return replace(true, ground=replace(true.ground, half=true.ground.half / 2))


FORGERIES = (
    Forgery(
        "a cut is inside of the cell: above",
        lambda: cut(lambda true: float(true.ground.mid[0] + 1.001 * true.ground.half[0])),
        "is cut at .* outside of the cell",
        (streams.Cuts, "cells"),
        "not lower[i] < cut < upper[i]",
    ),
    Forgery(
        "a cut is inside of the cell: below",
        lambda: cut(lambda true: float(true.ground.mid[0] - 1.001 * true.ground.half[0])),
        "is cut at .* outside of the cell",
        (streams.Cuts, "cells"),
        "not lower[i] < cut < upper[i]",
    ),
    Forgery(
        "the tree of cuts is whole",
        half_a_tree,
        "the tree of cuts ends before or after its last node",
        (streams.Cuts, "__init__"),
        "len(ends) != trees or ends[-1] != len(nodes)",
    ),
    Forgery(
        "no cut is left unread",
        lambda: replace(one_leaf(), cuts=np.array([0.05])),
        "there are 1 cuts for 0 nodes",
        (streams.Cuts, "__init__"),
        "len(proof.cuts) != np.count_nonzero(nodes >= 0)",
    ),
    Forgery(
        "no plane is left unread",
        one_plane_more,
        "the planes are",
        (streams.Cuts, "__init__"),
        "proof.planes.shape != (np.count_nonzero(nodes == PLANE), 5, 1 + len(play))",
    ),
    Forgery(
        "no choice is left unread",
        one_choice_more,
        "choices are not one of",
        (streams.Pieces, "__init__"),
        "len(choices) != len(proof.planes)",
    ),
    Forgery(
        "a choice is of two volumes that are there",
        a_choice_from_behind,
        "choices are not one of",
        (streams.Pieces, "__init__"),
        "((choices >= 0) & (choices < len(self._vertices))).all()",
        "True",
    ),
    Forgery(
        "a piece is of a kind that is known",
        another_kind_of_piece,
        "a piece is halved along an axis that is not there, or is of no kind",
        (streams.Pieces, "__init__"),
        "pieces.min() >= EMPTY",
        "True",
    ),
    Forgery(
        "no piece is left unread",
        lambda: replace(one_leaf(), pieces=with_entry(one_leaf().pieces, PLANE), counts=with_entry(one_leaf().counts, 0)),
        "the pieces are not .* trees, one for each vertex",
        (streams.Pieces, "__init__"),
        "len(self._bounds) != 1 + self._first[-1] or self._bounds[-1] != len(pieces)",
    ),
    Forgery(
        "no count is left unread",
        lambda: replace(one_leaf(), counts=with_entry(one_leaf().counts, 0)),
        "counts of multipliers, for",
        (streams.Multipliers, "__init__"),
        "len(counts) != wanted",
    ),
    Forgery(
        "no multiplier is left unread",
        lambda: replace(one_leaf(), faces=np.zeros(1, np.int16), multipliers=np.ones(1, np.float32)),
        "1 faces and 1 multipliers where 0 belong",
        (streams.Multipliers, "__init__"),
        "not len(self._faces) == len(proof.multipliers) == total",
    ),
    Forgery(
        "a multiplier is of a face that is there",
        a_face_from_behind,
        "a multiplier is of a face that is not there",
        (streams.Multipliers, "__init__"),
        "self._faces.min() >= 0",
        "True",
    ),
    Forgery(
        "multipliers are not negative",
        lambda: emptied([-1.0, -1.0]),
        "a multiplier is negative or not finite",
        (streams.Multipliers, "__init__"),
        "proof.multipliers.min() >= 0",
        "True",
    ),
    Forgery(
        "an empty leaf misses the polytope",
        lambda: emptied([]),
        "the multipliers do not prove that it misses the polytope",
        (partition.CellCheck, "_check_empty"),
        "~(value > rounding(size, sums.count)) | ~np.isfinite(value)",
        "~np.isfinite(value)",
    ),
    Forgery(
        "every vertex is on its side of the plane",
        moved_plane,
        "the multipliers do not prove that it is on its side of the plane",
        (partition.CellCheck, "_margins"),
        "~((t > 0) & finite)",
        "~finite",
    ),
    Forgery(
        "kappa bounds the normal",
        shorter_normal,
        "kappa does not bound the plane's normal",
        (partition.CellCheck, "_gap"),
        "~(room >= 0)",
        "~np.isfinite(room)",
    ),
    Forgery(
        "a volume contains its geometries",
        smaller_volume,
        "volume",
        (partition.PartitionCheck, "prepared"),
        "check_volume(scene, kinematics, volume)",
        "pass",
    ),
    Forgery(
        "a coarse volume contains its geometries",
        smaller_ball,
        "may leave the coarse volume that stands for it",
        (coarse, "check_coarse"),
        "reach + exact(geometry.radius) > exact(volume.radius)",
    ),
    Forgery(
        "a coarse volume has the geometries of the volume that it stands for",
        lambda: with_coarse(1, "arm/link1/bar"),
        "a coarse volume has other geometries than the one that it stands for",
        (partition.PartitionCheck, "prepared"),
        "other.geometries != volume.geometries",
    ),
    Forgery(
        "revolute joints lead from a coarse volume to its geometries",
        other_axes,
        "is not behind revolute joints of arm/link2",
        (partition.PartitionCheck, "prepared"),
        "check_coarse(scene, kinematics, other)",
        "pass",
    ),
    Forgery(
        "the box is around the polytope",
        smaller_box,
        "the multipliers do not prove the box around the polytope",
        (separations, "verify_separation"),
        "check_ground(proof.scene, proof.ground)",
        "pass",
    ),
)


def without(monkeypatch: pytest.MonkeyPatch, where: tuple[Any, str], check: str, instead: str) -> None:
    """Replaces one condition in the source of one function, and where the function was imported."""
    owner, name = where
    function = getattr(owner, name)
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(check) == 1
    found: dict[str, Any] = {}
    # The names of a module's future are not in what is compiled of it.
    code = "from __future__ import annotations\n" + source.replace(check, instead)
    exec(compile(code, inspect.getfile(function), "exec"), function.__globals__, found)
    monkeypatch.setattr(owner, name, found[name])
    if inspect.ismodule(owner):
        for module in (partition, separations, file):
            if getattr(module, name, None) is function:
                monkeypatch.setattr(module, name, found[name])


def file_of(forgery: Forgery) -> bytes:
    forged = forgery.make()
    return with_scene(forged.to_bytes(), forged.scene)


@pytest.mark.parametrize("forgery", FORGERIES, ids=lambda forgery: forgery.name)
def test_a_forged_file_is_refused_for_the_rule_that_it_breaks(forgery):
    with pytest.raises(ProofError, match=forgery.reason):
        verify_file(file_of(forgery))


@pytest.mark.parametrize("forgery", FORGERIES, ids=lambda forgery: forgery.name)
def test_nothing_but_the_check_refuses_it(forgery, monkeypatch):
    """So the file breaks this rule alone, and the check is needed."""
    data = file_of(forgery)
    without(monkeypatch, forgery.where, forgery.check, forgery.instead)
    assert verify_file(data).kind == "partition"


def test_there_are_at_most_ten_coarse_volumes(monkeypatch):
    name = proof("ball").volumes[0].geometries[0]
    data = [with_scene(forged.to_bytes(), forged.scene) for forged in (with_coarse(9, name), with_coarse(10, name))]
    assert verify_file(data[0]).kind == "partition"
    with pytest.raises(ProofError, match="at most 10"):
        verify_file(data[1])
    monkeypatch.setattr(limits, "COARSE", 11)
    assert verify_file(data[1]).kind == "partition"
