"""Pieces of work on a map travel between processes as bytes: tasks to who works on them, and back what was found."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from certifier.map.growing import Task
from certifier.map.pair import Found, OpenCells, Proved
from certifier.map.trees import Pairs
from certifier.model import Array, Scene

OF_TREES = ("looked", "nodes", "cuts", "normals")
"""These fields of certifier.map.pair.Found are arrays or numbers."""


class Entry(NamedTuple):
    """What was found for a task.

    Attributes:
        pairs: which name the tree.
        nodes: the open nodes of the tree that the task began with.
    """

    pairs: Pairs
    nodes: Array
    found: Found


def pack_tasks(scene: Scene, tasks: Sequence[Task]) -> bytes:
    """Returns tasks as bytes. What only the map needs to know of them stays behind: the numbers of samples."""
    return _bytes(({**_named(scene, task), **_cells(task.given)} for task in tasks), ("samples", "weights", "most", "water"), tasks)


def unpack_tasks(scene: Scene, data: bytes) -> list[Task]:
    """Returns tasks from their bytes; the numbers of their samples are those among the task's own."""
    return [
        Task(
            _pairs(scene, one), one["places"], np.arange(len(one["samples"])), _open_cells(one), one["samples"], one["weights"],
            int(one["most"]), float(one["water"]),
        )
        for one in _read(data)
    ]  # fmt: skip


def pack_entries(scene: Scene, entries: Sequence[Entry]) -> bytes:
    """Returns what was found for tasks as bytes."""
    parts = ({**_named(scene, one), **_cells(one.found.left), **one.found.proved._asdict()} for one in entries)
    return _bytes(parts, OF_TREES, [one.found for one in entries], small=True)


def unpack_entries(scene: Scene, data: bytes) -> list[Entry]:
    """Returns what was found for tasks from its bytes."""
    return [Entry(_pairs(scene, one), one["places"], _found(one)) for one in _read(data)]


def _found(one: dict[str, Array]) -> Found:
    proved = Proved(*(one[field] for field in Proved._fields))
    return Found(int(one["looked"]), one["nodes"], one["cuts"], one["normals"], proved, _open_cells(one))


def _named(scene: Scene, one: Task | Entry) -> dict[str, Any]:
    number = {pair: i for i, pair in enumerate(scene.pairs)}
    return {"pairs": np.array([number[pair] for pair in one.pairs]), "places": one.nodes}


def _pairs(scene: Scene, one: dict[str, Array]) -> Pairs:
    return tuple(scene.pairs[i] for i in one["pairs"])


def _cells(cells: OpenCells) -> dict[str, Array]:
    return {f"cells.{field}": getattr(cells, field) for field in OpenCells._fields}


def _open_cells(one: dict[str, Array]) -> OpenCells:
    return OpenCells(*(one[f"cells.{field}"] for field in OpenCells._fields))


def _bytes(parts: Iterable[dict[str, Any]], fields: Sequence[str], values: Sequence[Any], *, small: bool = False) -> bytes:
    """Returns arrays by name as an npz file, those of each part under its number.

    Args:
        small: whether to take the time to make the file smaller.
    """
    arrays = {
        f"{i}/{name}": array
        for i, (part, value) in enumerate(zip(parts, values, strict=True))
        for name, array in (*part.items(), *((field, getattr(value, field)) for field in fields))
    }
    written = io.BytesIO()
    (np.savez_compressed if small else np.savez)(written, **arrays)
    return written.getvalue()


def _read(data: bytes) -> list[dict[str, Array]]:
    found: dict[int, dict[str, Array]] = {}
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        for name in arrays.files:
            number, _, field = name.partition("/")
            found.setdefault(int(number), {})[field] = arrays[name]
    return list(found.values())
