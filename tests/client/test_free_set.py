"""``ciris free-set`` as users run it, on maps of examples. Drake looks at what the free sets contain."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ciris import FreeSet
from tests.client.conftest import PLANAR, Ciris
from tests.oracles.distances import Distances

SAMPLES, MOTIONS, ALONG = 20_000, 400, 20


def test_drake_finds_no_collision_in_the_free_set_of_a_map(ciris: Ciris) -> None:
    assert ciris("map", PLANAR, "--local", "--coverage", "0.9", "--out", "planar.proof").status == 0
    done = ciris("free-set", "planar.proof")
    assert (done.status, "read it: ciris.FreeSet.load" in done.stdout) == (0, True)
    found = FreeSet.load("planar.free.npz")
    rng, distances = np.random.default_rng(0), Distances(Path(PLANAR))
    q = rng.uniform(found.space.q_lower, found.space.q_upper, (SAMPLES, 2))
    drawn = distances.order(found.joints)
    free = q[found.contains(q)]
    collide = np.array([distances.least(row[drawn], 0.01) <= 0 for row in q[:2000]])
    assert collide.any()
    assert not (collide & found.contains(q[:2000])).any()
    start, end = free[:MOTIONS], free[MOTIONS : 2 * MOTIONS]
    proved = found.contains_motion(start, end)
    assert 0.1 < proved.mean() < 1
    t = np.linspace(0, 1, ALONG)[:, None]
    for a, b in zip(start[proved], end[proved], strict=True):
        assert min(distances.least((a + x * (b - a))[drawn], 0.01) for x in t) > 0


def test_programs_can_read_it_and_bad_files_are_named(ciris: Ciris, tmp_path: Path) -> None:
    ciris("map", PLANAR, "--local", "--coverage", "0.5", "--out", "planar.proof")
    found = ciris("free-set", "planar.proof", "--out", "a.npz", "--json").json
    assert (found["name"], found["file"], found["cells"] > 10) == ("planar-2dof", "a.npz", True)
    data = bytearray((tmp_path / "planar.proof").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "damaged.proof").write_bytes(data)
    (tmp_path / "a.free.npz").write_text("precious")
    for arguments, words in (
        (("missing.proof",), "missing.proof"),
        (("damaged.proof",), "damaged.proof"),
        (("planar.proof", "--out", "a.npz"), "--out"),
        (("a.proof",), "a.free.npz is there already"),
        (("planar.proof", "--out", "."), "--out"),
    ):
        done = ciris("free-set", *arguments)
        assert done.status == 2, arguments
        assert words in done.stderr
