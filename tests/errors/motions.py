"""Errors of motions, from the command line and from files."""

from __future__ import annotations

from dataclasses import replace

from certifier.motion.given import given
from certifier.proof.motion import Space
from tests.client.conftest import PLANAR
from tests.errors.rows import Row, Trial, rows
from tests.scenes import slider

SHAPE = "give two or more, with {n} numbers each, in the scene's order of joints"
FILE = "give q or s, one row of numbers for each waypoint, and perhaps t"


def planned(t: Trial, *options: str) -> str:
    return t.ciris("certify-path", PLANAR, *options)


def from_file(t: Trial, name: str, content: str) -> str:
    (t.directory / name).write_text(content)
    return planned(t, "--path", name, "--local")


MOTIONS: list[Row] = [
    *rows(
        "certifier/motion/given.py",
        ("motion_shape", "waypoints", "the waypoints are {shape}", SHAPE, lambda t: given(slider(), [[0.0]], Space.Q)),
        ("motion_shape", "waypoints", "the waypoints are {shape}", SHAPE, lambda t: given(slider(), [[0.0], ["x"]], Space.Q)),
        (
            "motion_shape",
            "scene",
            "the scene has no pair of bodies to keep apart",
            "add what moves against something else",
            lambda t: given(replace(slider(), pairs=()), [[0.0], [0.1]], Space.Q),
        ),
        (
            "motion_too_long",
            "waypoints",
            "there are {...} waypoints, and a proof about this scene holds at most {most}",
            "divide the motion",
            lambda t: given(slider(), [[0.0]] * (1 << 21), Space.Q),
        ),
        (
            "motion_not_finite",
            "{field}[{i}][{j}]",
            "{...} is no number of at most {MAGNITUDE}",
            "",
            lambda t: given(slider(), [[0.0], [float("nan")]], Space.Q),
        ),
        (
            "outside_limits",
            "{field}[{i}][{j}]",
            "joint {name} is at {...} in waypoint {i}, not between {...} and {...}",
            "move it between them; waypoints count from 0",
            lambda t: given(slider(), [[0.0], [99.0]], Space.Q),
        ),
    ),
    *rows(
        "client/motion.py",
        (
            "option",
            "--path",
            "a motion needs its waypoints, from one place",
            "give them with --q, once for each, or as a file with --path",
            lambda t: planned(t, "--local"),
        ),
        (
            "motion_shape",
            "--q",
            "the waypoints have different numbers of joints",
            "give one number for each joint",
            lambda t: planned(t, "--q", "0,0", "--q", "0"),
        ),
    ),
    *rows(
        "client/paths.py",
        ("path_file", "--path", "{path} is neither .npz nor .json, .yaml or .csv", FILE, lambda t: from_file(t, "path.txt", "0 0")),
        ("path_file", "--path", "there is no file {path}", FILE, lambda t: planned(t, "--path", "none.json", "--local")),
        ("path_file", "--path", "{path} is no {kind} file of numbers", FILE, lambda t: from_file(t, "path.json", "[")),
        ("path_file", "--path", "{path} must have either q or s", FILE, lambda t: from_file(t, "path.json", "{}")),
        (
            "path_file",
            "--path",
            "t of {path} must be ascending numbers, one for each waypoint",
            "t may be left out",
            lambda t: from_file(t, "path.json", '{"q": [[0, 0], [0, 1]], "t": [1, 0]}'),
        ),
        ("path_file", "--path", "{path}, waypoint {i}: {wrong} is no number", FILE, lambda t: from_file(t, "path.csv", "0,0\n0,x\n")),
        (
            "path_file",
            "--path",
            "{path}, waypoint {i}: it must have {columns} numbers, as the first row",
            "",
            lambda t: from_file(t, "path.csv", "0,0\n0\n"),
        ),
    ),
]
