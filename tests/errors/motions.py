"""Errors of motions, from the command line and from files."""

from __future__ import annotations

from dataclasses import replace

from certifier.motion.given import given, motion_of, padding_of
from certifier.motion.splines import curve
from certifier.proof.motion import Space
from db import scenes
from tests.certifier.motions import swing
from tests.client.conftest import PLANAR
from tests.errors.rows import Row, Trial, rows
from tests.scenes import slider
from tests.workers.service import eventually

SHAPE = "give two or more, with {n} numbers each, in the scene's order of joints"
FILE = "give q or s, one row of numbers for each waypoint, and perhaps t; or bezier, or knots and control_points"


def planned(t: Trial, *options: str) -> str:
    return t.ciris("certify-path", PLANAR, *options)


def from_file(t: Trial, name: str, content: str) -> str:
    (t.directory / name).write_text(content)
    return planned(t, "--path", name, "--local")


def not_a_motion(t: Trial) -> None:
    t.request.getfixturevalue("scene")
    client = t.request.getfixturevalue("client")
    job = client.post("/v1/jobs", json={"kind": "grow", "scene": "slider", "seed": {"q": [0.0]}}).json()["id"]
    t.ask("GET", f"/v1/jobs/{job}/motion")


def unproved(t: Trial) -> None:
    """Asks for the proof of a motion that begins in contact."""
    database, client = t.request.getfixturevalue("database"), t.request.getfixturevalue("client")
    scene = swing(-0.01)
    with database.write() as session:
        scenes.add(session, scene)
    job = client.post("/v1/jobs", json={"kind": "certify-path", "scene": scene.name, "q": [[0.0], [0.5]]}).json()["id"]
    t.request.getfixturevalue("worker")
    eventually(lambda: client.get(f"/v1/jobs/{job}").json()["ended"], "the job ends")
    t.ask("GET", f"/v1/jobs/{job}/motion/proof")


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
            "there are {waypoints} waypoints, and a proof about this scene holds at most {most}",
            "divide the motion",
            lambda t: given(slider(), [[0.0]] * (1 << 21), Space.Q),
        ),
        (
            "outside_limits",
            "{field}[{i}][{j}]",
            "joint {name} is at {...} in waypoint {i}, not between {...} and {...}",
            "move it between them; waypoints count from 0",
            lambda t: given(slider(), [[0.0], [99.0]], Space.Q),
        ),
        ("padding", "padding", "must be from 0 to {MAGNITUDE} metres, not {value}", "", lambda t: padding_of(-1.0)),
        (
            "motion_shape",
            "bezier",
            "the control points have {...} coordinates each",
            "give {n} numbers for each, in the scene's order of joints",
            lambda t: motion_of(slider(), {"bezier": [[[0.0, 0.0], [0.1, 0.1]]]}),
        ),
        (
            "outside_limits",
            "bezier[{piece}][{k}][{j}]",
            "joint {name} is at {...} in {place}, not between {...} and {...}",
            "all control points must be within the limits, as then all of the motion is; divide a piece whose own are far out",
            lambda t: motion_of(slider(), {"bezier": [[[0.0], [99.0], [0.0]]]}),
        ),
    ),
    *rows(
        "certifier/jobs/motion.py",
        (
            "proof_motion",
            "padding",
            "the proof shows that the bodies are {gap} m apart, and the padding of the request asks for {...} m",
            "ask for a little less",
            "a search whose planes leave too little for what the verifier rounds (tests/certifier/motion/test_clearance.py)",
        ),
    ),
    *rows(
        "certifier/motion/splines.py",
        (
            "curve_shape",
            "bezier",
            "the curve is not given in one way",
            "give either bezier, or knots and control_points",
            lambda t: curve({"knots": [0.0, 0.0, 1.0, 1.0]}),
        ),
        (
            "curve_shape",
            "bezier",
            "a piece has {...} control points, and 2 to {...} are allowed",
            "all pieces are of one degree; raise the lower ones",
            lambda t: curve({"bezier": [[[0.0]]]}),
        ),
        (
            "curve_not_continuous",
            "bezier[{k}][0]",
            "piece {k} does not begin where piece {...} ends; pieces count from 0",
            "its first control point must be the last one of piece {...}, to the last digit",
            lambda t: curve({"bezier": [[[0.0], [0.1]], [[0.2], [0.1]]]}),
        ),
        (
            "curve_shape",
            "knots",
            "{...} knots and {...} control points are those of no spline of a degree from 1 to {DEGREE}",
            "give as many knots as control points, the degree and 1, and more control points than the degree",
            lambda t: curve({"knots": [0.0, 1.0], "control_points": [[0.0], [0.1]]}),
        ),
        (
            "knots",
            "knots[{k}]",
            "knot {k} is less than the one before; knots count from 0",
            "sort them",
            lambda t: curve({"knots": [0.0, 0.0, 1.0, 0.5], "control_points": [[0.0], [0.1]]}),
        ),
        (
            "knots",
            "knots",
            "the domain of the spline, from knot {degree} to {...}, has no length",
            "repeat a knot at most {...} times",
            lambda t: curve({"knots": [0.0, 0.0, 0.0, 1.0], "control_points": [[0.0], [0.1]]}),
        ),
        (
            "curve_not_continuous",
            "knots",
            "the spline of degree {degree} may jump at its knot {...}, which is repeated more than {degree} times",
            "divide the motion there",
            lambda t: curve({"knots": [0.0, 0.0, 1.0, 1.0, 2.0, 2.0], "control_points": [[0.0], [0.1], [0.2], [0.3]]}),
        ),
        (
            "curve_shape",
            "bezier",
            "the numbers are {shape}",
            "give (P, m + 1, n) numbers: the control points of each piece",
            lambda t: curve({"bezier": [[0.0]]}),
        ),
    ),
    *rows(
        "api/routers/jobs.py",
        (
            "motion_not_found",
            "job",
            "the {kind} job {id} is {state} and has no verdict of a motion{...}",
            "a certify-path job has one when it has ended before its deadline",
            not_a_motion,
        ),
        ("proof_not_found", "job", "nothing is proved of this motion", "the contact is where it begins", unproved),
    ),
    *rows(
        "client/motion.py",
        ("option", "--job", "a job needs a service", "leave out --local", lambda t: planned(t, "--q", "0,0", "--local", "--job")),
    ),
    *rows(
        "client/paths.py",
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
        ("path_file", "--path", "{path} is neither .npz nor .json, .yaml or .csv", FILE, lambda t: from_file(t, "path.txt", "0 0")),
        ("path_file", "--path", "there is no file {path}", FILE, lambda t: planned(t, "--path", "none.json", "--local")),
        ("path_file", "--path", "{path} is no {kind} file of numbers", FILE, lambda t: from_file(t, "path.json", "[")),
        ("path_file", "--path", "{path} must have either q or s, or one curve", FILE, lambda t: from_file(t, "path.json", "{}")),
        (
            "path_file",
            "--path",
            "t of {path} must be ascending numbers, one for each waypoint, or for each piece's beginning and for the end",
            "t may be left out",
            lambda t: from_file(t, "path.json", '{"q": [[0, 0], [0, 1]], "t": [1, 0]}'),
        ),
        (
            "path_file",
            "--path",
            "{path} has knots, which are its times, and t",
            "leave t out",
            lambda t: from_file(t, "path.json", '{"knots": [0, 0, 1, 1], "control_points": [[0, 0], [0, 1]], "t": [0, 1]}'),
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
