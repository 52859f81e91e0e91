"""What a stranger's file may not do: print what it likes, say something of nothing, end the verifier, take its time or its memory."""

from __future__ import annotations

import copy
import io
import json
import struct
import time
import zipfile
import zlib
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.model import WORLD, Ignored, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.container import npy, pack, unpack, with_scene
from certifier.proof.ground import Ground
from certifier.proof.pair import PairProof, Side
from certifier.proof.region import RegionProof
from certifier.verify.file import answer, verify_file
from tests.certifier.proofs import files, region
from tests.certifier.scenes import planar_arm
from tests.certifier.verify.hostile import fitting, members, saved, text_of, zipped

KINDS = ("region", "pair", "motion", "dual", "witness")


@cache
def valid(kind: str) -> bytes:
    return files()[kind]


def refusal(data: bytes) -> dict[str, Any]:
    """The error of a file that does not hold, whose texts are all printable."""
    found = answer(data)
    assert not found["holds"], found
    error: dict[str, Any] = found["error"]
    assert all((error[key] or "").isprintable() and len(error[key] or "") < 600 for key in ("code", "message", "field", "hint"))
    return error


def with_header(data: bytes, header: Any) -> bytes:
    return zipped([(name, text_of(header) if name == "header.json" else content) for name, content in members(data)], zipfile.ZIP_DEFLATED)


def with_value(data: bytes, path: tuple, value: Any) -> bytes:
    """The file with another value in its header, and the hash that its scene has then."""
    header = copy.deepcopy(json.loads(dict(members(data))["header.json"]))
    node = header
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return with_header(data, fitting(header))


# What is printed


BAD_WORDS = ["\n  guarantee: exact", "a\x1b[2K", "\u202eb", "a  b", "", "x" * 600]


@pytest.mark.parametrize("word", BAD_WORDS)
@pytest.mark.parametrize("path", [("joints", 0, "name"), ("bodies", 2), ("geometries", 0, "name")])
def test_a_name_has_an_alphabet(path, word):
    """Everywhere in the scene it is the same, so nothing but the alphabet speaks against it."""
    header, arrays = unpack(valid("region"), "region")
    node = header["scene"]
    for key in path:
        node = node[key]
    old, new = json.dumps(node), json.dumps(word)
    header = fitting(json.loads(json.dumps(header).replace(old, new)))
    assert refusal(pack(header, arrays))["code"] == "proof_model"


@pytest.mark.parametrize("word", [word for word in BAD_WORDS if word and word != "a  b"])
def test_reasons_and_substitutions_are_sentences(word):
    data = valid("region")
    assert refusal(with_value(data, ("scene", "geometries", 0, "substitution"), word))["code"] == "proof_model"
    ignored = [{"pair": ["arm/link1/bar", "arm/link2/bar"], "reason": word}]
    assert refusal(with_value(data, ("scene", "ignored"), ignored))["code"] == "proof_model"
    ignored[0]["reason"] = "neighbours"
    statement = answer(with_value(data, ("scene", "ignored"), ignored))["statement"]
    assert "not covered: 'arm/link1/bar' and 'arm/link2/bar', for the reason \"neighbours\"" in statement


@pytest.mark.parametrize("kind", KINDS)
def test_no_statement_follows_from_the_scenes_name(kind):
    named = with_value(valid(kind), ("scene", "name"), "x\n  hash 0000\x1b[1A")
    found = answer(named)
    assert found["statement"] == answer(valid(kind))["statement"]
    assert found["scene"]["name"] == "x\\n  hash 0000\\x1b[1A"


PRINTED: list[tuple[str, tuple]] = [
    ("region", ("kind",)),
    ("region", ("proofs", 0, "frame")),
    ("region", ("volumes", 0, "geometries", 0)),
    ("region", ("scene", "joints", 0, "kind")),
    ("motion", ("space",)),
    ("witness", ("pair", 0)),
    ("witness", ("scene", "geometries", 0, "body")),
]


@pytest.mark.parametrize(("kind", "path"), PRINTED)
def test_errors_are_printed_escaped(kind, path):
    refusal(with_value(valid(kind), path, "\x1b[2K\n  guarantee: exact"))


# Polytopes without a point


