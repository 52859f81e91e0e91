"""Errors of scene files: their YAML, their directives and their paths."""

from __future__ import annotations

from certifier.scene import load_scene
from tests.errors.rows import Row, rows
from tests.errors.scenes import BELOW, NAMES, NOT_YAML, WELD, YAML, D, linked_away

FILES = rows(
    "certifier/scene/file.py",
    ("scene_not_found", "", "{path} is a directory", "name the scene file in it, which ends in .yaml", lambda t: load_scene(t.directory)),
    (
        "scene_not_found",
        "",
        "there is no scene file {path}",
        "`ciris scene init` drafts one for a robot's model",
        lambda t: load_scene(t.directory / "nothing.yaml"),
    ),
    ("scene_not_found", "", "the scene file {path} cannot be read", "is it there, and may you read it?", "a file of another user"),
    (
        "scene_yaml",
        "",
        "{name} has {...} bytes; a scene file may have at most {MAX_BYTES}",
        "",
        lambda t: t.load("#" * (2**20 + 1)),
    ),
    ("scene_field", "name", "line {...}: {problem}", YAML, lambda t: t.load(D + "name: 2001-99-99\n")),
    ("scene_field", "limits", NOT_YAML, "", lambda t: t.load(D + "limits: {[a]: [0, 1]}\n")),
    (
        "scene_field",
        "directives",
        "is missing",
        "a list of Drake Model Directives that adds the robot and its surroundings",
        lambda t: t.load("name: x\n"),
    ),
    ("scene_field", "mesh.mode", "must be hull, not {...}", "", lambda t: t.load(D + "mesh: {mode: raw}\n")),
    (
        "scene_field",
        "fix.grip",
        "is given twice, again in line {...}",
        "leave one of them out",
        lambda t: t.load(D + "fix: {grip: 0, grip: 1}\n"),
    ),
    ("scene_field", "", "{name} must be a mapping of name, directives and so on", "", lambda t: t.load("- a\n")),
    ("scene_field", "", "{name}, line {...}: a key must be text", "", lambda t: t.load(D + "? [a, b]\n: c\n")),
    ("scene_field", "ignored", "is not a key of a scene file", "did you mean {...}?", lambda t: t.load(D + "ignored: []\n")),
    ("scene_field", "zzz", "is not a key of a scene file", "known keys: {...}", lambda t: t.load(D + "zzz: []\n")),
    ("scene_field", "mesh", "must be a mapping with the keys {...}", "", lambda t: t.load(D + "mesh: 3\n")),
    ("scene_field", "ignore[0][1]", "must be printable text, not {value}", "", lambda t: t.load(D + "ignore: [[a, 3]]\n")),
    ("scene_field", "name", "must be a name, not {value}", NAMES, lambda t: t.load(D + "name: 3\n")),
    (
        "scene_field",
        "ignore[0].reason",
        "must be one line of at most {MAX_SENTENCE} printable characters, not {value}",
        "",
        lambda t: t.load(D + "ignore: [{pair: [a, b], reason: 3}]\n"),
    ),
    ("scene_field", "padding", "must be a number of at most {MAGNITUDE}, not {value}", "", lambda t: t.load(D + "padding: .nan\n")),
    ("scene_field", "padding", "must be at least {minimum}, not {value}", "", lambda t: t.load(D + "padding: -1\n")),
    ("scene_field", "cylinder_sides", "must be a whole number, not {value}", "", lambda t: t.load(D + "cylinder_sides: 3.5\n")),
    ("scene_field", "packages", "must map names of packages to directories", "", lambda t: t.load(D + "packages: [m]\n")),
    (
        "scene_field",
        "packages.m",
        "there is no directory {path}",
        "a path that does not begin with / starts at the directory of the scene file",
        lambda t: t.load(D + "packages: {m: nowhere}\n"),
    ),
    ("scene_field", "q_star", "must be a list of numbers, one per joint", "", lambda t: t.load(D + "q_star: 3\n")),
    ("scene_field", "fix", "must map names of joints to numbers", "", lambda t: t.load(D + "fix: 3\n")),
    (
        "scene_field",
        "limits.a",
        "must be two numbers, [lower, upper], in radians or metres",
        "",
        lambda t: t.load(D + "limits: {a: 3}\n"),
    ),
    (
        "scene_field",
        "limits.a",
        "must have an interior: {lower} is not less than {upper}",
        "hold a joint by fix",
        lambda t: t.load(D + "limits: {a: [1, 1]}\n"),
    ),
    ("scene_field", "ignore", "must be a list of pairs of names", "", lambda t: t.load(D + "ignore: 3\n")),
    ("scene_field", "ignore[0]", "must be two names, [a, b] or {pair: [a, b], reason: ...}", "", lambda t: t.load(D + "ignore: [[a]]\n")),
    ("scene_field", "cylinder_sides", "must be at most {maximum}, not {value}", "", lambda t: t.load("cylinder_sides: 100000\n" + D)),
    ("scene_field", "hulls", "must be a list of bodies, such as [arm/link_1]", "", lambda t: t.load("hulls: arm/hand\n" + D)),
    (
        "scene_field",
        "directives",
        "must be a list of Drake Model Directives with at least one entry",
        "",
        lambda t: t.load("directives: []\n"),
    ),
    (
        "scene_field",
        "directives[0]",
        "must be a mapping with one key, the kind of directive, such as add_model",
        "",
        lambda t: t.load("directives: [add_model]\n"),
    ),
    ("scene_field", "directives", "line {line}: {file} is not a relative path", BELOW, lambda t: t.load(D.replace("a.urdf", "/a.urdf"))),
)

