"""Valid proofs of every kind, made once."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from certifier.jobs.region import certified_region
from certifier.model import WORLD, Pair, Scene
from certifier.motion.given import given
from certifier.motion.search import search
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.proof.container import with_scene
from certifier.proof.motion import MotionProof, Space
from certifier.proof.negative import DualProof, WitnessProof
from certifier.proof.pair import PairProof
from tests.certifier.scenes import accepted, ball, box, cube, planar_arm


@cache
def scene() -> Scene:
    """A two-link arm with a ball at its tip before two blocks, padded."""
    blocks = [box(f"world/block{i}", WORLD, (0.15, 0.3, 0.3), (0.7 + 0.2 * i, 1.0, 0.0)) for i in range(2)]
    base = planar_arm(2, blocks[0], padding=0.01, q_star=(0.05, -0.1))
    tip = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
    links = [geometry.name for geometry in base.geometries[:2]]
    pairs = tuple(Pair(a, block.name) for a in (*links, tip.name) for block in blocks)
    return replace(base, geometries=(*base.geometries, blocks[1], tip), pairs=pairs)


@cache
def region() -> bytes:
    """Both blocks share the proofs of the links; the tip has one for each block. The proofs lie on two different grounds."""
    polytope, larger = cube(scene(), 0.0, 0.1), cube(scene(), 0.0, 0.12)
    proofs: dict[int, bytes] = {}
    for index, pair in enumerate(scene().pairs):
        partners = tuple(p for p in scene().pairs if p.a == pair.a) if "bar" in pair.a else (pair,)
        part = replace(scene(), pairs=partners)
        shared = Certification(part, larger if index // 2 % 2 else polytope, np.zeros(2))
        found = PairProof.from_bytes(shared.certify(partners.index(pair)).proof, part)
        proofs[index] = replace(found, scene=scene()).to_bytes()
    return certified_region(scene(), accepted(polytope, np.zeros(2)), proofs, {}).proof


@cache
def dual() -> tuple[Scene, DualProof]:
    """The tip before a block that it would have to pass on both sides."""
    world = planar_arm(2, box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), limit=2.5)
    tip = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
    world = replace(world, geometries=(*world.geometries, tip), pairs=(*world.pairs, Pair(tip.name, "world/block")))
    for half in np.arange(0.2, 1.2, 0.1):
        shared = Certification(world, cube(world, 0.0, half), np.zeros(2))
        for index in range(len(world.pairs)):
            result = shared.certify(index)
            if result.outcome is Outcome.NOT_CERTIFIABLE:
                return world, DualProof.from_bytes(result.proof, world)
    raise AssertionError("none of the pairs is not certifiable")


def witness() -> tuple[Scene, WitnessProof]:
    """The bar in the block."""
    world = planar_arm(2, box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 0.0, 0.0)))
    result = Certification(world, cube(world, 0.0, 0.1), np.zeros(2)).certify(1)
    assert result.outcome is Outcome.REFUTED
    return world, WitnessProof.from_bytes(result.proof, world)


@cache
def motion() -> tuple[Scene, MotionProof]:
    """A two-link arm swings past its obstacle, through three waypoints and with a tube."""
    world = planar_arm(2, padding=0.01)
    path = given(world, [[-0.9, -0.4], [-0.2, 0.5], [0.1, -0.7]], Space.Q)
    proof = search(world, path, tube=True).proof
    assert proof is not None
    return world, proof


def files() -> dict[str, bytes]:
    """A file of every kind, its scene in it."""
    singles = {"dual": dual(), "witness": witness(), "motion": motion()}
    world = planar_arm(2)
    singles["pair"] = world, PairProof.from_bytes(Certification(world, cube(world, 0.0, 0.05), np.zeros(2)).certify(1).proof, world)
    return {"region": region(), **{kind: with_scene(proof.to_bytes(), world) for kind, (world, proof) in singles.items()}}
