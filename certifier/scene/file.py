"""The scene file is read and checked against its schema here; errors name the field.

The file is composed into YAML nodes and not loaded. So ``directives`` reach Drake as they were written, tags and all, at the same line
numbers. Only their relative ``file`` paths are made absolute, because in a string Drake has no directory to start from.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from certifier.configurations import Q_STAR, is_configuration_name
from certifier.errors import SceneError
from certifier.names import ALPHABET, SCENE_ALPHABET, is_scene_name
from certifier.scene import fields
from certifier.scene.conditions import ConditionEntry, read_conditions
from certifier.scene.directives import added_files, check_directives, replaced, resolved
from certifier.scene.nodes import compose, decoded
from certifier.scene.paddings import PaddedPair, Paddings
from certifier.scene.paths import beside

KEYS = (
    *("name", "packages", "directives", "srdf", "q_star", "limits", "fix", "configurations", "padding", "ignore", "hulls"),
    *("decompose", "mesh", "cylinder_sides", "xacro", "conditions"),
)
"""The keys of a scene file."""
SWEPT = "swept"
"""The word for a joint in ``fix`` that is not held at a position."""
MAX_BYTES = 2**20
MIN_HULL_VERTICES = 8
MAX_VERTICES, MAX_SIDES = 512, 128
"""What certifying costs grows with the vertices of a body, so nobody needs more."""
FINEST = 1e-5
"""The parts of a mesh may be asked to be so near to it, in metres, and no nearer."""


@dataclass(frozen=True)
class IgnoreEntry:
    """Names two bodies or geometries whose pairs are not certified; ``field`` is where the file says so."""

    a: str
    b: str
    reason: str
    field: str


@dataclass(frozen=True)
class SceneFile:
    """Holds a scene file that has passed the schema.

    Attributes:
        path: the file itself.
        packages: absolute root directories for package:// URIs, by the package's name.
        directives: Drake Model Directives, verbatim.
        resolved_directives: a document for Drake, the same directives with absolute paths, at the line numbers of the file.
        models: every ``file`` of the directives, as written.
        q_star: (n,) centre of the parametrisation, radians or metres; None for the middle of the joint limits.
        limits: narrower limits by joint, radians or metres.
        fix: positions by joint, radians or metres, at which joints are held.
        swept: joints of which everything behind them counts at all positions.
        padding: metres that are added around both geometries of every pair that ``paddings`` does not concern.
        paddings: what the file says of the padding of bodies and of pairs.
        ignore: the pairs that are not certified.
        hulls: the bodies that one hull of all their polytopes stands for.
        decompose: by mesh geometry, how far its convex parts may reach beyond it, metres.
        max_vertices: greatest number of vertices that stand for a mesh or an ellipsoid.
        xacro: arguments of models that are written in xacro.
        cylinder_sides: number of sides of the prism that stands for a cylinder.
        srdf: the SRDF file of a model, as written, by the model's name.
        configurations: positions by joint, or one for every joint, radians or metres, by the name of the configuration.
        conditions: what has to hold beside that no pair touches.
    """

    path: Path
    name: str
    packages: dict[str, Path]
    directives: str
    resolved_directives: str
    models: tuple[str, ...]
    q_star: tuple[float, ...] | None = None
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    fix: dict[str, float] = field(default_factory=dict)
    swept: tuple[str, ...] = ()
    padding: float = 0.0
    paddings: Paddings = field(default_factory=Paddings)
    ignore: tuple[IgnoreEntry, ...] = field(default=())
    hulls: tuple[str, ...] = ()
    decompose: dict[str, float] = field(default_factory=dict)
    max_vertices: int = 32
    cylinder_sides: int = 12
    xacro: dict[str, str | int | float | bool] = field(default_factory=dict)
    srdf: dict[str, str] = field(default_factory=dict)
    configurations: dict[str, dict[str, float] | tuple[float, ...]] = field(default_factory=dict)
    conditions: tuple[ConditionEntry, ...] = ()

    @property
    def largest_padding(self) -> float:
        """Returns the largest padding that the file gives, in metres."""
        return max(self.padding, *self.paddings.bodies.values(), *(pair.padding for pair in self.paddings.pairs), 0.0)

    @property
    def files(self) -> tuple[str, ...]:
        """Returns every file that the scene file itself names, as written."""
        return (*self.models, *self.srdf.values())


def read_scene_file(path: Path) -> SceneFile:
    """Reads and checks a scene file.

    Raises:
        SceneError: ``scene_not_found``, ``scene_yaml`` (not YAML, with the line) or ``scene_field`` (with the field).
    """
    text = _text(path)
    nodes = _mapping(compose(text, path.name), path.name, KEYS)
    if "directives" not in nodes:
        raise fields.wrong("directives", "is missing", hint="a list of Drake Model Directives that adds the robot and its surroundings")
    values: dict[str, Any] = {key: fields.construct(node, key) for key, node in nodes.items() if key != "directives"}
    mesh = fields.section(values.get("mesh", {}), "mesh", ("mode", "max_vertices"))
    if mesh.get("mode", "hull") != "hull":
        raise fields.wrong("mesh.mode", f"must be hull, not {mesh['mode']!r}")
    fix = _by_joint(values.get("fix", {}), "fix")
    padding, paddings = _padding(values.get("padding", 0.0))
    directives = nodes["directives"]
    _check_directives(directives, path.name)
    return SceneFile(
        path=path,
        name=_scene_name(values.get("name", path.parent.name if path.stem == "scene" else path.stem)),
        packages=_packages(values.get("packages", {}), path.parent),
        directives=text[directives.start_mark.index : directives.end_mark.index].rstrip(),
        resolved_directives=resolved(text, directives, path.parent),
        models=tuple(added.file for added in added_files(directives)),
        q_star=_q_star(values.get("q_star")),
        limits=_limits(values.get("limits", {})),
        fix={name: _position(value, f"fix.{name}") for name, value in fix.items() if value != SWEPT},
        swept=tuple(name for name, value in fix.items() if value == SWEPT),
        padding=padding,
        paddings=paddings,
        ignore=_ignore(values.get("ignore", [])),
        hulls=_hulls(values.get("hulls", [])),
        decompose=_decompose(values.get("decompose", {})),
        max_vertices=fields.integer(mesh.get("max_vertices", 32), "mesh.max_vertices", minimum=MIN_HULL_VERTICES, maximum=MAX_VERTICES),
        cylinder_sides=fields.integer(values.get("cylinder_sides", 12), "cylinder_sides", minimum=3, maximum=MAX_SIDES),
        srdf=_srdf(values.get("srdf", {})),
        configurations=_configurations(values.get("configurations", {})),
        xacro=_arguments(values.get("xacro", {})),
        conditions=read_conditions(values.get("conditions", [])),
    )


def read_condition_file(path: Path) -> list[dict[str, Any]]:
    """Returns the ``conditions`` of a file that has them as a scene file has them, and nothing else.

    Raises:
        SceneError: as :func:`read_scene_file`; the field begins with the file.
    """
    try:
        return _conditions_in(path)
    except SceneError as error:
        error.field = f"{path.name}: {error.field}" if error.field else path.name
        raise


def _conditions_in(path: Path) -> list[dict[str, Any]]:
    nodes = _mapping(compose(_text(path), path.name), path.name, ("conditions",))
    if "conditions" not in nodes:
        raise fields.wrong("conditions", "is missing", hint="write conditions, as docs/conditions.md shows them")
    found: list[dict[str, Any]] = fields.construct(nodes["conditions"], "conditions")
    read_conditions(found)
    return found


def existing(path: str | Path) -> Path:
    """Returns the absolute path of a scene file that is there. No directory in it is a symbolic link, and the file itself may be one.

    Raises:
        SceneError: ``scene_not_found``.
    """
    path = Path(path)
    if path.is_dir():
        raise SceneError("scene_not_found", f"{path} is a directory", hint="name the scene file in it, which ends in .yaml")
    if not path.is_file():
        raise SceneError("scene_not_found", f"there is no scene file {path}", hint="`ciris scene init` drafts one for a robot's model")
    return path.parent.resolve() / path.name


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError:
        raise SceneError("scene_not_found", f"the file {path} cannot be read", hint="is it there, and may you read it?") from None
    if len(data) > MAX_BYTES:
        raise SceneError("scene_yaml", f"{path.name} is too long: a scene file may have at most {MAX_BYTES} bytes")
    return decoded(data, path.name)


def _mapping(node: yaml.Node | None, name: str, known: tuple[str, ...]) -> dict[str, yaml.Node]:
    if not isinstance(node, yaml.MappingNode):
        raise fields.wrong("", f"{name} must be a mapping with the {'keys' if known[1:] else 'key'} {', '.join(known)}")
    found: dict[str, yaml.Node] = {}
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise fields.wrong("", f"{name}, line {key.start_mark.line + 1}: a key must be text")
        if key.value in found:
            raise fields.twice(str(key.value), key)
        found[key.value] = value
    fields.check_known(found, "", known)
    return found


def _scene_name(value: Any) -> str:
    if not is_scene_name(value):
        raise fields.wrong("name", f"must be a name of a scene, not {value!a}"[:200], hint=f"names have {SCENE_ALPHABET}")
    return str(value)


def _packages(value: Any, directory: Path) -> dict[str, Path]:
    if not isinstance(value, dict):
        raise fields.wrong("packages", "must map names of packages to directories")
    roots = {}
    for name, root in value.items():
        path = beside(directory, fields.string(root, f"packages.{name}"))
        if not path.is_dir():
            hint = "a path that does not begin with / starts at the directory of the scene file"
            raise fields.wrong(f"packages.{name}", f"there is no directory {path}", hint=hint)
        roots[fields.name(name, "packages")] = path
    return roots


def _srdf(value: Any) -> dict[str, str]:
    if not isinstance(value, dict):
        raise fields.wrong("srdf", "must map names of models to SRDF files")
    return {fields.name(model, "srdf"): _srdf_file(file, f"srdf.{model}") for model, file in value.items()}


def _srdf_file(value: Any, where: str) -> str:
    file = fields.name(value, where)
    if not file.endswith(".srdf"):
        raise fields.wrong(where, f"must name a file that ends in .srdf, not {file!r}", hint="rename the file")
    return file


def _configurations(value: Any) -> dict[str, dict[str, float] | tuple[float, ...]]:
    if not isinstance(value, dict):
        raise fields.wrong("configurations", "must map names to joint positions")
    found: dict[str, dict[str, float] | tuple[float, ...]] = {}
    for name, said in value.items():
        if not is_configuration_name(name):
            hint = f"names have {ALPHABET}, but no commas; a number and {Q_STAR} are none"
            raise fields.wrong("configurations", f"{name!a} cannot be the name of a configuration", hint=hint)
        where = f"configurations.{name}"
        if isinstance(said, list):
            found[name] = tuple(fields.number(x, f"{where}[{i}]") for i, x in enumerate(said))
        elif isinstance(said, dict) and said:
            found[name] = {joint: fields.number(x, f"{where}.{joint}") for joint, x in _by_joint(said, where).items()}
        else:
            raise fields.wrong(where, "must be positions by joint, as in {turn: 0.5}, or a list of numbers, one per joint")
    return found


def _q_star(value: Any) -> tuple[float, ...] | None:
    if value is None:
        return None
    if not isinstance(value, list):
        raise fields.wrong("q_star", "must be a list of numbers, one per joint")
    return tuple(fields.number(x, f"q_star[{i}]") for i, x in enumerate(value))


def _by_joint(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise fields.wrong(where, "must map names of joints to numbers")
    return {fields.name(name, where): content for name, content in value.items()}


def _position(value: Any, where: str) -> float:
    if isinstance(value, str):
        raise fields.wrong(where, f"must be a position, in radians or metres, or the word {SWEPT}, not {value!r}")
    return fields.number(value, where)


def _limits(value: Any) -> dict[str, tuple[float, float]]:
    found = {}
    for name, limits in _by_joint(value, "limits").items():
        where = f"limits.{name}"
        if not isinstance(limits, list) or len(limits) != 2:
            raise fields.wrong(where, "must be two numbers, [lower, upper], in radians or metres")
        lower, upper = (fields.number(limit, f"{where}[{i}]") for i, limit in enumerate(limits))
        if lower >= upper:
            raise fields.wrong(where, f"must have an interior: {lower:g} is not less than {upper:g}", hint="hold a joint by fix")
        found[name] = (lower, upper)
    return found


def _padding(value: Any) -> tuple[float, Paddings]:
    """Returns the padding of all pairs, and that of bodies and pairs that have another one."""
    if not isinstance(value, dict):
        return fields.number(value, "padding", minimum=0.0), Paddings()
    fields.check_known(value, "padding", ("default", "bodies", "pairs"))
    bodies, pairs = value.get("bodies", {}), value.get("pairs", [])
    if not isinstance(bodies, dict):
        raise fields.wrong("padding.bodies", "must map names of bodies or geometries to metres")
    if not isinstance(pairs, list):
        raise fields.wrong("padding.pairs", "must be a list of {pair: [a, b], padding: metres}")
    found = {fields.string(name, "padding.bodies"): fields.number(x, f"padding.bodies.{name}", minimum=0.0) for name, x in bodies.items()}
    entries = tuple(_padded_pair(entry, f"padding.pairs[{i}]") for i, entry in enumerate(pairs))
    return fields.number(value.get("default", 0.0), "padding.default", minimum=0.0), Paddings(found, entries)


def _padded_pair(value: Any, where: str) -> PaddedPair:
    entry = fields.section(value, where, ("pair", "padding"))
    pair = entry.get("pair")
    if not isinstance(pair, list) or len(pair) != 2:
        raise fields.wrong(f"{where}.pair", "must be two names, [a, b]")
    a, b = (fields.string(name, f"{where}.pair[{k}]") for k, name in enumerate(pair))
    return PaddedPair(a, b, fields.number(entry.get("padding"), f"{where}.padding", minimum=0.0), f"{where}.pair")


def _ignore(value: Any) -> tuple[IgnoreEntry, ...]:
    if not isinstance(value, list):
        raise fields.wrong("ignore", "must be a list of pairs of names")
    entries = []
    for i, entry in enumerate(value):
        where = f"ignore[{i}]"
        reason = "ignored by the scene file"
        if isinstance(entry, dict):
            fields.check_known(entry, where, ("pair", "reason"))
            reason = fields.sentence(entry.get("reason", reason), f"{where}.reason")
            where, entry = f"{where}.pair", entry.get("pair")
        if not isinstance(entry, list) or len(entry) != 2:
            raise fields.wrong(where, "must be two names, [a, b] or {pair: [a, b], reason: ...}")
        a, b = (fields.string(name, f"{where}[{k}]") for k, name in enumerate(entry))
        entries.append(IgnoreEntry(a, b, reason, where))
    return tuple(entries)


def _hulls(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise fields.wrong("hulls", "must be a list of bodies, such as [arm/link_1]")
    return tuple(dict.fromkeys(fields.string(name, f"hulls[{k}]") for k, name in enumerate(value)))


def _decompose(value: Any) -> dict[str, float]:
    if not isinstance(value, dict):
        raise fields.wrong(
            "decompose", "must map names of geometries to how they are decomposed, as in {room/walls/bin: {threshold: 0.01}}"
        )
    found = {}
    for name, said in value.items():
        where = f"decompose.{fields.name(name, 'decompose')}"
        threshold = fields.section(said, where, ("threshold",)).get("threshold")
        found[name] = fields.number(threshold, f"{where}.threshold", minimum=FINEST)
    return found


def _arguments(value: Any) -> dict[str, str | int | float | bool]:
    if not isinstance(value, dict):
        raise fields.wrong("xacro", "must map names of arguments to text, numbers, true or false")
    for name, argument in value.items():
        fields.string(name, "xacro")
        if not isinstance(argument, bool | int | float):
            fields.sentence(argument, f"xacro.{name}")
    return value


def _check_directives(node: yaml.Node, name: str) -> None:
    if not isinstance(node, yaml.SequenceNode) or not node.value:
        raise fields.wrong("directives", "must be a list of Drake Model Directives with at least one entry")
    fields.check_unique(node, "directives")
    for i, entry in enumerate(node.value):
        if not isinstance(entry, yaml.MappingNode) or len(entry.value) != 1:
            raise fields.wrong(f"directives[{i}]", "must be a mapping with one key, the kind of directive, such as add_model")
    check_directives(node, name)
    for added in added_files(node):
        if added.file.startswith(("/", "~", "file:")):
            hint = "name a directory above it under packages, and write package://NAME/FILE"
            raise fields.wrong("directives", f"line {added.line}: {added.file!a} is not a relative path", hint=hint)


def for_bundle(path: Path) -> str:
    """Returns the text of a scene file that has passed the schema, as it can travel.

    Absolute paths of packages are relative to its directory, and there are no arguments of xacro: models travel expanded.
    """
    text = _text(path)
    root = compose(text, path.name)
    assert isinstance(root, yaml.MappingNode), "it has passed the schema"
    roots = [node for key, packages in root.value if key.value == "packages" for _, node in packages.value]
    directory = os.path.abspath(path.parent)
    absolute = [node for node in roots if node.value.startswith("/")]
    relative = [json.dumps(os.path.relpath(node.value, directory), ensure_ascii=False) for node in absolute]
    changes = list(zip(absolute, relative, strict=True))
    for key, node in root.value:
        if key.value == "xacro":
            changes.append((node, "{}" + "\n" * text[node.start_mark.index : node.end_mark.index].count("\n")))
    return replaced(text, 0, len(text), sorted(changes, key=lambda change: change[0].start_mark.index))
