"""The examples, and scenes that end Drake's process, through the killable child."""

import numpy as np
import pytest
import yaml
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from certifier.errors import SceneError
from certifier.model import WORLD, JointKind, Scene
from certifier.scene import load_scene
from certifier.scene.drake_model import build_diagram, drake_name, geometry_name
from certifier.scene.file import read_scene_file
from tests.certifier.scene.workshop import EXAMPLES, NAMES, SCENE, parsed, write

PAIRS = {"planar_2dof": 6, "arm_3dof": 12, "iiwa_shelf": 70, "ur3e_bin": 51, "dual_ur3e": 102, "sphere_arm": 1374}
PAIRS |= {"ur3e_gripper": 188, "iiwa_gripper": 212}
JOINTS = {"planar_2dof": 2, "arm_3dof": 3, "iiwa_shelf": 7, "ur3e_bin": 6, "dual_ur3e": 12, "sphere_arm": 7}
JOINTS |= {"ur3e_gripper": 6, "iiwa_gripper": 7}

CROOKED = """<sdf version="1.7"><model name="crooked">
  <link name="base"/>
  <link name="one"><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose></link>
  <link name="two"><pose>-0.2 0.1 0.5 1.0 -0.4 0.2</pose></link>
  <link name="three"><pose>0.4 0 0.7 0.1 0.1 2.0</pose>
    <collision name="ball"><geometry><sphere><radius>0.05</radius></sphere></geometry></collision></link>
  <joint name="turn" type="revolute"><pose>0.05 0.02 -0.1 0.3 0.2 0.1</pose><parent>base</parent><child>one</child>
    <axis><xyz>1 2 3</xyz><limit><lower>-2</lower><upper>1</upper></limit></axis></joint>
  <joint name="slide" type="prismatic"><pose>0 0.3 0 0 1 0</pose><parent>one</parent><child>two</child>
    <axis><xyz>0 1 -1</xyz><limit><lower>-0.2</lower><upper>0.5</upper></limit></axis></joint>
  <joint name="twist" type="revolute"><pose>0.1 0 0 0 0 0.7</pose><parent>two</parent><child>three</child>
    <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>
</model></sdf>
"""
HELD = """
directives:
  - add_model: {name: crooked, file: crooked.sdf}
  - add_frame: {name: hook, X_PF: {base_frame: world, translation: [0.3, 0.1, 0], rotation: !Rpy {deg: [10, 20, 30]}}}
  - add_weld: {parent: hook, child: crooked::LINK, X_PC: {translation: [0, 0.2, 0], rotation: !Rpy {deg: [0, 40, 0]}}}
"""


@pytest.fixture(scope="module")
def examples():
    return {name: parsed(EXAMPLES / name / "scene.yaml") for name in NAMES}


def test_a_child_reads_the_same_scene(examples):
    assert load_scene(EXAMPLES / "iiwa_shelf" / "scene.yaml").to_document() == examples["iiwa_shelf"].to_document()


def original(path):
    """The plant that Drake itself makes of a scene file. Where the file holds a slide of a model, its other slides are there too."""
    scene_file = read_scene_file(path)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(scene_file.resolved_directives, "dmd.yaml")
    plant.Finalize()
    for name, value in scene_file.fix.items():
        for index in plant.GetJointIndices(plant.GetModelInstanceByName(name.split("/")[0])):
            if plant.get_joint(index).type_name() == "prismatic":
                plant.get_mutable_joint(index).set_default_translation(value)
    return plant


def body_in(plant, name):
    if name == WORLD:
        return plant.world_body()
    model, body = name.split("/")
    return plant.GetBodyByName(body, plant.GetModelInstanceByName(model))


def poses(scene: Scene, q):
    """X_WB of every body by the formula in certifier.model, one joint after another."""
    X = {WORLD: RigidTransform()}
    joints = list(scene.joints)
    while joints:
        j = next(j for j in joints if j.parent in X)
        joints.remove(j)
        X_FM = RigidTransform()
        if j.kind is JointKind.REVOLUTE:
            X_FM = RigidTransform(AngleAxis(q[j.index], j.axis), [0, 0, 0])
        elif j.kind is JointKind.PRISMATIC:
            X_FM = RigidTransform(q[j.index] * j.axis)
        X[j.child] = X[j.parent] @ RigidTransform(j.X_PF) @ X_FM @ RigidTransform(j.X_BM).inverse()
    return X


