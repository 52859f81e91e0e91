"""A scene file is drafted here for a robot's model and what stands around it.

The draft says what was found: where packages are, how the models are welded to the world, which mimic joints are held, and which bodies
overlap whatever the robot does, as neighbours in a chain often do.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np
import yaml

from certifier.errors import SceneError
from certifier.model import WORLD, Array, JointKind, Pair, Scene
from certifier.scene.contacts import touching
from certifier.scene.load import load_scene
from certifier.scene.references import references
from certifier.scene.xml import parse_xml

TRIED = 200
"""So many random configurations tell which pairs always overlap."""
SEEDS = 2000
"""A free configuration is looked for among so many."""
_PACKAGE = "package://"


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


@dataclass
class _Model:
    """What a model file says of itself: its name, its links that hang on no joint, and its mimic joints."""

    path: Path
    name: str = ""
    links: list[str] = field(default_factory=list)
    children: set[str] = field(default_factory=set)
    mimics: dict[str, str] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    static: bool = False

    @property
    def roots(self) -> list[str]:
        return [] if self.static else [link for link in self.links if link not in self.children and link != WORLD]


def draft(robot: Path, worlds: Sequence[Path], out: Path, packages: Mapping[str, Path]) -> Draft:
    """Returns a scene file for a robot and what stands around it, which was loaded once.

    Args:
        robot, worlds: model files, URDF, SDFormat or MJCF.
        out: where the scene file will be; the paths in it are relative to its directory.
        packages: directories of packages, by name; others are looked for in the directories above the model that names them.

    Raises:
        SceneError: a file cannot be used; ``scene_package`` for a package that was not found.
    """
    models = [_read(path) for path in (robot, *worlds)]
    for model in models:
        model.name = _unused(model.name, [other.name for other in models[: models.index(model)]])
    directory = out.resolve().parent
    found = {name: root for model in models for name, root in _packages(model.path, packages).items()}
    held = {f"{model.name}/{joint}": _at_rest(model, joint) for model in models for joint in _coupled(model)}
    head = _head(out, models, found, held, directory)
    scene = _loaded(head, directory)
    rng = np.random.default_rng(0)
    random = rng.uniform(scene.q_lower, scene.q_upper, (TRIED + SEEDS, scene.n))
    middle = scene.q_star.clip(scene.q_lower, scene.q_upper)
    always = set(scene.pairs)
    for touches in touching(scene, [middle, *random[:TRIED]]):
        always &= touches
    robot_alone = [p for p in always if all(name.startswith(f"{models[0].name}/") for name in (p.a, p.b))]
    ignored = tuple(sorted(robot_alone, key=lambda p: (p.a, p.b)))
    near = np.linalg.norm((random[TRIED:] - middle) / (scene.q_upper - scene.q_lower), axis=1)
    candidates = [middle, *random[TRIED:][np.argsort(near)]]
    seed = next((q for q, touches in zip(candidates, touching(scene, candidates), strict=True) if touches <= always), None)
    text = head + _joints(scene) + _ignore(ignored, scene)
    others = tuple(sorted(always - {*ignored}, key=lambda p: (p.a, p.b)))
    return Draft(text, _loaded(text, directory), seed, ignored, others)


def _read(path: Path) -> _Model:
    model, inside = _Model(path), [""]
    text: list[str] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        text.clear()
        parent = inside[-1]
        if name in ("robot", "model") and not model.name:
            model.name = attributes.get("name", "")
        if name == "mujoco":
            model.name = attributes.get("model", "")
        if name == "link" and parent in ("robot", "model"):
            model.links.append(attributes.get("name", ""))
        if name == "joint":
            joints.append(attributes.get("name", ""))
        if name == "child" and parent == "joint" and "link" in attributes:
            model.children.add(attributes["link"])
        if name == "mimic" and parent in ("joint", "axis") and "joint" in attributes:
            model.mimics[joints[-1]] = attributes["joint"]
        if name == "limit" and parent == "joint":
            model.limits[joints[-1]] = _number(attributes.get("lower")), _number(attributes.get("upper"))
        inside.append(name)

    def end(name: str) -> None:
        inside.pop()
        said = "".join(text).strip()
        if name == "child" and inside[-1] == "joint" and said:
            model.children.add(said)
        if name == "static" and inside[-1] == "model":
            model.static = said in ("1", "true")

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, text.append

    joints: list[str] = []
    if not path.is_file():
        problem = f"{path} is a directory" if path.is_dir() else f"there is no file {path}"
        raise SceneError("scene_model", problem, hint="name a model file: URDF, SDFormat or MJCF")
    parse_xml(path, path.name, "scene_model", install)
    model.name = model.name or path.stem
    return model


def _number(text: str | None) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        return 0.0


def _unused(name: str, taken: Sequence[str]) -> str:
    return name if name not in taken else next(f"{name}_{i}" for i in range(2, 1000) if f"{name}_{i}" not in taken)


def _packages(path: Path, given: Mapping[str, Path]) -> dict[str, Path]:
    """Returns where the packages are that a model names."""
    found: dict[str, Path] = {}
    for reference in references(path):
        if not reference.startswith(_PACKAGE):
            continue
        name = reference.removeprefix(_PACKAGE).partition("/")[0]
        above = [place / name for place in path.absolute().parents] + [place for place in path.absolute().parents if place.name == name]
        places = [given[name]] if name in given else [place for place in above if place.is_dir()]
        if not places or not places[0].is_dir():
            message = f"{path.name} names the package {name}, which is not above it"
            raise SceneError("scene_package", message, hint=f"say where it is: --package {name}=DIRECTORY")
        found[name] = places[0].absolute()
    return found


def _coupled(model: _Model) -> list[str]:
    """Returns the joints to hold: those that others mimic, and in SDFormat, where Drake does not read this, the others as well."""
    followers = [] if model.path.suffix.lower() == ".urdf" else list(model.mimics)
    return list(dict.fromkeys([*model.mimics.values(), *followers]))


def _at_rest(model: _Model, joint: str) -> float:
    lower, upper = model.limits.get(joint, (0.0, 0.0))
    return float(np.clip(0.0, lower, upper))


def _head(out: Path, models: Sequence[_Model], packages: Mapping[str, Path], held: Mapping[str, float], directory: Path) -> str:
    name = out.stem if out.stem != "scene" else directory.name
    lines = [f"# Drafted by ciris scene init for {models[0].path.name}; docs/scenes.md explains every key.", f"name: {_quoted(name)}"]
    if packages:
        lines += ["# Where the packages are that models name as package://", "packages:"]
        lines += [f"  {_quoted(package)}: {_quoted(os.path.relpath(root, directory))}" for package, root in packages.items()]
    lines.append("directives:")
    for model in models:
        lines.append(f"  - add_model: {{name: {_quoted(model.name)}, file: {_quoted(os.path.relpath(model.path.resolve(), directory))}}}")
        lines += [f"  - add_weld: {{parent: world, child: {_quoted(f'{model.name}::{root}')}}}" for root in model.roots]
    if any(model.roots for model in models[1:]):
        lines.append("# The welds say where things stand, not the poses of links in their files. A weld may have a pose:")
        lines.append("#   X_PC: {translation: [0.5, 0, 0], rotation: !Rpy {deg: [0, 0, 90]}}")
    if held:
        lines += ["# Other joints mimic these, so they are held, and the others with them. Choose where.", "fix:"]
        lines += [f"  {_quoted(joint)}: {value:g}" for joint, value in held.items()]
    return "\n".join(lines) + "\n"


def _loaded(text: str, directory: Path) -> Scene:
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", prefix=".draft-", dir=directory, encoding="utf-8") as file:
        file.write(text)
        file.flush()
        return load_scene(file.name)


def _joints(scene: Scene) -> str:
    lines = ["# The middle of every joint's range, in radians or metres:"]
    for j in scene.moving:
        unit, scale = ("degrees", np.degrees(1.0)) if j.kind is JointKind.REVOLUTE else ("m", 1.0)
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
