"""The files of an MJCF model become one tree here. What a file includes stands in the place of its <include>, as in MuJoCo and in Drake."""

from __future__ import annotations

import posixpath
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from certifier.errors import SceneError
from certifier.names import escaped
from certifier.scene.formats.model_file import decimals, wanted
from certifier.scene.paths import beside
from certifier.scene.xml import parse_xml

MEND = "mend the model there"


@dataclass
class Node:
    """An element, the file and the line where it stands, and the elements in it.

    Attributes:
        source, start: the path of the file, and the byte at which the element's start tag begins.
        childclass: the class of defaults that the bodies around it, and itself if it is one, give to what is in it.
    """

    name: str
    file: str
    line: int
    attributes: dict[str, str]
    parent: Node | None = None
    children: list[Node] = field(default_factory=list)
    childclass: str | None = None
    source: Path = Path()
    start: int = 0

    def under(self, *names: str) -> list[Node]:
        """Returns the children with one of these names."""
        return [child for child in self.children if child.name in names]

    def inside(self) -> Iterator[Node]:
        """Yields every element below this one, parents before children, in the order of the files."""
        waiting = deque(self.children)
        while waiting:
            node = waiting.popleft()
            yield node
            waiting.extendleft(reversed(node.children))

    def around(self) -> Iterator[Node]:
        """Yields the elements that this one is in, the nearest first."""
        node = self.parent
        while node is not None:
            yield node
            node = node.parent


def refuse(node: Node, what: str, *, hint: str = MEND) -> NoReturn:
    raise SceneError("scene_model", f"{node.file}:{node.line}: {what}", field="directives", hint=hint)


def numbers(node: Node, key: str, counts: tuple[int, ...]) -> list[float]:
    """Returns the numbers of an attribute that the element has.

    Raises:
        SceneError: ``scene_model``, where it holds anything else.
    """
    text = node.attributes[key]
    if (found := decimals(text, counts)) is None:
        refuse(node, f"{key} of <{node.name}> is {text[:80]!a} instead of {wanted(counts)}")
    return found


@dataclass(frozen=True)
class Tree:
    """A model.

    Attributes:
        sources: the content of its files, by their paths.
        includes: the elements that include some of them, and which.
    """

    root: Node
    sources: dict[Path, bytes]
    includes: list[tuple[Node, Path]]


def read_tree(path: Path, name: str, data: bytes) -> Tree:
    """Reads a model. Paths of <include> start at the directory of the model's first file, also in files that it includes.

    Args:
        name: the first file's name for people.

    Raises:
        SceneError: ``scene_model`` with file and line, for what is not XML and for an <include> that cannot be followed.
    """
    tree = Tree(_read(path, name, data), {path: data}, [])
    read, waiting = {path.resolve()}, [tree.root]
    for node in waiting:
        before, node.children = deque(node.children), []
        while before:
            child = before.popleft()
            if child.name == "include":
                before.extendleft(reversed(_included(child, path, name, read, tree).children))
            else:
                child.parent, child.childclass = node, child.attributes.get("childclass", node.childclass)
                node.children.append(child)
        waiting += node.children
    return tree


def _included(node: Node, path: Path, name: str, read: set[Path], tree: Tree) -> Node:
    file = node.attributes.get("file", "")
    if node.attributes.keys() != {"file"} or node.children:
        refuse(node, "<include> must have the attribute file and nothing else")
    found = beside(path.parent, file)
    if not found.is_file():
        hint = "paths start at the directory of the model's first file, also in files that it includes"
        refuse(node, f"{file[:200]!a} is no file that was found", hint=hint)
    if found.resolve() in read:
        refuse(node, f"{file[:200]!a} is included twice, which MuJoCo does not accept")
    read.add(found.resolve())
    tree.sources[found] = found.read_bytes()
    tree.includes.append((node, found))
    included = escaped(posixpath.normpath(posixpath.join(posixpath.dirname(name), file)))
    return _read(found, included, tree.sources[found])


def _read(path: Path, name: str, data: bytes) -> Node:
    top = Node("", name, 0, {})
    opened = [top]

    def install(parser: expat.XMLParserType) -> None:
        def start(element: str, attributes: dict[str, str]) -> None:
            node = Node(element, name, parser.CurrentLineNumber, attributes, source=path, start=parser.CurrentByteIndex)
            opened[-1].children.append(node)
            opened.append(node)

        def end(_: str) -> None:
            opened.pop()

        parser.StartElementHandler, parser.EndElementHandler = start, end

    parse_xml(data, name, "scene_model", install)
    return top.children[0]
