"""SRDF files are applied to the models of a scene here: the pairs of bodies that they disable are ignored, each with the file's reason."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from certifier.errors import SceneError, close_matches
from certifier.model import WORLD
from certifier.scene.file import IgnoreEntry, SceneFile
from certifier.scene.formats.srdf import LinkPair, Srdf
from certifier.scene.references import resolve

_DEFAULT = "collisions are disabled by default"
"""The reason of the pairs of a link with ``disable_default_collisions``."""


@dataclass(frozen=True)
class Semantics:
    """An SRDF file of a model.

    Attributes:
        model: Drake's name of the model, with which the names of its bodies and joints begin.
        file: as the scene file names it.
        ignore: entries for the pairs of bodies that the file disables.
    """

    model: str
    file: str
    srdf: Srdf
    ignore: tuple[IgnoreEntry, ...]


def read_semantics(scene_file: SceneFile, bodies: Sequence[str]) -> list[Semantics]:
    """Returns what the SRDF files of a scene file say.

    Args:
        bodies: names of all bodies of the scene.

    Raises:
        SceneError: ``scene_srdf``, with file and line, for a file that is not accepted; ``unknown_name`` for a model or a link that the
            scene does not have.
    """
    found = []
    for model, file in scene_file.srdf.items():
        try:
            found.append(_semantics(scene_file, model, file, bodies))
        except SceneError as error:
            error.field = f"srdf.{model}"
            raise
    return found


def _semantics(scene_file: SceneFile, model: str, file: str, bodies: Sequence[str]) -> Semantics:
    links = [body.removeprefix(f"{model}/") for body in bodies if body.startswith(f"{model}/")]
    if not links:
        models = list(dict.fromkeys(body.rpartition("/")[0] for body in bodies if body != WORLD))
        hint = close_matches(model, models) or f"models: {', '.join(models)}"
        raise SceneError("unknown_name", f"{model!r} is no model of the scene", field=f"srdf.{model}", hint=hint)
    path = resolve(file, scene_file.path.parent, scene_file.packages)
    if not path.is_file():
        hint = "a relative path starts at the directory of the scene file; or write package://NAME/FILE"
        raise SceneError("scene_srdf", f"there is no file {file!r}", field=f"srdf.{model}", hint=hint)
    srdf = Srdf(path, file)
    for pair in (*srdf.disabled, *srdf.enabled):
        for link in (pair.a, pair.b):
            _check_link(srdf, pair.line, link, links, model)
    for link, line in srdf.undefaulted.items():
        _check_link(srdf, line, link, links, model)
    disabled = [*srdf.disabled, *_by_default(srdf, links)]
    entries = [
        IgnoreEntry(f"{model}/{pair.a}", f"{model}/{pair.b}", f"{file}: {pair.reason}", f"srdf.{model}")
        for pair in disabled
        if WORLD not in (pair.a, pair.b)
    ]
    return Semantics(model, file, srdf, tuple(entries))


def _check_link(srdf: Srdf, line: int, link: str, links: Sequence[str], model: str) -> None:
    if link not in links and link != WORLD:
        hint = close_matches(link, list(links)) or "name links of this model only"
        message = f"{srdf.name}:{line}: {link[:80]!a} is no link of {model}"
        raise SceneError("unknown_name", message, field=f"srdf.{model}", hint=hint)


def _by_default(srdf: Srdf, links: Sequence[str]) -> Iterable[LinkPair]:
    """Yields the pairs that are disabled because collisions of one of their links are, as far as they are not enabled.

    MoveIt disables the collisions of such a link with obstacles as well. Those stay certified here: the file is about one model.
    """
    enabled = {frozenset((pair.a, pair.b)) for pair in srdf.enabled}
    for link, line in srdf.undefaulted.items():
        for other in links:
            if other != link and frozenset((link, other)) not in enabled:
                yield LinkPair(link, other, _DEFAULT, line)