def proof_on_nothing(normal: float) -> PairProof:
    """0.1 <= s <= -0.2 holds nowhere, so the two faces add up to -0.3 and -t den is a sum of squares times faces: any plane separates."""
    scene = planar_arm(1)
    faces, t, half = np.array([[1.0], [-1.0]]), 1.0, 0.5
    prove = np.array([[100.0, 100.0, 0.0, 0.0]])
    ground = Ground(faces, np.array([-0.2, -0.1]), np.zeros(1), np.array([half]), prove, prove)
    plane = np.zeros((4, 2))
    plane[0, 0] = normal
    sides = []
    for chain, vertices in (((0,), 8), ((), 8)):
        root = np.sqrt(t / 0.3) * (np.diag([1.0, half]) if chain else np.eye(1))
        factor = np.stack([0 * root, root, root])[None].repeat(vertices, axis=0)
        sides.append(Side.rounded(chain, factor, "int64"))
    volumes = (Volume.of(scene.geometries[0]), Volume.of(scene.geometries[1]))
    return PairProof(scene, volumes, WORLD, ground, np.zeros(1), plane, t, 0.0, (0, 1), (sides[0], sides[1]))


@pytest.mark.parametrize("normal", [0.0, 1e-4])
def test_of_an_empty_polytope_nothing_is_said(normal):
    proof = proof_on_nothing(normal)
    for point in (0.0, 0.1, -0.2, 1.9):
        data = with_scene(replace(proof, interior=np.array([point])).to_bytes(), proof.scene)
        assert refusal(data)["code"] == "proof_interior"


@pytest.mark.parametrize("kind", ["pair", "dual"])
def test_the_point_of_a_polytope_is_in_it_and_within_the_joint_limits(kind):
    header, arrays = unpack(valid(kind), kind)
    polytope = arrays["ground/0/C"], arrays["ground/0/d"]
    inside = arrays["interior"]
    for wrong in (inside + 1.0, inside + 1e6, inside[:1], inside[None]):
        assert refusal(pack(header, {**arrays, "interior": wrong}))["code"] == "proof_interior"
    corner = np.array([polytope[1][0], inside[1]])
    assert answer(pack(header, {**arrays, "interior": corner}))["holds"]


# Headers


HOSTILE: list[Any] = [None, True, [], {}, "", " 1.0", "@deep@", 10**400, float("nan"), float("inf"), "\ud800", [None], {"a": []}]
FINE = [("substitution", None), ("substitution", ""), ("substitution", " 1.0"), ("shape", {}), ("shape", {"a": []}), ("ignored", [])]
"""What may stand there."""
PLACES: dict[str, list[tuple]] = {
    "region": [
        *[(key,) for key in ("format", "kind", "grounds", "volumes", "proofs", "scene")],
        *[("proofs", 0, key) for key in ("volumes", "frame", "ground", "faces", "chains")],
        ("volumes", 0),
        ("volumes", 0, "geometries"),
        *[("scene", key) for key in ("schema_version", "joints", "bodies", "geometries", "pairs", "ignored", "q_star", "padding")],
        *[("scene", "joints", 0, key) for key in ("name", "kind", "parent", "child", "axis", "X_PF", "X_BM", "index", "lower", "upper")],
        *[("scene", "geometries", 0, key) for key in ("name", "body", "vertices", "radius", "shape", "substitution", "inflation")],
        ("scene", "joints", 0, "X_PF", 1, 1),
        ("scene", "geometries", 0, "vertices", 0, 2),
        ("scene", "pairs", 0),
    ],
    "dual": [(key,) for key in ("pair", "frame", "equations")],
    "witness": [("pair",), ("pair", 0)],
}


@pytest.mark.parametrize(("kind", "path"), [(kind, path) for kind, paths in PLACES.items() for path in paths])
def test_whatever_stands_in_a_header_is_answered(kind, path):
    for value in HOSTILE:
        found = answer(with_value(valid(kind), path, value))
        if found["holds"]:
            assert (path[-1], value) in FINE
        else:
            assert refusal(with_value(valid(kind), path, value))["code"].startswith("proof_")


@pytest.mark.parametrize("path", [path for path in PLACES["region"] if isinstance(path[-1], str)])
def test_what_is_missing_or_unknown_in_a_header_is_named(path):
    header, arrays = unpack(valid("region"), "region")
    node = header
    for key in path[:-1]:
        node = node[key]
    value = node.pop(path[-1])
    error = refusal(pack(header, arrays))
    assert path[-1] in f"{error['message']} {error['field']}"
    node |= {path[-1]: value, "more": 1}
    assert "more" in refusal(pack(header, arrays))["message"]


def test_json_is_read_in_one_way():
    text = dict(members(valid("region")))["header.json"]
    for changed in (
        text.replace(b'"kind": "region"', b'"kind": "pair", "kind": "region"'),
        text.replace(b'"padding": 0.01', b'"padding": NaN'),
        text.replace(b'"padding": 0.01', b'"padding": 1e999'),
        b"\xef\xbb\xbf" + text,
        text.decode().encode("utf-16"),
        text + b" 1",
        b"[]",
        b"[" * 10**6,
        b"",
    ):
        others = [(name, changed if name == "header.json" else content) for name, content in members(valid("region"))]
        assert refusal(zipped(others, zipfile.ZIP_DEFLATED))["code"] in ("proof_malformed", "proof_too_large")


