"""YAML is read as Drake's yaml-cpp reads it, and fast."""

from __future__ import annotations

import time

import pytest
import yaml
from pydrake.multibody.parsing import LoadModelDirectivesFromString

from certifier.errors import SceneError
from certifier.scene import fields
from certifier.scene.nodes import compose

MODEL = "directives:\n- add_model:\n    name: {}\n    file: b.sdf\n"
FRAME = "directives:\n- add_frame:\n    name: x\n    X_PF:\n      base_frame: w\n      translation: {}\n"


def here(text: str) -> object:
    node = compose(text, "scene.yaml")
    assert node is not None
    (directive,) = fields.construct(node, "")["directives"]
    return directive["add_model"]["name"] if "add_model" in directive else directive["add_frame"]["X_PF"]["translation"]


def drake(text: str) -> object:
    (directive,) = LoadModelDirectivesFromString(text).directives
    return directive.add_model.name if directive.add_model is not None else directive.add_frame.X_PF.translation.tolist()


@pytest.mark.parametrize(
    "name",
    [
        "a\t",
        "a\t# c",
        "a \t",
        "a\tb",
        "a # \t",
        "\ta",
        "|#c\n      a",
        "|\n      a\n\n      b",
        ">-\n      a\n      b",
        '"a\\/b\\x41"',
        "'a\n\n     b'",
    ],
)
def test_texts_are_what_drake_reads(name: str) -> None:
    assert here(MODEL.format(name)) == drake(MODEL.format(name))


@pytest.mark.parametrize(
    "numbers", ["[0, 1,\t2]", "[0,\t1, 2\t]", "[0, 1, 2]\t", "[0, 1, 2]\t# c", "[1e-3, +2.5E2, -3e0]", "\n      - 0\n      - 1\n      - .5"]
)
def test_numbers_are_what_drake_reads(numbers: str) -> None:
    assert here(FRAME.format(numbers)) == drake(FRAME.format(numbers))


@pytest.mark.parametrize("text", ["a\n\t", "a\n\t# c", "|\n      a\n     \tb"])
def test_tabs_that_indent_are_refused_here_and_there(text: str) -> None:
    with pytest.raises(SceneError, match="tab"):
        here(MODEL.format(text))
    with pytest.raises(RuntimeError, match="tab"):
        drake(MODEL.format(text))


def test_a_byte_order_mark_may_only_be_the_first_character() -> None:
    assert here("\ufeff" + MODEL.format("a")) == "a"
    for text in (MODEL.format("a\n\ufeff    x: y"), MODEL.format('"a\n\ufeff"')):
        with pytest.raises(SceneError, match=r"scene.yaml, line 4: a byte order mark \(U\+FEFF\) may only be the first character"):
            compose(text, "scene.yaml")
    with pytest.raises(SceneError, match=r"line 1: a byte order mark"):
        compose("\ufeff\ufeffa: b", "scene.yaml")


def test_a_megabyte_is_read_in_seconds() -> None:
    text = "directives:\n" + "".join(
        f"- add_model:\n    name: box{i}\n    file: box.urdf\n    at: [0.1, 2.5e-3, {i}]\n" for i in range(14_000)
    )
    assert len(text) > 10**6
    began = time.process_time()
    root = compose(text, "scene.yaml")
    assert time.process_time() - began < 5.0, "PyYAML without libyaml takes about ten seconds"
    assert isinstance(root, yaml.MappingNode)
