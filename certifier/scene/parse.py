"""This module is the child's side of scene loading: Drake reads the models, and the module turns Drake's plant into a Scene.

Only here do user files meet Drake, which ends the process on some of them. So ``certifier.scene.load`` runs it in a child process.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import logging
import os
import re
import sys
import tempfile
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    HalfSpace,
    Mesh,
    Role,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.inverse_kinematics import AddMultibodyPlantConstraints
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import Joint as DrakeJoint
from pydrake.multibody.tree import PrismaticJoint, QuaternionFloatingJoint, RevoluteJoint, RpyFloatingJoint, WeldJoint
from pydrake.solvers import MathematicalProgram
from pydrake.systems.framework import DiagramBuilder

from certifier.errors import SceneError
from certifier.model import Array, Geometry, Joint, JointKind, Scene
from certifier.names import MAX_SENTENCE, escaped
from certifier.positions import MAGNITUDE
from certifier.scene import drawn, following, shapes
from certifier.scene.census import check_counts
from certifier.scene.conditions import constrained
from certifier.scene.configurations import own_configurations, srdf_configurations
from certifier.scene.copies import Copies
from certifier.scene.decomposition.parts import Decomposition
from certifier.scene.drawn import Placed
from certifier.scene.file import SceneFile, read_scene_file
from certifier.scene.hollow import recorded
from certifier.scene.hulls import with_hulls
from certifier.scene.joints import Coupling, centered, counted, held, held_at, narrowed
from certifier.scene.lint import findings
from certifier.scene.names import Names
from certifier.scene.pairs import pairs
from certifier.scene.semantics import read_semantics
from certifier.scene.strict import StrictReader
from certifier.scene.sweep import Sweeper, others_of, said_of, sweeps_of
from certifier.scene.tree import Tree, floating

_IGNORED_SHAPE = re.compile(r"geom \S+ specified unknown mesh|The geom type|The fromto tag")
"""These are Drake's warnings about collision geometry that it leaves out."""
_SEVERAL_MODELS = re.compile(r"must have a single <model>|can only contain one model")
"""So Drake says that a file holds no model or several."""
_ONE_MODEL = (
    "a file is one model: name a file for each, or put them all into one <model>, in place of <world>, without its physics, lights and gui"
)
_NAMED_TWICE = re.compile(r"The name '.*' has already been used by a geometry")
"""So Drake says that two models have geometries of one name in the world, which has none for each model."""
_OWN_NAMES = "geometries in the world, outside of bodies, have one name each; put them into a body, or rename them in one file"
_CPLUSPLUS = re.compile(r"std::|\.array\(\)|\.all\(\)")
"""What Drake's assertions say to compilers only."""


