"""A seed in collision is refused here, with the pair, how deep it is in, and a free configuration nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.broken import not_kept
from certifier.collisions.clearance import Clearance
from certifier.errors import RegionError
from certifier.model import Array, Pair, Scene
from certifier.scene.hollow import beyond, remedy, standing_for
from certifier.words import with_units

SHELLS, EACH = np.geomspace(0.004, 1.0, 12), 40
"""A free configuration is looked for at these parts of the joints' half ranges from the seed, EACH times."""
ROOM = (1e-3, 0.0)
"""A free configuration that is named has the first of these distances to contact, in metres, that is found. On contact, none can grow."""
WIDTHS, NEARER = np.geomspace(1.0, 0.05, 10), 0.97
"""Ways that leave the known one by these widths are tried EACH times: is a configuration free at this part of the distance already?"""
TOUCH = 1e-9
"""Bodies that overlap by less than this, in metres, are said to touch."""
STEPS = 8
"""What was found is moved back towards the seed in this many steps of bisection."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """The pair that is nearest at a configuration.

    Attributes:
        q: (n,) the configuration.
        field: where in the user's input it is, or which line between such places.
        distance: of the padded bodies, in metres; infinite in a scene without pairs.
        pair: None in a scene without pairs.
    """

    q: Array
    field: str
    distance: float
    pair: Pair | None


def named(field: str) -> str:
    """Returns how a message names a place in the user's input."""
    return "the seed" if field == "seed.q" else field.removeprefix("seed.")


def check_free(scene: Scene, q: Array, field: str) -> Nearest:
    """Refuses a configuration in which a pair is not farther apart than twice the padding, and returns the nearest pair of others.

    Raises:
        RegionError: ``seed_in_collision``; the hint names a free configuration near by, if one was found.
    """
    if not scene.pairs:
        return Nearest(q, field, np.inf, None)
    clearance = Clearance(scene)
    distance, pair = clearance.least(q)
    if distance > 0:
        return Nearest(q, field, distance, pair)
    padding = scene.padding_of(pair)
    distance += 2 * padding
    searched = ((room, nearest_free(scene, clearance, scene.in_windows(q), room)) for room in ROOM)
    room, found = next((one for one in searched if one[1] is not None), (0.0, None))
    condition = not_kept(scene, pair, q)
    if condition is None:
        how = f"are {distance:.3g} m apart, with a padding of {padding:g} m on each"
        if distance <= 0:
            how = f"overlap by {-distance:.3g} m" if distance < -TOUCH else "touch"
        message, hint = f"{pair.a} and {pair.b} {how}", "move the seed, or ignore the pair in the scene"
        if distance <= 0:
            message += _hollow(scene, pair)
    else:
        message, hint = condition, "move the seed, or change the condition"
    if found is not None:
        hint = _said(scene, scene.in_windows(q), found, written(scene, clearance, found, room))
    raise RegionError("seed_in_collision", message, field=field, hint=hint)


def _hollow(scene: Scene, pair: Pair) -> str:
    """Returns that a pair may overlap only in a hull, where one of the two is the hull of something that is not convex."""
    hollow = [(beyond(scene, name), scene.geometry(name)) for name in (pair.a, pair.b) if beyond(scene, name)]
    said = [f"the hull of {g.name} reaches at least {1000 * distance:.3g} mm beyond {standing_for(g)}" for distance, g in hollow]
    what = " and ".join(dict.fromkeys(remedy(g) for _, g in hollow))
    return f"; {' and '.join(said)}, so they may overlap in the hull only ({what})" if said else ""


def nearest_free(scene: Scene, clearance: Clearance, q: Array, room: float = 0.0, reach: float = 1.0) -> Array | None:
    """Returns a free configuration near q, (n,), within the joint limits; None where none was found.

    Args:
        room: all pairs are farther apart by this, in metres.
        reach: it is looked for within this part of the joints' half ranges.
    """
    half = (scene.q_upper - scene.q_lower) / 2
    lower, upper = scene.q_lower + 1e-3 * half, scene.q_upper - 1e-3 * half
    rng = np.random.default_rng(0)
    for shell in SHELLS[reach >= SHELLS]:
        directions = rng.normal(size=(EACH, scene.n))
        directions *= shell / np.linalg.norm(directions, axis=1, keepdims=True)
        near = np.clip(q + directions * half, lower, upper)
        found = [x for x in near if clearance.free(x, room)]
        if found:
            best = min(found, key=lambda x: float(np.linalg.norm((x - q) / half)))
            return _nearer(clearance, q, best, room, (lower, upper), rng)
    return None


def _nearer(clearance: Clearance, q: Array, free: Array, room: float, limits: tuple[Array, Array], rng: np.random.Generator) -> Array:
    """Returns a free configuration nearer to q: joints that need not move are put back, and ways beside the one that is known are tried.

    The way that is known is one of few at random, in which all joints move and most of them for nothing.
    """
    lower, upper = limits
    half = (upper - lower) / 2
    best = _towards(clearance, q, _put_back(clearance, q, free, room), room)
    for width in WIDTHS:
        for aside in width * rng.normal(size=(EACH, len(q))) / np.sqrt(len(q)):
            way = (best - q) / half
            length = np.linalg.norm(way)
            turned = way / length + aside
            near = np.clip(q + NEARER * length * turned / np.linalg.norm(turned) * half, lower, upper)
            if np.linalg.norm((near - q) / half) < length and clearance.free(near, room):
                best = _towards(clearance, q, near, room)
    return _put_back(clearance, q, best, room)


def _put_back(clearance: Clearance, q: Array, free: Array, room: float) -> Array:
    """Returns the free configuration with each joint back at q, those that have moved least first, where it is free without that."""
    found = free
    for joint in np.abs(free - q).argsort():
        back = np.where(np.arange(len(q)) == joint, q, found)
        if clearance.free(back, room):
            found = back
    return found


def _towards(clearance: Clearance, q: Array, free: Array, room: float) -> Array:
    """Returns the free configuration nearest to q that bisection finds on the way to a free one."""
    inside, outside = free, q
    for _ in range(STEPS):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if clearance.free(middle, room) else (inside, middle)
    return inside


def written(scene: Scene, clearance: Clearance, q: Array, room: float) -> str:
    """Returns a free configuration as text, with enough decimals to be free with this room when it is read again."""
    for decimals in (4, 6, 9):
        rounded = np.round(q, decimals)
        if clearance.free(rounded, room):
            return with_units([f"{x:.{decimals}f}" for x in rounded], scene.units)
    return with_units([*map(repr, q.tolist())], scene.units)


def _said(scene: Scene, q: Array, found: Array, text: str) -> str:
    moved = int(np.abs(found - q).argmax())
    joint, (unit, scale) = scene.moving[moved], scene.moving[moved].shown
    by = scale * abs(found[moved] - q[moved])
    return f"the nearest free configuration found is q = {text}; it moves {joint.name} most, by {by:.2g} {unit}"
