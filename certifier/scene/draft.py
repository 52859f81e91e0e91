"""A scene file is drafted here for a robot's model and what stands around it.

The draft says what was found: where packages are, how the models are welded to the world, which mimic joints are held, and which bodies
overlap whatever the robot does, as neighbours in a chain often do.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix

from certifier.errors import SceneError, close_matches
from certifier.model import Array, JointKind, Pair, Scene
from certifier.scene.contacts import overlaps, touching
from certifier.scene.draft_hulls import doubt, hulls, offers, quoted, vertices
from certifier.scene.file import SceneFile
from certifier.scene.load import MEMORY_BYTES, TIMEOUT_S, load_scene, read_in_child
from certifier.scene.mimics import Mimic, at_rest
from certifier.scene.packages import packages_of
from certifier.scene.paths import beside
from certifier.scene.xml import parse_xml

TRIED = 200
"""This many random configurations show which pairs always overlap."""
SEEDS = 2000
"""A free configuration is looked for among this many."""
SLIDE = 1.0
"""A slide without limits is drafted to go so far from its limit, in metres, or to either side of 0 if it has neither."""
_NAMED = {"robot": "name", "model": "name", "mujoco": "model"}
"""The elements that are models, and the attribute that is the model's name."""


@dataclass(frozen=True)
class Part:
    """A model of a cell besides the robot, and where it stands.

    Attributes:
        path: its file, URDF, SDFormat or MJCF.
        link: the link of the robot, or of a part before it, that carries it; "" for the world.
        translation, rpy: its pose on the link or in the world, metres and degrees (turns about x, then y, then z of the link).
    """

    path: Path
    link: str = ""
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Draft:
    """Holds a scene file, the scene that it describes, and a free configuration.

    Attributes:
        text: the scene file.
        seed: (n,) the free configuration that is nearest to q* of those tried; None where all of them are in collision.
        ignored: the pairs of the robot, and of what it carries, that overlap at every configuration tried, which the draft ignores.
        overlapping: other pairs that do. They are not ignored, because something else stands in the wrong place.
        doubtful: those of both of which perhaps only the replacements overlap, such as hulls, each with a sentence that says so.
        notes: sentences about what was found and chosen.
    """

    text: str
    scene: Scene
    seed: Array | None
    ignored: tuple[Pair, ...]
    overlapping: tuple[Pair, ...]
    doubtful: Mapping[Pair, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def draft(
    robot: Path,
    worlds: Sequence[Part],
    out: Path,
    packages: Mapping[str, Path],
    mounts: Sequence[Part] = (),
    srdf: Path | None = None,
    environment: Mapping[str, str] | None = None,
    arguments: Mapping[str, str] | None = None,
) -> Draft:
    """Returns a scene file for a robot, what it carries and what stands around it, which was loaded once.

    Args:
        robot: model file, URDF, SDFormat or MJCF.
        worlds: what stands around it.
        out: where the scene file will be; the paths in it are relative to its directory.
        packages: directories of packages, by name; others are looked for (:mod:`certifier.scene.packages`).
        mounts: what the robot carries.
        srdf: SRDF file of the robot; None for one beside the model, if there is one.
        environment: the variables in which ROS lists places of packages; None for nowhere.
        arguments: arguments of models that are written in xacro.

    Raises:
        SceneError: a file cannot be used; ``scene_package`` for a package that was not found; ``mount`` for a link that is missing.
    """
    parts: dict[str, Part] = {}
    for part in (Part(robot), *mounts, *worlds):
        parts[_unused(_name_in(part.path), parts)] = part
    models = {name: part.path for name, part in parts.items()}
    directory = out.parent.resolve()
    looked = [packages_of(path, packages, environment or {}, arguments or {}, directory) for path in models.values()]
    found, notes = {name: root for roots, _ in looked for name, root in roots.items()}, [note for _, said in looked for note in said]
    head = _head(out, robot, found, arguments or {}, directory)
    add = {name: f"  - add_model: {{name: {quoted(name)}, file: {quoted(_relative(path, directory))}}}" for name, path in models.items()}
    own = [*parts][: 1 + len(mounts)]
    semantics = srdf or beside_model(robot)
    held = _inventory("\n".join([head, *add.values()]), models, {} if semantics is None else {own[0]: semantics}, directory)
    head = "\n".join([head, *_directives(add, parts, own, held), *_limits(held), *_fix(held)]) + "\n"
    head, scene, said = _with_srdf(head, semantics, semantics is srdf, robot, own[0], directory)
    notes += said
    if more := hulls(scene) + vertices(scene, SceneFile.max_vertices):
        head += more
        scene = _loaded(head, directory)
    random = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, (TRIED + SEEDS, scene.n))
    middle = scene.q_star.clip(scene.q_lower, scene.q_upper)
    always = _always(scene, [middle, *random[:TRIED]])
    prefixes = tuple(f"{name}{mark}" for name in own for mark in ("/", "::"))
    overlapping = sorted(always, key=lambda pair: (pair.a, pair.b))
    ignored = tuple(pair for pair in overlapping if pair.a.startswith(prefixes) and pair.b.startswith(prefixes))
    others = tuple(pair for pair in overlapping if pair not in ignored)
    doubtful = {pair: said_of for pair in overlapping if (said_of := doubt(scene, pair, always[pair]))}
    text = head + offers(scene, doubtful) + _joints(scene) + _ignore(ignored, doubtful, scene)
    seed = _free(scene, middle, random[TRIED:], {*always})
    return Draft(text, _loaded(text, directory), seed, ignored, others, doubtful, tuple(notes))


