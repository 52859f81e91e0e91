"""A scene file is drafted here for a robot's model and what stands around it.

The draft says what was found: where packages are, how the models are welded to the world, which mimic joints are held, and which bodies
overlap whatever the robot does, as neighbours in a chain often do.
"""

from __future__ import annotations

import json
import os
import secrets
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
import yaml

from certifier.errors import SceneError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, JointKind, Pair, Scene
from certifier.scene.contacts import touching
from certifier.scene.load import MEMORY_BYTES, TIMEOUT_S, load_scene, read_in_child
from certifier.scene.macros import Expander, in_xacro, packages_named
from certifier.scene.mimics import Mimic, at_rest
from certifier.scene.paths import beside
from certifier.scene.references import references
from certifier.scene.xml import parse_xml

TRIED = 200
"""This many random configurations show which pairs always overlap."""
SEEDS = 2000
"""A free configuration is looked for among this many."""
MANY_PARTS = 4
"""Where a body that moves has more polytopes than this, the draft has their hull stand for them."""
SLIDE = 1.0
"""A slide without limits is drafted to go so far from its limit, in metres, or to either side of 0 if it has neither."""
_PACKAGES = ("package://", "model://")
_NAMED = {"robot": "name", "model": "name", "mujoco": "model"}
"""The elements that are models, and the attribute that is the model's name."""


@dataclass(frozen=True)
class Draft:
    """Holds a scene file, the scene that it describes, and a free configuration.

    Attributes:
        text: the scene file.
        seed: (n,) the free configuration that is nearest to q* of those tried; None where all of them are in collision.
        ignored: the pairs of the robot with itself that overlap at every configuration tried, which the draft ignores.
        overlapping: other pairs that do. They are not ignored, because something else stands in the wrong place.
    """

    text: str
    scene: Scene
    seed: Array | None
    ignored: tuple[Pair, ...]
    overlapping: tuple[Pair, ...]


def draft(robot: Path, worlds: Sequence[Path], out: Path, packages: Mapping[str, Path], arguments: Mapping[str, str]) -> Draft:
    """Returns a scene file for a robot and what stands around it, which was loaded once.

    Args:
        robot, worlds: model files, URDF, SDFormat or MJCF.
        out: where the scene file will be; the paths in it are relative to its directory.
        arguments: arguments of models that are written in xacro.
        packages: directories of packages, by name; others are looked for in the directories above the model that names them.

    Raises:
        SceneError: a file cannot be used; ``scene_package`` for a package that was not found.
    """
    models: dict[str, Path] = {}
    for path in (robot, *worlds):
        models[_unused(_name_in(path), models)] = path
    directory = out.parent.resolve()
    found = {name: root for path in models.values() for name, root in _packages(path, packages, arguments, directory).items()}
    head = _head(out, robot, found, arguments, directory)
    add = {name: f"  - add_model: {{name: {_quoted(name)}, file: {_quoted(_relative(path, directory))}}}" for name, path in models.items()}
    held = _inventory("\n".join([head, *add.values()]), models, directory)
    head = "\n".join([head, *_directives(add, held["roots"]), *_limits(held), *_fix(held)]) + "\n"
    scene = _loaded(head, directory)
    if hulls := _hulls(scene):
        head += hulls
        scene = _loaded(head, directory)
    random = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, (TRIED + SEEDS, scene.n))
    middle = scene.q_star.clip(scene.q_lower, scene.q_upper)
    always = set(scene.pairs)
    for touches in touching(scene, [middle, *random[:TRIED]]):
        always &= touches
    own = tuple(f"{next(iter(models))}{mark}" for mark in ("/", "::"))
    overlapping = sorted(always, key=lambda pair: (pair.a, pair.b))
    ignored = tuple(pair for pair in overlapping if pair.a.startswith(own) and pair.b.startswith(own))
    others = tuple(pair for pair in overlapping if pair not in ignored)
    text = head + _joints(scene) + _ignore(ignored, scene)
    return Draft(text, _loaded(text, directory), _free(scene, middle, random[TRIED:], always), ignored, others)


def _hulls(scene: Scene) -> str:
    """Returns that hulls stand for the bodies of many parts, each part of which would be a pair with each part of all other bodies."""
    moved = [joint.child for joint in scene.joints if Kinematics.of(scene).chain(WORLD, joint.child)]
    parts = Counter(geometry.body for geometry in scene.geometries if geometry.radius == 0)
    bodies = [body for body in moved if parts[body] > MANY_PARTS]
    if not bodies:
        return ""
    lines = [f"  - {_quoted(body)}  # {parts[body]} parts" for body in bodies]
    return (
        "\n".join(["# One hull stands for all parts of each of these. Leave a body out where its hollows matter.", "hulls:", *lines]) + "\n"
    )


