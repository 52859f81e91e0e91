"""docs/scenes.md says of SDFormat what the tables of names say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from certifier.errors import SceneError
from certifier.scene.formats import sdf_names
from tests.certifier.scene.workshop import SCENE, parsed, write

DOCS = Path(__file__).parents[3] / "docs" / "scenes.md"


def section() -> str:
    return DOCS.read_text().partition("### SDFormat\n")[2].partition("\n#")[0]


def cells(row: str) -> list[list[str]]:
    return [re.findall(r"`([^`]+)`", cell) for cell in row.strip("|").split("|")]


def test_the_table_of_elements_is_that_of_the_code():
    rows = [cells(row) for row in section().partition("| in |")[2].partition("\n\n")[0].splitlines()[2:]]
    said = {parent: [set(read), set(harmless), set(refused)] for (parent,), read, harmless, refused in rows}
    parents = {*sdf_names.ONCE, *sdf_names.MANY, *sdf_names.HARMLESS, *sdf_names.REFUSED}
    tables = (sdf_names.HARMLESS, sdf_names.REFUSED)
    assert said == {
        parent: [{*sdf_names.ONCE.get(parent, ()), *sdf_names.MANY.get(parent, ())}, *(set(table.get(parent, ())) for table in tables)]
        for parent in parents
    }


def test_the_table_of_attributes_is_that_of_the_code():
    rows = [cells(row) for row in section().partition("| element | attributes |")[2].partition("\n\n")[0].splitlines()[2:]]
    assert {element: tuple(attributes) for (element,), attributes in rows} == sdf_names.ATTRIBUTES


def test_the_versions_are_those_of_the_code():
    assert f"Versions {sdf_names.VERSIONS[0]} to {sdf_names.VERSIONS[-1]} are read" in section()


ARM = """<sdf version="{version}">
<model name="arm"><link name="base"><collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link>
<link name="hand">
{link}</link>
<joint name="turn" type="{kind}"><parent>base</parent><child>hand</child>
{joint}</joint>
{model}</model></sdf>"""
AXIS = "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis>"
BOX = "<geometry><box><size>0.1 0.1 0.1</size></box></geometry>"

MESH = "<geometry><mesh><uri>t.obj</uri><submesh><name>b</name><center>true</center></submesh></mesh></geometry>"

CONE = "<geometry><cone><radius>1</radius></cone></geometry>"


def arm(directory: Path, *, link="", joint=AXIS, model="", kind="revolute", version="1.9", **files) -> Path:
    text = ARM.format(link=link, joint=joint, model=model, kind=kind, version=version)
    return write(directory, SCENE.replace("arm.urdf", "arm.sdf"), files={"arm.sdf": text, **files})


SHAPE = '<collision name="c"><geometry>{}</geometry></collision>'
IN_WORLD = """<sdf version="1.6"><world name="w">{}
<model name="room"><link name="walls"/></model></world></sdf>"""


@pytest.mark.parametrize("name", ["population", "state"])
def test_models_of_a_world_that_drake_leaves_out_are_refused(tmp_path, name):
    more = f"<{name} name='p'><model name='can'><link name='l'/></model></{name}>"
    path = write(tmp_path, files={"room.sdf": IN_WORLD.format(more)})
    with pytest.raises(SceneError, match=rf"room\.sdf:1: <{name}> in <world> is not read"):
        parsed(path)


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        ({"link": '<colision name="c"/>'}, 4, "<colision> is not known in <link> (did you mean collision?"),
        ({"link": f'<collision name="c" pose="1 0 0 0 0 0">{BOX}</collision>'}, 4, "the attribute 'pose' of <collision> is not known"),
        ({"link": '<pose realtive_to="base"/>'}, 4, "'realtive_to' of <pose> is not known (did you mean relative_to?)"),
        ({"link": '<pose rotation_formt="quat_xyzw">0 0 0 0 0 0 1</pose>'}, 4, "did you mean rotation_format?"),
        ({"link": '<pose degres="true">0 0 0 0 0 90</pose>'}, 4, "did you mean degrees?"),
        ({"link": '<pose degrees="True">0 0 0 0 0 90</pose>'}, 4, "degrees of <pose> is 'True' instead of true or false"),
        ({"link": "<pose>0 0 0 0 0 0 1</pose>"}, 4, "<pose> is '0 0 0 0 0 0 1' instead of"),
        ({"link": f'<link name="x"><collision name="c">{BOX}</collision></link>'}, 4, "<link> is not known in <link>"),
        ({"link": f'<visual><collision name="c">{BOX}</collision></visual><geometry/>'}, 4, "<geometry>"),
        ({"link": '<collision name="c"/>'}, 4, "<collision> has no <geometry>"),
        ({"link": '<collision name="c"><geometry/></collision>'}, 4, "<geometry> has no shape"),
        ({"link": f'<collision name="c">{BOX.replace("</geometry>", "<empty/></geometry>")}</collision>'}, 4, "more than one shape"),
        ({"link": f'<collision name="c">{MESH}</collision>'}, 4, "<submesh> in <mesh> is not read (Drake would take the whole file"),
        *(
            ({"link": f'<collision name="c"><geometry><{shape}/></geometry></collision>'}, 4, f"<{shape}> in <geometry> is not read")
            for shape in ("heightmap", "polyline", "image", "cone")
        ),
        *(
            ({"link": f'<pose rotation_format="quat_xyzw">0 0 0 {q}</pose>'}, 4, f"the quaternion of <pose> has the length {length}")
            for q, length in (("0 0 0 0", 0), ("0 0 0 2", 2), ("0.707107 0 0 0.707107", "1.00000031"), ("0 1e-200 0 1e-200", "1.4142135"))
        ),
        *(({"link": f"<pose>{x} 0 0 0 0 0</pose>"}, 4, f"<pose> has {x} in it") for x in ("1e+90", "-1.1e+06")),
        ({"link": SHAPE.format("<box><size>1e20 1e-20 1</size></box>")}, 4, "<size> has 1e+20 in it"),
        ({"link": SHAPE.format("<sphere><radius>1e-300</radius></sphere>")}, 4, "<radius> has 1e-300 in it"),
        *(({"link": SHAPE.format(f"<plane><normal>{n}</normal></plane>")}, 4, "<normal> has the length") for n in ("0 0 0", "0 0 1e-7")),
        *(
            ({"link": SHAPE.format(f"<mesh><uri>m.obj</uri><scale>{x} 1 1</scale></mesh>")}, 4, f"<scale> has {x} in it")
            for x in ("0", "1e-09", "1.1e+09")
        ),
        ({"link": SHAPE.format("<mesh><scale>1 1 1</scale></mesh>")}, 4, "<mesh> has no <uri>"),
        *(({"joint": AXIS.replace("0 0 1", n)}, 6, "<xyz> has the length") for n in ("0 0 0", "0 1e-7 0", "1e7 0 0", "1e200 1e200 0")),
        *(
            ({"model": f"<my:data><{name}/></my:data>"}, 7, f"<{name}> in <my:data> is not read")
            for name in ("collision", "model", "my:collision", "include")
        ),
        ({"link": f'<my:collision name="c">{BOX}</my:collision>'}, 4, "<geometry> in <my:collision> is not read"),
        ({"link": '<my:collision name="c"/>'}, 4, "<my:collision> is not known in <link>"),
        ({"link": f'<collision name="c">{BOX.replace("<box>", "<my:lens/><box>")}</collision>'}, 4, "<my:lens> is not known in <geometry>"),
        ({"link": '<pose my:degrees="true">0 0 0 0 0 90</pose>'}, 4, "the attribute 'my:degrees' of <pose> is not known"),
        ({"joint": f'{AXIS}<drake:mimic joint="turn" offset="1e90"/>'}, 6, "offset of <drake:mimic> has 1e+90 in it"),
        ({"link": '<xacro:box size="1"/>'}, 4, "<xacro:box> is not known in <link>"),
        ({"link": "<kinematic>true</kinematic>"}, 4, "<kinematic> is true"),
        ({"joint": AXIS.replace("<xyz>", '<xyz expresed_in="base">')}, 6, "did you mean expressed_in?"),
        ({"joint": AXIS.replace("lower", "lowr")}, 6, "<lowr> is not known in <limit> (did you mean lower?"),
        ({"joint": AXIS.replace("limit", "limits")}, 6, "<limits> is not known in <axis> (did you mean limit?"),
        ({"joint": f"{AXIS}<axis2><xyz>1 0 0</xyz></axis2>"}, 5, "<axis2>, which its type does not have"),
        ({"joint": f"{AXIS}<parent>hand</parent>"}, 6, "a second <parent>"),
        ({"joint": AXIS.replace("xyz", "xyz<!-- -->", 1).replace("xyz<!-- -->>", "xyz>0 <!-- -->")}, 6, "more than text"),
        ({"kind": "revolut"}, 5, "type of <joint> is 'revolut' (did you mean revolute"),
        ({"model": "<static>yes</static>"}, 7, "<static> is 'yes' instead of true or false"),
        ({"model": "move"}, 2, "<model> holds the text 'move'"),
        ({"model": '<frame name="f" atached_to="base"/>'}, 7, "did you mean attached_to?"),
        ({"model": '<drake:joint name="f" type="planar"/>'}, 7, "<drake:joint> in <model> is not read"),
        ({"model": '<gz:joint name="f"/>'}, 7, "<gz:joint> is not known in <model>"),
        ({"model": '<include><uri>p.sdf</uri><experimental:params/></include>'}, 7, "<experimental:params> in <include> is not read"),
        ({"model": '<include mrege="1"><uri>p.sdf</uri></include>'}, 7, "did you mean merge?"),
        ({"model": '<include><uri>p.sdf</uri><pose realtive_to="x"/></include>'}, 7, "did you mean relative_to?"),
        ({"model": '<include><uri>p.sdf</uri><pose frame="x"/></include>'}, 7, "have no frame of <pose>"),
        ({"model": '<include><uri>m.xml</uri></include>', "m.xml": "<mujoco/>"}, 7, "is MJCF"),
        ({"model": '<link name="hand"/>'}, 7, "a second <link> is called 'hand'"),
        ({"model": '<drake:collision_filter_group name="g"><drake:membr/></drake:collision_filter_group>'}, 7, "did you mean drake:member"),
        ({"version": "1.3"}, 1, "version of <sdf> is '1.3'"),
        ({"version": "1.13"}, 1, "version of <sdf> is '1.13'"),
    ],
)  # fmt: skip
def test_what_is_not_known_is_refused_with_its_line(tmp_path, change, line, words):
    with pytest.raises(SceneError) as caught:
        parsed(arm(tmp_path, **change))
    assert caught.value.message.startswith(f"arm.sdf:{line}: "), caught.value
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        {"link": "<kinematic>0</kinematic><self_collide>true</self_collide><visual name='v'>" + CONE + "</visual>"},
        {"link": f'<collision name="c">{BOX}<surface><contact><collide_bitmask>0</collide_bitmask></contact></surface></collision>'},
        {"link": '<collision name="c"><geometry><empty/></geometry></collision>'},
        {"model": '<plugin name="p" filename="p.so"><pose>x</pose></plugin><frame name="f" attached_to="hand"/>'},
        {"joint": AXIS.replace("</limit>", "<effort>1</effort><velocity>2</velocity></limit><dynamics><damping>1</damping></dynamics>")},
        {"kind": "continuous"},
        {"link": '<pose rotation_format="quat_xyzw">0 0 0 0.70710678 0 0 0.70710678</pose>'},
        {"link": "<my:data><my:more>3</my:more></my:data>", "model": '<my:data xmlns:my="http://x" a="1">move</my:data>'},
        {"model": '<frame name="f" my:note="1"/><plugin name="p" filename="p.so"><my:data><pose>x</pose></my:data></plugin>'},
        {"joint": AXIS.replace("<xyz>", '<xyz expressed_in="base">')},
    ],
)
def test_what_is_known_or_harmless_is_read(tmp_path, change):
    assert parsed(arm(tmp_path, **change)).n == 1
