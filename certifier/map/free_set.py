"""The free set of a map is made here: its cells without their proofs, in joint positions, for quick lookups (ciris.free_set).

A configuration is in the free set if each *clause* holds there: one of the clause's trees has a proved cell at it. Each pair of bodies has
the trees that are about it; pairs with the same ones share a clause.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit

from certifier.conditions import called
from certifier.errors import ProofError
from certifier.model import Array, Pair, Scene
from certifier.proof.map import MapProof, PairMap
from certifier.proof.partition import OBLIQUE, PLANE
from certifier.proof.sub_scene import sub_scene
from certifier.verify.file import read_file
from certifier.verify.map import verify_map

FORMAT = 2
"""Version of the file."""
PROVED, OPEN = -1, -2
"""These nodes of a tree are leaves."""
HAIR = 2e-9
"""Oblique cuts are moved back by what HAIR in each joint changes at most, radians or metres; where a joint's limits are beyond 1, HAIR is a
part of the larger one. Lookups need half of it (ciris.free_set), and the rest is more than what they round.
"""


def of_file(payload: dict[str, Any]) -> dict[str, Any]:
    """Checks a map's file, and returns its free set as a file. It runs in a child process, because the map may come from a stranger.

    Args:
        payload: ``path`` of the map and ``processes``.

    Returns:
        The ``free_set`` as a file, in base 64, the ``name`` of the scene, and numbers of ``nodes`` and of proved ``cells``.

    Raises:
        CirisError: no_file.
        ProofError: the file is no map, or does not hold.
    """
    data = read_file(payload["path"])
    statement = verify_map(data, payload["processes"])
    proof = MapProof.from_bytes(data)
    arrays = free_set(proof)
    file = base64.b64encode(as_file(arrays)).decode()
    return {"name": proof.scene.name, "cells": statement.cells, "nodes": len(arrays["joint"]), "free_set": file}


def as_file(arrays: dict[str, Any]) -> bytes:
    """Returns what :func:`free_set` gives as a file."""
    written = io.BytesIO()
    np.savez_compressed(written, **arrays)
    return written.getvalue()


def checked(payload: dict[str, Any]) -> dict[str, Any]:
    """Checks a map's file, in a child process, and returns the ``sha256`` of the file that holds.

    Args:
        payload: as for :func:`of_file`.

    Raises:
        CirisError, ProofError: as :func:`of_file`.
    """
    data = read_file(payload["path"])
    verify_map(data, payload["processes"])
    return {"sha256": hashlib.sha256(data).hexdigest()}


def free_set(proof: MapProof) -> dict[str, Any]:
    """Returns the arrays of a verified map's free set, as ciris.lookups.Cells names them, and a ``head`` as JSON.

    Raises:
        ProofError: no_pairs, for a scene without pairs; not_covered, where a pair has no proved cell, so that no configuration is free.
    """
    scene = proof.scene
    if not scene.pairs:
        raise ProofError("no_pairs", "the scene has no pairs of bodies, so nothing can collide", field="scene", hint="it needs no free set")
    kept = [(pairs, part) for pairs, part in zip(proof.pairs, proof.maps, strict=True) if (part.nodes == PLANE).any()]
    trees = [_tree(scene, pairs, part) for pairs, part in kept]
    about: dict[Pair, list[int]] = {pair: [] for pair in scene.pairs}
    for number, (pairs, _) in enumerate(kept):
        for pair in pairs:
            about[pair].append(number)
    alone = next((pair for pair, numbers in about.items() if not numbers), None)
    if alone is not None:
        message = f"{called(alone.a, alone.b)}: no cell is proved, so no configuration is proved to be free"
        raise ProofError("not_covered", message, hint="let the map grow for longer")
    clauses: dict[tuple[int, ...], list[Pair]] = {}
    for pair, numbers in about.items():
        clauses.setdefault(tuple(numbers), []).append(pair)
    sizes = [len(joint) for joint, *_ in trees]
    root = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    head = {
        "format": FORMAT,
        "scene": scene.hash,
        "name": scene.name,
        "joints": [joint.name for joint in scene.moving],
        "clauses": [[[pair.a, pair.b] for pair in pairs] for pairs in clauses.values()],
    }
    uppers = [np.where(joint >= 0, upper + begin, 0) for begin, (joint, _, upper, _) in zip(root, trees, strict=True)]
    return {
        "head": np.array(json.dumps(head)),
        "q_star": scene.q_star,
        "q_lower": scene.q_lower,
        "q_upper": scene.q_upper,
        "revolute": scene.revolute,
        "joint": np.concatenate([joint for joint, *_ in trees]),
        "cut": np.concatenate([cut for _, cut, *_ in trees]),
        "upper": np.concatenate(uppers).astype(np.int32),
        "normals": np.concatenate([normals for *_, normals in trees]),
        "root": root.astype(np.int32),
        "first": np.concatenate([[0], np.cumsum([len(numbers) for numbers in clauses])]).astype(np.int32),
        "tree": np.array([number for numbers in clauses for number in numbers], np.int32),
    }


def _tree(scene: Scene, pairs: Sequence[Pair], part: PairMap) -> tuple[np.ndarray, Array, np.ndarray, Array]:
    """Returns the joint, the cut in q and the upper part of each node of a tree. Parts that are alike all over become one leaf.

    The place of an oblique cut is in s, a hair nearer to where the plane is than in the map. The last array has the normals.
    """
    positions, oblique, of_joint = sub_scene(scene, pairs).positions, part.nodes == OBLIQUE, (part.nodes >= 0) & (part.nodes != OBLIQUE)
    joints = np.where(part.nodes == PLANE, PROVED, OPEN).astype(np.int16)
    joints[of_joint], joints[oblique] = positions[part.nodes[of_joint]], OBLIQUE
    cuts = np.zeros(len(joints))
    cuts[part.nodes >= 0] = part.cuts
    s = np.zeros((np.count_nonzero(of_joint), scene.n))
    of_cuts = np.arange(len(s)), joints[of_joint]
    s[of_cuts] = cuts[of_joint]
    cuts[of_joint] = scene.to_q(s)[of_cuts]
    normals = np.zeros((np.count_nonzero(oblique), scene.n))
    normals[:, positions] = part.normals
    farthest = np.maximum(np.abs(scene.s_lower), np.abs(scene.s_upper))
    hairs = HAIR * np.maximum(1.0, np.maximum(np.abs(scene.q_lower), np.abs(scene.q_upper)))
    cuts[oblique] -= np.abs(normals) @ (hairs * np.where(scene.revolute, (1 + farthest**2) / 2, 1.0))
    kept, cuts, uppers, places = smallest(joints, cuts)
    return kept, cuts, uppers, normals[(np.cumsum(oblique) - 1)[places[kept == OBLIQUE]]]


@njit(cache=True)
def smallest(joint: np.ndarray, cut: Array) -> tuple[np.ndarray, Array, np.ndarray, np.ndarray]:
    """Returns a tree in preorder with its upper parts, without the cuts whose both parts are wholly proved, or wholly open.

    The last array says which of the given nodes each node is.
    """
    N = len(joint)
    kind, size, left = joint.copy(), np.ones(N, np.int32), np.ones(N, np.int32)
    waiting, top = np.empty(N, np.int32), 0
    for node in range(N - 1, -1, -1):
        if joint[node] >= 0:
            lower, upper = waiting[top - 1], waiting[top - 2]
            top -= 2
            size[node] = 1 + size[lower] + size[upper]
            left[node] = 1 + left[lower] + left[upper]
            if kind[lower] < 0 and kind[lower] == kind[upper]:
                kind[node], left[node] = kind[lower], 1
        waiting[top] = node
        top += 1
    joints, cuts, uppers = np.empty(left[0], np.int16), np.zeros(left[0]), np.zeros(left[0], np.int32)
    node, places = 0, np.empty(left[0], np.int64)
    for at in range(left[0]):
        joints[at], places[at] = kind[node], node
        if kind[node] < 0:
            node += size[node]
        else:
            cuts[at], uppers[at] = cut[node], at + 1 + left[node + 1]
            node += 1
    return joints, cuts, uppers, places