def assert_same_kinematics(scene, plant, held=0):
    diagram = build_diagram(scene)
    context = diagram.CreateDefaultContext()
    ours, ours_context = diagram.plant(), diagram.mutable_plant_context(context)
    theirs_context = plant.CreateDefaultContext()
    names = [joint.name.split("/") for joint in scene.moving]
    moving = [plant.GetJointByName(joint, plant.GetModelInstanceByName(model)).position_start() for model, joint in names]
    assert ours.num_positions() == plant.num_positions() - held == scene.n
    np.testing.assert_array_equal(ours.GetPositionLowerLimits(), plant.GetPositionLowerLimits()[moving])
    np.testing.assert_array_equal(ours.GetPositionUpperLimits(), plant.GetPositionUpperLimits()[moving])
    everything = plant.GetDefaultPositions()
    for q in np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, (5, scene.n)):
        ours.SetPositions(ours_context, q)
        everything[moving] = q
        plant.SetPositions(theirs_context, everything)
        formula = poses(scene, q)
        for name in scene.bodies:
            theirs = plant.EvalBodyPoseInWorld(theirs_context, body_in(plant, name)).GetAsMatrix4()
            mine = ours.world_body() if name == WORLD else ours.GetBodyByName(drake_name(name))
            np.testing.assert_allclose(ours.EvalBodyPoseInWorld(ours_context, mine).GetAsMatrix4(), theirs, atol=1e-13)
            np.testing.assert_allclose(formula[name].GetAsMatrix4(), theirs, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_an_example_loads_and_survives_a_round_trip(examples, name):
    scene = examples[name]
    assert (scene.n, len(scene.pairs)) == (JOINTS[name], PAIRS[name])
    assert scene.ignored == ()
    assert Scene.from_document(scene.to_document()).hash == scene.hash
    assert not any("overlap" in w or "units" in w for w in scene.warnings)


@pytest.mark.parametrize("name", NAMES)
def test_an_examples_seed_is_clear_of_everything(examples, name):
    scene = examples[name]
    q = np.array(yaml.safe_load((EXAMPLES / name / "seed.yaml").read_text())["q"])
    assert np.all(scene.q_lower < q)
    assert np.all(q < scene.q_upper)
    distances = signed_distances(scene, q)
    assert len(distances) == len(scene.pairs)
    assert min(distances.values()) > 0.015


def signed_distances(scene, q):
    diagram = build_diagram(scene)
    context = diagram.CreateDefaultContext()
    diagram.plant().SetPositions(diagram.mutable_plant_context(context), q)
    scene_graph = diagram.scene_graph()
    query = scene_graph.get_query_output_port().Eval(diagram.scene_graph_context(context))
    inspector = scene_graph.model_inspector()
    return {
        tuple(sorted((geometry_name(inspector, a), geometry_name(inspector, b)))): query.ComputeSignedDistancePairClosestPoints(
            a, b
        ).distance
        for a, b in inspector.GetCollisionCandidates()
    }


@pytest.mark.parametrize("name", NAMES)
def test_the_numbers_move_as_the_files_say(examples, name):
    assert_same_kinematics(examples[name], original(EXAMPLES / name / "scene.yaml"), 2 if name.endswith("gripper") else 0)


@pytest.mark.parametrize("held", ["base", "one", "three"])
def test_crooked_frames_and_trees_held_by_any_link(tmp_path, held):
    path = write(tmp_path, HELD.replace("LINK", held), files={"crooked.sdf": CROOKED})
    assert_same_kinematics(parsed(path), original(path))


def test_only_the_scenes_pairs_can_collide_in_the_drake_model(examples):
    scene = examples["ur3e_bin"]
    assert set(signed_distances(scene, scene.q_star)) == {(p.a, p.b) for p in scene.pairs}


def test_the_sphere_arm_is_balls_and_may_touch_itself_the_rack_and_the_table(examples):
    """Its scene is clean without ignoring a pair, and not because nothing in it can collide."""
    scene = examples["sphere_arm"]
    assert scene.warnings == ()
    assert {g.shape["kind"] for g in scene.geometries if g.body.startswith("arm/")} == {"sphere"}
    assert sum(g.body.startswith("arm/") for g in scene.geometries) == 58
    touching = {
        ("arm/link_3/", "arm/link_5/"): [0, 0, 1.57, 2.5, 0, 0, 0],
        ("arm/link_6/", "rack/boards/table"): [0, 1.9, 0, 0.2, 0, 0, 0],
        ("arm/link_6/", "rack/boards/middle"): [0, 1.1, 0, 0.1, 0, 0, 0],
    }
    for (a, b), q in touching.items():
        assert min(gap for pair, gap in signed_distances(scene, q).items() if pair[0].startswith(a) and pair[1].startswith(b)) < 0


def test_the_iiwas_flange_is_where_its_data_sheet_says(examples):
    flange = poses(examples["iiwa_shelf"], np.zeros(7))["iiwa/flange"]
    np.testing.assert_allclose(flange.translation(), [0, 0, 0.36 + 0.42 + 0.4 + 0.126], atol=1e-12)


def test_the_ur3es_reach_is_what_its_data_sheet_says(examples):
    """Stretched out level, wrist 1 is a2 + a3 from the shoulder's axis."""
    q = examples["ur3e_bin"].q_star.copy()
    q[:3] = 0.0
    p = poses(examples["ur3e_bin"], q)["arm/wrist_1"].translation()
    assert p[0] == pytest.approx(0.24355 + 0.2132)


def doubled(levels):
    """SDFormat files, each of which includes the next one twice; the first is arm.sdf."""
    files = {}
    for level in range(levels):
        twice = "".join(f"<include><uri>arm{level + 1}.sdf</uri><name>{name}</name></include>" for name in "ab")
        files[f"arm{level or ''}.sdf"] = f'<sdf version="1.9"><model name="arm"><link name="base"/>{twice}</model></sdf>'
    return files | {f"arm{levels}.sdf": '<sdf version="1.9"><model name="arm"><link name="base"/></model></sdf>'}


@pytest.mark.parametrize(
    ("levels", "limits", "words"),
    [
        (16, {"timeout_s": 3}, ["took more than 3 s", "try again when the machine has less to do"]),
        (13, {"memory_bytes": 500 * 2**20}, ["memory"]),
    ],
)
def test_a_model_that_ends_drakes_process_ends_nothing_else(tmp_path, levels, limits, words):
    path = write(tmp_path, SCENE.replace("arm.urdf", "arm.sdf"), files=doubled(levels))
    with pytest.raises(SceneError) as caught:
        load_scene(path, **limits)
    assert (caught.value.code, caught.value.field) == ("scene_model_crash", "directives")
    for word in [*words, "arm.sdf"]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("arm.sdf", '<sdf version="1.7"><model name="arm"><link name="base"/><include><uri>arm.sdf</uri></include></model></sdf>'),
        ("arm.xml", '<mujoco model="arm"><include file="arm.xml"/><worldbody><body name="base"/></worldbody></mujoco>'),
        ("arm.yaml", "directives: [{add_directives: {file: package://mine/arm.yaml}}]"),
    ],
)
def test_a_file_that_includes_itself_is_refused(tmp_path, name, text):
    kind = "add_directives: {" if name.endswith("yaml") else "add_model: {name: arm, "
    scene = f"packages: {{mine: .}}{SCENE.replace('add_model: {name: arm, file: arm.urdf', f'{kind}file: {name}')}"
    with pytest.raises(SceneError, match=rf"{name}( includes itself|' is included twice)") as caught:
        load_scene(write(tmp_path, scene, files={name: text}))
    assert caught.value.code == "scene_model"


def test_a_missing_scene_file_is_named(tmp_path):
    with pytest.raises(SceneError, match=r"there is no scene file .*nothing\.yaml"):
        load_scene(tmp_path / "nothing.yaml")
