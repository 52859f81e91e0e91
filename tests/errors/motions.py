"""Errors of motions, from the command line and from files."""

from __future__ import annotations

from dataclasses import replace

from certifier.motion.given import given, motion_of
from certifier.motion.padding import padding_of
from certifier.motion.splines import curve
from certifier.proof.motion import Space
from db import scenes
from tests.certifier.motions import swing
from tests.client.conftest import PLANAR
from tests.errors.trial import Table, Trial
from tests.scenes import slider
from tests.workers.service import eventually


def planned(t: Trial, *options: str) -> None:
    t.ciris("certify-path", PLANAR, *options)


def from_file(t: Trial, name: str, content: str) -> None:
    (t.directory / name).write_text(content)
    planned(t, "--path", name, "--local")


def not_a_motion(t: Trial) -> None:
    t.need("scene")
    client = t.need("client")
    job = client.post("/v1/jobs", json={"kind": "grow", "scene": "slider", "seed": {"q": [0.0]}}).json()["id"]
    t.ask("GET", f"/v1/jobs/{job}/motion")


def unproved(t: Trial) -> None:
    """Asks for the proof of a motion that begins in contact."""
    database, client = t.need("database"), t.need("client")
    scene = swing(-0.01)
    with database.write() as session:
        scenes.add(session, scene)
    job = client.post("/v1/jobs", json={"kind": "certify-path", "scene": scene.name, "q": [[0.0], [0.5]]}).json()["id"]
    t.need("worker")
    eventually(lambda: client.get(f"/v1/jobs/{job}").json()["ended"], "the job ends")
    t.ask("GET", f"/v1/jobs/{job}/motion/proof")


MOTIONS: Table = {
    ("motion_shape", "waypoints"): [
        lambda t: given(slider(), [[0.0]], Space.Q),
        lambda t: given(slider(), [[0.0, 0.0]] * 2, Space.Q),
        lambda t: given(slider(), [[0.0], ["x"]], Space.Q),
    ],
    ("no_pairs", "scene"): [lambda t: given(replace(slider(), pairs=()), [[0.0], [0.1]], Space.Q)],
    ("motion_too_long", "waypoints"): [lambda t: given(slider(), [[0.0]] * (1 << 21), Space.Q)],
    ("outside_limits", "waypoints[1][0]"): [lambda t: given(slider(), [[0.0], [99.0]], Space.Q)],
    ("padding", "padding"): [lambda t: padding_of(-1.0)],
    ("motion_shape", "bezier"): [lambda t: motion_of(slider(), {"bezier": [[[0.0, 0.0], [0.1, 0.1]]]})],
    ("outside_limits", "bezier[0][1][0]"): [lambda t: motion_of(slider(), {"bezier": [[[0.0], [99.0], [0.0]]]})],
    ("curve_shape", "bezier"): [
        lambda t: curve({"knots": [0.0, 0.0, 1.0, 1.0]}),
        lambda t: curve({"bezier": [[[0.0]]]}),
        lambda t: curve({"bezier": [[0.0]]}),
    ],
    ("curve_not_continuous", "bezier[1][0]"): [lambda t: curve({"bezier": [[[0.0], [0.1]], [[0.2], [0.1]]]})],
    ("curve_shape", "knots"): [lambda t: curve({"knots": [0.0, 1.0], "control_points": [[0.0], [0.1]]})],
    ("knots", "knots[3]"): [lambda t: curve({"knots": [0.0, 0.0, 1.0, 0.5], "control_points": [[0.0], [0.1]]})],
    ("knots", "knots"): [lambda t: curve({"knots": [0.0, 0.0, 0.0, 1.0], "control_points": [[0.0], [0.1]]})],
    ("curve_not_continuous", "knots"): [
        lambda t: curve({"knots": [0.0, 0.0, 1.0, 1.0, 2.0, 2.0], "control_points": [[0.0], [0.1], [0.2], [0.3]]})
    ],
    ("motion_not_found", "job"): [not_a_motion],
    ("proof_not_found", "job"): [unproved],
    ("option", "--job"): [lambda t: planned(t, "--q", "0,0", "--local", "--job")],
    ("option", "--deadline"): [lambda t: planned(t, "--q", "0,0", "--deadline", "60")],
    ("option", "--path"): [lambda t: planned(t, "--local")],
    ("motion_shape", "--q"): [lambda t: planned(t, "--q", "0,0", "--q", "0")],
    ("path_file", "--path"): [
        lambda t: from_file(t, "path.txt", "0 0"),
        lambda t: planned(t, "--path", "none.json", "--local"),
        lambda t: from_file(t, "path.json", "["),
        lambda t: from_file(t, "path.json", "{}"),
        lambda t: from_file(t, "path.json", '{"q": [[0, 0], [0, 1]], "t": [1, 0]}'),
        lambda t: from_file(t, "path.json", '{"knots": [0, 0, 1, 1], "control_points": [[0, 0], [0, 1]], "t": [0, 1]}'),
        lambda t: from_file(t, "path.csv", "0,0\n0,x\n"),
        lambda t: from_file(t, "path.json", '{"q": [[0, 0], [0, "1"]]}'),
        lambda t: from_file(t, "path.csv", "elbow,shoulder\n0,0\n0,1\n"),
        lambda t: from_file(t, "path.csv", "0,0\n0\n"),
    ],
}
