"""Uploads that mean harm, through HTTP: each is refused with a problem that names the file and the reason, and nothing is left behind."""

from __future__ import annotations

import io
import os
import struct
import tempfile
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from certifier.errors import SceneError
from certifier.scene.bundle import BundleLimits, pack_bundle
from certifier.scene.unpack import unpack
from tests.api.conftest import PROBLEM
from tests.certifier.scene.workshop import ARM, BOX, LIMIT, ROOM, SCENE

HONEST = {
    "bundle.json": '{"scene": "scene.yaml"}',
    "scene.yaml": SCENE,
    "arm.urdf": ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more=""),
    "room.sdf": ROOM,
}
URDF = "<robot name='arm'>{}</robot>"
LAUGHS = "".join(f"<!ENTITY l{i} '{f'&l{i - 1};' * 10}'>" for i in range(1, 10))
ENTITIES = {
    "billion laughs": f"<!DOCTYPE r [<!ENTITY l0 'lol'>{LAUGHS}]><robot name='arm'>&l9;</robot>",
    "external entity": "<!DOCTYPE r [<!ENTITY x SYSTEM 'file:///etc/passwd'>]><robot name='arm'>&x;</robot>",
    "parameter entity": "<!DOCTYPE r [<!ENTITY % x SYSTEM 'http://example.org/x.dtd'> %x;]><robot name='arm'/>",
    "external document type": "<!DOCTYPE r SYSTEM 'http://example.org/x.dtd'><robot name='arm'/>",
}
URIS = [
    "file:///etc/passwd",
    "file:/etc/passwd",
    "http://example.org/m.obj",
    "HTTPS://example.org/m.obj",
    "ftp://example.org/m.obj",
    "/etc/passwd",
    "~/m.obj",
    "../../../../etc/passwd",
    "package://nowhere/m.obj",
    "package://../m.obj",
    "C:\\m.obj",
]
ELEMENTS = {
    "arm.urdf": URDF.format("<link name='a'><collision><geometry><mesh filename='{}'/></geometry></collision></link>"),
    "room.sdf": "<sdf version='1.7'><model name='room'><include><uri>{}</uri></include></model></sdf>",
    "more.mjcf": "<mujoco><asset><mesh file='{}'/></asset></mujoco>",
    "more.dmd.yaml": 'directives: [{{add_model: {{name: a, file: "{}"}}}}]',
    "scene.yaml": 'directives: [{{add_model: {{name: a, file: "{}"}}}}]',
}


