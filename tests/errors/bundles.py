"""Errors of bundles, which carry a scene to a service."""

from __future__ import annotations

import zipfile

from certifier.scene import BundleLimits, load_bundle
from tests.errors.trial import Table


def link() -> tuple[zipfile.ZipInfo, str]:
    entry = zipfile.ZipInfo("link.obj")
    entry.external_attr = 0o120777 << 16
    return entry, "/etc/passwd"


XACRO = "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:property name='x' value='1'/></robot>"

BUNDLES: Table = {
    ("bundle_too_large", "bundle"): [
        lambda t: load_bundle(bytes(9), BundleLimits(bytes=8)),
        lambda t: t.unpack(*((f"{i}.obj", "") for i in range(1001))),
        lambda t: load_bundle(t.pack(), BundleLimits(unpacked_bytes=100)),
    ],
    ("bundle_file", ""): [
        lambda t: t.stranger(arm__urdf="<robot><mesh filename='run.sh'/></robot>", run__sh="true"),
        lambda t: t.stranger(other__urdf=XACRO),
    ],
    ("bundle_text", ""): [lambda t: t.stranger(m__gltf=b"\xff\xfe"), lambda t: t.stranger(m__gltf="{"), lambda t: t.stranger(m__gltf="[]")],
    ("bundle_uri", ""): [
        lambda t: t.pack(shape='<mesh filename="/m.obj"/>'),
        lambda t: t.pack(shape='<mesh filename="https://example.org/m.obj"/>'),
        lambda t: t.pack(shape='<mesh filename="package://no/m.obj"/>', extra="packages: {here: .}\n"),
        lambda t: t.pack(shape='<mesh filename="package://no/m.obj"/>'),
        lambda t: t.stranger(m__xml="<mujoco><compiler meshdir='..'/></mujoco>"),
        lambda t: t.stranger(m__xml="<mujoco><mesh file='a/../m.obj'/></mujoco>"),
        lambda t: t.stranger(arm__urdf="<robot><mesh filename='../m.obj'/></robot>"),
    ],
    ("bundle_xml", ""): [lambda t: t.stranger(arm__urdf="<a>" * 60 + "</a>" * 60)],
    ("bundle_zip", "bundle"): [
        lambda t: load_bundle(b"not a zip"),
        lambda t: t.unpack(("LICENSE", "all")),
        lambda t: t.unpack(("arm_macro.xacro", "<robot/>")),
    ],
    ("bundle_choice", "bundle"): [lambda t: t.unpack(("a/scene.yaml", ""), ("b/scene.yaml", ""))],
    ("scene_package", ""): [lambda t: t.unpack(("arm.urdf", "<robot name='a'><mesh filename='package://no/m.obj'/></robot>"))],
    ("bundle_path", "bundle"): [lambda t: t.unpack(link()), lambda t: t.unpack(("../evil", "")), lambda t: t.unpack(("a/" * 40 + "b", ""))],
}
