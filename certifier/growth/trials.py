"""A trial is a polytope that is certified next, whatever it is for. The order of its pairs is decided here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from certifier.growth.actions import Certify, Transition
from certifier.growth.options import EFFORT
from certifier.growth.state import GrowthState
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Polytope, Scene
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume_bound


def certify(
    scene: Scene,
    state: GrowthState,
    label: str,
    polytope: Polytope,
    center: Array | None,
    *,
    reuse: dict[int, int] | None = None,
    hard: Sequence[int] = (),
    failures: int | None = 1,
    cells: int = 1,
) -> Transition:
    """Asks to certify a polytope.

    The pairs that failed last come first, then those with few joints between them, which are cheap and fail early.
    """
    reuse = reuse or {}
    suspects = [i for i in state.suspects if i not in reuse]
    others = [i for i in by_joints(scene) if i not in reuse and i not in set(suspects)]
    action = Certify(state.next, label, polytope, center, suspects + others, reuse, list(hard), failures, cells)
    return Transition(replace(state, next=state.next + 1), action)


def is_worth_it(state: GrowthState, polytope: Polytope) -> bool:
    """Returns whether certifying the polytope would be progress."""
    if state.best is None:
        return True
    least = state.best.ellipsoid_volume * (1 + state.options.tolerance)
    return volume_bound(polytope) > least and inscribed_ellipsoid(polytope).volume > least


def joints_between(scene: Scene, index: int) -> tuple[int, ...]:
    """Returns the position indices of the joints between the bodies of pair ``scene.pairs[index]``, ascending."""
    a, b = (scene.geometry(name).body for name in (scene.pairs[index].a, scene.pairs[index].b))
    return tuple(sorted(Kinematics.of(scene).chain(a, b)))


def effort(scene: Scene, state: GrowthState, option: str) -> int:
    """Returns the option of this name: what was asked for, or what pays in scenes with chains as long as this one's."""
    given = getattr(state.options, option)
    if given is not None:
        return int(given)
    joints = max((len(joints_between(scene, index)) for index in range(len(scene.pairs))), default=0)
    return next(options for most, options in EFFORT if joints <= most)[option]


def by_joints(scene: Scene) -> list[int]:
    """Returns the pairs' indices, those with few joints between their bodies first."""
    return sorted(range(len(scene.pairs)), key=lambda i: len(joints_between(scene, i)))


def alike(scene: Scene, index: int) -> frozenset[str]:
    """Returns the rigid parts of a pair, by their first bodies; for the world's part, the geometry. Pairs of the same parts are alike."""
    kinematics, pair = Kinematics.of(scene), scene.pairs[index]
    roots = {name: kinematics.rigid_root(scene.geometry(name).body) for name in (pair.a, pair.b)}
    return frozenset(name if root == WORLD else root for name, root in roots.items())
