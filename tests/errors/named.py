"""Errors of SRDF files, of named configurations, and of drafts of whole cells."""

from __future__ import annotations

from collections.abc import Sequence

from certifier.configurations import positions
from certifier.scene.draft import Part, draft
from tests.certifier.scene.workshop import ARM, BOX, LIMIT, SCENE
from tests.errors.trial import Table, Trial

GRIP = "<robot name='grip'><link name='palm'/></robot>"
TWO = "<sdf version='1.9'><model name='two'><link name='a'/><link name='b'/></model></sdf>"
NAMED_SCENE = SCENE + "configurations: {home: {turn: 0.5}, away: {turn: 0.6}}\n"
TWO_JOINTS = {"a/home": {"a/x": 0.0}, "b/home": {"b/x": 0.0}}


def srdf(t: Trial, inside: str, more: str = "", model: str = "arm") -> None:
    t.scene(f"{SCENE}srdf: {{{model}: arm.srdf}}\n{more}", files={"arm.srdf": f"<robot name='arm'>{inside}</robot>"})


def state(t: Trial, joints: str) -> None:
    srdf(t, f"<group_state name='a' group='g'>{joints}</group_state>")


def configured(t: Trial, text: str) -> None:
    t.scene(f"{SCENE}configurations: {text}\n")


def mounted(t: Trial, link: str, text: str = GRIP, name: str = "grip.urdf", before: Sequence[str] = ()) -> None:
    for file, content in (("r.urdf", ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more="")), (name, text)):
        (t.directory / file).write_text(content)
    draft(t.directory / "r.urdf", [], t.directory / "scene.yaml", {}, [Part(t.directory / name, one) for one in (*before, link)])


def checked(t: Trial, q: str) -> None:
    t.scene(NAMED_SCENE)
    t.ciris("scene", "check", t.directory / "scene.yaml", "--q", q)


def nowhere(t: Trial) -> None:
    url, _ = (t.need(name) for name in ("url", "region"))
    t.ciris("contains", "slider", "--q", "nowhere", CIRIS_URL=url)


NAMED: Table = {
    ("scene_srdf", "srdf.arm"): [
        lambda t: srdf(t, "<links/>"),
        lambda t: srdf(t, "<xacro:if value='1'/>"),
        lambda t: srdf(t, "<group name='${g}'/>"),
        lambda t: srdf(t, "<group name='g'><group_state/></group>"),
        lambda t: srdf(t, "<disable_collisions link1='base' link='hand'/>"),
        lambda t: srdf(t, "<disable_collisions link1='base'/>"),
        lambda t: srdf(t, "<disable_collisions link1='base' link2='base'/>"),
        lambda t: srdf(t, "<enable_collisions link1='a' link2='b'/><disable_collisions link1='a' link2='b'/>"),
        lambda t: srdf(t, "<group_state name='a'/>\n<group_state name='a'/>"),
        lambda t: srdf(t, "<group name='g'>" * 60),
        lambda t: state(t, "<joint name='turn' value='x'/>"),
        lambda t: state(t, "<joint name='turn' value='1'/><joint name='turn' value='1'/>"),
        lambda t: t.scene(f"{SCENE}srdf: {{arm: none.srdf}}\n"),
    ],
    ("unknown_name", "srdf.arm"): [
        lambda t: srdf(t, "<disable_default_collisions link='hend'/>"),
        lambda t: srdf(t, "<disable_default_collisions link='zzz'/>"),
    ],
    ("unknown_name", "srdf.arms"): [lambda t: srdf(t, "", model="arms")],
    ("unknown_name", "srdf.zzz"): [lambda t: srdf(t, "", model="zzz")],
    ("scene_field", "srdf.arm"): [lambda t: t.scene(f"{SCENE}srdf: {{arm: arm.xml}}\n")],
    ("scene_field", "srdf"): [lambda t: t.scene(f"{SCENE}srdf: arm.srdf\n")],
    ("scene_field", "configurations"): [lambda t: configured(t, "[home]"), lambda t: configured(t, "{'1': [0]}")],
    ("scene_field", "configurations.home"): [lambda t: configured(t, "{home: 1}"), lambda t: configured(t, "{home: [0, 0]}")],
    ("scene_field", "configurations.home.arm/turn"): [lambda t: configured(t, "{home: {turn: 9}}")],
    ("mount", "--mount"): [
        lambda t: mounted(t, ""),
        lambda t: mounted(t, "hend"),
        lambda t: mounted(t, "zzz"),
        lambda t: mounted(t, "palm", before=["hand", "hand"]),
        lambda t: mounted(t, "hand", TWO, "two.sdf"),
    ],
    ("bad_option", "--world"): [lambda t: t.ciris("scene", "init", "arm.urdf", "--world", "table.sdf@1,2")],
    ("unknown_configuration", "--q"): [lambda t: checked(t, "hoem"), lambda t: checked(t, "zzz")],
    ("configuration", "--q"): [lambda t: checked(t, "home,away"), lambda _: positions("a/home", TWO_JOINTS, ["a/x", "b/x"], [0, 0], "--q")],
    ("unknown_configuration", "q"): [lambda _: positions("home", TWO_JOINTS, ["a/x", "b/x"], [0, 0], "q")],
    ("unknown_configuration", "--q[0]"): [nowhere],
}