def zipped(**changed: str | bytes) -> bytes:
    """The honest bundle with some files changed, or more of them."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, content in {**HONEST, **changed}.items():
            archive.writestr(name, content)
    return data.getvalue()


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "unpacked").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "unpacked"))


def refused(client: TestClient, data: bytes, status: int, code: str, *words: str) -> None:
    answer = client.post("/v1/scenes", files={"bundle": ("scene.zip", data, "application/zip")})
    problem = answer.json()
    assert (answer.status_code, problem["code"], answer.headers["content-type"]) == (status, code, PROBLEM), problem
    for word in words:
        assert word in problem["detail"]
    assert tempfile.gettempdir() not in answer.text
    assert "root:" not in answer.text, "the content of /etc/passwd"
    assert os.listdir(tempfile.gettempdir()) == []
    assert client.get("/v1/scenes").json()["scenes"] == []


def test_the_honest_bundle_is_accepted(client: TestClient) -> None:
    assert client.post("/v1/scenes", files={"bundle": ("scene.zip", zipped(), "application/zip")}).status_code == 201


@pytest.mark.parametrize("name", ["../evil.obj", "/tmp/evil.obj", "a/../../evil.obj", "..\\evil.obj", "C:\\evil.obj", "~/../../evil.obj"])
def test_a_path_that_slips_out_of_the_zip(client: TestClient, name: str) -> None:
    refused(client, zipped(**{name: "v 0 0 0\n"}), 422, "bundle_path", "evil.obj", "not a path inside")


def test_a_link_in_the_zip(client: TestClient) -> None:
    data = io.BytesIO(zipped())
    link = zipfile.ZipInfo("link.obj")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(data, "a") as archive:
        archive.writestr(link, "/etc/passwd")
    refused(client, data.getvalue(), 422, "bundle_path", "'link.obj' is not a plain file")


@pytest.mark.slow
def test_a_mesh_of_a_gigabyte(client: TestClient) -> None:
    data = io.BytesIO(zipped())
    with zipfile.ZipFile(data, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive, archive.open("big.obj", "w") as mesh:
        for _ in range(1024):
            mesh.write(bytes(2**20))
    assert len(data.getvalue()) < 16 * 2**20
    refused(client, data.getvalue(), 413, "bundle_too_large", "'big.obj' goes beyond it")


def test_a_bomb(client: TestClient) -> None:
    data = zipped(**{"big.obj": bytes(300 * 2**20)})
    assert len(data) < 3 * 2**20
    refused(client, data, 413, "bundle_too_large", "'big.obj' goes beyond it")


def test_a_bomb_that_lies_about_its_size(client: TestClient) -> None:
    small = zipped(**{"big.obj": bytes(300 * 2**20)})
    place = small.rindex(b"PK\x01\x02", 0, small.rindex(b"big.obj"))
    data = small[: place + 24] + struct.pack("<L", 100) + small[place + 28 :]
    assert zipfile.ZipFile(io.BytesIO(data)).getinfo("big.obj").file_size == 100
    refused(client, data, 422, "bundle_zip")


def test_files_count_together(tmp_path: Path) -> None:
    """Small limits stand for large ones."""
    data = zipped(**{f"{i}.obj": bytes(1000) for i in range(20)})
    (tmp_path / "bundle.zip").write_bytes(data)
    with pytest.raises(SceneError) as caught:
        unpack(tmp_path / "bundle.zip", tmp_path / "files", BundleLimits(unpacked_bytes=10_000))
    assert caught.value.code == "bundle_too_large"
    assert sum(file.stat().st_size for file in (tmp_path / "files").rglob("*")) <= 10_000


def test_too_many_files(client: TestClient) -> None:
    refused(client, zipped(**{f"{i}.obj": "" for i in range(1000)}), 413, "bundle_too_large", "1004 files")


def test_a_directory_of_a_hundred_thousand_names_is_read_by_the_child(client: TestClient) -> None:
    entry = struct.Struct("<4s4B4HL2L5H2L").pack(b"PK\x01\x02", 20, 0, 20, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0) + b"a"
    count = 100_000
    end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, count & 0xFFFF, count & 0xFFFF, count * len(entry), 0, 0)
    refused(client, entry * count + end, 413, "bundle_too_large", "100000 files")


def test_directories_nested_for_ever(client: TestClient) -> None:
    refused(client, zipped(**{"a/" * 40 + "x.obj": ""}), 422, "bundle_path", "32 directories deep")


@pytest.mark.parametrize("kind", ENTITIES)
@pytest.mark.parametrize("file", ["arm.urdf", "room.sdf", "more.mjcf"])
def test_entities(client: TestClient, kind: str, file: str) -> None:
    refused(client, zipped(**{file: ENTITIES[kind]}), 422, "bundle_xml", file, "document type or entity")


@pytest.mark.parametrize("file", ELEMENTS)
def test_uris_that_lead_elsewhere(tmp_path_factory: pytest.TempPathFactory, file: str) -> None:
    """Through the check that the child makes; one of each goes through HTTP below."""
    from certifier.scene.unpack import check_bundle

    for uri in URIS:
        root = tmp_path_factory.mktemp("uri").resolve()
        for name, content in {**HONEST, file: ELEMENTS[file].format(uri.replace("\\", "\\\\") if "yaml" in file else uri)}.items():
            (root / name).write_text(content)
        with pytest.raises(SceneError) as caught:
            check_bundle(root, root / "scene.yaml")
        absolute = file == "scene.yaml" and uri.startswith(("/", "~", "file:"))
        assert caught.value.code == ("scene_field" if absolute else "bundle_uri"), uri
        assert uri.lower() in caught.value.message.replace("\\\\", "\\").lower(), caught.value


@pytest.mark.parametrize("file", ELEMENTS)
def test_a_uri_that_leads_elsewhere(client: TestClient, file: str) -> None:
    code = "scene_field" if file == "scene.yaml" else "bundle_uri"
    refused(client, zipped(**{file: ELEMENTS[file].format("file:///etc/passwd")}), 422, code, "file:///etc/passwd")


@pytest.mark.parametrize(
    ("file", "content", "code"),
    [
        ("arm.urdf", "<robot name='a'>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>", "bundle_xml"),
        ("more.gltf", "[" * 100_000, "bundle_text"),
        ("more.yaml", "[" * 100_000, "scene_yaml"),
        ("scene.yaml", "a: " + "{b: " * 10_000, "scene_yaml"),
        ("bundle.json", "[" * 100_000, "bundle_zip"),
    ],
)
def test_files_nested_for_ever(client: TestClient, file: str, content: str, code: str) -> None:
    refused(client, zipped(**{file: content}), 422, code, *(() if file == "bundle.json" else (file,)))


def test_programs_and_other_files_have_no_place(client: TestClient) -> None:
    """A robot's package may have them. A model may not refer to them."""
    mesh = "<robot name='a'><link name='l'><collision><geometry><mesh filename='run.sh'/></geometry></collision></link></robot>"
    refused(client, zipped(**{"arm.urdf": mesh, "run.sh": "#!/bin/sh\ntrue\n"}), 422, "bundle_file", "run.sh")


EXAMPLE = pack_bundle(Path(__file__).parents[2] / "examples" / "planar_2dof" / "scene.yaml")


@examples(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, len(EXAMPLE) - 1), st.integers(0, 255)), min_size=1, max_size=8), cut=st.integers(0, 40))
def test_any_damage_to_a_zip_is_an_error_that_was_meant(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]], cut: int
) -> None:
    data = bytearray(EXAMPLE)
    for place, byte in changes:
        data[place] = byte
    directory = tmp_path_factory.mktemp("damaged")
    (directory / "bundle.zip").write_bytes(data[: len(data) - cut])
    with suppress(SceneError):  # anything else would be the service's fault
        unpack(directory / "bundle.zip", directory / "files", BundleLimits())