def _free(scene: Scene, middle: Array, random: Array, always: set[Pair]) -> Array | None:
    """Returns the middle or else the nearest to it of the random configurations, at which nothing touches but what always does."""
    near = np.linalg.norm((random - middle) / (scene.q_upper - scene.q_lower), axis=1)
    candidates = [middle, *random[np.argsort(near)]]
    return next((q for q, touches in zip(candidates, touching(scene, candidates), strict=True) if touches <= always), None)


def _name_in(path: Path) -> str:
    """Returns the name that a model file gives its first model, or else the file's."""
    found: list[str] = []

    def start(element: str, attributes: dict[str, str]) -> None:
        if element in _NAMED:
            found.append(attributes.get(_NAMED[element], ""))

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler = start

    if not path.is_file():
        problem = f"{path} is a directory" if path.is_dir() else f"there is no file {path}"
        raise SceneError("scene_model", problem, hint="name a model file: URDF, SDFormat or MJCF")
    parse_xml(path.read_bytes(), path.name, "scene_model", install)
    return next((name for name in found[:1] if name and "$" not in name), path.name.partition(".")[0])


def _unused(name: str, taken: Collection[str]) -> str:
    return name if name not in taken else next(f"{name}_{i}" for i in range(2, 1000) if f"{name}_{i}" not in taken)


def _packages(path: Path, given: Mapping[str, Path], arguments: Mapping[str, str], directory: Path) -> dict[str, Path]:
    """Returns where the packages are that a model names. One that is written in xacro has to be in a package or below the directory."""

    def find(name: str) -> Path | None:
        above = [place / name for place in path.absolute().parents] + [place for place in path.absolute().parents if place.name == name]
        return next((place.absolute() for place in ([given[name]] if name in given else above) if place.is_dir()), None)

    found: dict[str, Path] = {}
    expanded = None
    if in_xacro(path, path.name):
        found = packages_named(path, find)
        file = beside(Path.cwd(), str(path))
        if not any(file.is_relative_to(root) for root in (directory, *found.values())):
            own = next((place for place in file.parents if (place / "package.xml").is_file()), file.parent)
            found[own.name] = own
        expanded = Expander(directory, found, arguments).expanded(file, path.name)
    for reference in references(path, expanded):
        if not reference.startswith(_PACKAGES):
            continue
        name = reference.partition("://")[2].partition("/")[0]
        place = find(name)
        if place is None:
            message = f"{path.name} names the package {name}, which is not above it"
            raise SceneError("scene_package", message, hint=f"say where it is: --package {name}=DIRECTORY")
        found[name] = place
    return found


def _head(out: Path, robot: Path, packages: Mapping[str, Path], arguments: Mapping[str, str], directory: Path) -> str:
    name = out.stem if out.stem != "scene" else directory.name
    lines = [f"# Drafted by ciris scene init for {robot.name}; docs/scenes.md explains every key.", f"name: {_quoted(name)}"]
    if packages:
        lines += ["# Where the packages are that models name as package:// or model://", "packages:"]
        lines += [f"  {_quoted(package)}: {_quoted(_relative(root, directory))}" for package, root in packages.items()]
    if arguments:
        lines += ["# What the model's xacro is given", "xacro:"]
        lines += [f"  {_quoted(key)}: {_quoted(value)}" for key, value in arguments.items()]
    return "\n".join([*lines, "directives:"])


def _inventory(text: str, models: Mapping[str, Path], directory: Path) -> dict[str, Any]:
    """Returns what the models of a scene file hold (:mod:`certifier.scene.inventory`)."""
    with _scene_file(text, directory) as path:
        payload = {"path": str(path), "models": {name: str(beside(Path.cwd(), str(model))) for name, model in models.items()}}
        return read_in_child("certifier.scene.inventory:inventory", payload, "the draft", TIMEOUT_S, MEMORY_BYTES)


def _directives(add: Mapping[str, str], roots: Sequence[Mapping[str, Any]]) -> list[str]:
    """Returns the directives that add each model, given by its name, and weld its roots to the world where its file has them."""
    lines = []
    for name, line in add.items():
        lines.append(line)
        for root in roots:
            if root["body"].startswith(f"{name}::"):
                lines += _weld(root)
    if len(add) > 1:
        lines.append("# The X_PC of a weld says where its child stands, in metres and degrees. Without one, that is the world's origin.")
        lines.append("#   X_PC: {translation: [0.5, 0, 0], rotation: !Rpy {deg: [0, 0, 90]}}")
    return lines