def test_a_scene_document_is_read_strictly_where_the_service_reads_it_too():
    document = planar_arm(1).to_document()
    for key, value in (("padding", "0"), ("q_star", ["0"]), ("q_star", [True]), ("joints", {}), ("pairs", [["a"]]), ("more", 1)):
        with pytest.raises(SceneError) as error:
            Scene.from_document({**document, key: value})
        assert error.value.code == "scene_document"
        assert key in str(error.value)
    for document_ in (None, [], "scene"):
        with pytest.raises(SceneError):
            Scene.from_document(document_)


# Containers


def rewritten(data: bytes, change: Any) -> bytes:
    found = members(data)
    change(found)
    return zipped(found)


def at(found: list, name: str) -> int:
    return [known for known, _ in found].index(name)


MEMBER = "proof/0/plane.npy"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda found: found.append(found[at(found, MEMBER)]), "same name"),
        (lambda found: found.append((MEMBER, npy(np.zeros((4, 3))))), "same name"),
        (lambda found: found.append(("header.json", b"{}")), "same name"),
        (lambda found: found.append(("proof/9/plane.npy", npy(np.zeros(3)))), "no part of the proof"),
        (lambda found: found.append(("volume/0/vertices.npy", npy(np.zeros((1, 3))))), "no part of the proof"),
        (lambda found: found.append(("readme.txt", b"")), "no plain array"),
        (lambda found: found.append(("dir/", b"")), "no plain array"),
        (lambda found: found.pop(at(found, MEMBER)), "missing"),
        (lambda found: found.pop(at(found, "header.json")), "no header.json"),
    ],
)
def test_the_members_are_those_that_the_header_implies(change, words):
    error = refusal(rewritten(valid("region"), change))
    assert error["code"] == "proof_malformed"
    assert words in error["message"]


def test_a_ground_or_a_volume_that_no_proof_uses_is_refused():
    header, arrays = unpack(valid("region"), "region")
    more = {name.replace("ground/0", "ground/2"): array for name, array in arrays.items() if name.startswith("ground/0")}
    assert refusal(pack({**header, "grounds": 3}, arrays | more))["code"] == "proof_malformed"
    volumes = [*header["volumes"], {"geometries": ["arm/link1/bar"]}]
    assert refusal(pack({**header, "volumes": volumes}, arrays))["code"] == "proof_malformed"


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data + b"\0",
        lambda data: b"#!" + data,
        lambda data: zipped(members(data), comment=b"more"),
        lambda data: zipped(members(data), zipfile.ZIP_LZMA),
        lambda data: zipped(members(data), zipfile.ZIP_BZIP2),
        lambda data: b"",
        lambda data: b"PK\5\6" + bytes(18),
        lambda data: data[:-1],
    ],
)
def test_a_zip_is_plain(change):
    assert refusal(change(valid("witness")))["code"] == "proof_malformed"


@pytest.mark.parametrize(
    "content",
    [
        saved(np.zeros((4, 3), dtype=">f8")),
        saved(np.zeros((4, 3), dtype="<f4")),
        saved(np.asfortranarray(np.zeros((4, 3)))),
        saved(np.zeros((4, 3)), version=(2, 0)),
        saved(np.array([None] * 3, dtype=object)),
        saved(np.zeros((4, 3), dtype=bool)),
        npy(np.zeros((4, 3)))[:-1],
        npy(np.zeros((4, 3))) + b"\0",
        npy(np.zeros((4, 3))).replace(b"False", b"0    "),
        npy(np.zeros((4, 3))).replace(b"(4, 3)", b"(12,) "),
        npy(np.zeros((0, 3))).replace(b"(0, 3), }         ", b"(0, 9999999999), }"),
        npy(np.zeros(())),
        npy(np.zeros(0)),
        npy(np.full((4, 3), np.nan)),
        npy(np.zeros((4, 3), dtype="<i4")),
    ],
)
def test_an_array_is_plain(content):
    error = refusal(rewritten(valid("region"), lambda found: found.__setitem__(at(found, MEMBER), (MEMBER, content))))
    assert error["code"] == "proof_malformed"


# Limits


