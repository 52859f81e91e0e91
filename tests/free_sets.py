"""Free sets made by hand, for tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

N = 3
LIMIT = 2.0
PROVED, OPEN, OBLIQUE = -1, -2, 127


def written(path: Path, wanted: list[list[Any]], **changes: Any) -> Path:
    """A file as ``ciris free-set`` writes them. A node is a leaf; or joint, cut, lower and upper part, and the normal of an oblique cut."""
    joint, cut, upper, root, first, tree, normals = [], [], [], [], [0], [], []

    def add(node: Any) -> None:
        at = len(joint)
        joint.append(node if isinstance(node, int) else node[0])
        cut.append(0.0 if isinstance(node, int) else node[1])
        upper.append(0)
        if not isinstance(node, int):
            normals.extend(node[4:])
            add(node[2])
            upper[at] = len(joint)
            add(node[3])

    for members in wanted:
        for node in members:
            root.append(len(joint))
            tree.append(len(tree))
            add(node)
        first.append(len(tree))
    head = {
        "format": 2,
        "scene": "0" * 64,
        "name": "cell",
        "joints": ["a", "b", "c"],
        "clauses": [[[f"a{i}", f"b{i}"]] for i in range(len(wanted))],
    }
    arrays = {
        "q_star": np.zeros(N),
        "q_lower": np.full(N, -LIMIT),
        "q_upper": np.full(N, LIMIT),
        "revolute": np.ones(N, bool),
        "joint": np.array(joint, np.int16),
        "cut": np.array(cut),
        "upper": np.array(upper, np.int32),
        "normals": np.array(normals, float).reshape(-1, N),
        "root": np.array(root, np.int32),
        "first": np.array(first, np.int32),
        "tree": np.array(tree, np.int32),
    }
    head |= changes.pop("head", {})
    np.savez(path, head=np.array(json.dumps(head)), **(arrays | changes))
    return path