def _weld(root: Mapping[str, Any]) -> list[str]:
    """Returns the directives that hold a body where its file has it. Of a model in a model, Drake welds only a frame of the outer one."""
    translation, rpy = ([round(x, 9) + 0.0 for x in root[key]] for key in ("translation", "rpy"))
    parts = [f"translation: {translation}"] if any(translation) else []
    parts += [f"rotation: !Rpy {{deg: {rpy}}}"] if any(rpy) else []
    pose = f", X_PC: {{{', '.join(parts)}}}" if parts else ""
    model, *inside = root["body"].split("::")
    child, lines = root["body"], []
    if len(inside) > 1:
        child = f"{model}::{'_'.join(inside)}_stands"
        lines.append(f"  - add_frame: {{name: {_quoted(child)}, X_PF: {{base_frame: {_quoted(root['body'])}}}}}")
    return [*lines, f"  - add_weld: {{parent: world, child: {_quoted(child)}{pose}}}"]


def _limits(held: Mapping[str, Any]) -> list[str]:
    """Returns limits for the slides that have none in the model."""
    coupled = {mimic[role] for mimic in held["mimics"] for role in ("follower", "leader")}
    slides = {
        joint["name"]: (joint["lower"], joint["upper"])
        for joint in held["joints"]
        if joint["kind"] == JointKind.PRISMATIC and joint["name"] not in coupled
    }
    guessed = {joint: _guess(*limits) for joint, limits in slides.items() if np.isinf(limits).any()}
    if not guessed:
        return []
    lines = [f"  {_quoted(joint)}: [{lower:.12g}, {upper:.12g}]" for joint, (lower, upper) in guessed.items()]
    return ["# The model does not say how far these slide, so this is a guess. Write how far, in metres:", "limits:", *lines]


def _guess(lower: float, upper: float) -> tuple[float, float]:
    if np.isfinite(lower):
        return lower, lower + SLIDE
    return (upper - SLIDE, upper) if np.isfinite(upper) else (-SLIDE, SLIDE)


def _fix(held: Mapping[str, Any]) -> list[str]:
    """Returns where joints are held that others mimic, and where those that Drake does not have follow."""
    mimics = [Mimic(**mimic) for mimic in held["mimics"]]
    followers = {mimic.follower for mimic in mimics} - {*held["unread"]}
    rest = at_rest(mimics, {joint["name"]: (joint["lower"], joint["upper"]) for joint in held["joints"]})
    lines = [f"  {_quoted(joint)}: {position:.12g}" for joint, position in rest.items() if joint not in followers]
    return ["# Other joints mimic these, so they are held, and the others with them. Choose where.", "fix:", *lines] if lines else []


@contextmanager
def _scene_file(text: str, directory: Path) -> Iterator[Path]:
    """Yields a scene file with this text, which is there for so long."""
    path = directory / f".draft-{secrets.token_hex(8)}.yaml"
    try:  # the name is known before the file is there: whatever signal comes, the file goes
        path.write_text(text, encoding="utf-8")
        yield path
    finally:
        path.unlink(missing_ok=True)


def _loaded(text: str, directory: Path) -> Scene:
    with _scene_file(text, directory) as path:
        return load_scene(path)


def _relative(path: Path, directory: Path) -> str:
    return os.path.relpath(beside(Path.cwd(), str(path)), directory)


def _joints(scene: Scene) -> str:
    lines = ["# The middle of every joint's range, in radians or metres:"]
    for j in scene.moving:
        unit, scale = j.shown
        window = ", a window of its turn, which this middle moves" if j.own_limits is not None else ""
        lines.append(f"#   {j.name}: {scale * (j.lower or 0.0):.4g} to {scale * (j.upper or 0.0):.4g} {unit}{window}")
    return "\n".join([*lines, f"q_star: {[round(float(x), 6) for x in scene.q_star]}"]) + "\n"


def _ignore(pairs: Sequence[Pair], scene: Scene) -> str:
    if not pairs:
        return ""
    neighbours = {frozenset((j.parent, j.child)) for j in scene.joints}
    lines = [f"# These overlap at all of {TRIED + 1} configurations that were tried, so no region could be certified with them.", "ignore:"]
    for pair in pairs:
        bodies = frozenset(scene.geometry(name).body for name in (pair.a, pair.b))
        why = "neighbours, which overlap" if bodies in neighbours else "they overlap"
        lines.append(f"  - {{pair: [{_quoted(pair.a)}, {_quoted(pair.b)}], reason: {why} at every configuration that was tried}}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """Returns a text as YAML has it, in quotes where it needs them."""
    plain = all((c.isalnum() and c.isascii()) or c in "_-./" for c in text) and text[:1].isalpha()
    return text if plain and yaml.safe_load(text) == text else json.dumps(text)
