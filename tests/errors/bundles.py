"""Errors of bundles, which carry a scene to a service."""

from __future__ import annotations

import zipfile

from certifier.scene import BundleLimits, load_bundle
from tests.errors.rows import Row, rows
from tests.errors.scenes import BELOW, MESH

PACK = "make bundles with `ciris scene add`"
SMALLER = "use smaller meshes, or fewer of them"


def link() -> tuple[zipfile.ZipInfo, str]:
    entry = zipfile.ZipInfo("link.obj")
    entry.external_attr = 0o120777 << 16
    return entry, "/etc/passwd"


BUNDLES: list[Row] = [
    *rows(
        "certifier/scene/bundle.py",
        (
            "bundle_too_large",
            "bundle",
            "the bundle has {...} bytes; at most {bytes} are accepted",
            SMALLER,
            lambda t: load_bundle(bytes(9), BundleLimits(bytes=8)),
        ),
    ),
    *rows(
        "certifier/scene/references.py",
        (
            "bundle_file",
            "",
            "{name}: files of this kind are not part of a scene",
            "known kinds: {kinds}",
            lambda t: t.stranger(run__sh="true"),
        ),
        ("bundle_text", "", "{name}: byte {start} is not UTF-8 text", "save the file as UTF-8", lambda t: t.stranger(m__gltf=b"\xff\xfe")),
        ("bundle_text", "", "{name} is not JSON", MESH, lambda t: t.stranger(m__gltf="{")),
        ("bundle_text", "", "{name} is not glTF", MESH, lambda t: t.stranger(m__gltf="[]")),
        ("bundle_uri", "", "{reference} is not a relative path", BELOW, lambda t: t.pack(shape='<mesh filename="/m.obj"/>')),
        (
            "bundle_uri",
            "",
            "{reference} is no file of the scene",
            "use a relative path or package://NAME/FILE",
            lambda t: t.pack(shape='<mesh filename="https://example.org/m.obj"/>'),
        ),
        (
            "bundle_uri",
            "",
            "{reference} names the unknown package {name}",
            "known packages: {...}",
            lambda t: t.pack(shape='<mesh filename="package://no/m.obj"/>', extra="packages: {here: .}\n"),
        ),
        (
            "bundle_uri",
            "",
            "{reference} names the unknown package {name}",
            "name its directory under packages in the scene file",
            lambda t: t.pack(shape='<mesh filename="package://no/m.obj"/>'),
        ),
        (
            "bundle_xml",
            "",
            "{name} may be nested at most {MAX_DEPTH} levels deep",
            "",
            lambda t: t.stranger(arm__urdf="<a>" * 60 + "</a>" * 60),
        ),
        (
            "bundle_uri",
            "",
            "{name}: .. is not accepted in {...}",
            "keep the files below the directory of the model",
            lambda t: t.stranger(m__xml="<mujoco><compiler meshdir='..'/></mujoco>"),
        ),
    ),
    *rows(
        "certifier/scene/unpack.py",
        (
            "bundle_uri",
            "",
            "{where}: {reference}: .. is not accepted here",
            "keep the file below the directory of the model",
            lambda t: t.stranger(m__xml="<mujoco><mesh file='a/../m.obj'/></mujoco>"),
        ),
        (
            "bundle_uri",
            "",
            "{what} leads out of the bundle",
            "`ciris scene add` packs every file that is needed",
            lambda t: t.stranger(arm__urdf="<robot><mesh filename='../m.obj'/></robot>"),
        ),
        (
            "bundle_too_large",
            "bundle",
            "the bundle has {...} files; at most {files} are accepted",
            SMALLER,
            lambda t: t.unpack(*((f"{i}.obj", "") for i in range(1001))),
        ),
        (
            "bundle_zip",
            "bundle",
            "this is no zip of a scene, or it cannot be unpacked",
            PACK,
            lambda t: load_bundle(b"not a zip"),
        ),
        (
            "bundle_zip",
            "bundle",
            "the zip has no {INDEX}, and {...} files that may be the scene file",
            "zip a directory with one {SCENE_FILE}, or use `ciris scene add`",
            lambda t: t.unpack(("a/scene.yaml", ""), ("b/scene.yaml", "")),
        ),
        ("bundle_path", "bundle", "{filename} is not a plain file", PACK, lambda t: t.unpack(link())),
        (
            "bundle_too_large",
            "bundle",
            "the bundle unpacks to more than is accepted; {filename} goes beyond it",
            SMALLER,
            lambda t: load_bundle(t.pack(), BundleLimits(unpacked_bytes=100)),
        ),
        ("bundle_path", "bundle", "{name} is not a path inside the bundle", PACK, lambda t: t.unpack(("../evil", ""))),
        (
            "bundle_path",
            "bundle",
            "{...}... may be nested at most {_DEPTH} directories deep",
            PACK,
            lambda t: t.unpack(("a/" * 40 + "b", "")),
        ),
    ),
]
