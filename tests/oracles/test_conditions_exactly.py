"""Wherever pairs that stand for a condition are apart, the condition holds: in whole numbers, with kinematics of an arm worked out here.

``python -m tests.oracles.test_conditions_exactly --samples 100000`` asks more than the tests do.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import arb, ctx

from certifier.conditioned import COVERED, condition_of, with_conditions
from certifier.conditions import Condition, Cone, Distance, InBall, Inside, Range
from certifier.model import WORLD, Pair, Scene
from certifier.pair.collisions import in_collision
from tests.certifier.scenes import ball, planar_arm

STEPS = 1024
"""Samples are whole multiples of 1 / STEPS in s."""
BITS = 200
"""Cosines of angles have this many bits."""
HAIR = 1e-6
"""Nothing is asked of what is nearer to where a condition begins to fail, but that it is not proved where it fails."""
TIP, RADIUS, POST = (0.75, 0.25, -0.5), 0.125, (1.5, 1.0, 0.25)
DIRECTION, FACE = (0.6, 0.0, 0.8), (0.0, 0.6, 0.8, 0.875)
CONDITIONS: dict[str, Condition] = {
    "cone": Cone("c", "arm/link3", DIRECTION, WORLD, (0.0, 0.6, 0.8), 1.25),
    "inside": Inside("c", ("arm/link3/tip",), WORLD, (FACE, (1.0, 0.0, 0.0, 2.5))),
    "point": Inside("c", (), WORLD, (FACE,), points=(("arm/link3", TIP),)),
    "ball": InBall("c", ("arm/link3/tip",), WORLD, (0.5, -0.5, 0.25), 2.5),
    "distance": Distance("c", "arm/link3/tip", "world/post", 1.5),
    "range": Range("c", (("arm/joint1", 1), ("arm/joint2", -1), ("arm/joint3", 1)), -0.75, 1.25),
}
LOST = {"ball": (2.5 - RADIUS) ** 2 - (COVERED * 2.5 - RADIUS) ** 2}
"""A polytope in the ball stands for it. So nothing is proved of what is as near to its surface as this."""


def arm() -> Scene:
    """Returns an arm whose joints turn about z, y and x, each a metre along x from the one before, with a ball at its end."""
    base = planar_arm(3)
    joints = tuple(replace(joint, axis=axis) for joint, axis in zip(base.joints, np.eye(3)[::-1], strict=True))
    tip, post = ball("arm/link3/tip", "arm/link3", RADIUS, TIP), ball("world/post", WORLD, RADIUS, POST)
    return replace(base, joints=joints, geometries=(tip, post), pairs=(Pair(tip.name, post.name),))


def number(found: arb) -> Fraction:
    """Returns the middle of a ball, whose radius is far below what doubles round with BITS."""
    mantissa, exponent = found.mid().man_exp()
    return int(mantissa) * Fraction(2) ** int(exponent)


def pose(steps: list[int]) -> tuple[Any, list[Fraction]]:
    """Returns the rotation of the last link, (3, 3), and the center of its ball, in exact fractions, at s = steps / STEPS."""
    R, t, below = np.eye(3, dtype=int).astype(object), np.zeros(3, dtype=int).astype(object), 1
    for i, k in enumerate(steps):
        if i:
            t = t + R[:, 0]
        c, s, one = STEPS**2 - k**2, 2 * k * STEPS, STEPS**2 + k**2
        turn = [[[c, -s, 0], [s, c, 0], [0, 0, one]], [[c, 0, s], [0, one, 0], [-s, 0, c]], [[one, 0, 0], [0, c, -s], [0, s, c]]][i]
        R, t, below = R @ np.array(turn, dtype=object), t * one, below * one
    exact = [[Fraction(int(x), below) for x in row] for row in R]
    return exact, [Fraction(int(t[i]), below) + dot(exact[i], TIP) for i in range(3)]


def dot(a: Any, b: Any) -> Fraction:
    return sum((Fraction(x) * Fraction(y) for x, y in zip(a, b, strict=True)), Fraction(0))


def room(kind: str, steps: list[int]) -> Fraction:
    """Returns a number that is positive where the condition holds: exact, but for the cosines of its angles."""
    condition = CONDITIONS[kind]
    R, center = pose(steps)
    match condition:
        case Cone():
            turned = [dot(row, condition.axis) for row in R]
            return dot(turned, condition.along) - number(arb(condition.angle).cos())
        case Inside():
            radius = Fraction(RADIUS if condition.geometries else 0)
            return min(d - radius - dot(center, normal) for *normal, d in [map(Fraction, face) for face in condition.faces])
        case InBall():
            square = sum(((x - Fraction(y)) ** 2 for x, y in zip(center, condition.center, strict=True)), Fraction(0))
            return Fraction(condition.radius - RADIUS) ** 2 - square
        case Distance():
            square = sum(((x - Fraction(y)) ** 2 for x, y in zip(center, POST, strict=True)), Fraction(0))
            return square - Fraction(2 * RADIUS + condition.metres) ** 2
        case Range():
            re, im = Fraction(1), Fraction(0)
            for (_, sign), k in zip(condition.joints, steps, strict=True):
                one = STEPS**2 + k**2
                c, s = Fraction(STEPS**2 - k**2, one), Fraction(2 * sign * k * STEPS, one)
                re, im = re * c - im * s, re * s + im * c
            middle, half = (condition.lower + condition.upper) / 2, (condition.upper - condition.lower) / 2
            return re * number(arb(middle).cos()) + im * number(arb(middle).sin()) - number(arb(half).cos())
    raise AssertionError(kind)


def compare(kind: str, samples: int, proved: Condition | None = None) -> tuple[int, int, int]:
    """Returns how many samples keep the condition, how many do not, and how many are too near to ask whether they are proved.

    Half of the samples are neighbours, a step or less from each other in each coordinate: the pairs touch at one of them alone.

    Args:
        proved: another condition, which the pairs prove in its place.
    """
    scene = with_conditions(arm(), [proved or CONDITIONS[kind]])
    lone = replace(scene, pairs=tuple(pair for pair in scene.pairs if condition_of(scene, pair)) or scene.pairs)
    rng = np.random.default_rng(0)
    steps = rng.integers(-STEPS // 2, STEPS // 2 + 1, (samples // 2, 3))
    touching = in_collision(lone, steps / STEPS)
    low, high = (rng.choice(steps[side], samples // 4) for side in (touching, ~touching))
    for _ in range(STEPS.bit_length()):
        middle = (low + high) // 2
        same = in_collision(lone, middle / STEPS)
        low[same], high[~same] = middle[same], middle[~same]
    assert abs(low - high).max() <= 1
    steps = np.concatenate([steps, low, high])
    kept = ~in_collision(lone, steps / STEPS)
    holds = fails = near = 0
    for at, apart in zip(steps.tolist(), kept.tolist(), strict=True):
        with ctx.workprec(BITS):
            left = room(kind, at)
        assert left > 0 or not apart, f"{kind}: proved at {at} / {STEPS}, where it fails by {float(left)}"
        near += abs(left) <= HAIR
        assert apart or left <= LOST.get(kind, HAIR), f"{kind}: not proved at {at} / {STEPS}, where it holds by {float(left)}"
        holds, fails = holds + (left > 0), fails + (left <= 0)
    return holds, fails, near


@pytest.mark.parametrize("kind", CONDITIONS)
def test_conditions_hold_exactly_where_their_pairs_are_apart(kind: str) -> None:
    holds, fails, _ = compare(kind, 800)
    assert min(holds, fails) > 80


@pytest.mark.parametrize(
    ("kind", "wider"),
    [
        ("cone", {"angle": 1.26}),
        ("inside", {"faces": (FACE,)}),
        ("point", {"points": (("arm/link3", (0.75, 0.25, -0.51)),)}),
        ("ball", {"radius": 2.7}),
        ("distance", {"metres": 1.49}),
        ("range", {"upper": 1.26}),
    ],
)
def test_a_wider_condition_is_seen(kind: str, wider: dict[str, Any]) -> None:
    with pytest.raises(AssertionError, match="where it fails"):
        compare(kind, 800, replace(CONDITIONS[kind], **wider))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=100_000)
    for name in CONDITIONS:
        print(name, "holds, fails, near:", *compare(name, parser.parse_args().samples), flush=True)
