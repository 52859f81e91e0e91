"""This module finds what in a scene that loads may not mean what its author thinks, and says it in sentences for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import NO_PAIRS, Array, Geometry, Pair, Scene
from certifier.scene.contacts import touching
from certifier.scene.hollow import beyond, remedy, standing_for
from certifier.scene.tree import Tree
from certifier.scene.units import units
from certifier.verify.decimals import at_most_mm
from certifier.words import counted

_SAMPLES = 40
_IGNORED_SAMPLES = 200
_STEEP = 50.0
_HULLS = ("mesh", "convex", "hull", "part")
"""The kinds of shape of which a hull is taken, or a polytope of few vertices around it."""
_EXACT = 1e-6
"""A polytope that reaches less than this beyond a hull, in metres, is as good as the hull."""
_POLYTOPES = "polytopes of few vertices stand for hulls of meshes or parts"


def findings(
    scene: Scene, tree: Tree, candidates: list[tuple[str, str]], drawn: set[str], files: Mapping[str, str] | None = None
) -> list[str]:
    """Returns what a careful colleague would remark on.

    Args:
        candidates: the pairs of geometries that the collision filters of the model files leave.
        drawn: bodies that have a visual geometry.
        files: the SRDF file that a reason for ignoring pairs comes from, by the reason; None without such files.
    """
    return [
        *_substituted(scene),
        *_hollow(scene),
        *_windows(scene),
        *_off_center(scene),
        *_filtered(scene, tree, candidates),
        *_unguarded(scene, tree, drawn),
        *_steep(scene),
        *units(scene, tree),
        *_always_touching(scene),
        *(_ignored(scene, files or {}) if scene.ignored else []),
        *([] if scene.pairs else [f"{NO_PAIRS}: there is nothing to prove"]),
    ]


def _substituted(scene: Scene) -> list[str]:
    """Returns a finding about every kind of replacement, such as a prism of 12 sides, and the geometries that it was made for.

    A hull that is exactly that of its mesh is no finding here: :func:`_hollow` says where it matters.
    """
    groups: dict[str, list[Geometry]] = {}
    for g in scene.geometries:
        if g.substitution and (g.inflation > _EXACT or g.shape["kind"] not in _HULLS):
            groups.setdefault(_POLYTOPES if g.shape["kind"] in _HULLS else g.substitution, []).append(g)
    findings = []
    for what, group in groups.items():
        inflation = max(g.inflation for g in group)
        behind = "" if what != _POLYTOPES else " of these. With a larger mesh.max_vertices they reach less far"
        reach = f", reaching at most {at_most_mm(inflation)} outside{behind}" if inflation else ""
        findings.append(f"{_several(group, lambda g: g.inflation)}: {what}{reach}")
    return findings


def _hollow(scene: Scene) -> list[str]:
    """Returns a finding about every kind of hull that reaches notably beyond what it stands for."""
    groups: dict[str, list[Geometry]] = {}
    for g in scene.geometries:
        if beyond(scene, g.name):
            groups.setdefault(remedy(g), []).append(g)
    findings = []
    for what, group in groups.items():
        most = f"at least {1000 * max(beyond(scene, g.name) for g in group):.3g} mm"
        said = f"the hull reaches {most} beyond {standing_for(group[0])}, which is not convex, and closes its openings"
        if len(group) > 1:
            said = f"each has a hull that closes openings; that of the first reaches {most} beyond its shape"
        findings.append(f"{_several(group, lambda g: beyond(scene, g.name))}: {said}. Where that matters: {what}")
    return findings


def _several(group: list[Geometry], size: Callable[[Geometry], float]) -> str:
    """Returns the name of the geometry of a group for which a size is largest, and how many others there are."""
    first = max(group, key=lambda g: round(size(g), 6))
    return f"{first.name} and {len(group) - 1} more" if len(group) > 1 else first.name


def _windows(scene: Scene) -> list[str]:
    """Returns a finding about every joint of which the scene covers a window."""
    return [
        f"joint {j.name} may turn 179 degrees from q* and farther: the scene covers {lower:.9g} to {upper:.9g} degrees"
        for j, lower, upper in zip(scene.moving, np.degrees(scene.q_lower), np.degrees(scene.q_upper), strict=True)
        if j.own_limits is not None
    ]


def _off_center(scene: Scene) -> list[str]:
    """Returns a finding about every joint whose q* is outside of its own limits."""
    return [
        f"q_star of joint {j.name} is {center:.9g} {j.unit}, which is not within its limits, {lower:.9g} to {upper:.9g} {j.unit}"
        for j, center, lower, upper in zip(scene.moving, scene.q_star, *scene.own_limits, strict=True)
        if not lower <= center <= upper
    ]


def _filtered(scene: Scene, tree: Tree, candidates: list[tuple[str, str]]) -> list[str]:
    """Returns a finding about the pairs that a collision filter hides although no joint connects their bodies directly."""
    kept = {frozenset(c) for c in candidates}
    neighbours = {frozenset((j.parent, j.child)) for j in tree.joints}
    hidden = [
        f"{a.name} and {b.name}"
        for i, a in enumerate(scene.geometries)
        for b in scene.geometries[i + 1 :]
        if tree.group[a.body] != tree.group[b.body]
        and frozenset((a.body, b.body)) not in neighbours
        and frozenset((a.name, b.name)) not in kept
    ]
    if not hidden:
        return []
    more = f" and {len(hidden) - 1} more" if len(hidden) > 1 else ""
    return [f"the models' collision filters hide {hidden[0]}{more}: nothing is certified about them"]


def _unguarded(scene: Scene, tree: Tree, drawn: set[str]) -> list[str]:
    solid = {g.body for g in scene.geometries}
    return [f"body {body} has a visual but no collision geometry: nothing is certified about it" for body in sorted(drawn - solid)]


def _steep(scene: Scene) -> list[str]:
    reach = np.maximum(np.abs(scene.s_lower), np.abs(scene.s_upper))
    return [
        f"joint {j.name} comes close to q* +- pi, where s reaches {s:.3g}: narrower limits would condition the programs better"
        for j, s, revolute in zip(scene.moving, reach, scene.revolute, strict=True)
        if revolute and s > _STEEP
    ]


def _always_touching(scene: Scene) -> list[str]:
    """Returns findings about pairs that touch at every configuration tried: no region can be certified for them."""
    always = set(scene.pairs)
    for found in touching(scene, _tried(scene, _SAMPLES)):
        always &= found
        if not always:
            break
    mend = "in every configuration tried: mend the geometry, or ignore the pair with a reason"
    return [
        f"{p.a} and {p.b} are nearer than a padding of {scene.padding_of(p):g} m on each {mend}, or give it less padding"
        if scene.padding_of(p)
        else f"{p.a} and {p.b} overlap {mend}"
        for p in sorted(always, key=lambda p: (p.a, p.b))
    ]


def _ignored(scene: Scene, files: Mapping[str, str]) -> list[str]:
    """Returns a finding about every two bodies that the scene file ignores and that never touch, and one about every SRDF file."""
    reasons: dict[tuple[str, ...], str] = {}
    for pair in scene.ignored:
        bodies = _bodies(scene, pair.a, pair.b)
        if pair.reason not in files:
            reasons[bodies] = pair.reason
        reasons.setdefault(bodies, pair.reason)
    apart = _apart(scene)
    found = []
    for file in dict.fromkeys(files.values()):
        of_file = {bodies: reason for bodies, reason in reasons.items() if files.get(reason) == file}
        if of_file:
            counts = Counter(reason.removeprefix(f"{file}: ") for reason in of_file.values())
            said = ", ".join(f"{count} {reason}" for reason, count in counts.most_common())
            never = len(apart & {*of_file})
            tried = (
                f"{never} of them touch at none of {_IGNORED_SAMPLES + 1} configurations tried: without the entries, these are certified"
            )
            pairs = f"{counted(len(of_file), 'pair')} of bodies {'is' if len(of_file) == 1 else 'are'}"
            found.append(f"{file}: {pairs} ignored: {said}{f'; {tried}' if never else ''}")
    return found + [
        f"{a} and {b} are ignored, but touch at none of {_IGNORED_SAMPLES + 1} configurations tried: without the entry, they are certified"
        for a, b in sorted(bodies for bodies in apart if reasons[bodies] not in files)
    ]


def _bodies(scene: Scene, a: str, b: str) -> tuple[str, ...]:
    return tuple(sorted(scene.geometry(name).body for name in (a, b)))


def _apart(scene: Scene) -> set[tuple[str, ...]]:
    """Returns the bodies with ignored pairs of which none touches at any configuration tried."""
    ignored = tuple(Pair(pair.a, pair.b) for pair in scene.ignored)
    apart = {_bodies(scene, pair.a, pair.b) for pair in ignored}
    chains = {bodies: Kinematics.of(scene).chain(bodies[0], bodies[-1]) for bodies in apart}
    apart = {bodies for bodies, chain in chains.items() if len({*chain}) == len(chain)}  # others cannot be certified
    for found in touching(replace(scene, pairs=ignored), _tried(scene, _IGNORED_SAMPLES)):
        apart -= {_bodies(scene, pair.a, pair.b) for pair in found}
        if not apart:
            break
    return apart


def _tried(scene: Scene, samples: int) -> list[Array]:
    """Returns q*, moved into the joint limits, and ``samples`` random configurations."""
    rng = np.random.default_rng(0)
    return [scene.q_star.clip(scene.q_lower, scene.q_upper), *rng.uniform(scene.q_lower, scene.q_upper, (samples, scene.n))]
