"""Arguments of the commands that make regions, and of those that show and check them."""

from __future__ import annotations

from typing import Any

from client.arguments.common import OF_ONE, SCENE, add_proving, as_json, group, remote
from client.options import CERTIFY, COVER, GROW, JOINTS, MAP, RECERTIFY, SEED, about, add_options

PROOF = "new file for the proof; default: one in this directory, named after scene and proof"


def add(verbs: Any) -> None:
    """Adds the commands."""
    grow = verbs.add_parser("grow", parents=[remote(), as_json()], help="grow a certified region around a configuration")
    grow.add_argument("scene", metavar="SCENE", help=SCENE)
    grow.add_argument(
        f"--{SEED.argument}",
        dest="seed.q",
        metavar=JOINTS,
        action="append",
        help=f"{about(SEED)}; default: q of the seed.yaml beside scene.yaml, or NAME.seed.yaml beside NAME.yaml; "
        "may be repeated: the service then grows one region for each seed, all at the same time",
    )
    add_options(grow, GROW)
    add_proving(grow, "grow", PROOF)
    grow.set_defaults(run="client.commands:grow")

    again = verbs.add_parser(
        "recertify", parents=[remote(), as_json()], help="make a region of a changed scene from a region of the old scene"
    )
    again.add_argument("region", metavar="REGION", nargs="?", help="the region's id; with --local its proof file")
    again.add_argument("--from", dest="old", metavar="SCENE", help="certify all regions of this scene again, one job a region")
    again.add_argument("--scene", metavar="SCENE", required=True, help="the scene as it is now")
    again.add_argument(
        "--q",
        metavar=JOINTS,
        action="append",
        help="with --local: joint positions that must stay inside; may be repeated; "
        "default: the interior point that the proof names. The service keeps the seed inside",
    )
    add_options(again, RECERTIFY)
    add_proving(again, "certify", PROOF)
    again.set_defaults(run="client.recertify:recertify")

    cover = verbs.add_parser(
        "cover",
        parents=[remote(), as_json()],
        help="grow regions until they cover the free space, or connect configurations",
        epilog="Example: ciris cover examples/planar_2dof/scene.yaml --coverage 0.95 --connected --deadline 60. "
        "The exit status is 0 if all goals are reached. Regions that the scene has already count.",
    )
    cover.add_argument("scene", metavar="SCENE", help=SCENE)
    add_options(cover, COVER)
    cover.set_defaults(run="client.cover:cover")

    mapped = verbs.add_parser(
        "map",
        parents=[remote(), as_json()],
        help="prove as much as possible of the free configurations, cell by cell",
        epilog="Example: ciris map examples/iiwa_shelf/scene.yaml --coverage 0.8 --deadline 60. "
        "The exit status is 0 if the coverage is reached.",
    )
    mapped.add_argument("scene", metavar="SCENE", help=SCENE)
    add_options(mapped, MAP)
    mapped.add_argument(
        "--former",
        metavar="MAP",
        help="take over what this map proves of the same bodies, such as the robot's own: the id of a job; with --local, a proof file; "
        "default: the service's map that proves most of them; none takes over nothing",
    )
    mapped.add_argument("--out", metavar="FILE", help="new file for the map; default: one in this directory, named after scene and map")
    mapped.add_argument("--local", action="store_true", help="grow the map in this process, without a service")
    mapped.set_defaults(run="client.map:grow")

    certify = verbs.add_parser("certify", parents=[remote(), as_json()], help="certify a given polytope: one outcome for each pair")
    certify.add_argument("scene", metavar="SCENE", help=SCENE)
    certify.add_argument(
        "--polytope",
        metavar="FILE",
        required=True,
        help="npz, JSON or YAML with C (m x n), d (m) and optionally center (n), in s; ciris adds the joint limits",
    )
    add_options(certify, CERTIFY)
    add_proving(certify, "certify", "new file for the proof, if the polytope is certified; default: none")
    certify.add_argument("--backend", choices=["ciris", "drake"], default="ciris", help="drake asks Drake's own program, as a cross-check")
    certify.add_argument("--solver", metavar="NAME", help="solver that Drake uses: clarabel (default), scs, csdp or mosek")
    certify.set_defaults(run="client.commands:certify")

    region = group(verbs.add_parser("region", help="list, show, export and delete regions"))
    gone = region.add_parser("rm", parents=[remote()], help="delete a region")
    gone.add_argument("region", metavar="ID", help=OF_ONE)
    gone.set_defaults(run="client.removal:region_rm")
    ls = region.add_parser("ls", parents=[remote(), as_json()], help="list regions, newest first")
    ls.add_argument("--scene", help="list only the regions of this scene")
    ls.set_defaults(run="client.commands:region_ls")
    show = region.add_parser("show", parents=[remote(), as_json()], help="show a region's manifest")
    show.add_argument("region", metavar="ID", help=OF_ONE)
    show.set_defaults(run="client.commands:region_show")
    export = region.add_parser("export", parents=[remote()], help="write a region to a file")
    export.add_argument("region", metavar="ID", help=OF_ONE)
    export.add_argument(
        "--format", choices=["json", "npz", "drake-yaml", "proof"], default="json", help="format of the file; default: json"
    )
    export.add_argument("--name", help="name of the region in the file; default: its id")
    export.add_argument("--out", metavar="FILE", help="new file to write; default: standard output")
    export.set_defaults(run="client.commands:region_export")

    verify = verbs.add_parser("verify", parents=[as_json()], help="check a proof file offline and print what it proves")
    verify.add_argument("proof", metavar="PROOF", help="the proof file")
    verify.set_defaults(run="client.verify:verify")

    free_set = verbs.add_parser("free-set", parents=[as_json()], help="check a map's proof, and write its cells for quick lookups")
    free_set.add_argument("proof", metavar="PROOF", help="the proof file of a map")
    free_set.add_argument("--out", metavar="FILE", help="new file to write; default: one in this directory, named after PROOF")
    free_set.set_defaults(run="client.free_set:write")

    clearance = verbs.add_parser(
        "clearance", parents=[as_json()], help="prove how far apart the bodies are all over a region, from its proof file"
    )
    clearance.add_argument("proof", metavar="PROOF", help="the proof file of a region")
    clearance.add_argument("--out", metavar="FILE", help="new file for the proof of the clearance; default: none")
    clearance.set_defaults(run="client.clearance:clearance")