def parse(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns the document of the Scene that the file ``payload["path"]`` describes.

    Raises:
        SceneError: whatever is wrong with the file, the models it names or the scene they make.
    """
    with tempfile.TemporaryDirectory(dir=payload.get("scratch"), prefix="ciris-") as scratch:
        return _parsed(Path(payload["path"]), Path(scratch))[0]


def parse_with_meshes(path: Path) -> dict[str, Any]:
    """Returns the document of the ``scene`` that a file describes, and its ``meshes`` to be drawn (:func:`certifier.scene.drawn.document`).

    Raises:
        SceneError: as :func:`parse`.
    """
    with tempfile.TemporaryDirectory(prefix="ciris-") as scratch:
        scene, placed = _parsed(path, Path(scratch))
        return {"scene": scene, "meshes": drawn.document(placed)}


def _parsed(path: Path, scratch: Path) -> tuple[dict[str, Any], list[Placed]]:
    """Returns the document of a Scene, and the meshes of its models; ``scratch`` is an empty directory."""
    scene_file = read_scene_file(path)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    strict = StrictReader(scene_file)
    written = strict.check(scene_file.resolved_directives, path.name)
    copies = Copies(scene_file, strict, scratch)
    warnings = strict.notes + copies.warnings + read_models(scene_file, plant, copies)
    inspector = scene_graph.model_inspector()
    names = Names(plant, inspector)
    warnings += without_limits(strict, plant, names)
    every = [joint_of(plant.get_joint(index), names) for index in plant.GetJointIndices()]
    coupled = couplings(plant, names)
    sweeps = sweeps_of(every, scene_file.swept, scene_file.limits, coupled)
    at = held_at(every, scene_file.fix, coupled, sweeps)
    welded = at | {name: sweep.middle for name, sweep in sweeps.items()}
    marked = {names.joint(plant.GetJointByName(name, plant.GetModelInstanceByName(model))) for model, name in strict.followers}
    followers = following.followers_of(every, coupled, welded, marked)
    limits = others_of(scene_file.limits, sweeps, every)
    leader_of = {name: mimic.leader for name, mimic in followers.items()}
    free = narrowed(held(following.leading(every, followers), welded), limits, leader_of)
    leaders, q_star = centered(free, scene_file.q_star, leader_of)
    tree = Tree(following.with_followers(leaders, every, followers), list(names.bodies))
    reached, faults = dict[str, float](), dict[str, str]()
    sweeper = Sweeper(tree, sweeps, scene_file.max_vertices)
    read = _geometries(scene_file, strict, copies, plant, inspector, tree, sweeper, names, reached, faults)
    by_id = with_hulls(read, scene_file.hulls, tree.bodies, scene_file.max_vertices, names.register, reached)
    touching = ((one, other) for a, b in inspector.GetCollisionCandidates() for one in by_id[a] for other in by_id[b])
    candidates = list(dict.fromkeys((one.name, other.name) for one, other in touching))
    geometries = tuple({id(geometry): geometry for several in by_id.values() for geometry in several}.values())
    for geometry in geometries:
        _check_hull(geometry)
    semantics = read_semantics(scene_file, tree.bodies)
    described = [entry for one in semantics for entry in one.ignore]
    wanted, ignored, unused = pairs(candidates, geometries, tree, scene_file.ignore, described)
    padded, without = scene_file.paddings.on(wanted, geometries, tree.bodies)
    scene = Scene(
        name=scene_file.name,
        joints=tree.joints,
        bodies=tree.bodies,
        geometries=geometries,
        pairs=padded,
        ignored=ignored,
        q_star=q_star,
        padding=scene_file.padding,
        provenance={
            "directives": scene_file.directives,
            "packages": {name: escaped(root.name) for name, root in scene_file.packages.items()},
            "drake": importlib.metadata.version("drake"),
            **({"swept": list(sweeps)} if sweeps else {}),
            **({"coacd": importlib.metadata.version("coacd")} if scene_file.decompose else {}),
            **recorded(
                {geometry.name: reached[geometry.name] for geometry in geometries if geometry.name in reached},
                {geometry.name: faults[geometry.name] for geometry in geometries if geometry.name in faults},
            ),
        },
    )
    following.check_ways(scene)
    check_counts(written, inspector.NumGeometriesWithRole(Role.kProximity), scene)
    shown = {names.body(plant.GetBodyFromFrameId(inspector.GetFrameId(i))) for i in inspector.GetAllGeometryIds(Role.kIllustration)}
    states, left_out = srdf_configurations(scene, semantics, at, followers)
    files = {entry.reason: one.file for one in semantics for entry in one.ignore}
    named = replace(scene, configurations=states | own_configurations(scene, scene_file.configurations))
    document = constrained(named, scene_file.conditions, sweeps).to_document()
    document["warnings"] += (
        warnings
        + said_of(sweeps)
        + [f"joint {name} has the multiplier 0 (mimic), so it never moves: it is held at {at[name]:.9g}" for name in _at_rest(coupled)]
        + following.said_of(followers, scene)
        + unused
        + without
        + left_out
        + findings(scene, tree, candidates, shown, files)
    )
    return document, _placed_meshes(strict, copies, plant, inspector, names)


def _at_rest(coupled: list[Coupling]) -> list[str]:
    """Returns the joints that follow another one with the multiplier 0, by their full names."""
    return [name for coupling in coupled if len(coupling.factors) == 1 for name in coupling.factors]


def read_models(scene_file: SceneFile, plant: MultibodyPlant, copies: Copies) -> list[str]:
    """Adds the directives' models to the plant, finalises it and returns Drake's warnings.

    It prints the models' names first, because only what is printed remains if Drake ends the process.
    """
    parser = Parser(plant)
    packages = parser.package_map()
    for name in packages.GetPackageNames():
        packages.Remove(name)
    for name, root in scene_file.packages.items():
        packages.Add(name, str(root))
    print(f"reading {', '.join(scene_file.models)}", file=sys.stderr, flush=True)
    with _DrakeLog() as log, contextlib.chdir(copies.working_directory):
        try:
            parser.AddModelsFromString(copies.directives, "dmd.yaml")
            plant.Finalize()
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            raise _model_error(scene_file, copies.named(str(error))) from None
    messages = list(map(copies.named, log.messages))
    for warning in messages:
        if _IGNORED_SHAPE.search(warning):
            raise SceneError("unsupported_shape", _one_line(scene_file, warning), field="directives", hint="use a primitive or a mesh")
    return list(dict.fromkeys(_one_line(scene_file, warning) for warning in messages))


def without_limits(strict: StrictReader, plant: MultibodyPlant, names: Names) -> list[str]:
    """Takes the limits off continuous joints of URDF, which Drake would apply, and returns warnings that say so."""
    said = []
    for model, name in strict.unlimited:
        joint = plant.GetJointByName(name, plant.GetModelInstanceByName(model))
        lower, upper = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
        joint.set_position_limits([-np.inf], [np.inf])
        what = f"joint {names.joint(joint)} is continuous, so its limits {lower:g} and {upper:g} do not count in URDF"
        said.append(f"{what}: it turns without limits (for limits, write type revolute, or limits in the scene file)")
    return said


class _DrakeLog(logging.Handler):
    """Collects what Drake logs at level warning and above."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())

    def __enter__(self) -> _DrakeLog:
        logging.getLogger("drake").addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger("drake").removeHandler(self)


def _model_error(scene_file: SceneFile, error: str) -> SceneError:
    """Returns what Drake raised as an error for people. Where it does not say which model it is about, the error names every model.

    Of a failed assertion (SystemExit in pydrake) the condition is said, and not where it stands in Drake's source.
    """
    message = _one_line(scene_file, error)
    where = re.search(r"directives\[\d+\]", message)
    message = message.split(" while accepting")[0]
    if assertion := re.search(r"condition '(.+)' failed", message):
        message = f"a number of a model makes no sense: Drake needs {re.sub(_CPLUSPLUS, '', assertion[1])}"
    said = where or any(Path(file).name in message for file in (scene_file.path.name, *scene_file.models))
    models = "" if said else f"{', '.join(scene_file.models)}: "
    own = _OWN_NAMES if _NAMED_TWICE.search(message) else "mend the model or the directive"
    hint = _ONE_MODEL if _SEVERAL_MODELS.search(message) else own
    return SceneError("scene_model", f"{models}{message}", field=where[0] if where else "directives", hint=hint)


def _one_line(scene_file: SceneFile, message: str) -> str:
    """Returns a message of Drake's in one printable line, with paths relative to the scene file."""
    message = message.replace("<string>", scene_file.path.name).replace(": error: ", ": ")
    message = re.sub(rf"(file:)?/*{re.escape(os.path.abspath(scene_file.path.parent))}/", "", message)
    return textwrap.shorten(escaped(" ".join(message.removeprefix("error: ").split())), MAX_SENTENCE, placeholder=" ...")


def joint_of(joint: DrakeJoint, names: Names) -> Joint:
    """Returns a joint of the plant.

    Raises:
        SceneError: ``unsupported_joint``, ``floating_body``, or ``scene_model`` for a pose that is too far away.
    """
    parent, child, name = names.body(joint.parent_body()), names.body(joint.child_body()), names.joint(joint)
    X_PF = joint.frame_on_parent().GetFixedPoseInBodyFrame().GetAsMatrix4()
    X_BM = joint.frame_on_child().GetFixedPoseInBodyFrame().GetAsMatrix4()
    X_FM = joint.X_FM().GetAsMatrix4() if isinstance(joint, WeldJoint) else np.eye(4)
    for pose in (X_PF @ X_FM, X_BM):
        if not (np.abs(pose) <= MAGNITUDE).all():
            message = f"joint {name} has a pose with a coordinate that is not from {-MAGNITUDE:g} to {MAGNITUDE:g} m"
            raise SceneError("scene_model", message, field="directives", hint="mend the pose in the directive or in the model")
    match joint:
        case WeldJoint():
            return Joint(name, JointKind.WELD, parent, child, np.zeros(3), X_PF @ X_FM, X_BM)
        case RevoluteJoint():
            kind, axis = JointKind.REVOLUTE, joint.revolute_axis()
        case PrismaticJoint():
            kind, axis = JointKind.PRISMATIC, joint.translation_axis()
        case QuaternionFloatingJoint() | RpyFloatingJoint():
            raise floating(child)
        case _:
            message = (
                f"joint {name} is a {joint.type_name().removesuffix('_rpy')} joint; revolute, prismatic and fixed joints are supported"
            )
            planar = "write two slides and a turn, as docs/scenes.md does for a mobile base"
            hint = planar if joint.type_name() == "planar" else "replace it by such joints, or weld its bodies"
            raise SceneError("unsupported_joint", message, field="directives", hint=hint)
    lower, upper = (counted(float(limit[0])) for limit in (joint.position_lower_limits(), joint.position_upper_limits()))
    return Joint(name, kind, parent, child, np.array(axis), X_PF, X_BM, joint.position_start(), lower, upper)


def couplings(plant: MultibodyPlant, names: Names) -> list[Coupling]:
    """Returns what mimic joints keep to.

    Raises:
        SceneError: ``unsupported_joint``, when other constraints close a loop.
    """
    if not plant.num_constraints():
        return []
    program = MathematicalProgram()
    q = program.NewContinuousVariables(plant.num_positions(), "q")
    AddMultibodyPlantConstraints(plant=plant, q=q, prog=program, plant_context=plant.CreateDefaultContext())
    joints_at = {joint.position_start(): joint for joint in map(plant.get_joint, plant.GetJointIndices()) if joint.num_positions()}
    position = {v.get_id(): names.joint(joints_at[i]) for i, v in enumerate(q) if i in joints_at}
    found = []
    for binding in program.linear_equality_constraints():
        matrix, constants = binding.evaluator().GetDenseA(), binding.evaluator().lower_bound()
        joints = [position[v.get_id()] for v in binding.variables()]
        found += [
            Coupling({name: float(factor) for name, factor in zip(joints, row, strict=True) if factor}, float(constant))
            for row, constant in zip(matrix, constants, strict=True)
        ]
    if len(found) < plant.num_constraints():
        message = "the models close a loop by a constraint"
        raise SceneError("unsupported_joint", message, field="directives", hint="remove it; only independent joints are supported")
    return found


def _geometries(
    scene_file: SceneFile,
    strict: StrictReader,
    copies: Copies,
    plant: MultibodyPlant,
    inspector: SceneGraphInspector,
    tree: Tree,
    sweeper: Sweeper,
    names: Names,
    reached: dict[str, float],
    faults: dict[str, str],
) -> dict[GeometryId, tuple[Geometry, ...]]:
    """Returns what stands for every geometry of the proximity role: one geometry, or the parts of a mesh.

    Half-spaces come last, because their size depends on the reach of the others.

    Args:
        reached: gets the names of hulls that reach beyond their meshes, and how far, in metres.
        faults: gets the names of those whose meshes bound no solid, and why.
    """
    found: dict[GeometryId, tuple[Geometry, ...]] = {}
    half_spaces = []
    decomposition = Decomposition(scene_file, names.register)
    every = inspector.GetAllGeometryIds(Role.kProximity)
    for i in every:
        name, body_name = names.geometry(i), names.body(plant.GetBodyFromFrameId(inspector.GetFrameId(i)))
        shape, X_BG = inspector.GetShape(i), inspector.GetPoseInFrame(i)
        if isinstance(shape, HalfSpace):
            half_spaces.append((i, name, body_name))
            continue
        if decomposition.wanted(name) and isinstance(shape, Convex | Mesh):
            several = decomposition.parts(name, _said(shape, copies), *_mesh(shape, strict, copies))
        else:
            several = {name: _convex(shape, name, scene_file, strict, copies)}
        found[i] = tuple(sweeper.around(_placed(own, body_name, convex, X_BG)) for own, convex in several.items())
        reached |= {own: convex.beyond for own, convex in several.items() if convex.beyond}
        faults |= {own: convex.fault for own, convex in several.items() if convex.fault}
    decomposition.check([names.geometry(i) for i in every])
    reach = tree.reach([geometry for several in found.values() for geometry in several], scene_file.largest_padding)
    for i, name, body_name in half_spaces:
        if body_name not in tree.anchored:
            message = f"geometry {name} is a half-space on a body that moves"
            raise SceneError("unsupported_shape", message, field="directives", hint="use a box")
        sweeper.check_half_space(name, body_name)
        X_BG = inspector.GetPoseInFrame(i)
        center = (RigidTransform(tree.anchored[body_name]) @ X_BG).inverse().translation()
        found[i] = (_placed(name, body_name, shapes.half_space(center, reach), X_BG),)
    return found


def _placed(name: str, body: str, convex: shapes.Body, X_BG: RigidTransform) -> Geometry:
    vertices = np.ascontiguousarray((X_BG @ convex.vertices.T).T)
    shape = {**convex.shape, "X_BG": X_BG.GetAsMatrix4().tolist()}
    return Geometry(name, body, vertices, convex.radius, shape, convex.substitution, convex.inflation)


def _placed_meshes(
    strict: StrictReader, copies: Copies, plant: MultibodyPlant, inspector: SceneGraphInspector, names: Names
) -> list[Placed]:
    """Returns the meshes of the proximity role."""
    found = []
    for i in inspector.GetAllGeometryIds(Role.kProximity):
        shape = inspector.GetShape(i)
        if isinstance(shape, Convex | Mesh):
            mesh = strict.taken(copies.original(shape.source().path()))
            body = names.body(plant.GetBodyFromFrameId(inspector.GetFrameId(i)))
            found.append(Placed(names.geometry(i), body, mesh, shape.scale3(), inspector.GetPoseInFrame(i).GetAsMatrix4()))
    return found


def _check_hull(geometry: Geometry) -> None:
    """Refuses a polytope that is too thin for Drake, which finds contacts with it.

    Raises:
        SceneError: ``scene_model``.
    """
    if geometry.radius == 0:
        try:
            Convex(geometry.vertices.T, geometry.name).GetConvexHull()
        except RuntimeError:
            message = f"geometry {geometry.name} is too thin for its size and for its distance from the origin of its body"
            hint = "make it thicker, or move its body's origin to it"
            raise SceneError("scene_model", message, field="directives", hint=hint) from None


def _convex(shape: Shape, name: str, scene_file: SceneFile, strict: StrictReader, copies: Copies) -> shapes.Body:
    match shape:
        case Box():
            return shapes.box((shape.width(), shape.depth(), shape.height()))
        case Sphere():
            return shapes.sphere(shape.radius())
        case Capsule():
            return shapes.capsule(shape.radius(), shape.length())
        case Cylinder():
            return shapes.cylinder(shape.radius(), shape.length(), scene_file.cylinder_sides)
        case Ellipsoid():
            return shapes.ellipsoid((shape.a(), shape.b(), shape.c()), scene_file.max_vertices)
        case Convex() | Mesh():
            points, triangles = _mesh(shape, strict, copies)
            return shapes.polytope(_said(shape, copies), points, triangles, scene_file.max_vertices)
        case _:
            message = f"geometry {name} is a {type(shape).__name__}, which is not supported"
            raise SceneError("unsupported_shape", message, field="directives", hint="use a primitive or a mesh")


def _said(shape: Convex | Mesh, copies: Copies) -> dict[str, Any]:
    """Returns what the models say of a mesh."""
    file = copies.original(Path(shape.source().description()))
    return {"kind": type(shape).__name__.lower(), "file": escaped(file.name), "scale": shape.scale3().tolist()}


def _mesh(shape: Convex | Mesh, strict: StrictReader, copies: Copies) -> tuple[Array, NDArray[np.int64]]:
    """Returns the points of a mesh, (k, 3), as its file has them, times the scale, and the numbers of the points of its triangles, (t, 3).

    First come those that are vertices of Drake's hull, in Drake's order, on which the hashes of scenes depend.

    Raises:
        SceneError: Drake has taken a file that the models do not name, or a coordinate of a scaled point is above MAGNITUDE.
    """
    file = copies.original(shape.source().path())
    mesh = strict.taken(file)
    points = mesh.points * shape.scale3()
    if not (np.abs(points) <= MAGNITUDE).all():
        message = f"a coordinate of {escaped(file.name)} is above {MAGNITUDE:g} m"
        raise SceneError("scene_model", message, field="directives", hint="mend the file or the scale")
    hull = shape.GetConvexHull()
    rank = {tuple(hull.vertex(k)): k for k in range(hull.num_vertices())}
    order = np.argsort([rank.get(tuple(point), len(rank)) for point in points.tolist()], kind="stable")
    return points[order], np.argsort(order)[mesh.triangles]