def scene_of(joints: int, depth: int) -> dict[str, Any]:
    """The region's scene with this many welds more, in chains of the depth."""
    header, _ = unpack(valid("region"), "region")
    scene = header["scene"]
    weld = {**scene["joints"][0], "kind": "weld", "index": None, "lower": None, "upper": None, "axis": [0, 0, 0]}
    parents = [WORLD if i % depth == 0 else f"more/{i - 1}" for i in range(joints)]
    scene["joints"] += [{**weld, "name": f"weld/{i}", "parent": parent, "child": f"more/{i}"} for i, parent in enumerate(parents)]
    scene["bodies"] += [f"more/{i}" for i in range(joints)]
    return scene


WELDS = [(4000, 4000, "proof_model"), (4000, 64, None), (9000, 1, None), (10001, 1, "proof_too_large")]


@pytest.mark.parametrize(("joints", "depth", "code"), WELDS)
def test_welds_take_no_more_than_seconds(joints, depth, code):
    header, arrays = unpack(valid("region"), "region")
    data = pack(fitting({**header, "scene": scene_of(joints, depth)}), arrays)
    began = time.perf_counter()
    found = answer(data)
    assert time.perf_counter() - began < 20
    assert (found["error"]["code"] if code else found["holds"]) == (code or True)


def bomb(name: str, size: int, said: int | None = None) -> bytes:
    """A zip whose member inflates to ``size`` zeros and is said to have ``said`` of them."""
    deflater = zlib.compressobj(wbits=-15)
    content = b"".join(deflater.compress(bytes(1 << 20)) for _ in range(size >> 20)) + deflater.flush()
    crc = zlib.crc32(bytes(size if said is None else said))
    fields = struct.pack("<HHHHHLLLHH", 20, 0, 8, 0, 33, crc, len(content), size if said is None else said, len(name), 0)
    local = b"PK\3\4" + fields + name.encode() + content
    entry = b"PK\1\2" + struct.pack("<H", 20) + fields + struct.pack("<HHHLL", 0, 0, 0, 0, 0) + name.encode()
    return local + entry + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 1, 1, len(entry), len(local), 0)


def test_what_unpacks_to_too_much_is_refused_before_it_is_unpacked():
    error = refusal(bomb("header.json", 64 << 20))
    assert error["code"] == "proof_too_large"
    many = [(f"{i}.npy", npy(np.zeros(200_000))) for i in range(30)]
    assert refusal(zipped([("header.json", b"{}"), *many], zipfile.ZIP_DEFLATED))["code"] == "proof_too_large"


def test_no_more_is_inflated_than_the_directory_says(monkeypatch):
    inflated = []
    original = zipfile.ZipExtFile.read

    def read(self, n=-1):
        content = original(self, n)
        inflated.append(n)
        return content

    monkeypatch.setattr(zipfile.ZipExtFile, "read", read)
    assert refusal(bomb("header.json", 64 << 20, said=100))["code"] == "proof_malformed"
    assert all(0 <= n <= 100 for n in inflated)


def test_a_directory_of_millions_is_not_read(monkeypatch):
    monkeypatch.setattr(zipfile, "ZipFile", None)  # it would read the whole directory
    entries = (b"PK\1\2" + bytes(42)) * 1_000_000
    data = entries + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 60_000, 60_000, len(entries), 0, 0)
    assert refusal(data)["code"] == "proof_too_large"


