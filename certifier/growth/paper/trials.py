"""A trial is a polytope that is certified next, whatever it is for. The order of its pairs is decided here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from certifier.growth.actions import Certify, Transition
from certifier.growth.pairs import by_joints, joints_between
from certifier.growth.paper.options import EFFORT
from certifier.growth.paper.state import PaperState
from certifier.model import Array, Polytope, Scene
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume_bound


def certify(
    scene: Scene,
    state: PaperState,
    label: str,
    polytope: Polytope,
    center: Array | None,
    *,
    reuse: dict[int, int] | None = None,
    hard: Sequence[int] = (),
    failures: int = 1,
) -> Transition:
    """Asks to certify a polytope.

    The pairs that failed last come first, then those with few joints between them, which are cheap and fail early.
    """
    reuse = reuse or {}
    suspects = [i for i in state.suspects if i not in reuse]
    others = [i for i in by_joints(scene) if i not in reuse and i not in set(suspects)]
    action = Certify(state.next, label, polytope, center, suspects + others, reuse, list(hard), failures)
    return Transition(replace(state, next=state.next + 1), action)


def is_worth_it(state: PaperState, polytope: Polytope) -> bool:
    """Returns whether certifying the polytope would be progress."""
    if state.best is None:
        return True
    least = state.best.ellipsoid_volume * (1 + state.asked.tolerance)
    return volume_bound(polytope) > least and inscribed_ellipsoid(polytope).volume > least


def effort(scene: Scene, state: PaperState, option: str) -> int:
    """Returns the option of this name: what was asked for, or what pays in scenes with chains as long as this one's."""
    given = getattr(state.asked, option)
    if given is not None:
        return int(given)
    joints = max((len(joints_between(scene, index)) for index in range(len(scene.pairs))), default=0)
    return next(options for most, options in EFFORT if joints <= most)[option]
