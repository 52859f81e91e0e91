"""``ciris recertify`` on this machine: what it prints, what it writes, and its exit status."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

from tests.client.conftest import PLANAR, Ciris

POSE = re.compile(r"<pose>(.*?)</pose>")
EYE = [[1, 0], [0, 1], [-1, 0], [0, -1]]


def nudged(pose: str, by: float) -> str:
    """A pose that is moved along x, in metres."""
    x, *others = pose.split()
    return " ".join([str(float(x) + by), *others])


def changed(folder: Path, old: str, new: str) -> Path:
    """The example with another text in the place of one in its obstacles."""
    shutil.copytree(Path(PLANAR).parent, folder)
    text = (folder / "obstacles.sdf").read_text()
    assert old in text
    (folder / "obstacles.sdf").write_text(text.replace(old, new))
    return folder / "scene.yaml"


def test_a_region_of_a_changed_scene_is_written_with_its_proof_and_one_on_the_seed_is_revoked(ciris: Ciris, tmp_path: Path) -> None:
    (tmp_path / "p.json").write_text(json.dumps({"C": EYE, "d": [0.1] * 4}))
    assert ciris("certify", PLANAR, "--polytope", "p.json", "--cells", "200", "--local", "--out", "old.proof").status == 0
    first = POSE.findall((Path(PLANAR).parent / "obstacles.sdf").read_text())[0]
    moved = changed(tmp_path / "moved", first, nudged(first, 0.01))
    done = ciris("recertify", "old.proof", "--scene", moved, "--local", "--out", "new.proof", "--json")
    assert done.status == 0, done.error
    said = done.json["provenance"]["recertified"]
    assert (said["region"], said["kept"]["value"]) == (None, 1.0)
    assert {tuple(sorted(p.items())) for p in (*said["carried"], *said["proved"])} == {
        (("a", p["a"]), ("b", p["b"])) for p in done.json["pairs"]
    }
    assert ciris("verify", "new.proof").status == 0
    on_arm = changed(tmp_path / "on_arm", first, "0.2 0 0 0 0 0")
    done = ciris("recertify", "old.proof", "--scene", on_arm, "--local")
    assert done.status == 1
    assert "revoked: " in done.error
    assert "at q = (" in done.error