NODES = rows(
    "certifier/scene/nodes.py",
    ("scene_yaml", "", "{name}: byte {start} is not UTF-8 text", "save the file as UTF-8", lambda t: t.load(b"\xff\xfename")),
    ("scene_yaml", "directives", "{name} cannot be read", "is it a file, and may you read it?", "directives in a file of another user"),
    (
        "scene_yaml",
        "",
        "{name}, line {line}: the character U+{...} ends a line for some readers and not for others",
        "end lines by LF or CRLF",
        lambda t: t.load("# a\u2028b\n" + D),
    ),
    ("scene_yaml", "", "{name} may be nested at most {MAX_DEPTH} levels deep", "", lambda t: t.load("[" * 60 + "]" * 60)),
    ("scene_yaml", "", "{name}{where}: {problem}", YAML, lambda t: t.load("name: [unclosed\n" + D)),
    ("scene_yaml", "", "{name} is not YAML: {...}", YAML, lambda t: t.load("name: \x07\n")),
    (
        "scene_yaml",
        "",
        "{where}: the anchor or alias {...} is refused",
        "write out what it stands for",
        lambda t: t.load("a: &x [1]\nb: *x\n"),
    ),
    (
        "scene_yaml",
        "",
        "{where}: the tag {...} is refused",
        "remove it, and write values as they are; known tags: {...}",
        lambda t: t.load(D + "name: !thing x\n"),
    ),
    (
        "scene_yaml",
        "",
        "{name}, line {...}: the merge key << is refused",
        "write out the keys that it brings in",
        lambda t: t.load(D + "limits: {<<: {a: [0, 1]}}\n"),
    ),
)

DIRECTIVES = rows(
    "certifier/scene/directives.py",
    (
        "scene_field",
        "directives",
        "the text goes over several lines",
        "write it on one line, in quotes",
        lambda t: t.load("directives:\n- add_model:\n    file: >-\n      a.urdf\n"),
    ),
    (
        "scene_field",
        "directives",
        "the text {...} has a character that cannot be printed",
        "remove it",
        lambda t: t.load(D.replace("a.urdf", '"a.urdf\\0"')),
    ),
    (
        "scene_field",
        "directives",
        "axis of {what} is shorter than {_SHORT}",
        "write its direction with the length 1",
        lambda t: t.load(D.replace("}}", "}}, " + WELD.format("rotation: !AngleAxis {angle_deg: 1, axis: [0, 0, 0]}"))),
    ),
    (
        "scene_field",
        "directives",
        "{what} has {...} in the place of a finite decimal number of at most {MAGNITUDE}",
        "write such numbers, in metres, degrees or radians",
        lambda t: t.load(D.replace("}}", "}}, " + WELD.format("translation: [.nan, 0, 0]"))),
    ),
)

PATHS = rows(
    "certifier/scene/paths.py",
    (
        "scene_model",
        "directives",
        "{...} goes up by .. from a symbolic link, and readers disagree about where that leads",
        "name the directory under packages, and write package://NAME/FILE",
        linked_away,
    ),
)

SCENE_FILES: list[Row] = [*FILES, *NODES, *DIRECTIVES, *PATHS]
