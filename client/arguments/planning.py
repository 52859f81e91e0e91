"""Arguments of the commands about motions, and of a planner's questions."""

from __future__ import annotations

import argparse
from typing import Any

from client.arguments.common import SCENE, as_json, remote
from client.options import JOB, JOINTS, add_options


def add(verbs: Any) -> None:
    """Adds the commands."""
    motion = verbs.add_parser("certify-path", parents=[remote(), as_json()], help="certify a motion through waypoints or along a spline")
    motion.add_argument("scene", metavar="SCENE", help=SCENE)
    _add_curve(motion, "those given; q for a spline")
    motion.add_argument("--tube", action="store_true", help="search for the largest certified tube about the motion")
    motion.add_argument(
        "--clearance",
        action="store_true",
        help="prove a lower bound of the smallest distance, tight to 10 %% and 0.1 mm, and say where it is",
    )
    motion.add_argument(
        "--padding",
        type=float,
        metavar="METRES",
        default=0.0,
        help="prove the motion with this much added around every body, beyond the scene's padding; default: 0",
    )
    motion.add_argument("--local", action="store_true", help="certify in this process, without a service")
    motion.add_argument(
        "--job",
        action="store_true",
        help="run it as a job of the service, for a motion that takes minutes; --deadline, --priority and --label need this",
    )
    add_options(motion, JOB)
    motion.add_argument("--out", metavar="FILE", help="new file for the proof; default: none")
    motion.set_defaults(run="client.motion:certify_path")

    for verb, run, help_text in (
        ("contains", "client.commands:contains", "show which certified regions contain a configuration"),
        ("nearest", "client.planning:nearest", "show what is proved nearest to a configuration, by a region or the map, and how far it is"),
    ):
        about_points = verbs.add_parser(verb, parents=[remote(), as_json()], help=help_text)
        about_points.add_argument("scene", metavar="SCENE", help=SCENE)
        about_points.add_argument("--q", metavar=JOINTS, required=True, action="append", help="joint positions; may be repeated")
        about_points.set_defaults(run=run)

    plan = verbs.add_parser(
        "plan",
        parents=[remote(), as_json()],
        help="find a motion between two configurations and prove that it is free of collision",
        epilog="Example: ciris plan planar-2dof --from 0,0 --to 0.35,-0.2 --speed 1.5. Give either --to or --to-pose.",
    )
    plan.add_argument("scene", metavar="SCENE", help=SCENE)
    of_end = "joint positions, or the id of a region for any point of it"
    plan.add_argument("--from", dest="start", metavar=JOINTS, required=True, help=f"where the motion begins: {of_end}")
    plan.add_argument(
        "--to",
        dest="goal",
        metavar=JOINTS,
        action="append",
        default=[],
        help=f"where it ends: {of_end}; give it several times, and the motion goes to the one to which it is shortest",
    )
    plan.add_argument(
        "--to-pose",
        metavar="X,Y,Z,R,P,Y",
        help="instead of --to: a pose of a frame in the world, metres and radians (roll, pitch, yaw); with --line, X,Y,Z will do",
    )
    plan.add_argument("--frame", help="the body whose frame goes to the pose, or the last part of its name")
    plan.add_argument("--line", action="store_true", help="the frame goes to the pose on a straight line")
    plan.add_argument(
        "--tolerance",
        metavar="METRES[,RADIANS]",
        help="how far the frame may be from the line; default 0.001,0.01",
    )
    plan.add_argument("--via", metavar=JOINTS, action="append", default=[], help="go through these joint positions; may be repeated")
    plan.add_argument("--speed", help="largest speed in rad/s or m/s, one for all joints or one for each; default 1")
    plan.add_argument("--acceleration", help="largest acceleration in rad/s² or m/s², one for all joints or one for each; default 2")
    plan.add_argument("--seconds", type=float, help="how long to search for a motion; default 5")
    plan.add_argument("--regions-only", action="store_true", help="only take motions that lie in certified regions")
    plan.add_argument("--out", metavar="FILE", help="new file for a proof of the motion; default: none")
    plan.add_argument(
        "--grow",
        action="store_true",
        help="with --regions-only: if there is no motion, grow regions until the two ends are connected, and plan again; "
        "--deadline, --priority and --label need this",
    )
    add_options(plan, JOB)
    plan.set_defaults(run="client.planning:plan")

    path = verbs.add_parser("path", parents=[remote(), as_json()], help="decide whether every point of a path is proved to be free")
    path.add_argument("scene", metavar="SCENE", help=SCENE)
    _add_curve(path, "q")
    path.set_defaults(run="client.planning:path")

    graph = verbs.add_parser("graph", parents=[remote(), as_json()], help="show which regions of a scene overlap, and where gaps are")
    graph.add_argument("scene", metavar="SCENE", help=SCENE)
    graph.set_defaults(run="client.planning:graph")


def _add_curve(parser: argparse.ArgumentParser, space: str) -> None:
    """Adds the arguments that give a motion.

    Args:
        space: the default of ``--space``, in words.
    """
    parser.add_argument("--q", metavar=JOINTS, action="append", help="a waypoint: joint positions; give it two times or more")
    parser.add_argument("--path", metavar="FILE", help="npz, JSON, YAML or CSV with waypoints q or s and perhaps times t, or with a spline")
    parser.add_argument(
        "--space",
        choices=["q", "s"],
        help=f"coordinates in which the motion is straight, or in which a spline's control points are; default: {space}",
    )
