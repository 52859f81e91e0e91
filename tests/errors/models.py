"""Errors of model files: URDF, SDFormat and MJCF, as certifier/scene/formats/ reads them."""

from __future__ import annotations

from tests.certifier.scene.workshop import BOX, LIMIT
from tests.errors.scenes import BALL_JOINT, MUJOCO, linked, room
from tests.errors.scenes import mjcf as body
from tests.errors.trial import Table

LINK = "<link name='more'/><joint name='{}' type='fixed'><parent link='{}'/><child link='{}'/></joint>"
ZERO_AXIS = "<joint name='j' type='continuous'><parent link='hand'/><child link='l'/><axis xyz='0 0 0'/>"


def turn(limit: str) -> dict[str, str]:
    return {"limit": f"<limit {limit}/>"}


PAIR = "<contact><pair geom1='a' geom2='a'/></contact>"


def model(text: str) -> dict[str, object]:
    return {"scene": MUJOCO, "files": {"m.xml": f"<mujoco model='m'>{text}</mujoco>"}}


MODELS: Table = {
    ("scene_model", "directives"): [
        lambda t: t.scene(limit='<limit lower="2" upper="-1" effort="1" velocity="1"/>'),
        lambda t: t.scene(shape='<sphere radius="1,5"/>'),
        lambda t: t.scene(shape='<sphere radius="1e-300"/>'),
        lambda t: t.scene(limit=f"{LIMIT}</joint><link name='l'/>{ZERO_AXIS}"),
        lambda t: t.scene(shape='<sphere radius="0.1"/><box size="9 9 9"/>'),
        lambda t: t.scene(shape='<box size="1 1 1"/><box size="9 9 9"/>'),
        lambda t: t.scene(more="<xacro:gripper/>"),
        lambda t: t.scene(more="<link name='${name}'/>"),
        lambda t: t.scene(more="<material><collision/></material>"),
        lambda t: t.scene(more="<drake:ball_constraint/>"),
        lambda t: t.scene(more="<lnik/>"),
        lambda t: t.scene(more="<group/>"),
        lambda t: t.scene(shape="<box size='1 1 1'><x/></box>"),
        lambda t: t.scene(more=BOX),
        lambda t: t.scene(more="<link name='l'><collision><origin quat_xyzw='0 0 0 1'/></collision></link>"),
        lambda t: t.scene(more="<link name='l' drake_ignore='true'/>"),
        lambda t: t.scene(shape=BOX.replace("s", "z")),
        lambda t: t.scene(shape="<sphere thick='1'/>"),
        lambda t: t.scene(shape="<sphere/>"),
        lambda t: t.scene(shape=f"0.1 {BOX}"),
        lambda t: t.scene(shape='<sphere radius="0"/>'),
        lambda t: t.scene(more=f"<link name='l'><collision name=''><geometry>{BOX}</geometry></collision></link>"),
        lambda t: t.scene(more="<link name='l'><origin xyz='0 0 1'/></link>"),
        lambda t: t.scene(more="<link name='l'><collision/></link>"),
        lambda t: t.scene(shape=""),
        lambda t: t.scene(more="<link name='hand'/>"),
        lambda t: t.scene(more=LINK.format("j", "base", "hand")),
        lambda t: t.scene(**turn("upper='1'")),
        lambda t: t.scene(more=LINK.format("j", "hnad", "more")),
        lambda t: t.scene(more=LINK.format("j", "qqqq", "more")),
        lambda t: t.scene(**room("<sphere><radius>0</radius></sphere>")),
        lambda t: t.scene(**room("<sphere></sphere>")),
        lambda t: t.scene(**room("<sphere><radius>1<!-- --> 5</radius></sphere>")),
        lambda t: t.scene(**linked("<colision/>")),
        lambda t: t.scene(**linked("<zzz/>")),
        lambda t: t.scene(**linked("<pose degres='1'/>")),
        lambda t: t.scene(**linked("<pose zzz='1'/>")),
        lambda t: t.scene(**room("<cone/>")),
        lambda t: t.scene(**linked("1 2 3")),
        lambda t: t.scene(**linked("</link><link name='walls'>")),
        lambda t: t.scene(**linked("<my:data><collision/></my:data>")),
        lambda t: t.scene(**room("<mesh/>")),
        lambda t: t.scene(**linked("<collision name='x'/>")),
        lambda t: t.scene(**room("")),
        lambda t: t.scene(**linked("</link><joint name='j' type='fixed'><axis2/></joint><link name='z'>")),
        lambda t: t.scene(**linked("</link><joint name='j' type='revolut'/><link name='z'>")),
        lambda t: t.scene(**linked("</link><joint name='j' type=''/><link name='z'>")),
        lambda t: t.scene(**linked("</link><static>yes</static><link name='z'>")),
        lambda t: t.scene(**linked("<kinematic>true</kinematic>")),
        lambda t: t.scene(**linked("<pose rotation_format='quat_wxyz'>0 0 0 1 0 0 0</pose>")),
        lambda t: t.scene(**linked("<pose frame='x'/>")),
        lambda t: t.scene(**linked("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>")),
        lambda t: t.scene(**body("<geom size='1,5'/>")),
        lambda t: t.scene(**model("<include/>")),
        lambda t: t.scene(**model("<include file='x.xml'/>")),
        lambda t: t.scene(**model("<include file='m.xml'/>")),
        lambda t: t.scene(scene=MUJOCO, files={"m.xml": "<mujocoinclude/>"}),
        lambda t: t.scene(**body("<frame/>")),
        lambda t: t.scene(**body("<goem size='1'/>")),
        lambda t: t.scene(**body("<geom fitscale='1'/>")),
        lambda t: t.scene(**body("<geom siez='1'/>")),
        lambda t: t.scene(**model("<default><geom type='box'/><default class='c'/></default><worldbody><geom class='c'/></worldbody>")),
        lambda t: t.scene(**model("<default class='c'/>")),
        lambda t: t.scene(**model("<default><default/></default>")),
        lambda t: t.scene(**model("<default><geom/><geom/></default>")),
        lambda t: t.scene(**body("<geom class='mains'/>")),
        lambda t: t.scene(**body("<geom zaxis='1e-8 0 -1'/>")),
        lambda t: t.scene(**body("<geom quat='1 0 0 0' euler='0 0 0'/>")),
        lambda t: t.scene(**body("<joint range='1 1'/>")),
        lambda t: t.scene(**body("<joint type='ball'/>")),
        lambda t: t.scene(**body("<joint type='revolute'/>")),
        lambda t: t.scene(**body("<joint limited='yes'/>")),
        lambda t: t.scene(**body("<joint limited='true'/>")),
        lambda t: t.scene(**model("<compiler autolimits='false'/><worldbody><body><joint range='0 1'/></body></worldbody>")),
        lambda t: t.scene(**model("<worldbody><body mocap='true'/></worldbody>")),
        lambda t: t.scene(**model("<worldbody><body pos='1 0 0'><joint/><joint/></body></worldbody>")),
        lambda t: t.scene(**body("<joint/><freejoint/>")),
        lambda t: t.scene(**body("<body><freejoint/></body>")),
        lambda t: t.scene(**body("<freejoint align='true'/>")),
        lambda t: t.scene(**body("<geom size='1' pos='1e90 0 0'/>")),
        lambda t: t.scene(**body("<geom xyaxes='1 0 0 2 0 0'/>")),
        lambda t: t.scene(**body("<joint axis='0 0 0'/>")),
        lambda t: t.scene(**body("<geom contype='0x1'/>")),
        lambda t: t.scene(**body("<geom type='hfield'/>")),
        lambda t: t.scene(**body("<geom mesh='m'/>")),
        lambda t: t.scene(**body("<geom type='box' fromto='0 0 0 1 0 0' size='1'/>")),
        lambda t: t.scene(**body("<geom type='capsule' fromto='0 0 0 1 0 0' pos='1 0 0' size='1'/>")),
        lambda t: t.scene(**body("<geom type='capsule' fromto='0 0 0 0 0 0' size='1'/>")),
        lambda t: t.scene(**body("<geom/>")),
        lambda t: t.scene(**body("<geom size='0'/>")),
        lambda t: t.scene(**body("<geom size='1e-300'/>")),
        lambda t: t.scene(**body("<geom type='plane'/>")),
        lambda t: t.scene(**body("<joint/><geom type='plane' size='1 1 1'/>")),
        lambda t: t.scene(**model("<asset><mesh file='m.obj'/><mesh name='m' file='n.obj'/></asset>")),
        lambda t: t.scene(**body("<geom type='mesh' mesh='m'/>")),
        lambda t: t.scene(**model("<asset><mesh name='m'/></asset><worldbody><geom type='mesh' mesh='m'/></worldbody>")),
        lambda t: t.scene(**model("<worldbody><geom name='a' size='1' contype='0' conaffinity='0'/></worldbody>" + PAIR)),
        lambda t: t.scene(**model("<worldbody><geom name='a' size='1'/></worldbody><contact><pair geom1='a' geom2='a'/></contact>")),
        lambda t: t.scene(**model("<worldbody><geom name='a' size='1'/></worldbody><contact><pair geom1='aa' geom2='a'/></contact>")),
        lambda t: t.scene(**model("<compiler angle='rad'/>")),
        lambda t: t.scene(**body("<geom size='1'/><geom name='geom0' size='1'/>")),
        lambda t: t.scene(**body("<geom name='a' size='1'/><geom name='a' size='1'/>")),
        lambda t: t.scene(**model("<equality><weld/></equality>")),
        lambda t: t.scene(**model("<tendon><fixed range='0 1'/></tendon>")),
        lambda t: t.scene(**model("<option><flag filterparent='disable'/></option>")),
    ],
    ("unsupported_joint", "directives"): [
        lambda t: t.scene(kind="floating"),
        lambda t: t.scene(kind="planar"),
        lambda t: t.scene(more=BALL_JOINT),
        lambda t: t.scene(kind="Revolute"),
        lambda t: t.scene(kind="xyz"),
    ],
}