def _always(scene: Scene, configurations: Iterable[Array]) -> dict[Pair, float]:
    """Returns the pairs that overlap at each of some configurations, and how deep they are in each other at least, in metres."""
    least = dict.fromkeys(scene.pairs, np.inf)
    for depths in overlaps(scene, configurations):
        least = {pair: min(depth, depths[pair]) for pair, depth in least.items() if pair in depths}
    return least


def beside_model(robot: Path) -> Path | None:
    """Returns the SRDF file beside a robot's model; None where there is none."""
    return next(filter(Path.is_file, [robot.with_suffix(".srdf"), robot.parent.parent / "srdf" / f"{robot.stem}.srdf"]), None)


def _with_srdf(head: str, file: Path | None, given: bool, robot: Path, name: str, directory: Path) -> tuple[str, Scene, list[str]]:
    """Returns the beginning of a scene file with the robot's SRDF file, if there is one, its scene, and sentences that say so.

    A file that was not given, and that does not fit to the model, is left out.
    """
    if file is None:
        among = sorted(path.name for path in (robot.absolute().parent.parent / "srdf").glob("*.srdf"))
        said = [f"not used: {', '.join(among)} in ../srdf of the model; name one with --srdf"] if among else []
        return head, _loaded(head, directory), said
    text = f"{head}# Pairs that MoveIt does not check, and named configurations:\nsrdf: {{{quoted(name)}: "
    text += f"{quoted(_relative(file, directory))}}}\n"
    try:
        scene = _loaded(text, directory)
    except SceneError as error:
        if given or not (error.field or "").startswith("srdf"):
            raise
        return head, _loaded(head, directory), [f"not used: {file}, which is beside the model: {error.message}"]
    return text, scene, [] if given else [f"{file} is beside the model, and the draft uses it"]


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


def _head(out: Path, robot: Path, packages: Mapping[str, Path], arguments: Mapping[str, str], directory: Path) -> str:
    name = out.stem if out.stem != "scene" else directory.name
    lines = [f"# Drafted by ciris scene init for {robot.name}; docs/scenes.md explains every key.", f"name: {quoted(name)}"]
    if packages:
        lines += ["# Where the packages are that models name as package:// or model://", "packages:"]
        lines += [f"  {quoted(package)}: {quoted(_relative(root, directory))}" for package, root in packages.items()]
    if arguments:
        lines += ["# What the model's xacro is given", "xacro:"]
        lines += [f"  {quoted(key)}: {quoted(value)}" for key, value in arguments.items()]
    return "\n".join([*lines, "directives:"])


def _inventory(text: str, models: Mapping[str, Path], srdf: Mapping[str, Path], directory: Path) -> dict[str, Any]:
    """Returns what the models of a scene file, and an SRDF file, hold (:mod:`certifier.scene.inventory`)."""
    with _scene_file(text, directory) as path:
        files = {
            key: {name: str(beside(Path.cwd(), str(file))) for name, file in of.items()} for key, of in (("models", models), ("srdf", srdf))
        }
        payload = {"path": str(path), **files}
        return read_in_child("certifier.scene.inventory:inventory", payload, "the draft", TIMEOUT_S, MEMORY_BYTES)


def _directives(add: Mapping[str, str], parts: Mapping[str, Part], own: Sequence[str], held: Mapping[str, Any]) -> list[str]:
    """Returns the directives that add each model, given by its name, and weld its roots to the world or to the link that carries it."""
    lines = []
    for name, line in add.items():
        lines.append(line)
        part, carried = parts[name], name in own[1:]
        parent = _carrier(part, own[: own.index(name)], held) if carried else "world"
        roots = [root for root in held["roots"] if root["body"].startswith(f"{name}::")]
        if carried and len(roots) != 1:
            message = f"{part.path.name} has {len(roots)} bodies that nothing holds: {', '.join(root['body'] for root in roots)}"
            raise SceneError("mount", message, field="--mount", hint="something that is mounted hangs on one body; join the others to it")
        for root in roots:
            lines += _weld(_placed(root, part), parent)
    if len(add) > 1:
        lines.append("# The X_PC of a weld says where its child stands, in metres and degrees. Without one, that is the parent's origin.")
        lines.append("#   X_PC: {translation: [0.5, 0, 0], rotation: !Rpy {deg: [0, 0, 90]}}")
    return lines