def test_files_beyond_the_limits_are_refused(monkeypatch):
    assert all(answer(valid(kind))["holds"] for kind in KINDS)
    for name, least in (("POSITIONS", 1), ("GEOMETRIES", 4), ("VERTICES", 7), ("PAIRS", 5), ("FACES", 3), ("JOINTS", 1), ("CONTAINED", 7)):
        with monkeypatch.context() as patch:
            patch.setattr(limits, name, least)
            assert refusal(valid("region"))["code"] == "proof_too_large", name
    for name, least in (("PROOFS", 3), ("GROUNDS", 1), ("VOLUMES", 1), ("CORNERS", 1)):
        with monkeypatch.context() as patch:
            patch.setattr(limits, name, least)
            assert refusal(valid("region"))["code"] == "proof_malformed", name
    for name, least in (("FILE_BYTES", 1000), ("UNPACKED_BYTES", 1000), ("HEADER_BYTES", 100), ("MEMBERS", 10), ("FREE_BYTES", -(1 << 30))):
        with monkeypatch.context() as patch:
            patch.setattr(limits, name, least)
            assert refusal(valid("region"))["code"] == "proof_too_large", name
    for name, least, code in (
        ("EXPONENT", 10, "malformed"),
        ("DIMENSION", 1, "malformed"),
        ("PATH", 1, "model"),
        ("MULTIPLIERS", 0, "archimedean"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(limits, name, least)
            assert refusal(valid("region"))["code"] == f"proof_{code}", name
    for name, kind in (("FACTORS", "pair"), ("MOMENTS", "dual"), ("LOCALISED", "dual")):
        with monkeypatch.context() as patch:
            patch.setattr(limits, name, 10)
            assert refusal(valid(kind))["code"] == "proof_too_large", name


def test_gram_matrices_are_checked_a_few_vertices_at_a_time_with_the_same_result(monkeypatch):
    whole = verify_file(valid("region")).lines
    monkeypatch.setattr("certifier.verify.pair.TOGETHER", 1)
    assert verify_file(valid("region")).lines == whole


def test_a_header_that_is_not_json_names_what_it_is_about():
    assert refusal(with_header(valid("pair"), "@deep@"))["field"] == "header"


def test_nothing_hides_within_a_zip():
    """Bytes behind a deflated stream, a header of a member that says something else, and the record of a larger zip are refused."""
    data = region()
    end = struct.Struct("<4s4H2LH")
    *head, size, offset, comment = end.unpack(data[-end.size :])
    locator = struct.pack("<4sLQL", b"PK\6\7", 0, 0, 1)
    larger = data[: -end.size] + locator + end.pack(*head, size + len(locator), offset, comment)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        info = next(i for i in archive.infolist() if i.compress_type == zipfile.ZIP_DEFLATED)
        contents = {i.filename: (i, archive.read(i)) for i in archive.infolist()}
    renamed = bytearray(data)
    renamed[info.header_offset + 10] ^= 1  # the time in the member's own header
    hidden = io.BytesIO()
    with zipfile.ZipFile(hidden, "w") as archive:
        for name, (entry, content) in contents.items():
            archive.writestr(zipfile.ZipInfo(name, entry.date_time), content, entry.compress_type)
        stretched = archive.getinfo(info.filename)
        stretched.CRC, deflated = zlib.crc32(contents[info.filename][1]), zlib.compressobj(9, zlib.DEFLATED, -15)
    assert answer(hidden.getvalue())["holds"]
    stream = deflated.compress(contents[info.filename][1]) + deflated.flush() + b"what nobody reads"
    for wrong in (larger, bytes(renamed), respliced(hidden.getvalue(), info.filename, stream)):
        assert not answer(wrong)["holds"]


def respliced(data: bytes, name: str, stream: bytes) -> bytes:
    """The zip with another stream for a member, all sizes and offsets made to fit."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries, start = archive.infolist(), archive.start_dir
        raw = {}
        for entry, following in zip(entries, [*(e.header_offset for e in entries[1:]), start], strict=True):
            raw[entry.filename] = data[entry.header_offset + len(entry.FileHeader(zip64=False)) : following]
        body = b""
        for entry in entries:
            content = stream if entry.filename == name else raw[entry.filename]
            entry.header_offset, entry.compress_size = len(body), len(content)
            body += entry.FileHeader(zip64=False) + content
        sink = io.BytesIO(body)
        sink.seek(len(body))
        with zipfile.ZipFile(io.BytesIO(), "w") as writer:
            writer.fp, writer.filelist, writer.start_dir, writer._didModify = sink, entries, len(body), True
            writer._write_end_record()
            writer._didModify = False
            found = sink.getvalue()
    return found


def test_a_volume_names_a_geometry_once():
    proof = RegionProof.from_bytes(region())
    part = next(p for p in proof.proofs if not p.volumes[0].is_geometry_of(proof.scene) or not p.volumes[1].is_geometry_of(proof.scene))
    volumes = tuple(replace(volume, geometries=volume.geometries * 2) for volume in part.volumes)
    twice = replace(proof, proofs=tuple(replace(p, volumes=volumes) if p is part else p for p in proof.proofs))
    found = answer(twice.to_bytes())
    assert not found["holds"]
    assert found["error"]["code"] in ("proof_volume", "proof_malformed")


def test_a_pair_stands_once_and_is_not_ignored_as_well():
    proof = RegionProof.from_bytes(region())
    pair = proof.scene.pairs[0]
    for changed in (
        {"pairs": (*proof.scene.pairs, Pair(pair.b, pair.a))},
        {"ignored": (*proof.scene.ignored, Ignored(pair.a, pair.b, "as well"))},
        {"ignored": (*proof.scene.ignored, Ignored(pair.b, pair.a, "as well"))},
    ):
        scene = replace(proof.scene, **changed)
        found = answer(replace(proof, scene=scene, proofs=tuple(replace(p, scene=scene) for p in proof.proofs)).to_bytes())
        assert found["error"]["code"] == "proof_model"
