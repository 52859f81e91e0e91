"""Regions over HTTP: a really certified one, its proof and its exports, read by those they are for."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.isolation import child
from certifier.jobs.region import Region, certified_region
from certifier.model import Scene
from certifier.pair.certification import Certification
from certifier.verify.file import verify_file
from certifier.verify.region import verify_region
from db import pairs, regions
from db.models import ProofRow
from db.session import Database
from db.settings import settings
from tests.certifier.scenes import accepted
from tests.scenes import slider


def test_a_region_is_listed_and_shown_with_its_manifest(client: TestClient, region: str, certified: Region) -> None:
    for query in ("", "?scene=slider", f"?job={client.get('/v1/jobs').json()['jobs'][0]['id']}"):
        (summary,) = client.get(f"/v1/regions{query}").json()["regions"]
        assert (summary["id"], summary["guarantee"], summary["faces"]) == (region, "exact", 4)
        assert summary["share"] == certified.manifest["share"]
    assert summary["share"]["value"] == pytest.approx(0.25, abs=4 * summary["share"]["stderr"])
    job = client.get("/v1/jobs").json()["jobs"][0]["id"]
    assert client.get(f"/v1/jobs/{job}/growth").json()["points"][0]["share"] == summary["share"]["value"]
    assert client.get(f"/v1/regions/{region}").json()["manifest"] == certified.manifest


def test_the_proof_that_is_downloaded_holds(client: TestClient, region: str, certified: Region) -> None:
    answer = client.get(f"/v1/regions/{region}/proof")
    assert answer.content == certified.proof
    assert answer.headers["content-disposition"] == f'attachment; filename="{region}.proof"'
    assert len(verify_region(answer.content).gaps) == 2


def test_the_stored_proof_is_checked_again_on_request(client: TestClient, region: str, certified: Region) -> None:
    answer = client.post(f"/v1/regions/{region}/verify").json()
    assert (answer["region"], answer["holds"], answer["guarantee"], answer["error"]) == (region, True, "exact", None)
    assert answer["statement"] == certified.statement.lines()
    assert client.post("/v1/regions/none/verify").status_code == 404


def test_a_stored_proof_that_was_tampered_with_does_not_hold(client: TestClient, region: str, database: Database) -> None:
    """Another region's proof, and one that is none; the region's own would do."""
    smaller = small_region()
    for data, code in ((smaller, "proof_region"), (smaller[:-30], "proof_malformed")):
        with database.write() as session:
            row = session.get_one(ProofRow, regions.get(session, region).proof_digest)
            row.data = data
        answer = client.post(f"/v1/regions/{region}/verify").json()
        assert (answer["holds"], answer["guarantee"], answer["statement"]) == (False, "none", [])
        assert answer["error"]["code"] == code


def test_the_proof_of_a_pair_carries_its_scene(client: TestClient, region: str, database: Database, scene: Scene) -> None:
    job = client.get("/v1/jobs").json()["jobs"][0]["id"]
    assert client.get(f"/v1/jobs/{job}/pairs/9/proof?iteration=0").json()["code"] == "proof_not_found"
    found = Certification(scene, scene.polytope([[1.0], [-1.0]], [0.2, 0.3]), np.zeros(1)).certify(0)
    with database.write() as session:
        digest = pairs.of_iteration(session, job, 0, 0)[0].proof_digest
        session.get_one(ProofRow, digest).data = found.proof
    data = client.get(f"/v1/jobs/{job}/pairs/0/proof?iteration=0").content
    statement = verify_file(data)
    assert (statement.kind, statement.scene.hash) == ("pair", scene.hash)


def test_a_check_that_takes_too_long_is_stopped(client: TestClient, region: str, environment: pytest.MonkeyPatch) -> None:
    """A process that waits, loaded, may well answer in ten milliseconds; a new one loads its modules first and never does."""
    for nurseries in child._idle.values():
        for nursery in nurseries:
            nursery.kill()
    environment.setenv("CIRIS_VERIFY_TIMEOUT_SECONDS", "0.01")
    settings.cache_clear()
    answer = client.post(f"/v1/regions/{region}/verify")
    assert (answer.status_code, answer.json()["code"]) == (503, "child_timeout")


def small_region() -> bytes:
    """The proof of a part of the region."""
    scene = slider(posts=2)
    polytope = scene.polytope([[1.0], [-1.0]], [0.1, 0.1])
    certification = Certification(scene, polytope, np.zeros(1))
    proofs = {index: certification.certify(index).proof or b"" for index in range(2)}
    return certified_region(scene, accepted(polytope, np.zeros(1)), proofs, {"seconds": 1.0}).proof


UNCOVERED = {"not_covered", "not_covered_pairs", "not_covered_why", "not_covered_summary", "conditions"}
SUMMARY = "1 pair of neighbouring links is not covered"


@pytest.mark.parametrize("stored", ["now", "by an earlier version"])
def test_what_a_region_does_not_cover_is_said_wherever_it_is_told_of(
    client: TestClient, planar_region: str, database: Database, stored: str
) -> None:
    links = {"a": "arm/link1", "b": "arm/link2", "pairs": 1, "why": "neighbours", "reason": None}
    if stored != "now":
        with database.write() as session:
            row = regions.get(session, planar_region)
            row.manifest = {name: value for name, value in row.manifest.items() if name != "not_covered"}
    answer = client.get(f"/v1/regions/{planar_region}").json()
    expected = {"pairs": 1, "neighbours": 1, "filtered": 0, "ignored": 0, "bodies": [links], "summary": SUMMARY}
    assert answer["not_covered"] == answer["manifest"]["not_covered"] == expected
    assert client.get(f"/v1/scenes/{answer['scene']}").json()["not_covered"] == expected
    files = {name: client.get(f"/v1/regions/{planar_region}/export?format={name}").content for name in ("json", "npz", "drake-yaml")}
    assert json.loads(files["json"])["not_covered"] == expected
    with np.load(io.BytesIO(files["npz"])) as arrays:
        said = {name: arrays[name].tolist() for name in UNCOVERED}
    assert said == {
        "not_covered": [["arm/link1", "arm/link2"]],
        "not_covered_pairs": [1],
        "not_covered_why": ["neighbours"],
        "not_covered_summary": SUMMARY,
        "conditions": [],
    }
    assert f"# {SUMMARY}\n#   1 of arm/link1 and arm/link2: neighbours\n" in files["drake-yaml"].decode()
    statement = client.post(f"/v1/regions/{planar_region}/verify").json()["statement"]
    assert "not covered, as the scene has no such pairs: 1 of 'arm/link1' and 'arm/link2'" in statement
    for page in (f"/regions/{planar_region}", f"/scenes/{answer['scene']}", f"/jobs/{answer['job']}", f"/jobs/{answer['job']}/live"):
        assert SUMMARY in client.get(page, headers={"accept": "text/html"}).text


def test_the_manifest_and_the_arrays_are_exported(client: TestClient, region: str, certified: Region) -> None:
    assert client.get(f"/v1/regions/{region}/export").json() == {"name": region, **certified.manifest}
    with np.load(io.BytesIO(client.get(f"/v1/regions/{region}/export?format=npz").content)) as arrays:
        assert arrays["C"].tolist() == certified.manifest["halfspace_normals"]
        assert arrays["d"].tolist() == certified.manifest["halfspace_offsets"]
        meaning = {"joints", "q_star", "q_lower", "q_upper", "revolute"}
        assert set(arrays.files) == {"name", "C", "d", "center", "ellipsoid_center", "ellipsoid_shape", *meaning, *UNCOVERED}
        assert {name: arrays[name].tolist() for name in meaning} == {name: certified.manifest["space"][name] for name in meaning}


@pytest.mark.parametrize("heading", ["## npz, for NumPy", "## JSON, for any language", "## YAML, for Drake"])
def test_the_documents_snippets_say_what_the_service_says(client: TestClient, region: str, heading: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for format, suffix in (("json", "json"), ("npz", "npz"), ("drake-yaml", "yaml")):
        (tmp_path / f"region.{suffix}").write_bytes(client.get(f"/v1/regions/{region}/export?format={format}").content)
    text = (Path(__file__).parents[2] / "docs" / "exports.md").read_text()
    snippet = text.split(heading)[1].split("```python\n")[1].split("```")[0]
    space = client.get(f"/v1/regions/{region}").json()["manifest"]["space"]
    turning = "YAML" in heading and not all(space["revolute"])
    for q in (0.1, 0.19, 0.21, -0.29, -0.31, 0.9):
        known = client.post("/v1/planning/contains", json={"scene": "slider", "q": [[q]]}).json()["points"][0]["inside"]
        # The snippet for Drake is for joints that turn, and the slider slides: s = q, so tan(q / 2) is undone.
        given = 2 * np.arctan(q) if turning else q
        names = {"q": np.array([given])} | {key: np.array(space[key]) for key in ("q_star", "q_lower", "q_upper")}
        exec(snippet, names)
        assert bool(names["inside"]) is known
    assert "model/slide: s = q - 0.0, q in metres, from -1.0 to 1.0" in (tmp_path / "region.yaml").read_text()


def test_drake_reads_its_yaml_to_the_last_bit(client: TestClient, region: str, certified: Region, tmp_path) -> None:
    from pydrake.geometry.optimization import LoadIrisRegionsYamlFile

    file = tmp_path / "regions.yaml"
    file.write_bytes(client.get(f"/v1/regions/{region}/export?format=drake-yaml").content)
    ((name, polyhedron),) = LoadIrisRegionsYamlFile(str(file)).items()
    assert name == region
    assert polyhedron.A().tolist() == certified.manifest["halfspace_normals"]
    assert polyhedron.b().tolist() == certified.manifest["halfspace_offsets"]


def test_people_choose_what_a_region_is_called(client: TestClient, region: str, tmp_path) -> None:
    from pydrake.geometry.optimization import LoadIrisRegionsYamlFile

    def exported(format: str, name: str) -> bytes:
        return client.get(f"/v1/regions/{region}/export", params={"format": format, "name": name}).content

    assert json.loads(exported("json", "above the bin"))["name"] == "above the bin"
    with np.load(io.BytesIO(exported("npz", "above the bin"))) as arrays:
        assert arrays["name"] == "above the bin"
    file = tmp_path / "regions.yaml"
    file.write_bytes(exported("drake-yaml", "above the bin") + exported("drake-yaml", "below"))
    assert sorted(LoadIrisRegionsYamlFile(str(file))) == ["above the bin", "below"]
    refused = client.get(f"/v1/regions/{region}/export", params={"name": 'a": b'})
    assert (refused.status_code, refused.json()["field"]) == (422, "name")


def test_an_unknown_format_is_a_problem(client: TestClient, region: str) -> None:
    assert client.get(f"/v1/regions/{region}/export?format=step").json()["field"] == "format"


def test_a_deleted_region_is_gone(client: TestClient, region: str) -> None:
    assert client.delete(f"/v1/regions/{region}").status_code == 204
    for answer in (client.get(f"/v1/regions/{region}"), client.get(f"/v1/regions/{region}/proof"), client.delete(f"/v1/regions/{region}")):
        assert (answer.status_code, answer.json()["code"]) == (404, "region_not_found")
    assert client.get("/v1/jobs").json()["jobs"][0]["region"] is None
