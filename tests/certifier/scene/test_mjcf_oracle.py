"""Random MJCF models are read here as MuJoCo reads them, or they are refused with file and line."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import pytest

import certifier.scene.parse
from certifier.errors import SceneError
from certifier.scene.copies import Copies
from certifier.scene.formats.mjcf import Mjcf
from certifier.scene.load import load_scene
from certifier.scene.strict import StrictReader
from tests.certifier.scene.mjcf_models import SPOILERS, random_model
from tests.certifier.scene.mjcf_oracle import Oracle
from tests.certifier.scene.workshop import parsed

FEW, MANY = 24, 300
LINE = re.compile(r"(robot|more/part\w+|part\w+)\.xml:\d+: ")


@pytest.fixture(autouse=True)
def in_a_directory_of_its_own(tmp_path, monkeypatch):
    """MuJoCo writes its warnings into the working directory."""
    monkeypatch.chdir(tmp_path)


def differences(directory: Path, seed: int, spoil: bool, read=parsed) -> list[str] | SceneError:
    """Returns where our reading of a random model differs from MuJoCo's, or the error that refuses the model."""
    made = random_model(seed, directory, spoil)
    scene_file = directory / "scene.yaml"
    scene_file.write_text(made.scene)
    try:
        scene = read(scene_file)
    except SceneError as error:
        return error
    model = mujoco.MjModel.from_xml_path(str(made.path))
    found = Oracle(scene, model, seed).differences()
    counted = len(Mjcf(made.path, "robot.xml", made.path.read_bytes()).collisions)
    return found if counted == len(scene.geometries) else [*found, f"{counted} collisions were counted"]


@pytest.mark.parametrize("seed", range(FEW))
def test_a_model_is_read_as_mujoco_reads_it(tmp_path, seed):
    assert differences(tmp_path, seed, spoil=False) == []


@pytest.mark.parametrize("seed", range(len(SPOILERS)), ids=list(SPOILERS))
def test_what_drake_reads_otherwise_is_refused_with_its_line(tmp_path, seed):
    said = differences(tmp_path, seed, spoil=True)
    assert isinstance(said, SceneError), said
    assert LINE.match(said.message), said


SEEN = ["joints behind a pose", "pair of drawn geoms", "class without geom", "frame", "zaxis beside -z"]


@pytest.mark.parametrize("name", SEEN)
def test_the_oracle_sees_what_drake_reads_otherwise(tmp_path, monkeypatch, name):
    """Here nothing is refused, so Drake reads it."""
    monkeypatch.setattr(StrictReader, "check", lambda *_: 0)
    monkeypatch.setattr(StrictReader, "taken", StrictReader.mesh)
    monkeypatch.setattr(Copies, "_document", lambda *_: None)
    monkeypatch.setattr(certifier.scene.parse, "check_counts", lambda *_: None)
    monkeypatch.setattr(Mjcf, "__init__", lambda self, *_: setattr(self, "collisions", []))
    found = []
    for seed in range(list(SPOILERS).index(name), 4 * len(SPOILERS), len(SPOILERS)):
        (tmp_path / str(seed)).mkdir()
        said = differences(tmp_path / str(seed), seed, spoil=True)
        found += [] if isinstance(said, SceneError) else [words for words in said if "were counted" not in words]
    assert found


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [False, True])
def test_a_campaign_finds_no_silent_difference(tmp_path, spoil):
    """Every model of the campaign goes through the child, as a user's does."""
    wrong = {}
    for seed in range(1000, 1000 + MANY):
        (tmp_path / str(seed)).mkdir()
        said = differences(tmp_path / str(seed), seed, spoil, load_scene)
        if not (isinstance(said, SceneError) and LINE.match(said.message)) if spoil else said != []:
            wrong[seed] = said
    assert wrong == {}
