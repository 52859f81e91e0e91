"""A scene's names have ``::`` for models in models, which Drake accepts in no name."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Role

from certifier.model import Pair
from certifier.scene.contacts import touching
from certifier.scene.drake_model import build_diagram, drake_name, geometry_name, scene_name
from certifier.seeding.drake_iris import drake_iris
from certifier.seeding.options import Method, SeedOptions
from tests.certifier.scene.test_load import assert_same_kinematics, original
from tests.certifier.scene.workshop import parsed, write
from tests.oracles.clearance import DrakesClearance

NESTED = """<sdf version="1.9"><model name="room"><link name="walls"/><model name="i"><link name="l">
  <collision name="c:d:"><pose>0.6 0 0.3 0 0 0</pose><geometry><box><size>0.1 1 1</size></box></geometry></collision></link>
  <link name="door"><pose>0 0 3 0 0 0</pose><collision name="c">
  <geometry><sphere><radius>0.1</radius></sphere></geometry></collision></link>
  <joint name="turn" type="revolute"><parent>l</parent><child>door</child>
  <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis>
  </joint></model><joint name="f" type="fixed"><parent>walls</parent><child>i::l</child></joint></model></sdf>"""


@pytest.fixture
def path(tmp_path):
    return write(tmp_path, files={"room.sdf": NESTED})


def test_names_lead_to_drake_and_back():
    names = ["a::b/c", "a:b/c", "a::b:/c:::", "a/b"]
    assert [scene_name(drake_name(name)) for name in names] == names
    assert len({drake_name(name) for name in names}) == len(names)


def test_a_model_in_a_model_is_the_same_for_drake(path):
    scene = parsed(path)
    assert {"room::i/l", "room::i/door"} <= {*scene.bodies}
    inspector = build_diagram(scene).scene_graph().model_inspector()
    assert {geometry_name(inspector, i) for i in inspector.GetAllGeometryIds(Role.kProximity)} == {g.name for g in scene.geometries}


def test_a_model_in_a_model_moves_as_for_drake(path):
    assert_same_kinematics(parsed(path), original(path))


def test_a_region_grows_beside_a_model_in_a_model(path):
    """The palm, 0.05 around 0.3 m from the axis, never reaches the wall at 0.55 m."""
    scene = parsed(path)
    pair = Pair("arm/hand/palm", "room::i/l/c:d:")
    assert pair in scene.pairs
    apart, nearest = DrakesClearance(replace(scene, pairs=(pair,))).least(np.zeros(scene.n))
    assert (apart, nearest) == (pytest.approx(0.2), pair)
    assert list(touching(scene, [np.zeros(scene.n)])) == [set()]
    options = SeedOptions(Method.IRIS_NP2, max_iterations=1, max_iterations_separating_planes=3)
    C, d, _ = drake_iris(scene, np.zeros((1, scene.n)), options)
    assert (C @ np.zeros(scene.n) < d).all()
