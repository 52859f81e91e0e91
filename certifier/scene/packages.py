"""The packages that a model names are looked for here: above the model, in the workspace around it, and where the variables of ROS say."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from glob import escape
from pathlib import Path
from xml.parsers import expat

from certifier.errors import SceneError
from certifier.scene.macros import Expander, in_xacro, packages_named
from certifier.scene.paths import beside
from certifier.scene.references import MANIFEST, references
from certifier.scene.xml import parse_xml

_SCHEMES = ("package://", "model://")
_WORKSPACE = ("*", "src/*", "src/*/*")
"""Below a directory above the model, packages of a ROS workspace have their manifests here."""
_INSTALLED = ("install/*/share", "install/share", "share")
"""Below such a directory, installed packages are here, each under its name."""


def packages_of(
    model: Path, given: Mapping[str, Path], environment: Mapping[str, str], arguments: Mapping[str, str], directory: Path
) -> tuple[dict[str, Path], list[str]]:
    """Returns where the packages are that a model names, and sentences about those that are in several places.

    A model that is written in xacro has to be in a package or below the directory of the scene file. If it is in neither, its own package
    is among those returned, or else the directory that it is in.

    Args:
        given: directories of packages, by name. The others are looked for, and the nearest is taken.
        environment: AMENT_PREFIX_PATH and ROS_PACKAGE_PATH count after what is near the model.
        arguments: of xacro.
        directory: that of the scene file.

    Raises:
        SceneError: ``scene_package`` for a package that was not found; ``scene_xacro`` for what xacro refuses.
    """

    def at(name: str) -> list[Path]:
        return [given[name]] if name in given else list(places_of(name, model, environment))

    found: dict[str, Path] = {}
    said, expanded = [], None
    if in_xacro(model, model.name):
        found = packages_named(model, lambda name: next((place.absolute() for place in at(name) if place.is_dir()), None))
        file = beside(Path.cwd(), str(model))
        if not any(file.is_relative_to(root) for root in (directory, *found.values())):
            own = next((above for above in file.parents if (above / MANIFEST).is_file()), file.parent)
            found[_named(own) or own.name] = own
        expanded = Expander(directory, found, arguments).expanded(file, model.name)
    written = [reference.partition("://")[2] for reference in references(model, expanded) if reference.startswith(_SCHEMES)]
    for name in dict.fromkeys(reference.partition("/")[0] for reference in written):
        places = at(name)
        if not places or not places[0].is_dir():
            variables = ", in AMENT_PREFIX_PATH or in ROS_PACKAGE_PATH" if environment else ""
            looked = f"above it{',' if environment else ' or'} in a workspace around it{variables}"
            message = f"{model.name} names the package {name}, which is not {'there' if name in given else looked}"
            rest = [path.partition("/")[2] for path in written if path.startswith(f"{name}/")]
            like = next((above for above in model.absolute().parents for path in rest if path and (above / path).is_file()), None)
            there = f"{name}={like}, where such a file is" if like else f"{name}=DIRECTORY"
            raise SceneError("scene_package", message, hint=f"say where it is: --package {there}")
        found[name] = places[0].absolute()
        others = [place for place in places[1:] if place.resolve() != places[0].resolve()]
        if others:
            said.append(f"package {name}: {places[0]} is taken, which is the nearest; it is also in {', '.join(map(str, others))}")
    return found, said


def taken_from(model: Path) -> dict[str, list[str]]:
    """Returns the packages that a model names, each with the paths in it that the model names."""
    found: dict[str, list[str]] = {}
    for reference in references(model):
        if reference.startswith(_SCHEMES):
            name, _, path = reference.partition("://")[2].partition("/")
            found[name] = list(dict.fromkeys([*found.get(name, []), path]))
    return found


def places_of(name: str, model: Path, environment: Mapping[str, str]) -> Iterator[Path]:
    """Yields the directories that are a package, the nearest to the model first."""
    seen = set()
    for place in _all_places(name, model.absolute(), environment):
        if place.resolve() not in seen:
            seen.add(place.resolve())
            yield place


def _all_places(name: str, model: Path, environment: Mapping[str, str]) -> Iterator[Path]:
    for above in model.parents:
        if above.name == name or _named(above) == name:
            yield above
        if (above / name).is_dir():
            yield above / name
        manifests = (manifest for pattern in _WORKSPACE for manifest in sorted(above.glob(f"{pattern}/{MANIFEST}")))
        yield from (manifest.parent for manifest in manifests if _named(manifest.parent) == name)
        yield from (place for pattern in _INSTALLED for place in sorted(above.glob(f"{pattern}/{escape(name)}")) if place.is_dir())
    for prefix in _listed(environment, "AMENT_PREFIX_PATH"):
        if (prefix / "share" / name).is_dir():
            yield prefix / "share" / name
    for root in _listed(environment, "ROS_PACKAGE_PATH"):
        yield from (place for place in (root, root / name) if place.is_dir() and (place.name == name or _named(place) == name))


def _listed(environment: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(part) for part in environment.get(variable, "").split(os.pathsep) if part]


def _named(directory: Path) -> str | None:
    """Returns the name in the manifest of a package; None where there is no manifest, or one that cannot be read.

    Most manifests that are looked at are of other packages. So what is wrong with one is nothing that the draft is about.
    """
    manifest = directory / MANIFEST
    open_elements: list[str] = []
    text: list[str] = []

    def start(element: str, _: dict[str, str]) -> None:
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def data(part: str) -> None:
        if open_elements == ["package", "name"]:
            text.append(part)

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, data

    try:
        parse_xml(manifest.read_bytes(), manifest.name, "scene_package", install)
    except (OSError, SceneError):
        return None
    return "".join(text).strip() or None
