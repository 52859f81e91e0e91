"""Packages are found where ROS users have them, and the nearest one is taken, in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from certifier.errors import SceneError
from certifier.scene import packages


def packages_of(model: Path, given: dict[str, Path], environment: dict[str, str]) -> tuple[dict[str, Path], list[str]]:
    """Looks for the packages of a model without xacro."""
    return packages.packages_of(model, given, environment, {}, model.parent)


MODEL = '<robot name="r"><link name="l"><visual><geometry><mesh filename="package://{0}/m.obj"/></geometry></visual></link></robot>'


def package(directory: Path, name: str | None = None) -> Path:
    """Makes the directory, with a manifest of this name."""
    directory.mkdir(parents=True)
    if name is not None:
        (directory / "package.xml").write_text(
            f'<?xml version="1.0"?>\n<package format="3"><author><name>x</name></author><name> {name} </name></package>'
        )
    return directory


def model(directory: Path, names: str = "tools") -> Path:
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "r.urdf").write_text(MODEL.format(names))
    return directory / "r.urdf"


@pytest.mark.parametrize(
    ("place", "manifest"),
    [
        ("ws/src/arm", "tools"),
        ("ws/src/arm/tools", None),
        ("ws/tools", None),
        ("ws/src/other", "tools"),
        ("ws/src/stack/other", "tools"),
        ("ws/other", "tools"),
        ("ws/install/tools/share/tools", "tools"),
        ("ws/install/share/tools", None),
        ("ws/share/tools", None),
    ],
)
def test_a_package_is_found_near_the_model(tmp_path: Path, place: str, manifest: str | None) -> None:
    file = model(tmp_path / "ws/src/arm/urdf")
    with pytest.raises(SceneError) as refused:
        packages_of(file, {}, {})
    assert (refused.value.code, "--package tools=DIRECTORY" in refused.value.hint) == ("scene_package", True)
    there = tmp_path / place
    if there.exists():
        (there / "package.xml").write_text(f"<package><name>{manifest}</name></package>")
    else:
        package(there, manifest)
    assert packages_of(file, {}, {}) == ({"tools": there}, [])


@pytest.mark.parametrize(
    ("variable", "listed", "place", "manifest"),
    [
        ("AMENT_PREFIX_PATH", "ros", "ros/share/tools", "tools"),
        ("ROS_PACKAGE_PATH", "ros", "ros/tools", None),
        ("ROS_PACKAGE_PATH", "ros/tools", "ros/tools", None),
        ("ROS_PACKAGE_PATH", "ros/x", "ros/x", "tools"),
    ],
)
def test_a_package_is_found_where_ros_looks(tmp_path: Path, variable: str, listed: str, place: str, manifest: str | None) -> None:
    file = model(tmp_path / "a/b")
    package(tmp_path / place, manifest)
    environment = {variable: f"{tmp_path / 'nowhere'}:{tmp_path / listed}:"}
    assert packages_of(file, {}, environment) == ({"tools": tmp_path / place}, [])
    with pytest.raises(SceneError):
        packages_of(file, {}, {"PATH": environment[variable]})


def test_the_nearest_of_several_is_taken_and_the_others_are_named(tmp_path: Path) -> None:
    file = model(tmp_path / "ws/src/arm")
    near, far = package(tmp_path / "ws/src/tools", "tools"), package(tmp_path / "tools")
    ros = package(tmp_path / "ros/share/tools")
    found, said = packages_of(file, {}, {"AMENT_PREFIX_PATH": str(tmp_path / "ros")})
    assert found == {"tools": near}
    assert said == [f"package tools: {near} is taken, which is the nearest; it is also in {far}, {ros}"]
    assert packages_of(file, {"tools": ros}, {}) == ({"tools": ros}, [])
    with pytest.raises(SceneError, match="which is not there"):
        packages_of(file, {"tools": tmp_path / "nowhere"}, {})


def test_one_place_that_two_links_lead_to_is_one(tmp_path: Path) -> None:
    file = model(tmp_path / "ws/src/arm")
    package(tmp_path / "ws/src/tools", "tools")
    (tmp_path / "tools").symlink_to(tmp_path / "ws/src/tools")
    assert packages_of(file, {}, {})[1] == []


def test_a_manifest_that_cannot_be_read_is_that_of_no_package(tmp_path: Path) -> None:
    file = model(tmp_path / "ws/src/arm")
    (package(tmp_path / "ws/src/broken") / "package.xml").write_text("<package><name>tools</name>")
    (package(tmp_path / "ws/src/evil") / "package.xml").write_text(
        '<!DOCTYPE a [<!ENTITY t "tools">]><package><name>tools</name></package>'
    )
    with pytest.raises(SceneError):
        packages_of(file, {}, {})
    good = package(tmp_path / "ws/src/good", "tools")
    assert packages_of(file, {}, {}) == ({"tools": good}, [])


def test_a_directory_with_the_file_is_proposed_and_not_taken(tmp_path: Path) -> None:
    file = model(tmp_path / "robots/arm/urdf", "tools/meshes")
    for proposed in ("DIRECTORY", f"{tmp_path / 'robots'}, where such a file is"):
        with pytest.raises(SceneError) as refused:
            packages_of(file, {}, {})
        assert refused.value.hint == f"say where it is: --package tools={proposed}"
        (tmp_path / "robots/meshes").mkdir(exist_ok=True)
        (tmp_path / "robots/meshes/m.obj").touch()


def test_a_name_is_no_pattern(tmp_path: Path) -> None:
    package(tmp_path / "ws/share/tools")
    with pytest.raises(SceneError):
        packages_of(model(tmp_path / "ws/src", "*"), {}, {})
