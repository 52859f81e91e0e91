"""Errors of scene files: their YAML, their directives and their paths."""

from __future__ import annotations

from certifier.scene import load_scene
from tests.errors.scenes import WELD, D
from tests.errors.trial import Table, Trial


def unreadable_directives(t: Trial) -> None:
    (t.directory / "more.yaml").symlink_to("/proc/self/mem")
    t.load("directives: [{add_directives: {file: more.yaml}}]\n")


SCENE_FILES: Table = {
    ("scene_not_found", ""): [
        lambda t: load_scene(t.directory),
        lambda t: load_scene(t.directory / "nothing.yaml"),
        lambda t: load_scene("/proc/self/mem"),
    ],
    ("scene_yaml", "directives"): [unreadable_directives],
    ("scene_yaml", ""): [
        lambda t: t.load("#" * (2**20 + 1)),
        lambda t: t.load(b"\xff\xfename"),
        lambda t: t.load("# a\u2028b\n" + D),
        lambda t: t.load("# a\n\ufeff" + D),
        lambda t: t.load("[" * 60 + "]" * 60),
        lambda t: t.load("name: [unclosed\n" + D),
        lambda t: t.load("name: \x07\n"),
        lambda t: t.load("a: &x [1]\nb: *x\n"),
        lambda t: t.load(D + "name: !thing x\n"),
        lambda t: t.load(D + "limits: {<<: {a: [0, 1]}}\n"),
    ],
    ("scene_field", "name"): [lambda t: t.load(D + "name: 2001-99-99\n"), lambda t: t.load(D + "name: 3\n")],
    ("scene_field", "limits"): [lambda t: t.load(D + "limits: {[a]: [0, 1]}\n")],
    ("scene_field", "directives"): [
        lambda t: t.load("name: x\n"),
        lambda t: t.load("directives: []\n"),
        lambda t: t.load(D.replace("a.urdf", "/a.urdf")),
        lambda t: t.load("directives:\n- add_model:\n    file: >-\n      a.urdf\n"),
        lambda t: t.load(D.replace("a.urdf", '"a.urdf\\0"')),
        lambda t: t.load(D.replace("}}", "}}, " + WELD.format("rotation: !AngleAxis {angle_deg: 1, axis: [0, 0, 0]}"))),
        lambda t: t.load(D.replace("}}", "}}, " + WELD.format("translation: [.nan, 0, 0]"))),
    ],
    ("scene_field", "conditions"): [lambda t: t.load(D + "conditions: {a: 1}\n")],
    ("scene_field", "conditions[0]"): [
        lambda t: t.load(D + "conditions: [3]\n"),
        lambda t: t.load(D + "conditions: [{name: up}]\n"),
        lambda t: t.load(D + "conditions: [{name: up, cone: {}, range: {}}]\n"),
    ],
    ("scene_field", "conditions[0].name"): [lambda t: t.load(D + "conditions: [{cone: {}}]\n")],
    ("scene_field", "conditions[1].name"): [
        lambda t: t.load(D + "conditions: [{name: up, distance: {}}, {name: up, distance: {}}]\n"),
    ],
    ("scene_field", "conditions[0].cone"): [lambda t: t.load(D + "conditions: [{name: up, cone: 3}]\n")],
    ("scene_field", "conditions[0].cone.angle"): [lambda t: t.load(D + "conditions: [{name: up, cone: {angle: 3}}]\n")],
    ("scene_field", "mesh.mode"): [lambda t: t.load(D + "mesh: {mode: raw}\n")],
    ("scene_field", "fix.grip"): [lambda t: t.load(D + "fix: {grip: 0, grip: 1}\n"), lambda t: t.load(D + "fix: {grip: open}\n")],
    ("scene_field", "padding.bodies"): [lambda t: t.load(D + "padding: {bodies: [a]}\n")],
    ("scene_field", "padding.pairs"): [lambda t: t.load(D + "padding: {pairs: {a: 1}}\n")],
    ("scene_field", "padding.pairs[0].pair"): [lambda t: t.load(D + "padding: {pairs: [{pair: [a], padding: 1}]}\n")],
    ("scene_field", ""): [lambda t: t.load("- a\n"), lambda t: t.load(D + "? [a, b]\n: c\n")],
    ("scene_field", "ignored"): [lambda t: t.load(D + "ignored: []\n")],
    ("scene_field", "zzz"): [lambda t: t.load(D + "zzz: []\n")],
    ("scene_field", "xacro"): [lambda t: t.load(D + "xacro: 3\n")],
    ("scene_field", "mesh"): [lambda t: t.load(D + "mesh: 3\n")],
    ("scene_field", "ignore[0][1]"): [lambda t: t.load(D + "ignore: [[a, 3]]\n")],
    ("scene_field", "ignore[0].reason"): [lambda t: t.load(D + "ignore: [{pair: [a, b], reason: 3}]\n")],
    ("scene_field", "padding"): [lambda t: t.load(D + "padding: .nan\n"), lambda t: t.load(D + "padding: -1\n")],
    ("scene_field", "cylinder_sides"): [lambda t: t.load(D + "cylinder_sides: 3.5\n"), lambda t: t.load("cylinder_sides: 100000\n" + D)],
    ("scene_field", "packages"): [lambda t: t.load(D + "packages: [m]\n")],
    ("scene_field", "packages.m"): [lambda t: t.load(D + "packages: {m: nowhere}\n")],
    ("scene_field", "q_star"): [lambda t: t.load(D + "q_star: 3\n")],
    ("scene_field", "fix"): [lambda t: t.load(D + "fix: 3\n")],
    ("scene_field", "limits.a"): [lambda t: t.load(D + "limits: {a: 3}\n"), lambda t: t.load(D + "limits: {a: [1, 1]}\n")],
    ("scene_field", "ignore"): [lambda t: t.load(D + "ignore: 3\n")],
    ("scene_field", "ignore[0]"): [lambda t: t.load(D + "ignore: [[a]]\n")],
    ("scene_field", "hulls"): [lambda t: t.load("hulls: arm/hand\n" + D)],
    ("scene_field", "decompose"): [lambda t: t.load("decompose: [arm/hand/palm]\n" + D)],
    ("scene_field", "directives[0]"): [lambda t: t.load("directives: [add_model]\n")],
}