def _carrier(part: Part, before: Sequence[str], held: Mapping[str, Any]) -> str:
    """Returns Drake's name of the link that carries a part: of the robot, or of what was mounted before.

    Raises:
        SceneError: ``mount``, with the links at the ends of the robot.
    """
    links, leaves = ([name for name in held[key] if name.split("::")[0] in before] for key in ("links", "leaves"))
    ends = f"links at its ends: {', '.join(_short(name) for name in leaves)}"
    if not part.link:
        message = f"it is not said where {part.path.name} is mounted"
        raise SceneError("mount", message, field="--mount", hint=f"write {part.path.name}@LINK; {ends}")
    wanted = part.link.replace("/", "::")
    fitting = [name for name in links if name == wanted] or [name for name in links if name.endswith(f"::{wanted}")]
    if len(fitting) != 1:
        what = f"may be {' or '.join(fitting)}" if fitting else "is no link of the robot"
        hint = close_matches(part.link, [_short(name) for name in links]) or ends
        raise SceneError("mount", f"{part.link[:200]!a} {what}", field="--mount", hint=f"write MODEL::LINK; {ends}" if fitting else hint)
    return fitting[0]


def _short(name: str) -> str:
    return name.partition("::")[2]


def _placed(root: Mapping[str, Any], part: Part) -> dict[str, Any]:
    """Returns a body that nothing holds with its pose where its model stands elsewhere than at the origin."""
    turn, own = _rotation(part.rpy), _rotation(root["rpy"])
    translation = np.array(part.translation) + turn @ np.array(root["translation"])
    return {**root, "translation": translation.tolist(), "rpy": np.degrees(RollPitchYaw(turn @ own).vector()).tolist()}


def _rotation(rpy: Sequence[float]) -> RotationMatrix:
    return RotationMatrix(RollPitchYaw(np.radians(rpy)))


def _weld(root: Mapping[str, Any], parent: str) -> list[str]:
    """Returns the directives that hold a body on its parent. Of a model in a model, Drake welds only a frame of the outer one."""
    translation, rpy = ([round(x, 9) + 0.0 for x in root[key]] for key in ("translation", "rpy"))
    parts = [f"translation: {translation}"] if any(translation) else []
    parts += [f"rotation: !Rpy {{deg: {rpy}}}"] if any(rpy) else []
    pose = f", X_PC: {{{', '.join(parts)}}}" if parts else ""
    model, *inside = root["body"].split("::")
    child, lines = root["body"], []
    if len(inside) > 1:
        child = f"{model}::{'_'.join(inside)}_stands"
        lines.append(f"  - add_frame: {{name: {quoted(child)}, X_PF: {{base_frame: {quoted(root['body'])}}}}}")
    return [*lines, f"  - add_weld: {{parent: {quoted(parent)}, child: {quoted(child)}{pose}}}"]


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
    lines = [f"  {quoted(joint)}: [{lower:.12g}, {upper:.12g}]" for joint, (lower, upper) in guessed.items()]
    return ["# The model does not say how far these slide, so this is a guess. Write how far, in metres:", "limits:", *lines]


def _guess(lower: float, upper: float) -> tuple[float, float]:
    if np.isfinite(lower):
        return lower, lower + SLIDE
    return (upper - SLIDE, upper) if np.isfinite(upper) else (-SLIDE, SLIDE)


def _fix(held: Mapping[str, Any]) -> list[str]:
    """Returns where joints are held that others mimic, and where those that Drake does not have follow."""
    mimics = [Mimic(**mimic) for mimic in held["mimics"]]
    followers = {mimic.follower for mimic in mimics} - {*held["unread"]}
    rest = at_rest(mimics, {joint["name"]: (joint["lower"], joint["upper"]) for joint in held["joints"]}, held["state"])
    lines = [f"  {quoted(joint)}: {position:.12g}" for joint, position in rest.items() if joint not in followers]
    said = [
        "# Other joints mimic these, so they are held, and the others with them. Choose where, or write swept for all positions at once.",
        "# Take a line out, and the joint moves and takes the others with it, if docs/scenes.md allows it; q_star needs a number for it.",
    ]
    return [*said, "fix:", *lines] if lines else []


@contextmanager
def _scene_file(text: str, directory: Path) -> Iterator[Path]:
    """Yields a scene file with this text, which is there until the block ends."""
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


def _ignore(pairs: Sequence[Pair], doubtful: Mapping[Pair, str], scene: Scene) -> str:
    if not pairs:
        return ""
    neighbours = {frozenset((j.parent, j.child)) for j in scene.joints}
    lines = [f"# These overlap at all of {TRIED + 1} configurations that were tried, so no region could be certified with them.", "ignore:"]
    for pair in pairs:
        bodies = frozenset(scene.geometry(name).body for name in (pair.a, pair.b))
        why = "neighbours, which overlap" if bodies in neighbours else "they overlap"
        if pair in doubtful:
            lines.append(f"  # Look at these: {doubtful[pair]}.")
            lines.append("  # To certify the pair, take the entry out, and have the mesh decomposed (above).")
            why += ", perhaps as hulls only,"
        lines.append(
            f"  - {{pair: [{quoted(pair.a)}, {quoted(pair.b)}], reason: {quoted(f'{why} at every configuration that was tried')}}}"
        )
    return "\n".join(lines) + "\n"
