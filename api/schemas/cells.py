"""These models describe how pairs are proved: by which proof, and over which cells of the polytope."""

from __future__ import annotations

from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field

from api.schemas.scenes import PairInfo
from db.states import PairState


class ProofKind(StrEnum):
    """Names the form of a pair's proof."""

    PARTITION = "partition"
    """A plane for each cell of a partition of the polytope."""
    PROGRAM = "program"
    """One plane, which moves with the joints, on all of the polytope."""


class RegionPair(PairInfo):
    """Describes the proof of one pair of a region."""

    kind: ProofKind = Field(description="The form of the proof.")
    cells: int = Field(description="Number of cells of the proof, the leaves of its tree; 1 for one plane on all of the polytope.")
    proved_distance: float | None = Field(
        description="The distance of the padded bodies that the proof happens to show, in metres. They may be many times as far "
        "apart. Null where the proof bounds none."
    )
    margin: float | None = Field(description="The same as `proved_distance`.", deprecated=True)
    shares_with: list[int] = Field(description="Indices of the other pairs that the same proof covers.")


class RegionPairs(BaseModel):
    """Holds the pairs of a region's scene, in the scene's order, each with the proof that the region's file has for it."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "pairs": [
                        {
                            "index": 0,
                            "a": "arm/link2/box",
                            "b": "world/post",
                            "kind": "partition",
                            "cells": 14,
                            "proved_distance": 0.0012,
                            "margin": 0.0012,
                            "shares_with": [1],
                        }
                    ]
                }
            ]
        }
    )

    pairs: list[RegionPair] = Field(description="The pairs, in the scene's order.")


class CellCounts(BaseModel):
    """Counts cells by their state: how many have a plane, how many miss the polytope, and how many are undecided."""

    plane: int = Field(description="Cells with a plane that separates the pair.")
    empty: int = Field(description="Cells that miss the polytope.")
    open: int = Field(description="Cells about which nothing is proved. A certified pair has none.")


class Partition(BaseModel):
    """Holds the cells of one pair: a binary tree of cuts that divides a box around the polytope.

    The tree is a stream in preorder, the lower part of each cut first. To draw it, begin with the root cell, [`lower`, `upper`], and
    cuts it at the values of `cuts`, one after the other, in the joints that `nodes` names.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "pair": {"index": 0, "a": "arm/link2/box", "b": "world/post"},
                    "state": "certified",
                    "certified": True,
                    "iteration": 7,
                    "kind": "partition",
                    "joints": [0, 1],
                    "lower": [-0.6, -0.4],
                    "upper": [0.6, 0.4],
                    "q_star": [0.0, 0.0],
                    "revolute": [True, True],
                    "nodes": [0, -1, 1, -1, -2],
                    "cuts": [0.05, -0.1],
                    "choices": [0, 0],
                    "volumes": [["arm/link2/box", "world/post"]],
                    "counts": {"plane": 2, "empty": 1, "open": 0},
                    "folded": [],
                }
            ]
        }
    )

    pair: PairInfo = Field(description="The pair.")
    state: PairState = Field(description="State of the pair in `iteration`; `certified` for a pair of a region.")
    certified: bool = Field(description="True where a verified proof says that the pair is apart in all cells, on all of the polytope.")
    iteration: int | None = Field(description="The job's iteration that the cells are of; null for a region.")
    kind: ProofKind = Field(description="The form of its proof.")
    joints: list[int] = Field(description="Position indices of the joints in play, ascending: only these are cut.")
    lower: list[float] = Field(description="(n,) lower corner of the root cell, in s.")
    upper: list[float] = Field(description="(n,) upper corner of the root cell, in s.")
    q_star: list[float] = Field(description="(n,) q*: where joint i is revolute, q_i = q*_i + 2 atan(s_i), and else q_i = q*_i + s_i.")
    revolute: list[bool] = Field(description="(n,) true where the joint is revolute.")
    nodes: list[int] = Field(
        description="The tree in preorder. 0 or more: the cell is cut in the joint with this position index; its lower part comes next. "
        "-1: a plane separates the pair in the cell. -2: the cell misses the polytope. -3: the cell is open. -4: the cell is cut further, "
        "which this answer does not show."
    )
    cuts: list[float] = Field(description="Where each cut is, in s, in the order of the nodes that are 0 or more.")
    choices: list[int] = Field(description="For each node that is -1, in order: which of `volumes` its plane separates.")
    volumes: list[tuple[str, str]] = Field(
        description="By choice, in words: what stands for `a` and for `b`, the geometries themselves or simpler volumes that contain them."
    )
    counts: CellCounts = Field(description="The leaves of the whole tree, with those that are not shown.")
    folded: list[CellCounts] = Field(
        description="For each node that is -4, in order: the leaves below it. Empty where the answer shows the whole tree. An answer has "
        "at most 200000 nodes; in a larger tree, cells are folded from a depth on, the same one for all."
    )


class SeparatingPlane(BaseModel):
    """Holds the plane of a pair's proof in the cell that holds a configuration: [a; b](s) = Z [1; s_J], in a body's frame, in metres.

    In this cell, as far as the region reaches, a'p + b > 0 for the points p of the pair's first body, and a'p + b < 0 for those of the
    second one. The verifier has accepted this. The numbers are those of the proof file; what is computed with them in floating point is
    rounded.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "pair": {"index": 0, "a": "arm/link2/box", "b": "world/post"},
                    "cell": 1,
                    "lower": [-0.6, -0.4],
                    "upper": [0.05, 0.4],
                    "volumes": ["arm/link2/box", "world/post"],
                    "frame": "arm/link1",
                    "joints": [0, 1],
                    "Z": [[0.8, 0.1, 0.2], [-0.3, 0.4, 0.1], [0.0, 0.0, 0.0], [-0.2, 0.1, 0.1]],
                }
            ]
        }
    )

    pair: PairInfo = Field(description="The pair.")
    cell: int = Field(
        description="Number of the cell: of its node in the tree of the pair's proof, in preorder. Where `nodes` of the pair's cells has a "
        "-4, the answer with the cells does not show the whole tree, and its nodes have other numbers. Then compare `lower` and `upper`."
    )
    lower: list[float] = Field(description="(n,) lower corner of the cell, in s.")
    upper: list[float] = Field(description="(n,) upper corner of the cell, in s.")
    volumes: tuple[str, str] = Field(description="In words, what the plane separates: `a` and `b`, or simpler volumes that contain them.")
    frame: str = Field(description="Body whose frame a, b and p are expressed in.")
    joints: list[int] = Field(description="J: position indices of the joints that the plane moves with, ascending.")
    Z: list[list[float]] = Field(description="(4, 1 + k), for the k joints: three rows for a, and one for b.")
