"""Arguments of the commands about scenes."""

from __future__ import annotations

from typing import Any

from client.arguments.common import SCENE, as_json, dependents, group, remote


def add(verbs: Any) -> None:
    """Adds the commands."""
    scene = group(verbs.add_parser("scene", help="draft, check, add, constrain, stage, promote, list, show and delete scenes"))
    init = scene.add_parser(
        "init",
        help="write a scene file and a seed for a robot's model",
        epilog="Example: ciris scene init arm.urdf --mount gripper.urdf@tool0@0,0,0.02 --world table.sdf@0.5,0,0. Nothing is overwritten.",
    )
    init.add_argument("robot", metavar="ROBOT", help="model file: URDF, SDFormat, MJCF or xacro")
    init.add_argument(
        "--mount",
        metavar="FILE@LINK[@X,Y,Z[,R,P,Y]]",
        action="append",
        default=[],
        help="model of what the robot carries, such as a gripper, the link that carries it, and its pose there, metres and degrees; may be "
        "repeated",
    )
    init.add_argument(
        "--world",
        metavar="FILE[@X,Y,Z[,R,P,Y]]",
        action="append",
        default=[],
        help="model of an obstacle around it, and where it stands, metres and degrees; default: where its file says; may be repeated",
    )
    init.add_argument("--srdf", metavar="FILE", help="SRDF file of the robot; default: the one beside the model, or in ../srdf, if any")
    init.add_argument(
        "--package",
        metavar="NAME=DIR",
        action="append",
        default=[],
        help="directory of a package that a model names; default: the nearest in the directories above, in a ROS workspace around them, in "
        "AMENT_PREFIX_PATH or in ROS_PACKAGE_PATH; may be repeated",
    )
    init.add_argument("--xacro", metavar="NAME=VALUE", action="append", default=[], help="argument of a model in xacro; may be repeated")
    init.add_argument(
        "--out",
        metavar="FILE",
        default="scene.yaml",
        help="the scene file; default: scene.yaml here. The seed goes beside it, into seed.yaml, or NAME.seed.yaml for NAME.yaml",
    )
    init.set_defaults(run="client.scenes:scene_init")
    check = scene.add_parser("check", parents=[as_json()], help="show what ciris reads from a scene file and its models, without a service")
    check.add_argument("path", metavar="PATH.yaml", help="the scene file")
    check.add_argument("--q", metavar="Q", help="a configuration to look at; default: the seed beside the file, or else q*")
    check.set_defaults(run="client.scenes:scene_check")
    add = scene.add_parser("add", parents=[remote(), as_json()], help="upload a scene file and all files it refers to")
    add.add_argument("path", metavar="PATH.yaml", help="the scene file")
    add.set_defaults(run="client.commands:scene_add")
    stage = scene.add_parser(
        "stage",
        parents=[remote(), as_json()],
        help="upload a scene file as the next version of a name, which keeps its meaning for now",
        epilog="NAME@staged means the staged scene, wherever a command takes a scene.",
    )
    stage.add_argument("name", metavar="NAME", help="the name of a scene that the service knows")
    stage.add_argument("path", metavar="PATH.yaml", help="the scene file of the next version; its own name does not count")
    stage.set_defaults(run="client.staging:scene_stage")
    constrain = scene.add_parser(
        "constrain",
        parents=[remote(), as_json()],
        help="make another scene out of one: the same, with more conditions",
        epilog="FILE has `conditions:` as a scene file has them. The scene that the new one comes from stays as it is.",
    )
    constrain.add_argument("scene", metavar="SCENE", help=SCENE)
    constrain.add_argument("conditions", metavar="FILE", help="YAML file with the conditions")
    constrain.add_argument("--name", metavar="NAME", required=True, help="name of the new scene")
    constrain.set_defaults(run="client.commands:scene_constrain")
    promote = scene.add_parser("promote", parents=[remote(), as_json()], help="make a name mean its staged scene from now on")
    promote.add_argument("name", metavar="NAME", help="the name that the scene was staged under")
    promote.add_argument("--without-regions", action="store_true", help="promote a scene without regions where the present scene has some")
    promote.set_defaults(run="client.staging:scene_promote")
    scene.add_parser("ls", parents=[remote(), as_json()], help="list scenes, newest first").set_defaults(run="client.commands:scene_ls")
    show = scene.add_parser("show", parents=[remote(), as_json()], help="show a scene's joints, warnings and pairs")
    show.add_argument("scene", metavar="ID", help="its id or its name")
    show.set_defaults(run="client.commands:scene_show")
    gone = scene.add_parser("rm", parents=[remote(), dependents()], help="delete a scene")
    gone.add_argument("scene", metavar="ID", help="its id or its name")
    gone.set_defaults(run="client.removal:scene_rm")
